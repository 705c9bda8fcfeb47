#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <opencv2/calib3d.hpp>

#include <sgf/core/require.h>
#include <sgf/stereo/cost_options.h>
#include <sgf/stereo/matches.h>

namespace sgf::stereo {

std::span<const std::pair<const char*, Subpixel>> EnumNames(Subpixel) {
  static constexpr std::array<std::pair<const char*, Subpixel>, 3> kNames{
      {{"none", Subpixel::kNone},
       {"equiangular", Subpixel::kEquiangular},
       {"parabola", Subpixel::kParabola}}};
  return kNames;
}

namespace {
constexpr int kLargestUniqueness = 99;  // percent; less than the winner itself
}

void CheckOptions(const MatchChecks& o) {
  RequireRange("uniqueness_pct", o.uniqueness_pct, 0, kLargestUniqueness);
  RequireRange("left_right_max", o.left_right_max, -1, kLargestDisparity);
  RequireRange("speckle_window", o.speckle_window, 0, 1e9);
  RequireRange("speckle_range", o.speckle_range, 0, kLargestDisparity);
}

namespace internal {

int UniquenessQ16(double percent) { return static_cast<int>(std::lround(percent / 100 * 65536)); }

cv::Mat1s UniqueDisparities(const Matches& matches, double uniqueness_pct, short invalid) {
  RequireRange("uniqueness_pct", uniqueness_pct, 0, kLargestUniqueness);
  cv::Mat1s disparity = matches.disparity.clone();
  const int64_t q16 = UniquenessQ16(uniqueness_pct);
  if (q16 == 0) return disparity;
  const auto close = [q16](int best, int second) { return second <= best + ((best * q16) >> 16); };
  for (int y = 0; y < disparity.rows; ++y)
    for (int x = 0; x < disparity.cols; ++x)
      if (close(matches.best(y, x), matches.second(y, x))) disparity(y, x) = invalid;
  return disparity;
}

void DropSpeckles(cv::Mat1s& disparity, short invalid, int window, double range) {
  if (window > 0) cv::filterSpeckles(disparity, invalid, window, static_cast<int>(16 * range));
}

cv::Mat1f ToFloat(const cv::Mat1s& disparity, short invalid) {
  cv::Mat1f result;
  disparity.convertTo(result, CV_32F, 1.0 / 16);
  result.setTo(std::numeric_limits<float>::quiet_NaN(), disparity == invalid);
  return result;
}

}  // namespace internal
}  // namespace sgf::stereo
