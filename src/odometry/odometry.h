#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/alignment/point_selection.h>
#include <sgf/core/camera.h>
#include <sgf/core/inertial.h>
#include <sgf/core/se3.h>
#include <sgf/odometry/stereo_depth.h>
#include <sgf/stereo/block_matcher.h>

/// Key-frame odometry by direct image alignment, from rectified stereo pairs or from grey images
/// with depth.
namespace sgf::odometry {

/// Block matching for odometry: more disparities than its own default, since points may be near.
inline stereo::BlockMatcherOptions DefaultMatcher() {
  stereo::BlockMatcherOptions options;
  options.num_disparities = 128;
  return options;
}

/// Parameters of Odometry.
struct OdometryOptions {
  stereo::BlockMatcherOptions matcher = DefaultMatcher();
  RefinementOptions refinement;
  alignment::SelectionOptions selection;
  alignment::AlignmentOptions alignment;
  double min_depth_m = 0.1;
  double max_depth_m = 100;
  double keyframe_overlap = 0.9;
  double keyframe_inliers = 0.6;
  int tracking_levels = 4;
  int relocation_keyframes = 5;
  int lost_frames = 20;

  template <class V>
  void VisitFields(V&& visit) {
    visit("matcher", matcher, "", "block matching that depth comes from");
    visit("refinement", refinement, "", "of the disparities of tracked pixels");
    visit("selection", selection, "", "pixels of a key-frame that are tracked");
    visit("alignment", alignment, "", "direct image alignment");
    visit("min_depth_m", min_depth_m, "m", "nearest depth that is used");
    visit("max_depth_m", max_depth_m, "m", "farthest depth that is used");
    visit("keyframe_overlap", keyframe_overlap, "",
          "a new key-frame is made when fewer of its points are in view");
    visit("keyframe_inliers", keyframe_inliers, "",
          "a new key-frame is made when the share of inliers falls below");
    visit("tracking_levels", tracking_levels, "",
          "pyramid levels that tracking starts with; where that fails, all of them");
    visit("relocation_keyframes", relocation_keyframes, "",
          "last key-frames that a lost camera is aligned with");
    visit("lost_frames", lost_frames, "frames",
          "after so many lost ones the odometry starts anew at the predicted pose");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const OdometryOptions& options);

/// The cameras of an odometry: an ideal pinhole camera and, for rectified stereo, its twin.
struct Rig {
  Camera camera;          ///< of the left (or only) image, without distortion
  double baseline_m = 0;  ///< from the left to the right camera along +x; 0 with depth images
};

/// What became of a frame.
enum class TrackingState {
  kInitialised,  ///< the first frame, or the first after being lost without relocation
  kTracked,
  kLost,  ///< the pose is a prediction and not to be believed
};
std::span<const std::pair<const char*, TrackingState>> EnumNames(TrackingState);

/// Time spent on a frame, s.
struct StageTimes {
  double pyramid_s = 0;
  double alignment_s = 0;
  double depth_s = 0;      ///< stereo matching; 0 where no key-frame was wanted
  double selection_s = 0;  ///< of a key-frame's points, with their refinement and patches
  double total_s = 0;
};

/// What is known after a frame. World is the first
/// key-frame's camera (x right, y down, z forward).
struct FrameResult {
  std::int64_t time_ns = 0;
  TrackingState state = TrackingState::kLost;
  SE3 T_world_cam = {};
  /// Of the motion since the key-frame, in the tangent of T_cam_keyframe (left perturbation,
  /// translation in m before rotation in rad). 0 unless tracked.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  int keyframe = -1;          ///< index of the key-frame it was aligned with, counted from 0
  bool new_keyframe = false;  ///< this frame has become one
  double overlap = 0;         ///< share of the key-frame's points that are in view
  double inlier_share = 0;    ///< of the points in view
  double condition = 0;       ///< of the normal equations
  alignment::AlignmentFailure failure = alignment::AlignmentFailure::kNone;  ///< of the last try
  int iterations = 0;                                                        ///< of all tries
  StageTimes times = {};
};

/// A key-frame: its pose and the points that later frames are aligned with.
struct Keyframe {
  std::int64_t time_ns = 0;
  SE3 T_world_cam = {};
  std::vector<alignment::ReferencePoint> points;
};

/// Visual odometry against the last key-frame. Frames are handed over one at a time, in the order
/// of their times; the pose is that at frame time and is not changed later. Same input, same bits.
/// Calls of one object must not overlap; objects share no state.
class Odometry {
 public:
  /// @throws Error for a camera with distortion or out of range, or an option out of range.
  Odometry(const Rig& rig, const OdometryOptions& options);
  ~Odometry();
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;

  /// Tracks a rectified stereo pair (8-bit grey, of the camera's size).
  /// @throws Error for images of another size or type, a time not after the last one, or a rig
  ///   without baseline. The state is as before the call.
  FrameResult ProcessStereo(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right);

  /// Tracks a grey image with depth.
  /// @param depth_m depth along the optical axis, m; 0, negative or not finite where unknown.
  /// @throws Error as ProcessStereo().
  FrameResult ProcessDepth(std::int64_t time_ns, const cv::Mat& grey, const cv::Mat1f& depth_m);

  /// Takes an angular rate for the prediction of the next frame's rotation.
  /// @param gyro rad/s in camera coordinates. Samples come in the order of their times; one that
  ///   is not after the one before is ignored.
  void ProcessGyro(std::int64_t time_ns, const Eigen::Vector3d& gyro);

  /// The last key-frame. @throws Error before the first frame.
  const Keyframe& LastKeyframe() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sgf::odometry
