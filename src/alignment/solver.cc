#include <algorithm>

#include <Eigen/Cholesky>

#include <sgf/alignment/solver.h>

namespace sgf::alignment {
namespace {

constexpr double kFirstDamping = 1e-4, kLeastDamping = 1e-7, kMostDamping = 1e4;
constexpr double kDampingAfterRise = 1;  // half the step: one little shorter would rise as well
constexpr double kLeastInView = 0.7;     // the mean must not fall by looking away

/// Step of the damped normal equations.
template <int P>
Eigen::Matrix<double, P, 1> Solve(const NormalEquations<double, P>& equations, double damping) {
  Eigen::Matrix<double, P, P> H = equations.H();
  H.diagonal() *= 1 + damping;
  H.diagonal().array() += 1e-12 * H.diagonal().maxCoeff();  // a direction without any gradient
  return -H.ldlt().solve(equations.b());
}

}  // namespace

template <int P>
Descent<P>::Descent(const SolverOptions& options, const Equations& at_start)
    : options_(options),
      damped_(options.method == SolverMethod::kLevenbergMarquardt),
      damping_(damped_ ? kFirstDamping : 0),
      last_(at_start),
      most_in_view_(at_start.residuals()) {}

template <int P>
std::optional<typename Descent<P>::Parameters> Descent<P>::NextStep() {
  if (summary_.converged || summary_.iterations >= options_.max_iterations ||
      last_.residuals() <= 0)
    return std::nullopt;
  full_ = Solve(last_, 0);
  const Parameters delta = Solve(last_, damping_);
  if (!full_.allFinite() || !delta.allFinite()) return std::nullopt;
  const double promised = -0.5 * last_.b().dot(delta);
  ++summary_.iterations;
  if (!(promised > options_.tolerance * last_.cost())) {
    summary_.converged = promised >= 0;
    return std::nullopt;
  }
  step_ = damped_ ? length_.Next(last_.H(), last_.b()) * delta : delta;
  return step_;
}

template <int P>
bool Descent<P>::Keep(const Equations& equations) {
  const bool in_view = equations.residuals() >= kLeastInView * most_in_view_;
  if (damped_ && !(in_view && equations.MeanCost() <= last_.MeanCost())) {
    length_.Reset();
    damping_ = std::max(damping_ * 10, kDampingAfterRise);
    summary_.converged = damping_ > kMostDamping;  // no step lowers the cost
    return false;
  }
  damping_ = damped_ ? std::max(damping_ / 10, kLeastDamping) : 0;
  length_.Take(step_, full_);
  last_ = equations;
  most_in_view_ = std::max(most_in_view_, last_.residuals());
  return true;
}

template class Descent<1>;
template class Descent<2>;
template class Descent<3>;
template class Descent<4>;
template class Descent<6>;
template class Descent<8>;

}  // namespace sgf::alignment
