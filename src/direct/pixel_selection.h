#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include <sgf/alignment/level.h>

namespace sgf::direct {

/// How many pixels of a key-frame become points.
struct PixelSelectionOptions {
  int points = 1000;
  int block_px = 32;
  double above_median = 7;
  int border_px = 5;

  template <class V>
  void VisitFields(V&& visit) {
    visit("points", points, "", "of a new key-frame, about");
    visit("block_px", block_px, "px", "side of the blocks that each have a threshold of their own");
    visit("above_median", above_median, "grey levels/px",
          "by how much a gradient has to exceed its block's median");
    visit("border_px", border_px, "px", "no pixel nearer to the border");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const PixelSelectionOptions& options);

/// Pixels of large gradient, spread evenly over where there is any (Engel, Koltun, Cremers, "Direct
/// sparse odometry", 2018, Section III-A): the steepest pixel in each cell of a grid if it exceeds
/// its block's threshold, the median gradient plus `above_median`, smoothed over 3 x 3 blocks;
/// where a cell has none, the steepest of a cell of twice and of four times the side above 3/4 and
/// 9/16 of the threshold. The cell's side is found such that about `points` come out.
///
/// The cell's side found last serves as a start for the next image, which makes a selector's result
/// depend on the images before.
class PixelSelector {
 public:
  /// @throws Error as CheckOptions().
  explicit PixelSelector(const PixelSelectionOptions& options);

  /// @return pixels (px of the image) at least `border_px` inside, in the order of the cells, about
  ///   `points` of them; fewer where the image has no more, none where it has no gradients.
  std::vector<cv::Point> operator()(const alignment::SampleChannels& image);

 private:
  PixelSelectionOptions options_;
  int cell_px_ = 8;
};

}  // namespace sgf::direct
