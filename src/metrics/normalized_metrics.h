#pragma once

#include <sgf/metrics/derivative.h>
#include <sgf/metrics/sample.h>
#include <sgf/metrics/traits.h>

/// Dissimilarities of normalised gradients a = g_i / sqrt(||g_i||^2 + epsilon) and b likewise
/// (eq. 7). All are invariant to gain and offset of either image.
namespace sgf::metrics {

#include <sgf/metrics/sgf.inc>

/// a.b
template <class T>
inline T NormalizedDot(const Sample<T>& i, const Sample<T>& j) {
  return i.ax * j.ax + i.ay * j.ay;
}

/// Normalised gradient field of Haber and Modersitzki (eq. 8), in [0, 1]. Does not tell a gradient
/// from its opposite, and prefers strong edges: at equality it is 1 - ||a||^4.
struct Ngf {
  static constexpr MetricInfo kInfo{.name = "ngf",
                                    .alias = "",
                                    .formula = "1 - (a.b)^2",
                                    .equation = "8",
                                    .traits = {.symmetric = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    const T d = NormalizedDot(i, j);
    return T(1) - d * d;
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    const RowVector2<T> d_a = -2 * NormalizedDot(i, j) * NormalizedGradient(j).transpose();
    return GradientDerivative<T, 1>(d_a * NormalizedGradientJacobian(i));
  }
};

/// ngf without the square, for images of one kind of sensor (eq. 9), in [0, 2]. Tells a gradient
/// from its opposite; prefers strong edges: at equality it is 1 - ||a||^2.
struct Ugf {
  static constexpr MetricInfo kInfo{.name = "ugf",
                                    .alias = "",
                                    .formula = "1 - a.b",
                                    .equation = "9",
                                    .traits = {.symmetric = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return T(1) - NormalizedDot(i, j);
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    const RowVector2<T> d_a = -NormalizedGradient(j).transpose();
    return GradientDerivative<T, 1>(d_a * NormalizedGradientJacobian(i));
  }
};

/// The paper's scaled gradient field (eq. 10), in [0, 2] up to rounding:
/// (||a - b||^2 + | ||a||^2 - ||b||^2 |) / (2 max(||a||^2, ||b||^2)) outside the tau branch, so 0
/// only where a = b.
struct Sgf {
  static constexpr MetricInfo kInfo{.name = "sgf",
                                    .alias = "",
                                    .formula = "1 - a.b / max(|a|^2, |b|^2, tau)",
                                    .equation = "10",
                                    .traits = {.zero_at_equality = true,
                                               .symmetric = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return T(1) - SgfSimilarity(i, j);
  }

  /// Eq. 21, derived anew with squared norms; with m = min(r_i, r_j):
  /// -(m b^T + (a.b) dm/da) (I - a a^T) / sqrt(||g_i||^2 + epsilon).
  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    const RowVector2<T> d_a = -(Min(i.r, j.r) * NormalizedGradient(j).transpose() +
                                NormalizedDot(i, j) * SmallerReciprocalDerivative(i, j));
    return GradientDerivative<T, 1>(d_a * NormalizedGradientJacobian(i));
  }
};

/// Difference of the normalised gradients: the vector residual behind ugf,
/// ugf = ||a - b||^2 / 2 + (1 - ||a||^2) / 2 + (1 - ||b||^2) / 2. Not in the paper.
struct Ngv {
  static constexpr MetricInfo kInfo{.name = "ngv",
                                    .alias = "",
                                    .formula = "a - b",
                                    .equation = "-",
                                    .traits = {.residual = ResidualKind::kVector,
                                               .zero_at_equality = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 2;

  template <class T>
  Vector2<T> operator()(const Sample<T>& i, const Sample<T>& j) const {
    return NormalizedGradient(i) - NormalizedGradient(j);
  }

  template <class T>
  SampleDerivative<T, 2> Derivative(const Sample<T>& i, const Sample<T>& /*j*/) const {
    return GradientDerivative<T, 2>(NormalizedGradientJacobian(i));
  }
};

/// Scaled difference of the normalised gradients: the vector residual behind sgf; outside the tau
/// branch sgf = ||sgv||^2 / 2 + | ||a||^2 - ||b||^2 | / (2 max(||a||^2, ||b||^2)). Not in the
/// paper.
struct Sgv {
  static constexpr MetricInfo kInfo{.name = "sgv",
                                    .alias = "",
                                    .formula = "(a - b) / max(|a|, |b|, sqrt(tau))",
                                    .equation = "-",
                                    .traits = {.residual = ResidualKind::kVector,
                                               .zero_at_equality = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 2;

  template <class T>
  Vector2<T> operator()(const Sample<T>& i, const Sample<T>& j) const {
    using std::sqrt;
    return (NormalizedGradient(i) - NormalizedGradient(j)) * T(sqrt(Min(i.r, j.r)));
  }

  /// With m = min(r_i, r_j): (sqrt(m) I + (a - b) dm/da / (2 sqrt(m))) da/dg.
  template <class T>
  SampleDerivative<T, 2> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    const T root = std::sqrt(Min(i.r, j.r));
    const Vector2<T> difference = NormalizedGradient(i) - NormalizedGradient(j);
    const Eigen::Matrix<T, 2, 2> d_a = root * Eigen::Matrix<T, 2, 2>::Identity() +
                                       difference * SmallerReciprocalDerivative(i, j) / (2 * root);
    return GradientDerivative<T, 2>(d_a * NormalizedGradientJacobian(i));
  }
};

}  // namespace sgf::metrics
