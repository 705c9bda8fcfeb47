#pragma once

#include <span>

#include <Eigen/Core>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/metrics/sample.h>
#include <sgf/metrics/traits.h>

namespace sgf::metrics {

/// Locally scaled intensity differences: Basalt's patch residual (the paper's reference [16]), one
/// component per pixel: both patches are divided by their mean and then subtracted. A patch whose
/// mean is not positive stays undivided.
struct Lssd {
  static constexpr MetricInfo kInfo{.name = "lssd",
                                    .alias = "",
                                    .formula = "I_i / mean_W(I_i) - I_j / mean_W(I_j)",
                                    .equation = "-",
                                    .traits = {.kind = MetricKind::kPatch,
                                               .residual = ResidualKind::kVector,
                                               .zero_at_equality = true,
                                               .gain_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = Eigen::Dynamic;

  /// Residual of two patches of n pixels, n-vector.
  /// @throws Error for patches that are empty or differ in size.
  template <class T>
  Eigen::Matrix<T, Eigen::Dynamic, 1> operator()(std::span<const Sample<T>> i,
                                                 std::span<const Sample<T>> j) const {
    if (i.empty() || i.size() != j.size())
      throw Error("lssd", fmt::format("patches of {} and {} pixels", i.size(), j.size()));
    return Intensities(i) / Divisor(i) - Intensities(j) / Divisor(j);
  }

  /// Derivative of the residual with respect to the n intensities of patch i, n x n: with their
  /// mean m, I / m - x 1^T / (n m^2).
  template <class T>
  Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> Jacobian(std::span<const Sample<T>> i) const {
    const auto n = static_cast<Eigen::Index>(i.size());
    const Eigen::Matrix<T, Eigen::Dynamic, 1> x = Intensities(i);
    const T divisor = Divisor(i);
    Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> jacobian =
        Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>::Identity(n, n) / divisor;
    if (x.sum() > T(0)) jacobian.colwise() -= x / (T(double(n)) * divisor * divisor);
    return jacobian;
  }

 private:
  template <class T>
  static Eigen::Matrix<T, Eigen::Dynamic, 1> Intensities(std::span<const Sample<T>> patch) {
    Eigen::Matrix<T, Eigen::Dynamic, 1> x(static_cast<Eigen::Index>(patch.size()));
    for (Eigen::Index k = 0; k < x.size(); ++k) x(k) = patch[static_cast<size_t>(k)].intensity;
    return x;
  }

  template <class T>
  static T Divisor(std::span<const Sample<T>> patch) {
    const T sum = Intensities(patch).sum();
    return sum > T(0) ? sum / T(static_cast<double>(patch.size())) : T(1);
  }
};

}  // namespace sgf::metrics
