#pragma once

// Internal to sgf::stereo: cost rows of any dissimilarity of the name table.

#include <functional>
#include <memory>

#include <opencv2/core.hpp>

#include <sgf/stereo/band.h>
#include <sgf/stereo/block_matcher.h>

namespace sgf::stereo::internal {

/// Makes the cost rows of one band; rows of different bands may be made at the same time.
struct CostRowsFactory {
  std::function<std::unique_ptr<CostRows>()> make;
  int window;  ///< over which costs are summed: 1 where the dissimilarity has a window of its own
};

/// Prepares both images for `options.metric` and returns the maker of its cost rows. Costs are |e|
/// as integers of at most 65535, in units that suit the range of the dissimilarity: 1/16383 for
/// gain-invariant ones, 1/256 grey level for differences, 1 for products of gradients and bits.
CostRowsFactory PrepareCostRows(const cv::Mat& left, const cv::Mat& right,
                                const BlockMatcherOptions& options);

}  // namespace sgf::stereo::internal
