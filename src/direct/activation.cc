#include <algorithm>
#include <climits>
#include <cmath>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/parallel.h>
#include <sgf/direct/activation.h>
#include <sgf/direct/projection.h>

namespace sgf::direct {
namespace {

using Eigen::Vector2f;

/// Cells of an image that already have a point.
class Occupancy {
 public:
  Occupancy(const Camera& camera, double spacing_px)
      : spacing_(static_cast<float>(spacing_px)),
        cells_(static_cast<int>(camera.height / spacing_px) + 1,
               static_cast<int>(camera.width / spacing_px) + 1, uint8_t{0}) {}

  /// @return whether the place was free; it is taken then.
  bool Take(const Vector2f& pixel) {
    uint8_t& cell =
        cells_(static_cast<int>(pixel.y() / spacing_), static_cast<int>(pixel.x() / spacing_));
    if (cell) return false;
    cell = 1;
    return true;
  }

 private:
  float spacing_;
  cv::Mat1b cells_;
};

struct Candidate {
  Keyframe* host;
  size_t index;
  RefinedDepth refined = {};
  std::vector<View> views = {};
};

bool Mature(const ImmaturePoint& point, double min_quality) {
  constexpr float kMostInterval = 8;  // px
  return point.found > 0 && point.quality >= min_quality && point.interval_px < kMostInterval &&
         point.InverseDepth() > 0 && point.status != TraceStatus::kOutlier;
}

/// Mature points that the newest image has room for.
std::vector<Candidate> CandidatesOf(const Camera& camera, const Window& window, double spacing_px,
                                    double min_quality) {
  const Keyframe& newest = *window.back();
  Occupancy taken(camera, spacing_px);
  for (const auto& host : window) {
    const SE3 T = newest.T_cam_world * host->T_cam_world.Inverse();
    for (const ActivePoint& point : host->points)
      if (const auto seen = Project(camera, T, point.pixel, point.inverse_depth); seen.in_view)
        taken.Take(seen.pixel);
  }
  std::vector<Candidate> candidates;
  for (const auto& host : window) {
    const SE3 T = newest.T_cam_world * host->T_cam_world.Inverse();
    for (size_t k = 0; host->id != newest.id && k < host->immature.size(); ++k) {
      const ImmaturePoint& point = host->immature[k];
      if (!Mature(point, min_quality)) continue;
      const Projection seen = Project(camera, T, point.pixel, point.InverseDepth());
      if (seen.in_view && taken.Take(seen.pixel)) candidates.push_back({host.get(), k});
    }
  }
  return candidates;
}

/// Views of the window's other key-frames that have the point in them.
std::vector<View> ViewsOf(const Camera& camera, const Window& window, const Keyframe& host,
                          const ImmaturePoint& point) {
  std::vector<View> views;
  for (const auto& target : window) {
    if (target->id == host.id) continue;
    const SE3 T = target->T_cam_world * host.T_cam_world.Inverse();
    if (Project(camera, T, point.pixel, point.InverseDepth()).in_view)
      views.push_back({target.get(), T});
  }
  return views;
}

void Promote(const Candidate& candidate) {
  ImmaturePoint& point = candidate.host->immature[candidate.index];
  point.outliers = INT_MAX;  // tried: leaves in any case
  // In maps whose median depth is about 1; without parallax nothing is known. DSO's limit.
  constexpr double kLeastInformation = 100;
  if (candidate.refined.seen_by.empty() || candidate.refined.information < kLeastInformation)
    return;
  ActivePoint active{.pixel = point.pixel, .inverse_depth = candidate.refined.inverse_depth};
  for (int k : candidate.refined.seen_by)
    active.observations.push_back({candidate.views[k].target->id});
  ++candidate.host->points_made;
  candidate.host->points.push_back(active);
}

/// Takes out points that were activated or that are not in view any more.
void Prune(const Camera& camera, const Keyframe& newest, Keyframe& host) {
  if (host.id == newest.id) return;
  const SE3 T = newest.T_cam_world * host.T_cam_world.Inverse();
  std::erase_if(host.immature, [&](const ImmaturePoint& point) {
    if (point.GivenUp()) return true;
    const bool known = std::isfinite(point.inverse_depth_max);
    return known && !Project(camera, T, point.pixel, point.InverseDepth()).in_view;
  });
}

}  // namespace

PointActivation::PointActivation(const Camera& camera, const DirectOptions& options)
    : active_points_(options.active_points),
      min_quality_(options.depth.min_quality),
      threads_(options.threads),
      first_spacing_px_(std::sqrt(0.5 * camera.width * camera.height / options.active_points)),
      spacing_px_(first_spacing_px_) {}

void PointActivation::Activate(const Camera& camera, const DepthEstimator& depth, Window& window) {
  const int active = CountActive(window);
  if (active < 0.8 * active_points_) spacing_px_ = std::max(2., 0.85 * spacing_px_);
  if (active > 1.1 * active_points_)
    spacing_px_ = std::min(3 * first_spacing_px_, 1.15 * spacing_px_);
  std::vector<Candidate> candidates = CandidatesOf(camera, window, spacing_px_, min_quality_);
  ParallelForBatches(static_cast<int>(candidates.size()), threads_, [&](int k) {
    Candidate& candidate = candidates[k];
    const ImmaturePoint& point = candidate.host->immature[candidate.index];
    candidate.views = ViewsOf(camera, window, *candidate.host, point);
    candidate.refined =
        depth.Refine(*candidate.host, point.pixel, point.InverseDepth(), candidate.views);
  });
  for (const Candidate& candidate : candidates) Promote(candidate);
  for (const auto& host : window) Prune(camera, *window.back(), *host);
}

}  // namespace sgf::direct
