#pragma once

// Internal to sgf::stereo: images as the fixed-point kernels of sgf take them.

#include <opencv2/core.hpp>

#include <sgf/core/gradient.h>
#include <sgf/stereo/cost_options.h>

namespace sgf::stereo::internal {

/// An image prepared for fixed-point sgf: its 8-bit pixels or, for other inputs, its gradient; and
/// epsilon as one number or a map.
struct SgfImage {
  cv::Mat1b pixels;        ///< of 8-bit images; empty for others
  GradientOperator op;     ///< taken of the pixels
  GradientImage gradient;  ///< used where `pixels` is empty
  cv::Mat1f epsilon;       ///< 1 x 1, or one value a pixel, (grey levels/px)^2
  float tau;
};

/// Prepares an image. The pixels are shared with it, not copied.
SgfImage PrepareSgf(const cv::Mat& image, const CostOptions& options);

}  // namespace sgf::stereo::internal
