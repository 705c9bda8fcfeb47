#pragma once

// Internal to sgf::stereo: cost rows of any dissimilarity of the name table.

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/stereo/band.h>
#include <sgf/stereo/cost_options.h>

namespace sgf::stereo::internal {

/// Makes the cost rows of one band; rows of different bands may be made at the same time.
struct CostRowsFactory {
  std::function<std::unique_ptr<CostRows>()> make;
  int window;  ///< over which costs are summed: 1 where the dissimilarity has a window of its own
};

/// Prepares both images for `options.metric` and returns the maker of its cost rows. Costs are |e|
/// as integers of at most 65535, in units that suit the range of the dissimilarity: 1/63 for sgf,
/// which comes from the fixed-point kernel; 1/16383 for other gain-invariant ones, 1/256 grey level
/// for differences, 1 for products of gradients and bits.
/// @param window side of the window of dissimilarities that have one of their own, px.
CostRowsFactory PrepareCostRows(const cv::Mat& left, const cv::Mat& right,
                                const CostOptions& options, int window);

/// Costs as bytes, on one scale for all dissimilarities: the mean cost over a pair's pixels and
/// disparities becomes kMeanByteCost, and what exceeds 255 is cut. With it, a penalty stated in
/// such units means the same whatever the dissimilarity.
constexpr int kMeanByteCost = 64;

/// Factor from costs to bytes, in units of 2^-16: kMeanByteCost over the mean cost of every eighth
/// row, at most 256.
/// @param size of the images, px.
uint32_t ByteScaleQ16(const CostRowsFactory& factory, cv::Size size, int num_disparities);

/// Makes rows of byte costs of one band.
class ByteCostRows {
 public:
  ByteCostRows(const CostRowsFactory& factory, uint32_t scale_q16, int width, int num_disparities);

  /// Writes costs[x * stride + d] for x in [0, width), d in [0, num_disparities). Rows are asked
  /// for in increasing order.
  void Row(int y, int stride, uint8_t* costs);

 private:
  std::unique_ptr<CostRows> rows_;
  uint32_t scale_q16_;
  int width_, num_disparities_;
  std::vector<uint16_t> row_;
};

}  // namespace sgf::stereo::internal
