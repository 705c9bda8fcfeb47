#pragma once

#include <opencv2/core.hpp>

#include <sgf/core/gradient.h>
#include <sgf/metrics/epsilon.h>
#include <sgf/metrics/sample.h>

namespace sgf::metrics {

/// The samples of an image, one plane per field of Sample<float>, all of the image's size.
struct SampleImage {
  cv::Mat1f intensity;  ///< grey levels
  cv::Mat1f gx, gy;     ///< grey levels/px
  cv::Mat1f norm;       ///< grey levels/px
  cv::Mat1f reg_norm;   ///< grey levels/px
  cv::Mat1f ax, ay;     ///< normalised gradient
  cv::Mat1f r;          ///< 1 / max(||a||^2, tau)

  /// Sample at row y, column x, which must lie inside the image.
  Sample<float> At(int y, int x) const {
    return {intensity(y, x), gx(y, x), gy(y, x), norm(y, x),
            reg_norm(y, x),  ax(y, x), ay(y, x), r(y, x)};
  }
};

/// @throws Error for a tau outside [1e-30, 1].
void RequireTau(double tau);

/// Samples of a one-channel image (8-bit, 16-bit or float): At(y, x) equals MakeSample<float> of
/// the pixel's intensity, gradient and epsilon.
/// @param tau see MakeSample.
/// @throws Error for an image that cannot be worked on, a pixel that is not finite or beyond 1e18,
///   tau outside [1e-30, 1], or the options of ComputeEpsilon.
SampleImage MakeSampleImage(const cv::Mat& grey, GradientOperator op, const EpsilonOptions& options,
                            double tau = kTau);

}  // namespace sgf::metrics
