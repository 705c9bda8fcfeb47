#pragma once

#include <cmath>
#include <string_view>
#include <utility>

#include <sgf/alignment/residual_table.h>

/// The paper's dissimilarities with the derivatives that its text states, as far as a text
/// extraction shows them (docs/dissimilarities.md), for studies of what those would cost. Values
/// are the exact ones; a derivative is by the gradient of image i.
namespace sgf::alignment {

/// Eq. 21 with max(|a|, |b|) where the derivative has max(|a|^2, |b|^2).
struct SgfAsExtracted : metrics::Sgf {
  template <class T>
  metrics::SampleDerivative<T, 1> Derivative(const metrics::Sample<T>& i,
                                             const metrics::Sample<T>& j) const {
    using std::sqrt;
    auto derivative = metrics::Sgf::Derivative(i, j);
    derivative.gradient /= sqrt(metrics::Min(i.r, j.r));
    return derivative;
  }
};

/// Eq. 22 with |g_i|^2 where the derivative has epsilon: |a|^2 and 1 - |a|^2 change places. Of its
/// two cases, n_ij > n_ji is |g_i|^2 + epsilon > |g_j|^2 + theta.
struct Sgf2AsExtracted : metrics::Sgf2 {
  template <class T>
  metrics::SampleDerivative<T, 1> Derivative(const metrics::Sample<T>& i,
                                             const metrics::Sample<T>& j) const {
    using metrics::GradientDerivative, metrics::NormalizedNorm;
    const auto g_j = metrics::Gradient(j);
    if (!(i.norm > T(0))) return GradientDerivative<T, 1>(-g_j.transpose());
    const T a = NormalizedNorm(i);
    const T slope = i.reg_norm > j.reg_norm ? NormalizedNorm(j) * i.reg_norm * (2 - a * a)
                                            : j.norm * j.reg_norm * a * a / i.reg_norm;
    return GradientDerivative<T, 1>((slope * metrics::UnitGradient(i) - g_j).transpose());
  }
};

/// Eq. 24 with a factor of 1/2 that the derivative does not have.
struct Sgf3AsExtracted : metrics::Sgf3 {
  template <class T>
  metrics::SampleDerivative<T, 1> Derivative(const metrics::Sample<T>& i,
                                             const metrics::Sample<T>& j) const {
    return metrics::GradientDerivative<T, 1>(
        (j.norm / 2 * metrics::UnitGradient(i) - metrics::Gradient(j)).transpose());
  }
};

/// As VisitResidual(), which knows all other names, with `sgf_as_extracted`,
/// `sgf2_as_extracted` and `sgf3_as_extracted` besides.
/// @throws Error listing the names of alignment's table.
template <class F>
decltype(auto) VisitStudiedResidual(std::string_view name, F&& f) {
  if (name == "sgf_as_extracted") return f(PointResidual<SgfAsExtracted>{});
  if (name == "sgf2_as_extracted") return f(PointResidual<Sgf2AsExtracted>{});
  if (name == "sgf3_as_extracted") return f(PointResidual<Sgf3AsExtracted>{});
  return VisitResidual(name, std::forward<F>(f));
}

}  // namespace sgf::alignment
