#pragma once

#include <cmath>
#include <span>
#include <utility>

namespace sgf::alignment {

/// How far-off residuals count.
enum class RobustKind {
  kNone,      ///< as all others: least squares
  kHuber,     ///< linearly beyond 1.345 scales (95 % efficient under Gaussian noise)
  kStudentT,  ///< logarithmically: Student's t with 5 degrees of freedom (Kerl, Sturm, Cremers
              ///< 2013)
};
std::span<const std::pair<const char*, RobustKind>> EnumNames(RobustKind);

/// A robust loss rho of a residual's squared norm s; the cost is rho(s) / 2, and rho'(s) the weight
/// of iteratively reweighted least squares.
template <class T>
struct RobustLoss {
  RobustKind kind = RobustKind::kHuber;
  T scale = T(1);  ///< standard deviation of a good residual, in the residual's unit

  T Weight(T s) const {
    if (kind == RobustKind::kHuber) return s > HuberLimit() ? std::sqrt(HuberLimit() / s) : T(1);
    if (kind == RobustKind::kStudentT) return T(kFreedom + 1) / (T(kFreedom) + s / (scale * scale));
    return T(1);
  }

  /// Mean eigenvalue of d(Weight(s) r)/dr for a residual r of `dim` components, s = |r|^2: what a
  /// residual adds to the curvature of the cost, less than its weight in least squares.
  T Curvature(T s, int dim) const {
    const T w = Weight(s);
    if (kind == RobustKind::kHuber && s > HuberLimit()) return w * (T(1) - T(1) / T(dim));
    if (kind == RobustKind::kStudentT)
      return w - T(2) * s * w / (T(kFreedom) * scale * scale + s) / T(dim);
    return w;
  }

  T Rho(T s) const {
    if (kind == RobustKind::kHuber && s > HuberLimit())
      return T(2) * std::sqrt(HuberLimit() * s) - HuberLimit();
    if (kind == RobustKind::kStudentT)
      return T(kFreedom + 1) * scale * scale * std::log1p(s / (T(kFreedom) * scale * scale));
    return s;
  }

 private:
  static constexpr double kFreedom = 5;
  T HuberLimit() const {
    const T k = T(1.345) * scale;
    return k * k;
  }
};

}  // namespace sgf::alignment
