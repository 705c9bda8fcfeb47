#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <sgf/alignment/level.h>
#include <sgf/alignment/pattern.h>
#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

/// Sparse optical flow of a stereo camera: the front end of Basalt (Usenko, Demmel, Schubert,
/// Stückler, Cremers, "Visual-inertial mapping with non-linear factor recovery", RA-L 2020) with
/// the patch residual as a parameter.
///
/// Corners, at most one for each empty cell of a grid, are followed in the left image from frame to
/// frame by pyramidal alignment of patches under SE(2), and followed back. Every frame, each of
/// them is then searched in the right image, from the patch that the left image shows now: Basalt
/// matches left to right only once and follows both from there, which lets the two drift apart.
namespace sgf::flow {

struct FlowOptions {
  std::string residual = "lssd";
  alignment::Pattern pattern = alignment::Pattern::kBasalt52;
  int levels = 4;
  int stereo_levels = 2;
  int max_iterations = 5;
  double tolerance_px = 0.01;
  int cell_px = 56;
  int border_px = 10;
  int fast_threshold = 40;
  int least_fast_threshold = 5;
  double max_backward_px = 0.5;
  double max_epipolar_error = 0.005;
  double max_disparity_px = 100;
  alignment::LevelOptions image = {};
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit(
        "residual", residual, "",
        "what is compared: lssd, photo, or what alignment can minimise and an offset leaves alone, "
        "such as gm, gn, ugf, sgf, sgf2, sgf3, ngv, sgv, sgf3_vec; for studies also "
        "sgf_as_extracted, sgf2_as_extracted and sgf3_as_extracted");
    visit("pattern", pattern, "", "pixels of a patch");
    visit("levels", levels, "", "of the image pyramid");
    visit("stereo_levels", stereo_levels, "",
          "of these, the finest ones that a match starts from where the last disparity is known");
    visit("max_iterations", max_iterations, "", "at a level");
    visit("tolerance_px", tolerance_px, "px",
          "step that ends the iterations at the finest level; ten times that at the coarser ones");
    visit("cell_px", cell_px, "px",
          "side of the grid's cells; an empty one gets a new track (56: about 210 of EuRoC's "
          "images)");
    visit("border_px", border_px, "px", "around the grid, where no track begins");
    visit("fast_threshold", fast_threshold, "grey levels", "of the corners looked for first");
    visit("least_fast_threshold", least_fast_threshold, "grey levels",
          "the threshold is halved down to this one where a cell has no corner");
    visit("max_backward_px", max_backward_px, "px",
          "from a point to where it is found when followed there and back, else it is lost");
    visit("max_epipolar_error", max_epipolar_error, "",
          "distance of a right point's unit ray from the epipolar plane, else it is dropped");
    visit("max_disparity_px", max_disparity_px, "px",
          "how far a point is searched along its epipolar line where it has no disparity yet");
    visit("image", image, "", "gradients and their normalisation, one for each patch");
    visit("threads", threads, "", "0 for all cores; the result does not depend on it");
  }
};

/// @throws Error for an option out of range, or a residual that cannot be tracked.
void CheckOptions(const FlowOptions& options);

/// Two cameras on one body. Their images are tracked raw: distortion is only looked at where rays
/// are needed.
struct StereoRig {
  Camera left, right;
  SE3 T_left_right;  ///< right camera's coordinates to the left one's, m
};

/// A point seen in a frame.
struct FlowObservation {
  std::int64_t id = 0;  ///< of the track: never used twice
  Eigen::Vector2d left_px = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> right_px = std::nullopt;
};

/// Wall times.
struct FlowTimes {
  double pyramid_s = 0, tracking_s = 0, stereo_s = 0, detection_s = 0, total_s = 0;
};

/// Where the left image is thought to show tracks, px, by their ids: of those whose depth is known.
using ExpectedPixels = std::map<std::int64_t, Eigen::Vector2d>;

/// What a frame shows.
struct FlowFrame {
  std::int64_t time_ns = 0;
  std::vector<FlowObservation> observations;  ///< sorted by id
  int tracked = 0;                            ///< tracks of the last frame that were found
  int lost = 0;                               ///< and that were not: they have ended
  int detected = 0;                           ///< tracks that begin
  int stereo = 0;                             ///< observations with a right point
  FlowTimes times;
};

/// Follows points from frame to frame. Memory is that of three image pyramids and the tracks, at
/// most about two for each cell of the grid. Calls of one object must not overlap; objects share
/// no state.
class StereoFlow {
 public:
  /// @throws Error as CheckOptions(), for a camera that is none (Camera::Check()), cameras at one
  ///   place, or images too small for the pyramid.
  StereoFlow(const StereoRig& rig, const FlowOptions& options);
  ~StereoFlow();
  StereoFlow(StereoFlow&&) noexcept;
  StereoFlow& operator=(StereoFlow&&) noexcept;

  /// Takes the next frame.
  /// @param time_ns later than that of the last frame.
  /// @param left, right 8-bit grey images of the cameras' sizes. The right one may be empty.
  /// @param R_cur_last rotation of the left camera: coordinates at the last frame to those at this
  ///   one, where known. Tracks are then searched where it takes them.
  /// @param expected where tracks are searched first.
  /// @throws Error for other images, or a time that does not increase; the tracks stay as they
  /// were.
  FlowFrame Process(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right,
                    const std::optional<Eigen::Quaterniond>& R_cur_last = std::nullopt,
                    const ExpectedPixels& expected = {});

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sgf::flow
