#pragma once

#include <span>
#include <utility>

#include <opencv2/core.hpp>

namespace sgf {

/// How image derivatives are taken. Both operators are normalised to grey levels per pixel and
/// replicate the border. The paper: finite differences suffice for disparities, Scharr on rotated
/// patches for tracking (Section IV).
enum class GradientOperator {
  kCentral,  ///< [-1 0 1]/2
  kScharr,   ///< [-1 0 1]/2 smoothed by [3 10 3]/16 across
};

/// An operator as a separable filter: a derivative [-d 0 d] along one axis and [s c s] across it.
struct GradientTaps {
  float derivative;
  float across_side, across_centre;
};
GradientTaps TapsOf(GradientOperator op);

/// Names of the operators in options files.
std::span<const std::pair<const char*, GradientOperator>> EnumNames(GradientOperator);

/// Gradient of an image, in grey levels per pixel; both planes have the image's size.
struct GradientImage {
  cv::Mat1f x;
  cv::Mat1f y;
};

/// Gradient of a one-channel image (8-bit, 16-bit or float).
/// @throws Error for an empty image or one with more than one channel.
GradientImage ComputeGradient(const cv::Mat& image, GradientOperator op);

/// The same into a gradient whose memory is used again where it has the size.
void ComputeGradient(const cv::Mat& image, GradientOperator op, GradientImage& gradient);

/// Mean squared gradient magnitude over the image: the paper's epsilon (eq. 6), (grey levels/px)^2.
double MeanSquaredGradient(const GradientImage& gradient);

/// Checks that an image can be worked on: not empty, one channel, depth 8U, 16U or 32F.
/// @param name what the message calls the image.
/// @throws Error naming the image and its type otherwise.
void RequireGreyImage(const cv::Mat& image, const char* name);

}  // namespace sgf
