#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <sgf/core/camera.h>
#include <sgf/direct/frame.h>

/// Depth of pixels from one camera's motion, by any dissimilarity (Engel, Koltun, Cremers, "Direct
/// sparse odometry", 2018, Section II-C; the paper's "DSO w/ e_sgf" replaces the photometric
/// difference in it).
namespace sgf::direct {

struct TracingOptions {
  std::string residual = "photo";
  double max_length = 0.027;
  double min_correlation = 0.5;
  double min_quality = 3;
  int max_iterations = 4;

  template <class V>
  void VisitFields(V&& visit) {
    visit("residual", residual, "", "dissimilarity that depth is estimated with");
    visit("max_length", max_length, "image width + height",
          "most that is searched along an epipolar line");
    visit("min_correlation", min_correlation, "",
          "of a patch's gradients with those of what was found, else an outlier");
    visit("min_quality", min_quality, "",
          "second best over best dissimilarity that a point needs to become active");
    visit("max_iterations", max_iterations, "", "of the refinement along the line");
  }
};

/// @throws Error for an option out of range, or a residual that cannot estimate depth.
void CheckOptions(const TracingOptions& options);

/// A pixel of a key-frame as a point to be searched for.
/// @param pixel at least 3 px inside the image.
ImmaturePoint MakeImmaturePoint(const alignment::SampleChannels& image,
                                const Eigen::Vector2f& pixel);

/// A view that a point's depth is refined with.
struct View {
  const Keyframe* target = nullptr;
  SE3 T_target_host = {};
};

/// What a refinement over several views has found.
struct RefinedDepth {
  double inverse_depth = 0;
  double information = 0;         ///< curvature of the cost, for residuals of unit scale
  std::vector<int> seen_by = {};  ///< positions among the views of those that agree
};

/// Estimates depths of one host key-frame's pixels. Const calls may run in parallel.
class DepthEstimator {
 public:
  virtual ~DepthEstimator() = default;

  /// Searches a point in the image of another camera and narrows its interval.
  /// @param image of the other camera.
  /// @param relative brightness of the other image against the host's.
  virtual void Trace(const Keyframe& host, const alignment::SampleChannels& image,
                     const SE3& T_target_host, const RelativeBrightness& relative,
                     ImmaturePoint& point) const = 0;

  /// Refines an inverse depth over all views at once, along the epipolar lines.
  /// @return no views where none agrees.
  virtual RefinedDepth Refine(const Keyframe& host, const Eigen::Vector2f& pixel,
                              double inverse_depth, std::span<const View> views) const = 0;
};

/// @param camera without distortion.
/// @throws Error as CheckOptions().
std::unique_ptr<const DepthEstimator> MakeDepthEstimator(const Camera& camera,
                                                         const TracingOptions& options);

}  // namespace sgf::direct
