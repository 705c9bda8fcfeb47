#pragma once

// Internal to sgf::stereo: matching costs of slanted planes over bilateral support windows.

#include <cstdint>
#include <vector>

#include <hwy/aligned_allocator.h>
#include <opencv2/core.hpp>

#include <sgf/stereo/cost_rows.h>

namespace sgf::stereo::internal {

/// Disparities d(x, y) = slope_x * x + slope_y * y + offset of the pixels with centres (x, y), px.
struct Plane {
  float slope_x, slope_y, offset;

  float At(float x, float y) const { return slope_x * x + slope_y * y + offset; }

  /// The plane with these slopes and disparity d at (x, y).
  static Plane Through(float x, float y, float d, float slope_x, float slope_y) {
    return {slope_x, slope_y, d - slope_x * x - slope_y * y};
  }
};

constexpr int kStepsPerPx = 32;  ///< of interpolation between disparities

/// The pixels within `radius` columns and rows of `centre` that lie inside an image.
inline cv::Rect WindowInside(cv::Point centre, int radius, cv::Size image) {
  const cv::Point reach(radius, radius);
  return cv::Rect(centre - reach, centre + reach + cv::Point(1, 1)) & cv::Rect({}, image);
}

/// How one of the two images sees the cost volume: the cost of its pixel (x, y) at disparity index
/// k stands at origin[y * row_stride + k * index_stride + x].
struct VolumeView {
  const uint8_t* origin;
  ptrdiff_t row_stride, index_stride;
  int width, height, min_disparity, num_disparities;
};

/// Byte costs of all pixels and disparities (see ByteScaleQ16), a plane of disparities after the
/// other in each row, so that windows under slanted planes read runs of neighbouring pixels. Both
/// images see the same volume, the right one along its diagonals. Where a pixel's partner lies
/// outside the other image the cost is `outside_share` of the pixel's mean cost. Takes height *
/// disparities * (width + disparities) bytes.
class CostVolume {
 public:
  CostVolume(const CostRowsFactory& factory, cv::Size size, const CostOptions& options,
             double outside_share);

  VolumeView Left() const;
  VolumeView Right() const;

 private:
  struct MeanCosts;

  void FillOutside(const MeanCosts& mean, int d, uint8_t* costs) const;
  void FillRows(const CostRowsFactory& factory, uint32_t scale_q16, int y_begin, int y_end);

  cv::Size size_;
  int min_disparity_, num_disparities_;
  double outside_share_;
  ptrdiff_t index_stride_;
  hwy::AlignedFreeUniquePtr<uint8_t[]> costs_;
};

/// Square windows around chosen pixels, each pixel weighted by the likeness of its colour to the
/// centre's: exp(-|difference of colours|_1 / gamma) (Yoon and Kweon; PatchMatch Stereo). Weights
/// are bytes; pixels outside the image weigh nothing.
class SupportWindows {
 public:
  /// @param image 8-bit, one channel or BGR. For one channel the difference counts three times.
  SupportWindows(const cv::Mat& image, const std::vector<cv::Point>& centres, int window,
                 double gamma, int threads);

  int window() const { return window_; }
  /// Bytes from one row of a window's weights to the next; those past the window are 0.
  int stride() const { return stride_; }
  cv::Point Centre(int i) const { return centres_[i]; }
  const uint8_t* Weights(int i) const {
    return weights_.data() + static_cast<size_t>(i) * window_ * stride_;
  }
  uint8_t Weight(int i, int x, int y) const {
    const int radius = window_ / 2;
    return Weights(i)[(y - centres_[i].y + radius) * stride_ + x - centres_[i].x + radius];
  }
  /// Sum of a window's weights, at least 1.
  int TotalWeight(int i) const { return totals_[i]; }

 private:
  int window_, stride_;
  std::vector<cv::Point> centres_;
  std::vector<uint8_t> weights_;
  std::vector<int> totals_;
};

/// Mean byte cost of window i under a plane, interpolated between disparities in steps of 1 /
/// kStepsPerPx; disparities beyond the volume are cut to its range.
/// @param limit the caller discards results of this or more: the sum may stop early there.
float PlaneCost(const VolumeView& view, const SupportWindows& windows, int i, const Plane& plane,
                float limit);

}  // namespace sgf::stereo::internal
