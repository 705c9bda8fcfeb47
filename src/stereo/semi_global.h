#pragma once

#include <opencv2/core.hpp>

#include <sgf/stereo/cost_options.h>
#include <sgf/stereo/matches.h>

namespace sgf::stereo {

/// Parameters of SemiGlobal. Penalties are in units in which the mean cost over a pair's pixels and
/// disparities is 64 and a cost is cut at 127, whatever the dissimilarity, so that one pair of
/// penalties serves all.
///
/// Window and penalties were chosen for sgf on the Middlebury 2014 scenes at even places in the
/// list of their names; the optimum is flat (windows 3 to 7, p1 16 to 32, p2 96 to 127), and holds
/// on the others. A p2 that falls with the intensity step, as Hirschmueller proposes, makes matches
/// fewer and better there but filled maps no better, and it would bring back what sgf does away
/// with: a dependence on the gain of the images.
///
/// Checks are those of BlockMatcher: the uniqueness is that of OpenCV's sample for SGBM, left-right
/// check and largest step in a region are Hirschmueller's (Sec. 2.3, 2.5.1), as is the parabola.
struct SemiGlobalOptions : CostOptions, MatchChecks {
  int window = 5;
  int p1 = 24;
  int p2 = 120;

  SemiGlobalOptions() : MatchChecks{.subpixel = Subpixel::kParabola} {}

  template <class V>
  void VisitFields(V&& visit) {
    CostOptions::VisitFields(visit);
    visit("window", window, "px", "side of the square over which costs are averaged first, odd");
    visit("p1", p1, "mean cost / 64", "penalty of a step of one disparity along a path");
    visit("p2", p2, "mean cost / 64", "penalty of a larger step, at least p1");
    MatchChecks::VisitFields(visit);
  }
};

/// @throws Error for an option out of range, with its name and value.
void CheckOptions(const SemiGlobalOptions& options);

/// Semi-global matching of rectified images over any dissimilarity (Hirschmueller, "Stereo
/// processing by semiglobal matching and mutual information", PAMI 2008).
///
/// Costs C are averaged over a small window and cut at 127. Along each of eight directions r (the
/// rows, the columns and the diagonals, both ways), eq. 13 there:
///
///     L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + p1, min_k L(q, k) + p2) - min_k L(q, k)
///
/// with q = p - r, and L = C where q lies outside the image. The winner is the disparity with the
/// least sum of the eight L; sub-pixel interpolation and checks are those of BlockMatcher.
///
/// Disparity d pairs left pixel x with right pixel x - d. Only disparities whose right pixel lies
/// inside the image can win; the others take part in paths, with the right image's border column
/// repeated.
///
/// Memory grows with width * disparities * sqrt(height): 25 MB for 741 x 497 px and 128
/// disparities, 125 MB for 1482 x 994 px and 256. In return, costs are made twice and half of the
/// paths are followed twice. At most two threads have work.
///
/// Results are the same bits for any number of threads and any instruction set. One matcher may
/// serve several threads at once.
class SemiGlobal {
 public:
  /// @throws Error for an option out of range, with its name and value.
  explicit SemiGlobal(SemiGlobalOptions options);

  const SemiGlobalOptions& options() const { return options_; }

  /// The marker of pixels without a match: 16 * (min_disparity - 1), as in OpenCV.
  short InvalidDisparity() const { return internal::InvalidDisparity(options_.min_disparity); }

  /// Matches two rectified images of equal size and type (one channel; 8-bit, 16-bit or float).
  /// @param[out] disparity 16 * disparity, InvalidDisparity() where a check dropped the match; its
  ///   memory is used again if it has the right size.
  /// @throws Error for images that do not fit each other or the options.
  void Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const;

  /// Compute() without the filters on uniqueness and speckles but with what they need, so that a
  /// threshold can be swept without matching anew.
  Matches Match(const cv::Mat& left, const cv::Mat& right) const;

  /// Applies the uniqueness and speckle filters: Compute() is Filter(Match(...)).
  /// @param uniqueness_pct stands in for the option of that name.
  /// @throws Error when it is out of range.
  cv::Mat1s Filter(const Matches& matches, double uniqueness_pct) const;

  /// CV_16S disparities in 1/16 px as float in px, NaN where there is no match.
  cv::Mat1f ToFloat(const cv::Mat1s& disparity) const;

 private:
  SemiGlobalOptions options_;
};

}  // namespace sgf::stereo
