#include <array>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/core/gradient.h>

namespace sgf {

std::span<const std::pair<const char*, GradientOperator>> EnumNames(GradientOperator) {
  static constexpr std::array<std::pair<const char*, GradientOperator>, 2> kNames{
      {{"central", GradientOperator::kCentral}, {"scharr", GradientOperator::kScharr}}};
  return kNames;
}

void RequireGreyImage(const cv::Mat& image, const char* name) {
  if (image.empty()) throw Error(name, "image is empty");
  if (image.channels() != 1)
    throw Error(name, fmt::format("expected one channel, got {}", image.channels()));
  if (image.depth() != CV_8U && image.depth() != CV_16U && image.depth() != CV_32F)
    throw Error(name, fmt::format("unsupported pixel type {}", cv::typeToString(image.type())));
}

GradientTaps TapsOf(GradientOperator op) {
  if (op == GradientOperator::kScharr) return {0.5F, 3 / 16.F, 10 / 16.F};
  return {0.5F, 0, 1};
}

void ComputeGradient(const cv::Mat& image, GradientOperator op, GradientImage& gradient) {
  RequireGreyImage(image, "gradient input");
  const GradientTaps taps = TapsOf(op);
  const cv::Matx13f derivative(-taps.derivative, 0, taps.derivative);
  const cv::Matx13f across(taps.across_side, taps.across_centre, taps.across_side);
  const cv::Point centre(-1, -1);
  // Isolated: a part of a larger image is an image of its own.
  constexpr int kBorder = cv::BORDER_REPLICATE | cv::BORDER_ISOLATED;
  cv::sepFilter2D(image, gradient.x, CV_32F, derivative, across, centre, 0, kBorder);
  cv::sepFilter2D(image, gradient.y, CV_32F, across, derivative, centre, 0, kBorder);
}

GradientImage ComputeGradient(const cv::Mat& image, GradientOperator op) {
  GradientImage gradient;
  ComputeGradient(image, op, gradient);
  return gradient;
}

double MeanSquaredGradient(const GradientImage& gradient) {
  const double n = static_cast<double>(gradient.x.total());
  return n == 0 ? 0 : (gradient.x.dot(gradient.x) + gradient.y.dot(gradient.y)) / n;
}

}  // namespace sgf
