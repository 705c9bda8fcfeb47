#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/metrics/sample_image.h>

namespace sgf::metrics {
namespace {

// Squares of larger intensity differences would leave float.
constexpr double kLargestIntensity = 1e18;

void RequireUsableIntensities(const cv::Mat& grey) {
  cv::Point bad;
  if (!cv::checkRange(grey, true, &bad, -kLargestIntensity, kLargestIntensity))
    throw Error("image", fmt::format("pixel ({}, {}) is {}, not a usable intensity", bad.x, bad.y,
                                     grey.at<float>(bad)));
}

void StoreSample(const Sample<float>& sample, int y, int x, SampleImage& image) {
  image.norm(y, x) = sample.norm;
  image.reg_norm(y, x) = sample.reg_norm;
  image.ax(y, x) = sample.ax;
  image.ay(y, x) = sample.ay;
  image.r(y, x) = sample.r;
}

}  // namespace

void RequireTau(double tau) { RequireRange("tau", tau, 1e-30, 1); }

SampleImage MakeSampleImage(const cv::Mat& grey, GradientOperator op, const EpsilonOptions& options,
                            double tau) {
  RequireTau(tau);
  RequireGreyImage(grey, "image");
  if (grey.depth() == CV_32F) RequireUsableIntensities(grey);
  const GradientImage gradient = ComputeGradient(grey, op);
  const cv::Mat1f epsilon = ComputeEpsilon(gradient, options);
  SampleImage image;
  grey.convertTo(image.intensity, CV_32F);
  image.gx = gradient.x;
  image.gy = gradient.y;
  for (cv::Mat1f* plane : {&image.norm, &image.reg_norm, &image.ax, &image.ay, &image.r})
    plane->create(grey.size());
  for (int y = 0; y < grey.rows; ++y)
    for (int x = 0; x < grey.cols; ++x)
      StoreSample(MakeSample<float>(image.intensity(y, x), image.gx(y, x), image.gy(y, x),
                                    epsilon(y, x), tau),
                  y, x, image);
  return image;
}

}  // namespace sgf::metrics
