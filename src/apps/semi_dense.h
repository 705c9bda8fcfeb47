#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/io/calib.h>
#include <sgf/io/stereo_dataset.h>
#include <sgf/stereo/block_matcher.h>

namespace sgf::apps {

/// What Fig. 3 is drawn of: depth at pixels with enough gradient, found by patch search along rows.
struct SemiDenseOptions {
  double min_gradient = 5;
  double min_epipolar_gradient = 2;
  double bad_pct = 5;
  stereo::BlockMatcherOptions matcher;

  template <class V>
  void VisitFields(V&& visit) {
    visit("min_gradient", min_gradient, "grey levels/px",
          "least gradient magnitude of a pixel to match");
    visit("min_epipolar_gradient", min_epipolar_gradient, "grey levels/px",
          "least gradient along the row of such a pixel");
    visit("bad_pct", bad_pct, "%", "a depth is bad when off by more than this share of the truth");
    visit("matcher", matcher, "", "patch search; num_disparities is the pair's own");
  }
};

/// A reconstructed point in the left camera's frame: x right, y down, z forward.
struct SemiDensePoint {
  std::array<float, 3> position;  ///< m
  uint8_t grey;                   ///< of the left image
  float depth_error;              ///< m, found minus true depth
};

/// How well the depths of a reconstruction are. Quantiles are the smallest errors that this share
/// of the points does not exceed; those and percentages of points are NaN where there is no point.
struct SemiDenseScores {
  int candidates = 0;     ///< pixels with enough gradient and known truth
  int kept = 0;           ///< of those, matched with a finite depth
  double kept_pct = 0;    ///< kept / candidates
  double median_m = 0;    ///< absolute depth error
  double p90_m = 0;       ///< its 90th percentile
  double median_pct = 0;  ///< absolute depth error over true depth
  double p90_pct = 0;     ///< its 90th percentile
  double bad_pct = 0;     ///< points off by more than the options' bad_pct
  /// Of those bad points, the ones whose patch in the right image has the larger mean gradient
  /// magnitude, each in units of its image's root mean square.
  double bad_stronger_pct = 0;
};

/// Points in row order of their pixels, and their scores.
struct SemiDenseDepth {
  std::vector<SemiDensePoint> points;
  SemiDenseScores scores;
};

/// Pixels to match, 255: gradient magnitude and its horizontal part, by the matcher's operator,
/// reach the options' bounds. Horizontal edges are left out since a search along the row cannot
/// tell where on them it is.
cv::Mat1b SelectPixels(const cv::Mat1b& left, const SemiDenseOptions& options);

/// Matches the selected pixels of known truth by patch search and turns disparities into points:
/// depth f * baseline / (disparity + doffs). What the matcher's checks drop, and what has no
/// positive finite depth, is not kept.
/// @param pair with truth_all; `calib` states the disparities to search.
/// @throws Error for options out of range, and naming the pair when it lacks ground truth or its
///   size is not the calibration's.
SemiDenseDepth ReconstructSemiDense(const StereoPair& pair, const MiddleburyCalib& calib,
                                    const SemiDenseOptions& options);

/// The true points at the selected pixels, with scores as a perfect matcher has them.
SemiDenseDepth TrueSemiDense(const StereoPair& pair, const MiddleburyCalib& calib,
                             const SemiDenseOptions& options);

/// Points as a binary little-endian PLY file: float x, y, z (m), uchar red, green, blue (all grey),
/// float depth_error (m).
std::string ToPly(const std::vector<SemiDensePoint>& points);

/// What `sgf_study semi-dense` is asked for.
struct SemiDenseRequest {
  std::string experiment;  ///< YAML file of the study
  std::string pair;        ///< folder of a pair in Middlebury's layout with ground truth
  std::string output;      ///< folder for the results (made if missing)
  int threads = 1;
};

/// Reconstructs a pair in every case and by every column of the experiment and writes truth.ply,
/// <case>/<column>.ply but for extra columns, options.yaml, and scores.csv with a line per case and
/// column. Of the experiment's keys it reads `study` (SemiDenseOptions), `cases` (by name:
/// `right`, an ImageChange of the right image, and `matcher`, options on top of the study's) and
/// `columns` (by name: `options` of the matcher on top of those, and `extra`).
/// @throws Error for a file, name or option that is not as it should be.
void RunSemiDense(const SemiDenseRequest& request);

}  // namespace sgf::apps
