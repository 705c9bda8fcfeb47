#include <algorithm>
#include <vector>

#include <opencv2/features2d.hpp>

#include <sgf/flow/detection.h>

namespace sgf::flow::internal {

std::optional<Eigen::Vector2f> StrongestCorner(const cv::Mat1b& grey, const cv::Rect& cell,
                                               const DetectionOptions& options) {
  constexpr int kReach = 3 + 1;  // px: FAST looks at a circle, its suppression at the neighbours
  const cv::Rect around = cv::Rect(cell.x - kReach, cell.y - kReach, cell.width + 2 * kReach,
                                   cell.height + 2 * kReach) &
                          cv::Rect({}, grey.size());
  const cv::Point2f to_cell(around.tl() - cell.tl());
  const auto outside = [&](const cv::KeyPoint& corner) {
    return !cv::Rect({}, cell.size()).contains(cv::Point(corner.pt + to_cell));
  };
  std::vector<cv::KeyPoint> corners;
  for (int threshold = options.fast_threshold; threshold >= options.least_fast_threshold;
       threshold /= 2) {
    cv::FAST(grey(around), corners, threshold);
    std::erase_if(corners, outside);
    if (corners.empty()) continue;
    const auto best = std::max_element(
        corners.begin(), corners.end(),
        [](const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response < b.response; });
    return Eigen::Vector2f(best->pt.x + float(around.x), best->pt.y + float(around.y));
  }
  return std::nullopt;
}

}  // namespace sgf::flow::internal
