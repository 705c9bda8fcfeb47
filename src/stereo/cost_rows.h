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

/// Prepares both images for `options.metric` (a name of the table with a single number per pixel
/// pair or window) and returns the maker of its cost rows. Costs are |e| in units of 1/resolution,
/// at most 65535: 1/256 grey level or 1/16384 for dissimilarities bounded by 2.
CostRowsFactory PrepareCostRows(const cv::Mat& left, const cv::Mat& right,
                                const BlockMatcherOptions& options);

}  // namespace sgf::stereo::internal
