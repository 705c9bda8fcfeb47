#pragma once

#include <opencv2/core.hpp>

#include <sgf/stereo/cost_options.h>
#include <sgf/stereo/matches.h>

namespace sgf::stereo {

/// Parameters of BlockMatcher. Where a default has a counterpart in cv::StereoBM, it is named.
struct BlockMatcherOptions : CostOptions, MatchChecks {
  int window = 9;
  double texture_threshold = 0;

  template <class V>
  void VisitFields(V&& visit) {
    CostOptions::VisitFields(visit);
    visit("window", window, "px", "side of the square matching window, odd");
    visit("texture_threshold", texture_threshold, "grey levels/px",
          "a match is dropped where the mean gradient magnitude over the window is below; 0 keeps "
          "all");
    MatchChecks::VisitFields(visit);
  }
};

/// @throws Error for an option out of range, with its name and value.
void CheckOptions(const BlockMatcherOptions& options);

/// @throws Error for two images that do not fit each other or the options.
void CheckPair(const cv::Mat& left, const cv::Mat& right, const BlockMatcherOptions& options);

/// Local stereo matching of rectified images: window sums of a dissimilarity, winner-take-all over
/// the disparities, sub-pixel interpolation and checks (eqs. 16, 17 of the paper). Works row by
/// row: memory grows with width * disparities * window, never with height * disparities.
///
/// Disparity d pairs left pixel x with right pixel x - d. A pixel's candidates are the disparities
/// whose right pixel lies inside the image. Windows are cut at the border of the left image; where
/// one reaches out of the right image, the right image's border column is repeated.
///
/// Results are the same bits for any number of threads and any instruction set. One matcher may
/// serve several threads at once.
class BlockMatcher {
 public:
  /// @throws Error for an option out of range, with its name and value.
  explicit BlockMatcher(BlockMatcherOptions options);

  const BlockMatcherOptions& options() const { return options_; }

  /// The marker of pixels without a match: 16 * (min_disparity - 1), as in OpenCV.
  short InvalidDisparity() const { return internal::InvalidDisparity(options_.min_disparity); }

  /// Matches two rectified images of equal size and type (one channel; 8-bit, 16-bit or float).
  /// @param[out] disparity 16 * disparity, InvalidDisparity() where a check dropped the match; its
  ///   memory is used again if it has the right size.
  /// @throws Error for images that do not fit each other or the options.
  void Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const;

  /// Compute() without the filters on uniqueness, texture and speckles but with what they need, so
  /// that a threshold can be swept without matching anew.
  Matches Match(const cv::Mat& left, const cv::Mat& right) const;

  /// Applies uniqueness, texture and speckle filters: Compute() is Filter(Match(...)).
  /// @param uniqueness_pct stands in for the option of that name.
  /// @throws Error when it is out of range.
  cv::Mat1s Filter(const Matches& matches, const cv::Mat& left, double uniqueness_pct) const;

  /// CV_16S disparities in 1/16 px as float in px, NaN where there is no match.
  cv::Mat1f ToFloat(const cv::Mat1s& disparity) const;

 private:
  void DropTexturelessAndSpeckles(const cv::Mat& left, cv::Mat1s& disparity) const;

  BlockMatcherOptions options_;
};

}  // namespace sgf::stereo
