#pragma once

#include <sgf/metrics/derivative.h>
#include <sgf/metrics/sample.h>
#include <sgf/metrics/traits.h>

/// Dissimilarities that are plain differences of intensities and gradients.
namespace sgf::metrics {

/// Magnitude; like Min, it keeps the derivative of a ceres::Jet.
template <class T>
inline T Abs(const T& x) {
  return x < T(0) ? -x : x;
}

/// Photometric difference (eq. 1), grey levels.
struct Photo {
  static constexpr MetricInfo kInfo{
      .name = "photo",
      .alias = "",
      .formula = "I_i - I_j",
      .equation = "1",
      .traits = {
          .residual = ResidualKind::kSigned, .zero_at_equality = true, .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return i.intensity - j.intensity;
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& /*i*/, const Sample<T>& /*j*/) const {
    return IntensityDerivative(T(1));
  }
};

/// Magnitude of the photometric difference; summed over a window, the sum of absolute differences.
struct Sad {
  static constexpr MetricInfo kInfo{
      .name = "sad",
      .alias = "",
      .formula = "|I_i - I_j|",
      .equation = "1",
      .traits = {.zero_at_equality = true, .symmetric = true, .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return Abs(Photo{}(i, j));
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    return IntensityDerivative(Sign(Photo{}(i, j)));
  }
};

/// Difference of the gradient magnitudes (eq. 2), grey levels/px.
struct Gm {
  static constexpr MetricInfo kInfo{.name = "gm",
                                    .alias = "",
                                    .formula = "|g_i| - |g_j|",
                                    .equation = "2",
                                    .traits = {.residual = ResidualKind::kSigned,
                                               .zero_at_equality = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return i.norm - j.norm;
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& /*j*/) const {
    return GradientDerivative<T, 1>(UnitGradient(i).transpose());
  }
};

/// Magnitude of gm: the cost that the paper's figure 1 calls mag.
struct Agm {
  static constexpr MetricInfo kInfo{.name = "agm",
                                    .alias = "mag",
                                    .formula = "| |g_i| - |g_j| |",
                                    .equation = "2",
                                    .traits = {.zero_at_equality = true,
                                               .symmetric = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    return Abs(Gm{}(i, j));
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    return GradientDerivative<T, 1>(Sign(Gm{}(i, j)) * UnitGradient(i).transpose());
  }
};

/// Difference of the gradients (eq. 3), grey levels/px.
struct Gn {
  static constexpr MetricInfo kInfo{.name = "gn",
                                    .alias = "",
                                    .formula = "g_i - g_j",
                                    .equation = "3",
                                    .traits = {.residual = ResidualKind::kVector,
                                               .zero_at_equality = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 2;

  template <class T>
  Vector2<T> operator()(const Sample<T>& i, const Sample<T>& j) const {
    return Gradient(i) - Gradient(j);
  }

  template <class T>
  SampleDerivative<T, 2> Derivative(const Sample<T>& /*i*/, const Sample<T>& /*j*/) const {
    return GradientDerivative<T, 2>(Eigen::Matrix<T, 2, 2>::Identity());
  }
};

/// PatchMatch Stereo's blend of photometric and gradient difference (eq. 4). The defaults are that
/// method's; the paper states no truncation, which infinite limits give.
struct Pm {
  static constexpr MetricInfo kInfo{
      .name = "pm",
      .alias = "",
      .formula = "(1 - alpha) min(|I_i - I_j|, tau_c) + alpha min(|g_i - g_j|_1, tau_g)",
      .equation = "4",
      .traits = {.zero_at_equality = true, .symmetric = true, .differentiable = true}};
  static constexpr int kDim = 1;

  double alpha = 0.9;  ///< weight of the gradient part, in [0, 1]
  double tau_c = 10;   ///< limit of the photometric part, grey levels
  double tau_g = 2;    ///< limit of the gradient part, grey levels/px

  template <class T>
  T operator()(const Sample<T>& i, const Sample<T>& j) const {
    const T colour = Abs(i.intensity - j.intensity);
    const T gradient = Abs(i.gx - j.gx) + Abs(i.gy - j.gy);
    return T(1 - alpha) * Min(colour, T(tau_c)) + T(alpha) * Min(gradient, T(tau_g));
  }

  /// 0 for a part that is truncated.
  template <class T>
  SampleDerivative<T, 1> Derivative(const Sample<T>& i, const Sample<T>& j) const {
    SampleDerivative<T, 1> derivative;
    const T colour = i.intensity - j.intensity;
    const Vector2<T> gradient = Gn{}(i, j);
    if (Abs(colour) < T(tau_c)) derivative.intensity(0) = T(1 - alpha) * Sign(colour);
    if (gradient.template lpNorm<1>() < T(tau_g))
      derivative.gradient = T(alpha) * RowVector2<T>(Sign(gradient.x()), Sign(gradient.y()));
    return derivative;
  }
};

}  // namespace sgf::metrics
