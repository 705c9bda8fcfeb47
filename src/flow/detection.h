#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

/// Where tracks begin.
namespace sgf::flow::internal {

/// Corners that a track may begin at.
struct DetectionOptions {
  int fast_threshold = 40;
  int least_fast_threshold = 5;
};

/// The strongest FAST corner of a cell (Rosten, Drummond, "Machine learning for high-speed corner
/// detection", 2006): the first of those. The threshold is lowered until there is one.
/// @param grey 8-bit.
/// @param cell inside the image.
std::optional<Eigen::Vector2f> StrongestCorner(const cv::Mat1b& grey, const cv::Rect& cell,
                                               const DetectionOptions& options);

}  // namespace sgf::flow::internal
