#include <algorithm>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/stereo/band.h>
#include <sgf/stereo/block_matcher.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/prefilter.h>
#include <sgf/stereo/sgf_image.h>

namespace sgf::stereo {
namespace {

using internal::BandTask;
using internal::SgfImage;

constexpr int kLargestWindow = 51;  // at which 16 bits still hold sums of costs of 20 levels

}  // namespace

void CheckOptions(const BlockMatcherOptions& o) {
  CheckCostOptions(o);
  RequireRange("window", o.window, 1, kLargestWindow);
  RequireOdd("window", o.window);
  RequireRange("texture_threshold", o.texture_threshold, 0, 1e6);
  CheckOptions(static_cast<const MatchChecks&>(o));
}

void CheckPair(const cv::Mat& left, const cv::Mat& right, const BlockMatcherOptions& options) {
  CheckPair(left, right, static_cast<const CostOptions&>(options));
  if (options.window > std::min(left.cols, left.rows))
    throw Error("window",
                fmt::format("{} exceeds the image of {}x{}", options.window, left.cols, left.rows));
}

namespace {

// Runs `match_band` on bands of rows. Sums are exact, so the split does not show in the result.
template <class MatchBand>
void MatchBands(const BandTask& whole, int threads, const MatchBand& match_band) {
  internal::ForEachBand(0, whole.height, 2 * whole.window, threads, [&](int begin, int end) {
    BandTask band = whole;
    band.y_begin = begin;
    band.y_end = end;
    match_band(band);
  });
}

void RunBands(const cv::Mat& left, const cv::Mat& right, const BlockMatcherOptions& options,
              BandTask task) {
  if (options.metric == "sgf") {
    const SgfImage l = internal::PrepareSgf(left, options);
    const SgfImage r = internal::PrepareSgf(right, options);
    MatchBands(task, options.threads,
               [&](const BandTask& band) { internal::MatchSgfBand(band, l, r); });
    return;
  }
  const auto factory = internal::PrepareCostRows(left, right, options, options.window);
  task.window = factory.window;
  MatchBands(task, options.threads, [&](const BandTask& band) {
    const auto rows = factory.make();
    internal::MatchCostBand(band, *rows);
  });
}

// Mean gradient magnitude over the window around every pixel.
cv::Mat1f Texture(const cv::Mat& image, const BlockMatcherOptions& options) {
  const GradientImage gradient = ComputeGradient(image, options.gradient);
  cv::Mat1f magnitude, mean;
  cv::magnitude(gradient.x, gradient.y, magnitude);
  cv::boxFilter(magnitude, mean, CV_32F, {options.window, options.window}, {-1, -1}, true,
                cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
  return mean;
}

}  // namespace

BlockMatcher::BlockMatcher(BlockMatcherOptions options) : options_(std::move(options)) {
  CheckOptions(options_);
}

namespace {

BandTask MakeTask(const BlockMatcherOptions& o, cv::Mat1s& out) {
  return {
      out.cols,   out.rows,         0,    out.rows, o.min_disparity, o.num_disparities, o.window, 0,
      o.subpixel, o.left_right_max, &out, nullptr,  nullptr};
}

}  // namespace

void BlockMatcher::Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const {
  CheckPair(left, right, options_);
  disparity.create(left.size());
  BandTask task = MakeTask(options_, disparity);
  task.uniqueness_q16 = internal::UniquenessQ16(options_.uniqueness_pct);
  RunBands(ApplyPrefilter(left, options_), ApplyPrefilter(right, options_), options_, task);
  DropTexturelessAndSpeckles(left, disparity);
}

Matches BlockMatcher::Match(const cv::Mat& left, const cv::Mat& right) const {
  CheckPair(left, right, options_);
  Matches matches;
  matches.disparity.create(left.size());
  BandTask task = MakeTask(options_, matches.disparity);
  matches.best = cv::Mat1i::zeros(left.size());
  matches.second = cv::Mat1i::zeros(left.size());
  task.best = &matches.best;
  task.second = &matches.second;
  RunBands(ApplyPrefilter(left, options_), ApplyPrefilter(right, options_), options_, task);
  return matches;
}

cv::Mat1s BlockMatcher::Filter(const Matches& matches, const cv::Mat& left,
                               double uniqueness_pct) const {
  cv::Mat1s disparity = internal::UniqueDisparities(matches, uniqueness_pct, InvalidDisparity());
  DropTexturelessAndSpeckles(left, disparity);
  return disparity;
}

void BlockMatcher::DropTexturelessAndSpeckles(const cv::Mat& left, cv::Mat1s& disparity) const {
  if (options_.texture_threshold > 0)
    disparity.setTo(InvalidDisparity(), Texture(left, options_) < options_.texture_threshold);
  internal::DropSpeckles(disparity, InvalidDisparity(), options_.speckle_window,
                         options_.speckle_range);
}

cv::Mat1f BlockMatcher::ToFloat(const cv::Mat1s& disparity) const {
  return internal::ToFloat(disparity, InvalidDisparity());
}

}  // namespace sgf::stereo
