#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/apps/window_cost.h>

namespace sgf::apps {

/// Integer disparities that are searched.
struct DisparityRange {
  int first = 0;   ///< px
  int count = 20;  ///< at least 1

  int last() const { return first + count - 1; }
};

/// Errors of matching an image against a changed copy of itself: every true disparity is 0. Where
/// several disparities share the least cost, a pixel's error is the mean of their magnitudes.
struct SelfMatchScores {
  int pixels = 0;       ///< scored: same for all dissimilarities
  double mean_px = 0;   ///< mean error
  double first_px = 0;  ///< the same if the first of tied disparities were taken, as a plain argmin
                        ///< does; with a range from 0, the truth is that first one
  double median_px = 0;  ///< lower median
  double bad1_pct = 0;   ///< share of errors above 1 px
  double ties_pct = 0;   ///< share of pixels with tied disparities
};

struct SelfMatchResult {
  cv::Mat1f error_px;  ///< NaN where a pixel is not scored
  SelfMatchScores scores;
};

/// Finds for each pixel of `left` the disparity d of least cost between the window around it and
/// that around x - d in `right`, and scores it against 0. Scored are the pixels whose windows lie
/// inside the image at every candidate, a pixel away from the border where gradients are one-sided.
/// Costs within 1e-9 of the least count as tied: less than any that 8-bit images tell apart, more
/// than rounding.
/// @param metric name of a dissimilarity.
/// @param window side of the square window, px, odd.
/// @throws Error for an unknown or unfit dissimilarity, images of different sizes, a window that is
///   even, or an image too small for the disparities.
SelfMatchResult MatchSelf(const SampleField& left, const SampleField& right,
                          const std::string& metric, const stereo::PmOptions& pm, int window,
                          const DisparityRange& range, int threads);

/// What `sgf_study self-match` is asked for.
struct SelfMatchRequest {
  std::string experiment;  ///< YAML file of the study
  std::string image;       ///< file of the image
  std::string name;        ///< what the table calls it
  std::string output;      ///< CSV file
  std::string maps;        ///< folder for images and error maps; may be empty
  int threads = 0;
};

/// Matches an image against every change of the experiment and writes one CSV line per change,
/// range and column. Into the folder `maps` go, for each case, left.png and right.png as
/// matched, and per column the errors in the first range as an 8-bit PNG: 10 levels a px,
/// 255 where a pixel is not scored.
/// @throws Error for a file, name or option that is not as it should be.
void RunSelfMatch(const SelfMatchRequest& request);

}  // namespace sgf::apps
