#include <array>
#include <limits>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/metrics/registry.h>
#include <sgf/metrics/sample_image.h>
#include <sgf/stereo/cost_options.h>

namespace sgf::stereo {

std::span<const std::pair<const char*, Prefilter>> EnumNames(Prefilter) {
  static constexpr std::array<std::pair<const char*, Prefilter>, 3> kNames{
      {{"none", Prefilter::kNone},
       {"normalized_response", Prefilter::kNormalizedResponse},
       {"xsobel", Prefilter::kXSobel}}};
  return kNames;
}

void RequireOdd(const char* option, int value) { Require(value % 2 != 0, option, value, "odd"); }

void CheckCostOptions(const CostOptions& o) {
  if (o.metric != kCensusSobel &&
      metrics::FindMetric(o.metric).traits.kind == metrics::MetricKind::kPatch)
    throw Error("metric",
                fmt::format("'{}' compares patches and cannot be a stereo cost", o.metric));
  RequireRange("min_disparity", o.min_disparity, -kLargestDisparity, kLargestDisparity);
  RequireRange("num_disparities", o.num_disparities, 1, kLargestDisparity - o.min_disparity + 1);
  RequireRange("prefilter_window", o.prefilter_window, 3, 255);
  RequireOdd("prefilter_window", o.prefilter_window);
  RequireRange("prefilter_cap", o.prefilter_cap, 1, 63);
  RequireRange("epsilon.tile_px", o.epsilon.tile_px, 1, 1e6);
  RequireRange("epsilon.window_px", o.epsilon.window_px, 1, 1e6);
  RequireOdd("epsilon.window_px", o.epsilon.window_px);
  RequireRange("epsilon.noise_floor", o.epsilon.noise_floor, 0, 1e9);
  RequireRange("pm.alpha", o.pm.alpha, 0, 1);
  RequireRange("pm.tau_c", o.pm.tau_c, 0, std::numeric_limits<double>::infinity());
  RequireRange("pm.tau_g", o.pm.tau_g, 0, std::numeric_limits<double>::infinity());
  metrics::RequireTau(o.tau);
  RequireRange("threads", o.threads, 0, 4096);
}

void CheckPair(const cv::Mat& left, const cv::Mat& right, const CostOptions& options) {
  RequireGreyImage(left, "left image");
  RequireGreyImage(right, "right image");
  if (left.size() != right.size() || left.type() != right.type())
    throw Error("right image", fmt::format("is {}x{} {}, the left image {}x{} {}", right.cols,
                                           right.rows, cv::typeToString(right.type()), left.cols,
                                           left.rows, cv::typeToString(left.type())));
  if (options.num_disparities > left.cols)
    throw Error("num_disparities", fmt::format("{} exceeds the image's width of {}",
                                               options.num_disparities, left.cols));
}

}  // namespace sgf::stereo
