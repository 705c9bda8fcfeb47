#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>

/// Gauss-Newton and Levenberg-Marquardt, once for all warps.
namespace sgf::alignment {

enum class SolverMethod { kGaussNewton, kLevenbergMarquardt };
std::span<const std::pair<const char*, SolverMethod>> EnumNames(SolverMethod);

struct SolverOptions {
  SolverMethod method = SolverMethod::kLevenbergMarquardt;
  int max_iterations = 20;
  double tolerance = 1e-4;

  template <class V>
  void VisitFields(V&& visit) {
    visit("method", method, "", "gauss_newton or levenberg_marquardt");
    visit("max_iterations", max_iterations, "", "of a pyramid level");
    visit("tolerance", tolerance, "",
          "stop where a step promises to lower the cost by less than this share of it");
  }
};

/// Normal equations H delta = -b of a sum of weighted squares, sum(w ||r + J delta||^2) / 2,
/// gathered as the one matrix sum(w [J r]^T [J r]).
template <class T, int P>
class NormalEquations {
 public:
  using Parameters = Eigen::Matrix<double, P, 1>;

  template <class Residual, class Jacobian>
  void Add(const Residual& r, const Jacobian& J, T weight) {
    for (int k = 0; k < r.rows(); ++k) {
      Row row = Row::Zero();
      row.template head<P>() = J.row(k).transpose();
      row(P) = r(k);
      AddRow(row, weight);
    }
  }

  /// The same for one component, as (J, r, zeros).
  static constexpr int kRow = (P + 4) / 4 * 4;
  using Row = Eigen::Matrix<T, kRow, 1>;
  void AddRow(const Row& row, T weight) { sum_.noalias() += row * (weight * row).transpose(); }

  /// The same for many residuals, gathered elsewhere: the upper left P + 1 rows and columns.
  void AddSum(const Eigen::Matrix<T, P + 1, P + 1>& sum) {
    sum_.template topLeftCorner<P + 1, P + 1>() += sum;
  }

  void AddCost(double cost, int residuals) {
    cost_ += cost;
    residuals_ += residuals;
  }

  template <class U>
  void operator+=(const NormalEquations<U, P>& other) {
    sum_ += other.sum().template cast<T>();
    cost_ += other.cost();
    residuals_ += other.residuals();
  }

  Eigen::Matrix<double, P, P> H() const {
    return sum_.template topLeftCorner<P, P>().template cast<double>();
  }
  Parameters b() const { return sum_.template block<P, 1>(0, P).template cast<double>(); }
  const Eigen::Matrix<T, kRow, kRow>& sum() const { return sum_; }
  double cost() const { return cost_; }  ///< sum of rho / 2
  int residuals() const { return residuals_; }

  /// Cost for each residual: comparable where not the same ones are in view. Infinite without any.
  double MeanCost() const { return residuals_ > 0 ? cost_ / residuals_ : INFINITY; }

 private:
  Eigen::Matrix<T, kRow, kRow> sum_ = Eigen::Matrix<T, kRow, kRow>::Zero();
  double cost_ = 0;
  int residuals_ = 0;
};

struct SolverSummary {
  int iterations = 0;
  bool converged = false;
};

/// Length of the next step against that of Gauss-Newton, from the steps before (Barzilai and
/// Borwein, 1988, in the metric of the normal equations). Gauss-Newton halves the distance to a
/// minimum where residuals vanish together with their slopes, as costs like sgf do, and goes too
/// far where noise keeps them from vanishing; both show in how its steps follow one another.
template <int P>
class StepLength {
 public:
  using Parameters = Eigen::Matrix<double, P, 1>;

  /// @param H, b normal equations where the next step begins.
  double Next(const Eigen::Matrix<double, P, P>& H, const Parameters& b) const {
    if (!taken_) return 1;
    // How much of the slope is gone, against what H promised for the step that was taken.
    const double gone = step_.dot(b + H * full_), promised = step_.dot(H * step_);
    return gone > 0 ? std::clamp(promised / gone, kLeast, kMost) : kMost;
  }

  /// @param step that is taken. @param full that of Gauss-Newton, without damping.
  void Take(const Parameters& step, const Parameters& full) {
    step_ = step;
    full_ = full;
    taken_ = true;
  }

  /// After a step that was taken back.
  void Reset() { taken_ = false; }

 private:
  static constexpr double kLeast = 0.5, kMost = 2;
  Parameters step_ = Parameters::Zero(), full_ = Parameters::Zero();
  bool taken_ = false;
};

/// The course of a minimisation over P parameters: proposes steps and judges where they end. It
/// knows neither what is minimised nor the state, so it is compiled once for each P, in solver.cc.
template <int P>
class Descent {
 public:
  using Equations = NormalEquations<double, P>;
  using Parameters = Eigen::Matrix<double, P, 1>;

  Descent(const SolverOptions& options, const Equations& at_start);

  /// The step to try next; none at the end.
  std::optional<Parameters> NextStep();

  /// Whether the step stays: Levenberg-Marquardt takes it back where the mean cost has risen or too
  /// few residuals stay in view.
  /// @param equations at its end.
  bool Keep(const Equations& equations);

  const Equations& equations() const { return last_; }  ///< where it stands
  const SolverSummary& summary() const { return summary_; }

 private:
  SolverOptions options_;
  bool damped_;
  double damping_;
  Equations last_;
  int most_in_view_;
  Parameters step_ = Parameters::Zero();  // that is tried
  Parameters full_ = Parameters::Zero();  // Gauss-Newton's from the same place
  StepLength<P> length_;
  SolverSummary summary_;
};

extern template class Descent<1>;
extern template class Descent<2>;
extern template class Descent<3>;
extern template class Descent<4>;
extern template class Descent<6>;
extern template class Descent<8>;

/// Minimises from `state`. Linearises once an iteration: a step is judged by the linearisation at
/// its end.
/// @tparam P 1, 2, 3, 4, 6 or 8.
/// @param linearize state -> NormalEquations<double, P>.
/// @param update (state, Parameters) -> the state after a step.
/// @param[out] last normal equations at the final state.
template <int P, class State, class Linearize, class Update>
SolverSummary Minimize(State& state, const Linearize& linearize, const Update& update,
                       const SolverOptions& options, NormalEquations<double, P>& last) {
  Descent<P> descent(options, linearize(state));
  while (const auto step = descent.NextStep()) {
    State next = update(state, *step);
    if (descent.Keep(linearize(next))) state = std::move(next);
  }
  last = descent.equations();
  return descent.summary();
}

}  // namespace sgf::alignment
