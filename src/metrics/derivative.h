#pragma once

#include <limits>

#include <Eigen/Core>

#include <sgf/metrics/sample.h>

/// Derivatives of dissimilarities with respect to one pixel, and the pieces they share.
namespace sgf::metrics {

template <class T>
using Vector2 = Eigen::Matrix<T, 2, 1>;

template <class T>
using RowVector2 = Eigen::Matrix<T, 1, 2>;

/// Derivative of a residual with Dim components with respect to sample i, the moving image's, its
/// epsilon held constant. How intensity and gradient move with a warp is the caller's chain rule.
template <class T, int Dim>
struct SampleDerivative {
  Eigen::Matrix<T, Dim, 1> intensity = Eigen::Matrix<T, Dim, 1>::Zero();  ///< d e / d intensity
  Eigen::Matrix<T, Dim, 2> gradient = Eigen::Matrix<T, Dim, 2>::Zero();   ///< d e / d g
};

/// Derivative of a scalar that depends on the intensity alone.
template <class T>
inline SampleDerivative<T, 1> IntensityDerivative(T d_intensity) {
  SampleDerivative<T, 1> derivative;
  derivative.intensity(0) = d_intensity;
  return derivative;
}

/// Derivative of a residual that depends on the gradient alone.
template <class T, int Dim>
inline SampleDerivative<T, Dim> GradientDerivative(const Eigen::Matrix<T, Dim, 2>& d_gradient) {
  SampleDerivative<T, Dim> derivative;
  for (int k = 0; k < Dim; ++k)  // number by number, see NormalizedGradientJacobian()
    for (int c = 0; c < 2; ++c) derivative.gradient(k, c) = d_gradient(k, c);
  return derivative;
}

/// Sign of x, 0 at 0: the subgradient of |x| that dissimilarities use at their kinks.
template <class T>
inline T Sign(T x) {
  return T(T(0) < x) - T(x < T(0));
}

template <class T>
inline Vector2<T> Gradient(const Sample<T>& sample) {
  return {sample.gx, sample.gy};
}

template <class T>
inline Vector2<T> NormalizedGradient(const Sample<T>& sample) {
  return {sample.ax, sample.ay};
}

/// g / ||g||, the derivative of ||g||; 0 where g vanishes.
template <class T>
inline Vector2<T> UnitGradient(const Sample<T>& sample) {
  if (!(sample.norm > T(0))) return Vector2<T>(T(0), T(0));
  return Gradient(sample) / sample.norm;
}

/// d a / d g = (I - a a^T) / sqrt(||g||^2 + epsilon), from eq. 7; 0 where a is 0 by definition.
template <class T>
inline Eigen::Matrix<T, 2, 2> NormalizedGradientJacobian(const Sample<T>& sample) {
  // Number by number and without a branch, so that loops over pixels become SIMD code.
  const T length = sample.reg_norm > T(0) ? sample.reg_norm : std::numeric_limits<T>::infinity();
  Eigen::Matrix<T, 2, 2> jacobian;
  jacobian(0, 0) = (T(1) - sample.ax * sample.ax) / length;
  jacobian(0, 1) = (T(0) - sample.ax * sample.ay) / length;
  jacobian(1, 0) = (T(0) - sample.ay * sample.ax) / length;
  jacobian(1, 1) = (T(1) - sample.ay * sample.ay) / length;
  return jacobian;
}

/// d min(r_i, r_j) / d a_i: -2 r_i^2 a_i where ||a_i||^2 is the largest of (||a_i||^2, ||a_j||^2,
/// tau), else 0. Where ||a_i|| = ||a_j||, a kink, it is the one-sided derivative of r_i.
template <class T>
inline RowVector2<T> SmallerReciprocalDerivative(const Sample<T>& i, const Sample<T>& j) {
  const Vector2<T> a = NormalizedGradient(i);
  // r = 1/||a||^2 makes the product 1 up to two roundings; where tau rules it is smaller.
  const bool tau_rules = a.squaredNorm() * i.r < T(1) - 2 * std::numeric_limits<T>::epsilon();
  if (j.r < i.r || tau_rules) return RowVector2<T>::Zero();
  return -2 * i.r * i.r * a.transpose();
}

}  // namespace sgf::metrics
