#include <algorithm>
#include <array>
#include <string>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/metrics/registry.h>

namespace sgf::metrics {
namespace {

template <class... M>
constexpr std::array<MetricInfo, sizeof...(M)> CollectInfos(std::tuple<M...>*) {
  return {M::kInfo...};
}

constexpr auto kInfos = CollectInfos(static_cast<MetricTypes*>(nullptr));

std::string KnownNames() {
  std::string names;
  for (const MetricInfo& info : kInfos) {
    names += fmt::format("{}{}", names.empty() ? "" : ", ", info.name);
    if (!info.alias.empty()) names += fmt::format(" (or {})", info.alias);
  }
  return names;
}

}  // namespace

std::span<const MetricInfo> AllMetrics() { return kInfos; }

const MetricInfo& FindMetric(std::string_view name) {
  const auto* it = std::find_if(kInfos.begin(), kInfos.end(), [&](const MetricInfo& info) {
    return !name.empty() && (info.name == name || info.alias == name);
  });
  if (it == kInfos.end())
    throw Error("metric", fmt::format("'{}' is unknown; known: {}", name, KnownNames()));
  return *it;
}

}  // namespace sgf::metrics
