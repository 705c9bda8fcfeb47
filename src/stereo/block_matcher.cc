#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/core.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/stereo/band.h>
#include <sgf/stereo/block_matcher.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/prefilter.h>
#include <sgf/stereo/sgf_image.h>

namespace sgf::stereo {
namespace {

using internal::BandTask;
using internal::SgfImage;

constexpr int kLargestUniqueness = 99;  // percent; less than the winner itself
constexpr int kLargestWindow = 51;      // at which 16 bits still hold sums of costs of 20 levels

}  // namespace

void CheckOptions(const BlockMatcherOptions& o) {
  CheckCostOptions(o);
  RequireRange("window", o.window, 1, kLargestWindow);
  RequireOdd("window", o.window);
  RequireRange("uniqueness_pct", o.uniqueness_pct, 0, kLargestUniqueness);
  RequireRange("texture_threshold", o.texture_threshold, 0, 1e6);
  RequireRange("left_right_max", o.left_right_max, -1, kLargestDisparity);
  RequireRange("speckle_window", o.speckle_window, 0, 1e9);
  RequireRange("speckle_range", o.speckle_range, 0, kLargestDisparity);
}

void CheckPair(const cv::Mat& left, const cv::Mat& right, const BlockMatcherOptions& options) {
  CheckPair(left, right, static_cast<const CostOptions&>(options));
  if (options.window > std::min(left.cols, left.rows))
    throw Error("window",
                fmt::format("{} exceeds the image of {}x{}", options.window, left.cols, left.rows));
}

namespace {

int UniquenessQ16(double percent) { return static_cast<int>(std::lround(percent / 100 * 65536)); }

// Runs `match_band` on bands of rows. Sums are exact, so the split does not show in the result.
template <class MatchBand>
void ForEachBand(const BandTask& whole, int threads, const MatchBand& match_band) {
  const int count = ResolveThreads(threads);
  const int bands = std::min(count, std::max(1, whole.height / (2 * whole.window)));
  ParallelFor(bands, count, [&](int i) {
    BandTask band = whole;
    band.y_begin = static_cast<int>(int64_t{whole.height} * i / bands);
    band.y_end = static_cast<int>(int64_t{whole.height} * (i + 1) / bands);
    match_band(band);
  });
}

void RunBands(const cv::Mat& left, const cv::Mat& right, const BlockMatcherOptions& options,
              BandTask task) {
  if (options.metric == "sgf") {
    const SgfImage l = internal::PrepareSgf(left, options);
    const SgfImage r = internal::PrepareSgf(right, options);
    ForEachBand(task, options.threads,
                [&](const BandTask& band) { internal::MatchSgfBand(band, l, r); });
    return;
  }
  const auto factory = internal::PrepareCostRows(left, right, options, options.window);
  task.window = factory.window;
  ForEachBand(task, options.threads, [&](const BandTask& band) {
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

std::span<const std::pair<const char*, Subpixel>> EnumNames(Subpixel) {
  static constexpr std::array<std::pair<const char*, Subpixel>, 3> kNames{
      {{"none", Subpixel::kNone},
       {"equiangular", Subpixel::kEquiangular},
       {"parabola", Subpixel::kParabola}}};
  return kNames;
}

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
  task.uniqueness_q16 = UniquenessQ16(options_.uniqueness_pct);
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
  RequireRange("uniqueness_pct", uniqueness_pct, 0, kLargestUniqueness);
  cv::Mat1s disparity = matches.disparity.clone();
  const int64_t q16 = UniquenessQ16(uniqueness_pct);
  const auto close = [q16](int best, int second) { return second <= best + ((best * q16) >> 16); };
  if (q16 > 0)
    for (int y = 0; y < disparity.rows; ++y)
      for (int x = 0; x < disparity.cols; ++x)
        if (close(matches.best(y, x), matches.second(y, x))) disparity(y, x) = InvalidDisparity();
  DropTexturelessAndSpeckles(left, disparity);
  return disparity;
}

void BlockMatcher::DropTexturelessAndSpeckles(const cv::Mat& left, cv::Mat1s& disparity) const {
  if (options_.texture_threshold > 0)
    disparity.setTo(InvalidDisparity(), Texture(left, options_) < options_.texture_threshold);
  if (options_.speckle_window > 0)
    cv::filterSpeckles(disparity, InvalidDisparity(), options_.speckle_window,
                       static_cast<int>(16 * options_.speckle_range));
}

cv::Mat1f BlockMatcher::ToFloat(const cv::Mat1s& disparity) const {
  cv::Mat1f result;
  disparity.convertTo(result, CV_32F, 1.0 / 16);
  result.setTo(std::numeric_limits<float>::quiet_NaN(), disparity == InvalidDisparity());
  return result;
}

}  // namespace sgf::stereo
