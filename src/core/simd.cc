#include <algorithm>
#include <bit>
#include <cctype>

#include <fmt/core.h>
#include <fmt/ranges.h>
#include <hwy/highway.h>

#include <sgf/core/error.h>
#include <sgf/core/simd.h>

namespace sgf {
namespace {

std::string LowerName(int64_t target) {
  std::string name = hwy::TargetName(target);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

}  // namespace

std::vector<std::string> SimdTargets() {
  std::vector<std::string> names;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets())
    names.push_back(LowerName(target));
  return names;
}

void RestrictSimd(const std::string& target) {
  hwy::SetSupportedTargetsForTest(0);
  if (!target.empty()) {
    const auto targets = hwy::SupportedAndGeneratedTargets();
    const auto it = std::find_if(targets.begin(), targets.end(),
                                 [&](int64_t t) { return LowerName(t) == target; });
    if (it == targets.end())
      throw Error("isa", fmt::format("'{}' is not available; known here: {}", target,
                                     fmt::join(SimdTargets(), ", ")));
    hwy::SetSupportedTargetsForTest(*it);
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

std::string ActiveSimdTarget() { return SimdTargets().front(); }

}  // namespace sgf
