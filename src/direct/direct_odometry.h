#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/core/camera.h>
#include <sgf/core/se3.h>
#include <sgf/direct/frame.h>
#include <sgf/direct/initializer.h>
#include <sgf/direct/pixel_selection.h>
#include <sgf/direct/tracing.h>
#include <sgf/direct/window.h>

/// Direct sparse odometry with one camera (Engel, Koltun, Cremers, "Direct sparse odometry", PAMI
/// 2018), with a choice of dissimilarities.
namespace sgf::direct {

/// Options of the tracker's alignment: single pixels, as there are many.
inline alignment::AlignmentOptions DefaultTracking() {
  alignment::AlignmentOptions options;
  options.residual = "photo_affine";
  options.pattern = alignment::Pattern::kPoint;
  options.min_inlier_share = 0.6;  // directions of single gradients agree by chance more often
  return options;
}

/// Parameters of DirectOdometry. The dissimilarity is chosen in two places: `depth.residual`, and
/// `tracking.residual` with `window.residual`.
struct DirectOptions {
  PixelSelectionOptions selection;
  TracingOptions depth;
  alignment::AlignmentOptions tracking = DefaultTracking();
  WindowOptions window;
  InitializerOptions initializer;
  int active_points = 1000;
  int keyframes = 7;
  int min_keyframes = 5;
  double keyframe_flow = 0.06;
  double keyframe_parallax = 0.03;
  double keyframe_brightness = 0.5;
  double keyframe_inliers = 0.8;
  int lost_frames = 5;
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("selection", selection, "", "pixels of a key-frame whose depth is estimated");
    visit("depth", depth, "", "search for those pixels in other frames");
    visit("tracking", tracking, "", "alignment of a frame with the last key-frame");
    visit("window", window, "", "joint refinement of the last key-frames");
    visit("initializer", initializer, "", "the first motion");
    visit("active_points", active_points, "", "of the window, about");
    visit("keyframes", keyframes, "", "of the window, at most");
    visit("min_keyframes", min_keyframes, "", "fewer are not left for want of points in view");
    visit("keyframe_flow", keyframe_flow, "image width + height",
          "root mean square motion of pixels that makes a key-frame on its own");
    visit("keyframe_parallax", keyframe_parallax, "image width + height",
          "the same without what rotation does; all shares add up");
    visit("keyframe_brightness", keyframe_brightness, "",
          "change of the logarithm of the gain that makes a key-frame on its own");
    visit("keyframe_inliers", keyframe_inliers, "",
          "a key-frame is made when the share of inliers falls below");
    visit("lost_frames", lost_frames, "frames", "after so many lost ones a new map is begun");
    visit("threads", threads, "", "0 for all cores. The result does not depend on it");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const DirectOptions& options);

/// What became of a frame.
enum class DirectState {
  kInitialising,  ///< no map yet
  kTracked,
  kLost,  ///< no pose
};
std::span<const std::pair<const char*, DirectState>> EnumNames(DirectState);

/// Time spent on a frame, s.
struct DirectTimes {
  double image_s = 0;  ///< photometric correction and pyramid
  double tracking_s = 0;
  double tracing_s = 0;
  double keyframe_s = 0;  ///< activation, refinement of the window, marginalisation, new points
  double total_s = 0;
};

/// What is known right after a frame.
struct DirectFrameResult {
  std::int64_t time_ns = 0;
  DirectState state = DirectState::kInitialising;
  /// Number of the map, counted from 0. Each begins at the last believed pose and has a scale of
  /// its own.
  int segment = 0;
  SE3 T_world_cam = {};  ///< in the segment's world and units; if not tracked, the last one
  bool new_keyframe = false;
  bool new_map = false;     ///< this frame is the first with a pose of its segment
  double inlier_share = 0;  ///< of the points in view
  double overlap = 0;       ///< share of points that are in view
  Brightness brightness = {};
  int hypotheses = 0;  ///< motions that were tried
  int active_points = 0;
  WindowSummary window = {};  ///< if it became a key-frame
  DirectTimes times = {};
};

/// A pose of the whole trajectory.
struct DirectPose {
  std::int64_t time_ns = 0;
  int segment = 0;
  SE3 T_world_cam;
};

/// A point of the map.
struct MapPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in its segment's world and units
  double inverse_depth = 0;                            ///< in its key-frame, 1/unit
  double inverse_depth_variance = 0;
  int support = 0;  ///< key-frames that saw it, its own not counted
  float grey = 0;   ///< grey levels
  int keyframe = 0;
  int segment = 0;
};

/// Odometry of one camera. Frames are handed over one at a time. Same input, same bits, for any
/// number of threads. Memory does not grow with the sequence but for the poses. Calls of one object
/// must not overlap; objects share no state.
class DirectOdometry {
 public:
  /// @param camera without distortion.
  /// @throws Error for a camera with distortion or out of range, or an option out of range.
  DirectOdometry(const Camera& camera, const DirectOptions& options);
  ~DirectOdometry();
  DirectOdometry(DirectOdometry&&) noexcept;
  DirectOdometry& operator=(DirectOdometry&&) noexcept;

  /// @param grey 8-bit, or float as PhotometricCorrection gives it; of the camera's size.
  /// @param exposure_ms where it is known; then for all frames.
  /// @throws Error for another type or size, grey levels that are not finite, a time not after the
  ///   last one, an exposure that is not positive, or one of some frames only. The state is as
  ///   before the call.
  DirectFrameResult Process(std::int64_t time_ns, const cv::Mat& grey,
                            std::optional<double> exposure_ms = std::nullopt);

  /// Poses of all frames so far that have one, those before a map was there as well, as they are
  /// known now: key-frames refined, others as they lie to their key-frame.
  std::vector<DirectPose> Trajectory() const;

  /// As it is known now: the one given, unless `window.sigma_intrinsics` has it refined.
  const Camera& camera() const;

  /// Points that have left the window since the last call. They are kept until then: call it now
  /// and then for memory not to grow.
  std::vector<MapPoint> TakeFinishedPoints();

  /// Points of the window, as they are now.
  std::vector<MapPoint> ActivePoints() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sgf::direct
