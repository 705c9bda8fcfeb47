#include <algorithm>
#include <cmath>

#include <sgf/core/keyframe_choice.h>
#include <sgf/direct/leaving.h>

namespace sgf::direct {

std::vector<int> LeavingKeyframes(const Window& window, const DirectOptions& options) {
  const int newest = static_cast<int>(window.size()) - 1;
  std::vector<int> leaving;
  int left = newest + 1;
  for (int k = 0; k < newest - 1 && left > options.min_keyframes; ++k) {
    const Keyframe& frame = *window[k];
    const auto seen =
        std::count_if(frame.points.begin(), frame.points.end(),
                      [&](const ActivePoint& point) { return point.SeenBy(window[newest]->id); });
    constexpr double kLeastSeen = 0.05;
    const auto in_view = static_cast<double>(seen + std::ssize(frame.immature));
    const double gain = std::abs(frame.brightness.a - window[newest]->brightness.a);
    constexpr double kMostGain = 0.7;
    if (in_view < kLeastSeen * std::max(1, frame.points_made) || gain > kMostGain) {
      leaving.push_back(k);
      --left;
    }
  }
  if (left <= options.keyframes) return leaving;
  std::vector<Eigen::Vector3d> places;
  for (int k = 0; k < newest - 1; ++k) places.push_back(window[k]->T_cam_world.Inverse().p);
  const int farthest =
      static_cast<int>(LeastUsefulKeyframe(places, window[newest]->T_cam_world.Inverse().p));
  if (std::find(leaving.begin(), leaving.end(), farthest) == leaving.end())
    leaving.push_back(farthest);
  return leaving;
}

std::vector<std::vector<char>> LeavingPoints(const Window& window, std::span<const int> leaving) {
  const int newest = static_cast<int>(window.size()) - 1;
  std::vector<std::vector<char>> gone(window.size());
  for (int k = 0; k <= newest; ++k) {
    const bool host_leaves = std::find(leaving.begin(), leaving.end(), k) != leaving.end();
    for (const ActivePoint& point : window[k]->points) {
      const bool seen =
          point.SeenBy(window[newest]->id) || (newest > 0 && point.SeenBy(window[newest - 1]->id));
      gone[k].push_back(host_leaves || !seen);
    }
  }
  return gone;
}

}  // namespace sgf::direct
