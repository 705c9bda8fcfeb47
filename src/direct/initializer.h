#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

/// The first motion of a single camera, from tracked corners: five-point algorithm (Nister, "An
/// efficient solution to the five-point relative pose problem", 2004) and resection of the frames
/// in between. Depth is left to the dissimilarities.
namespace sgf::direct {

struct InitializerOptions {
  int corners = 600;
  double min_flow = 0.012;
  double min_parallax_deg = 1;
  double min_inliers = 0.75;
  int max_frames = 150;

  template <class V>
  void VisitFields(V&& visit) {
    visit("corners", corners, "", "that are tracked from the first frame on");
    visit("min_flow", min_flow, "image width + height",
          "median motion of corners before two views are tried");
    visit("min_parallax_deg", min_parallax_deg, "deg",
          "median angle between the rays to a point that a map needs");
    visit("min_inliers", min_inliers, "", "share of corners that have to agree on the motion");
    visit("max_frames", max_frames, "frames", "after so many without parallax it begins anew");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const InitializerOptions& options);

/// Motion since the first frame, in units of the median depth there.
struct InitialMotion {
  std::vector<SE3> T_cam_first;  ///< of every frame since, the first and the last among them
};

/// Watches the frames of one camera until they tell its motion. Same input, same result.
class Initializer {
 public:
  /// @param camera without distortion. @throws Error as CheckOptions().
  Initializer(const Camera& camera, const InitializerOptions& options);

  /// Takes a frame (grey levels, any exposure).
  /// @return the motion as soon as there is one. After that, begin with a new object.
  std::optional<InitialMotion> Add(const cv::Mat1f& image);

  /// Frames that were taken since the first, which changes where too few corners are left.
  int frames() const { return static_cast<int>(tracks_.size()); }

 private:
  using Corners = std::vector<cv::Point2f>;

  void Begin(const cv::Mat1b& image);
  bool Follow(const cv::Mat1b& image);
  std::optional<InitialMotion> Solve() const;

  Camera camera_;
  InitializerOptions options_;
  cv::Mat1b last_;
  std::vector<Corners> tracks_;  ///< of each frame, corners that are tracked to the last
};

}  // namespace sgf::direct
