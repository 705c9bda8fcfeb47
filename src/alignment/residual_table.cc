#include <algorithm>
#include <string>
#include <vector>

#include <fmt/core.h>

#include <sgf/alignment/residual_table.h>
#include <sgf/core/error.h>

namespace sgf::alignment {
namespace {

template <class Metric>
void AddMetric(std::vector<ResidualInfo>& infos) {
  if constexpr (kAlignable<Metric>)
    infos.push_back(
        {Metric::kInfo.name, Metric::kInfo.formula, PointResidual<Metric>::kInverseCompositional});
}

template <class... Metrics>
std::vector<ResidualInfo> CollectInfos(std::tuple<Metrics...>*) {
  std::vector<ResidualInfo> infos;
  (AddMetric<Metrics>(infos), ...);
  infos.push_back({"lssd", metrics::Lssd::kInfo.formula, LssdResidual::kInverseCompositional});
  infos.push_back(
      {"photo_affine", "exp(alpha) I_i + beta - I_j", AffinePhotoResidual::kInverseCompositional});
  infos.push_back({"bit_planes", "difference of eight smoothed binary images",
                   BitPlanesResidual::kInverseCompositional});
  return infos;
}

}  // namespace

std::span<const ResidualInfo> AllResiduals() {
  static const std::vector<ResidualInfo> kInfos =
      CollectInfos(static_cast<metrics::MetricTypes*>(nullptr));
  return kInfos;
}

const ResidualInfo& FindResidual(std::string_view name) {
  const auto infos = AllResiduals();
  const auto it = std::find_if(infos.begin(), infos.end(),
                               [&](const ResidualInfo& info) { return info.name == name; });
  if (it != infos.end()) return *it;
  std::string known;
  for (const ResidualInfo& info : infos)
    known += fmt::format("{}{}", known.empty() ? "" : ", ", info.name);
  throw Error("residual", fmt::format("'{}' is unknown; known: {}", name, known));
}

}  // namespace sgf::alignment
