#pragma once

#include <sgf/core/camera.h>
#include <sgf/direct/direct_odometry.h>
#include <sgf/direct/frame.h>
#include <sgf/direct/tracing.h>

namespace sgf::direct {

/// Turns points that are found well into active ones, where the newest image has room. How far
/// apart they have to be follows from how many there are, so that about `active_points` are active.
class PointActivation {
 public:
  PointActivation(const Camera& camera, const DirectOptions& options);

  /// @param camera as it is known now.
  /// @param window whose newest key-frame is left as it is. From the others go immature points that
  ///   were tried, that are given up, or that the newest does not have in view.
  void Activate(const Camera& camera, const DepthEstimator& depth, Window& window);

 private:
  int active_points_;
  double min_quality_;
  int threads_;
  double first_spacing_px_, spacing_px_;  ///< of points in the newest image
};

}  // namespace sgf::direct
