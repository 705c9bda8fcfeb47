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
    const T divisor_i = Divisor(i), divisor_j = Divisor(j);
    Eigen::Matrix<T, Eigen::Dynamic, 1> residual(static_cast<Eigen::Index>(i.size()));
    for (size_t k = 0; k < i.size(); ++k)
      residual(static_cast<Eigen::Index>(k)) =
          Component(i[k].intensity, divisor_i, j[k].intensity, divisor_j);
    return residual;
  }

  /// What the intensities of a patch of n pixels are divided by, from their sum.
  template <class T>
  static T Divisor(const T& sum, size_t n) {
    return sum > T(0) ? sum / T(static_cast<double>(n)) : T(1);
  }

  /// Residual of one pixel, from the intensities there and the divisors of both patches.
  template <class T>
  static T Component(const T& i, const T& divisor_i, const T& j, const T& divisor_j) {
    return i / divisor_i - j / divisor_j;
  }

  /// Derivative of Component() where intensity i changes by d_i and the mean of its patch by
  /// d_mean; d_mean is 0 where the patch stays undivided.
  template <class T>
  static T Derivative(const T& i, const T& divisor_i, const T& d_i, const T& d_mean) {
    return d_i / divisor_i - i / (divisor_i * divisor_i) * d_mean;
  }

  /// Derivative of the residual with respect to the n intensities of patch i, n x n: with their
  /// mean m, I / m - x 1^T / (n m^2).
  template <class T>
  Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> Jacobian(std::span<const Sample<T>> i) const {
    const auto n = static_cast<Eigen::Index>(i.size());
    const T divisor = Divisor(i);
    const bool divided = Sum(i) > T(0);
    Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> jacobian(n, n);
    for (Eigen::Index row = 0; row < n; ++row)
      for (Eigen::Index col = 0; col < n; ++col)
        jacobian(row, col) =
            Derivative(i[static_cast<size_t>(row)].intensity, divisor, T(row == col ? 1. : 0.),
                       divided ? T(1.0 / static_cast<double>(n)) : T(0));
    return jacobian;
  }

 private:
  template <class T>
  static T Sum(std::span<const Sample<T>> patch) {
    T sum(0);
    for (const Sample<T>& sample : patch) sum += sample.intensity;
    return sum;
  }

  template <class T>
  static T Divisor(std::span<const Sample<T>> patch) {
    return Divisor(Sum(patch), patch.size());
  }
};

}  // namespace sgf::metrics
