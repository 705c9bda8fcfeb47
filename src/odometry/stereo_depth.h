#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/alignment/level.h>
#include <sgf/core/camera.h>

namespace sgf::odometry {

/// Refinement of disparities by patch alignment along the row.
struct RefinementOptions {
  bool enabled = true;
  std::string residual = "ngv";
  alignment::Pattern pattern = alignment::Pattern::kDso8;
  int max_iterations = 8;
  double max_change_px = 1;
  double min_correlation = 0.8;

  template <class V>
  void VisitFields(V&& visit) {
    visit("enabled", enabled, "", "whether disparities of selected points are refined");
    visit("residual", residual, "", "dissimilarity that is minimised");
    visit("pattern", pattern, "", "pixels that make a patch");
    visit("max_iterations", max_iterations, "", "of a point");
    visit("max_change_px", max_change_px, "px",
          "a point whose disparity changes by more is dropped");
    visit("min_correlation", min_correlation, "",
          "a point whose gradients correlate less with those in the right image is dropped");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const RefinementOptions& options);

/// Moves points of the left image along their epipolar lines in the right one to the minimum of the
/// residual. Points that leave the right image, move too far or do not look alike are dropped.
/// @param camera of both images; the right one lies baseline_m along +x.
/// @param points with a first inverse depth.
void RefineDepths(const alignment::SampleChannels& left, const alignment::SampleChannels& right,
                  const Camera& camera, double baseline_m, const RefinementOptions& options,
                  std::vector<alignment::ReferencePoint>& points);

}  // namespace sgf::odometry
