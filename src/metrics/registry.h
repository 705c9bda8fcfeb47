#pragma once

#include <span>
#include <string_view>
#include <tuple>

#include <sgf/metrics/census.h>
#include <sgf/metrics/lssd.h>
#include <sgf/metrics/point_metrics.h>
#include <sgf/metrics/traits.h>
#include <sgf/metrics/windowed_metrics.h>

/// The one table of dissimilarities.
namespace sgf::metrics {

/// Every dissimilarity, in the order of tables and documentation.
using MetricTypes = std::tuple<Photo, Sad, Gm, Agm, Gn, Pm, Gom, Ngf, Ugf, Sgf, Sgf2, Sgf3, Ngv,
                               Sgv, Sgf3Vec, Ncc, Zncc, Census, Lssd>;

/// What the table says of each, in that order.
std::span<const MetricInfo> AllMetrics();

/// The entry with this name or alias.
/// @throws Error listing the known names.
const MetricInfo& FindMetric(std::string_view name);

namespace registry_internal {

template <size_t I, class F>
decltype(auto) Dispatch(std::string_view name, F& f) {
  using Metric = std::tuple_element_t<I, MetricTypes>;
  if constexpr (I + 1 < std::tuple_size_v<MetricTypes>) {
    if (name != Metric::kInfo.name) return Dispatch<I + 1>(name, f);
  }
  return f(Metric{});
}

}  // namespace registry_internal

/// f(M{}) for the dissimilarity type M with this name or alias. f must return the same type for all
/// of them. Meant for one choice per image or row, not per pixel.
/// @throws Error listing the known names.
template <class F>
decltype(auto) VisitMetric(std::string_view name, F&& f) {
  return registry_internal::Dispatch<0>(FindMetric(name).name, f);
}

}  // namespace sgf::metrics
