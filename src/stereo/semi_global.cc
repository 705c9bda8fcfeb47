#include <algorithm>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/prefilter.h>
#include <sgf/stereo/semi_global.h>
#include <sgf/stereo/semi_global_rows.h>

namespace sgf::stereo {

void CheckOptions(const SemiGlobalOptions& o) {
  CheckCostOptions(o);
  RequireRange("window", o.window, 1, internal::kLargestAverageWindow);
  RequireOdd("window", o.window);
  RequireRange("p2", o.p2, 0, internal::kLargestPenalty);
  RequireRange("p1", o.p1, 0, o.p2);
  CheckOptions(static_cast<const MatchChecks&>(o));
}

namespace {

void RequireRoomForWindow(const cv::Mat& image, int window) {
  if (window > std::min(image.cols, image.rows))
    throw Error("window",
                fmt::format("{} exceeds the image of {}x{}", window, image.cols, image.rows));
}

// Matches a pair as `task` says, whose band holds the outputs and the uniqueness margin.
void Run(const cv::Mat& left, const cv::Mat& right, const SemiGlobalOptions& o,
         internal::BandTask band) {
  band.width = left.cols;
  band.height = band.y_end = left.rows;
  band.min_disparity = o.min_disparity;
  band.num_disparities = o.num_disparities;
  band.subpixel = o.subpixel;
  band.left_right_max = o.left_right_max;
  const auto factory =
      internal::PrepareCostRows(ApplyPrefilter(left, o), ApplyPrefilter(right, o), o, o.window);
  band.window = factory.window;
  internal::MatchSemiGlobal({band, o.p1, o.p2, o.threads}, factory);
}

}  // namespace

SemiGlobal::SemiGlobal(SemiGlobalOptions options) : options_(std::move(options)) {
  CheckOptions(options_);
}

void SemiGlobal::Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const {
  CheckPair(left, right, options_);
  RequireRoomForWindow(left, options_.window);
  disparity.create(left.size());
  internal::BandTask band{};
  band.disparity = &disparity;
  band.uniqueness_q16 = internal::UniquenessQ16(options_.uniqueness_pct);
  Run(left, right, options_, band);
  internal::DropSpeckles(disparity, InvalidDisparity(), options_.speckle_window,
                         options_.speckle_range);
}

Matches SemiGlobal::Match(const cv::Mat& left, const cv::Mat& right) const {
  CheckPair(left, right, options_);
  RequireRoomForWindow(left, options_.window);
  Matches matches{cv::Mat1s(left.size()), cv::Mat1i::zeros(left.size()),
                  cv::Mat1i::zeros(left.size())};
  internal::BandTask band{};
  band.disparity = &matches.disparity;
  band.best = &matches.best;
  band.second = &matches.second;
  Run(left, right, options_, band);
  return matches;
}

cv::Mat1s SemiGlobal::Filter(const Matches& matches, double uniqueness_pct) const {
  cv::Mat1s disparity = internal::UniqueDisparities(matches, uniqueness_pct, InvalidDisparity());
  internal::DropSpeckles(disparity, InvalidDisparity(), options_.speckle_window,
                         options_.speckle_range);
  return disparity;
}

cv::Mat1f SemiGlobal::ToFloat(const cv::Mat1s& disparity) const {
  return internal::ToFloat(disparity, InvalidDisparity());
}

}  // namespace sgf::stereo
