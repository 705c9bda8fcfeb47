#pragma once

#include <span>
#include <string_view>

#include <sgf/alignment/residual.h>

namespace sgf::alignment {

/// A name in the table of residuals.
struct ResidualInfo {
  std::string_view name;
  std::string_view formula;
  bool inverse_compositional;  ///< can be linearised at the reference
};

/// Residuals that alignment can minimise: the differentiable dissimilarities that compare pixels,
/// `lssd`, and the baselines `photo_affine` and `bit_planes`.
std::span<const ResidualInfo> AllResiduals();

/// @throws Error listing the known names.
const ResidualInfo& FindResidual(std::string_view name);

template <class Metric>
inline constexpr bool kAlignable =
    metrics::PointMetric<Metric>&& Metric::kInfo.traits.differentiable;

namespace residual_internal {

template <size_t I, class F>
decltype(auto) VisitMetricResidual(std::string_view name, F& f) {
  using Metric = std::tuple_element_t<I, metrics::MetricTypes>;
  constexpr bool kLast = I + 1 == std::tuple_size_v<metrics::MetricTypes>;
  if constexpr (kAlignable<Metric>) {
    if (name == Metric::kInfo.name) return f(PointResidual<Metric>{});
  }
  if constexpr (kLast)
    return f(LssdResidual{});
  else
    return VisitMetricResidual<I + 1>(name, f);
}

}  // namespace residual_internal

/// f(residual) for the residual with this name. f must return the same type for all of them.
/// @throws Error listing the known names.
template <class F>
decltype(auto) VisitResidual(std::string_view name, F&& f) {
  const std::string_view known = FindResidual(name).name;
  if (known == "photo_affine") return f(AffinePhotoResidual{});
  if (known == "bit_planes") return f(BitPlanesResidual{});
  return residual_internal::VisitMetricResidual<0>(known, f);
}

}  // namespace sgf::alignment
