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
    if (kind == RobustKind::kStudentT) return LogFactor() * std::log1p(s * InverseSpread());
    return s;
  }

 private:
  template <class U>
  friend class RobustCost;

  static constexpr double kFreedom = 5;
  T HuberLimit() const {
    const T k = T(1.345) * scale;
    return k * k;
  }
  T LogFactor() const { return T(kFreedom + 1) * scale * scale; }
  T InverseSpread() const { return T(1) / (T(kFreedom) * scale * scale); }
};

/// The cost of many residuals, the sum of rho(s) / 2. Takes one logarithm of a product where the
/// sum would take many.
template <class T>
class RobustCost {
 public:
  explicit RobustCost(const RobustLoss<T>& loss)
      : loss_(loss), log_factor_(loss.LogFactor()), inverse_spread_(loss.InverseSpread()) {}

  void Add(T s) {
    ++residuals_;
    if (loss_.kind == RobustKind::kStudentT)
      Multiply(1 + double(s) * inverse_spread_);
    else
      sum_ += loss_.Rho(s);
  }

  int residuals() const { return residuals_; }
  double Value() const { return 0.5 * (sum_ + log_factor_ * std::log(product_)); }

 private:
  void Multiply(double factor) {
    constexpr double kMost = 1e100;  // far from overflow by one more factor
    product_ *= factor;
    if (product_ < kMost) return;
    sum_ += log_factor_ * std::log(product_);
    product_ = 1;
  }

  RobustLoss<T> loss_;
  double log_factor_, inverse_spread_;
  double sum_ = 0, product_ = 1;
  int residuals_ = 0;
};

}  // namespace sgf::alignment
