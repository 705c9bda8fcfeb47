#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/stereo/block_matcher.h>

namespace sgf {

/// Block matching as its documentation defines it, in the plainest loops: what the row kernels are
/// held against, bit by bit.
class ReferenceMatcher {
 public:
  /// @param window_sum cost of the window around left pixel (x, y) at a disparity in px.
  template <class WindowSum>
  ReferenceMatcher(cv::Size size, const stereo::BlockMatcherOptions& options, WindowSum window_sum)
      : size_(size),
        options_(options),
        sums_(static_cast<size_t>(size.area()) * options.num_disparities) {
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        for (int k = 0; k < options.num_disparities; ++k)
          Sum(x, y, k) = InRange(x, k) ? window_sum(x, y, options.min_disparity + k) : kNone;
  }

  cv::Mat1s Disparity() const {
    cv::Mat1s disparity(size_);
    for (int y = 0; y < size_.height; ++y)
      for (int x = 0; x < size_.width; ++x) disparity(y, x) = Pixel(x, y);
    return disparity;
  }

 private:
  static constexpr int64_t kNone = std::numeric_limits<int64_t>::max();

  int64_t& Sum(int x, int y, int k) {
    return sums_[(static_cast<size_t>(y) * size_.width + x) * options_.num_disparities + k];
  }
  int64_t At(int x, int y, int k) const {
    if (k < 0 || k >= options_.num_disparities) return kNone;
    return sums_[(static_cast<size_t>(y) * size_.width + x) * options_.num_disparities + k];
  }

  bool InRange(int x, int k) const {
    const int right = x - options_.min_disparity - k;
    return right >= 0 && right < size_.width;
  }

  // First of the least sums, or -1.
  int Winner(int x, int y) const {
    int best = -1;
    for (int k = 0; k < options_.num_disparities; ++k)
      if (At(x, y, k) != kNone && (best < 0 || At(x, y, k) < At(x, y, best))) best = k;
    return best;
  }

  bool Unique(int x, int y, int best) const {
    const auto q16 = std::lround(options_.uniqueness_pct / 100 * 65536);
    if (q16 == 0) return true;
    const int64_t limit = At(x, y, best) + ((At(x, y, best) * q16) >> 16);
    for (int k = 0; k < options_.num_disparities; ++k)
      if (std::abs(k - best) > 1 && At(x, y, k) <= limit) return false;
    return true;
  }

  // The right pixel's own winner: the first of its least sums.
  bool Consistent(int x, int y, int best) const {
    if (options_.left_right_max < 0) return true;
    const int right = x - best;
    int winner = best;
    for (int k = 0; k < options_.num_disparities; ++k) {
      const int left = right + k;
      if (left < 0 || left >= size_.width || At(left, y, k) == kNone) continue;
      const int64_t sum = At(left, y, k), least = At(right + winner, y, winner);
      if (sum < least || (sum == least && k < winner)) winner = k;
    }
    return std::abs(winner - best) <= options_.left_right_max;
  }

  short Pixel(int x, int y) const {
    const int best = Winner(x, y);
    if (best < 0 || !Unique(x, y, best) || !Consistent(x, y, best))
      return static_cast<short>(16 * (options_.min_disparity - 1));
    return static_cast<short>(16 * (options_.min_disparity + best) + Shift(x, y, best));
  }

  int Shift(int x, int y, int best) const {
    const int64_t before = At(x, y, best - 1), least = At(x, y, best), after = At(x, y, best + 1);
    if (before == kNone || after == kNone || options_.subpixel == stereo::Subpixel::kNone) return 0;
    const int64_t slope = options_.subpixel == stereo::Subpixel::kParabola
                              ? before + after - 2 * least
                              : std::max(before, after) - least;
    const float shift =
        static_cast<float>(8 * (before - after)) / static_cast<float>(std::max<int64_t>(slope, 1));
    return static_cast<int>(std::floor(shift + 0.5F));
  }

  cv::Size size_;
  stereo::BlockMatcherOptions options_;
  std::vector<int64_t> sums_;
};

}  // namespace sgf
