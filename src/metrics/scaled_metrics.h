#pragma once

#include <sgf/metrics/derivative.h>
#include <sgf/metrics/sample.h>
#include <sgf/metrics/traits.h>

/// The paper's cheaper combinations of orientation and magnitude, in (grey levels/px)^2. Unlike the
/// normalised ones they scale with the gradients.
namespace sgf::metrics {

/// g_i.g_j (eq. 11)
template <class T>
inline T GradientDot(const Sample<T>& i, const Sample<T>& j) {
  return i.gx * j.gx + i.gy * j.gy;
}

/// ||a|| = ||g|| / sqrt(||g||^2 + epsilon); 0 where a is 0 by definition.
template <class T>
inline T NormalizedNorm(const Sample<T>& sample) {
  return sample.reg_norm > T(0) ? sample.norm / sample.reg_norm : T(0);
}

/// sgf without its division by the regularised norms (eqs. 11-14). Not gain-invariant: with one
/// image darkened its minimum moves to a stronger gradient.
struct Sgf2 {
  static constexpr MetricInfo kInfo{
      .name = "sgf2",
      .alias = "",
      .formula = "max(|b| |g_i|^2 / |a|, |a| |g_j|^2 / |b|) - g_i.g_j",
      .equation = "14",
      .traits = {.zero_at_equality = true,
                 .symmetric = true,
                 .offset_invariant = true,
                 .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return Max(Ratio(i, j), Ratio(j, i)) - GradientDot(i, j);
  }

  /// Eqs. 22 and 23, derived anew: with u = g_i / ||g_i|| and epsilon / (||g_i||^2 + epsilon) =
  /// 1 - ||a||^2,
  /// d n_ij = ||b|| sqrt(||g_i||^2 + epsilon) (1 + ||a||^2) u^T and
  /// d n_ji = ||g_j|| sqrt(||g_j||^2 + theta) (1 - ||a||^2) / sqrt(||g_i||^2 + epsilon) u^T.
  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    if (!(i.norm > T(0))) return GradientDerivative<T, 1>(-Gradient(j).transpose());
    const T a = NormalizedNorm(i);
    const T slope = Ratio(i, j) > Ratio(j, i) ? NormalizedNorm(j) * i.reg_norm * (1 + a * a)
                                              : j.norm * j.reg_norm * (1 - a * a) / i.reg_norm;
    return GradientDerivative<T, 1>((slope * UnitGradient(i) - Gradient(j)).transpose());
  }

 private:
  /// n_ij (eq. 12) as ||b|| ||g_i|| sqrt(||g_i||^2 + epsilon): ||g_i||^2 / ||a|| without dividing
  /// by an ||a|| that may vanish.
  template <class T>
  static T Ratio(const Sample<T>& i, const Sample<T>& j) {
    return NormalizedNorm(j) * i.norm * i.reg_norm;
  }
};

/// sgf2 without normalisation (eq. 15): 0 for any two parallel gradients of whatever strength, and
/// wherever one of them vanishes.
struct Sgf3 {
  static constexpr MetricInfo kInfo{.name = "sgf3",
                                    .alias = "",
                                    .formula = "|g_i| |g_j| - g_i.g_j",
                                    .equation = "15",
                                    .traits = {.zero_at_equality = true,
                                               .symmetric = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return i.norm * j.norm - GradientDot(i, j);
  }

  /// Eq. 24, derived anew: ||g_j|| g_i^T / ||g_i|| - g_j^T.
  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    return GradientDerivative<T, 1>((j.norm * UnitGradient(i) - Gradient(j)).transpose());
  }
};

/// The vector whose half squared norm is sgf3, grey levels/px: sqrt(||g_i|| ||g_j||) (u_i - u_j)
/// with the directions u = g / ||g||; 0 where either gradient vanishes. Where sgf3 has a vanishing
/// derivative, at its minimum, this one keeps a slope for least squares. Not in the paper.
struct Sgf3Vec {
  static constexpr MetricInfo kInfo{.name = "sgf3_vec",
                                    .alias = "",
                                    .formula = "sqrt(|g_j| / |g_i|) g_i - sqrt(|g_i| / |g_j|) g_j",
                                    .equation = "-",
                                    .traits = {.residual = ResidualKind::kVector,
                                               .zero_at_equality = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 2;

  template <class T>
  Vector2<T> operator()(const Sample<T>& i, const Sample<T>& j) const {
    using std::sqrt;
    if (!(i.norm > T(0) && j.norm > T(0))) return Vector2<T>(T(0), T(0));
    const T ratio = sqrt(j.norm / i.norm);
    return Gradient(i) * ratio - Gradient(j) / ratio;
  }

  /// sqrt(||g_j|| / ||g_i||) (I - (u_i + u_j) u_i^T / 2).
  template <class T>
  SampleDerivative<T, 2> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    if (!(i.norm > T(0) && j.norm > T(0))) return {};
    const Vector2<T> u_i = UnitGradient(i);
    const Vector2<T> u_sum = u_i + UnitGradient(j);
    return GradientDerivative<T, 2>(
        std::sqrt(j.norm / i.norm) *
        (Eigen::Matrix<T, 2, 2>::Identity() - u_sum * u_i.transpose() / T(2)));
  }
};

}  // namespace sgf::metrics
