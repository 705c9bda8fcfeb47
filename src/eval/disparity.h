#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

namespace sgf {

/// Errors of a disparity map against ground truth. The mean and the bad-pixel rates are over the
/// matched pixels that have ground truth, the invalid share is over all pixels that have it, so the
/// two are to be read together: the fewer pixels a matcher keeps, the better the kept ones look.
struct DisparityScores {
  int64_t truth_px = 0;    ///< pixels with ground truth
  int64_t matched_px = 0;  ///< of these, pixels with an estimate
  double mean_px = 0;      ///< mean |estimate - truth|
  double bad1_pct = 0;     ///< share with an error above 1 px
  double bad2_pct = 0;     ///< above 2 px
  double bad4_pct = 0;     ///< above 4 px
  double d1_pct = 0;       ///< above 3 px and above 5 % of the true disparity (KITTI 2015)
  double invalid_pct = 0;  ///< share of truth_px without an estimate
};

/// Scores a disparity map.
/// @param estimate, truth disparities in px of the same size; NaN (or infinite) where there is
/// none.
///   The region to score in (all, non-occluded) is chosen by the pixels that have truth.
/// @return the scores; with no matched pixel the mean and the rates are NaN and 100 % are invalid.
/// @throws Error when the sizes differ or no pixel has ground truth.
DisparityScores ScoreDisparity(const cv::Mat1f& estimate, const cv::Mat1f& truth);

}  // namespace sgf
