#pragma once

#include <cmath>

/// Everything a pointwise dissimilarity needs to know of one pixel.
namespace sgf::metrics {

/// Lower bound of the squared norm that sgf divides by (eq. 10; the paper says "small").
inline constexpr double kTau = 1e-4;

/// Smaller of two values, the first where they are equal. For arithmetic types, ceres::Jet (which
/// keeps the derivative of the chosen one) and Q15; sgf.inc looks it up by this name.
template <class T>
inline T Min(const T& a, const T& b) {
  return b < a ? b : a;
}

/// Larger of two values, the first where they are equal.
template <class T>
inline T Max(const T& a, const T& b) {
  return a < b ? b : a;
}

/// One pixel as the dissimilarities see it: intensity, gradient g, and what follows from them once
/// per pixel. T is float in images, double or ceres::Jet in least squares.
template <class T>
struct Sample {
  T intensity;  ///< grey levels
  T gx, gy;     ///< gradient g, grey levels/px
  T norm;       ///< ||g||, grey levels/px
  T reg_norm;   ///< sqrt(||g||^2 + epsilon), grey levels/px
  T ax, ay;     ///< normalised gradient a = g / reg_norm (eq. 7); 0 where reg_norm is 0
  T r;          ///< 1 / max(||a||^2, tau)
};

namespace sample_internal {

/// Square root that is 0 with a vanishing derivative at 0, where a Jet's would be infinite.
template <class T>
inline T SqrtOrZero(const T& x) {
  using std::sqrt;
  return x > T(0) ? sqrt(x) : T(0);
}

}  // namespace sample_internal

/// Completes a pixel from its intensity and gradient.
///
/// The operations and their order are part of the interface, so that SIMD code reproduces the float
/// result bit for bit:
///
///     n2 = gx * gx + gy * gy
///     norm = sqrt(n2)
///     reg_norm = sqrt(n2 + epsilon)
///     s = reg_norm > 0 ? 1 / reg_norm : 0
///     ax = gx * s;  ay = gy * s
///     a2 = ax * ax + ay * ay
///     r = 1 / max(a2, tau)
///
/// A flat pixel of a blank image (g = 0, epsilon = 0) gets a = 0. In float, gradient components
/// have to be 0 or between 1e-18 and 1e18 in magnitude for their squares to be normal numbers.
/// @param epsilon mean squared gradient magnitude (eq. 6), (grey levels/px)^2, not negative.
/// @param tau in [1e-30, 1].
template <class T>
inline Sample<T> MakeSample(const T& intensity, const T& gx, const T& gy, double epsilon,
                            double tau = kTau) {
  using sample_internal::SqrtOrZero;
  const T n2 = gx * gx + gy * gy;
  const T reg_norm = SqrtOrZero(n2 + static_cast<T>(epsilon));
  const T s = reg_norm > T(0) ? T(1) / reg_norm : T(0);
  const T ax = gx * s;
  const T ay = gy * s;
  const T a2 = ax * ax + ay * ay;
  return {intensity, gx, gy, SqrtOrZero(n2), reg_norm, ax, ay, T(1) / Max(a2, static_cast<T>(tau))};
}

}  // namespace sgf::metrics
