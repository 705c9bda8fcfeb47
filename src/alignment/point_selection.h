#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/alignment/level.h>

namespace sgf::alignment {

/// Which pixels of an image are worth aligning.
struct SelectionOptions {
  int cell_px = 16;
  double min_gradient = 4;
  int border_px = 4;

  template <class V>
  void VisitFields(V&& visit) {
    visit("cell_px", cell_px, "px", "side of the square cells that each give one pixel at most");
    visit("min_gradient", min_gradient, "grey levels/px", "magnitude that a pixel has to exceed");
    visit("border_px", border_px, "px", "no pixel nearer to the border");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const SelectionOptions& options);

/// The pixel of the largest gradient magnitude in each cell of a grid, among the eligible ones,
/// row of cells after row of cells.
/// @param eligible CV_8U of the image's size, not 0 where a pixel may be chosen.
std::vector<cv::Point> SelectPoints(const SampleChannels& image, const cv::Mat1b& eligible,
                                    const SelectionOptions& options);

}  // namespace sgf::alignment
