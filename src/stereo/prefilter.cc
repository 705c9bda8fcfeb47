#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/stereo/prefilter.h>

namespace sgf::stereo {
namespace {

// A part of a larger image is an image of its own.
constexpr int kBorder = cv::BORDER_REPLICATE | cv::BORDER_ISOLATED;

// Four times the difference between a centre-weighted mean of five pixels and the mean over a
// window: what OpenCV's PREFILTER_NORMALIZED_RESPONSE computes, up to its integer rounding.
cv::Mat1f NormalizedResponse(const cv::Mat& image, int window) {
  const cv::Matx33f centre(0, 1, 0, 1, 4, 1, 0, 1, 0);
  cv::Mat1f weighted, mean;
  cv::filter2D(image, weighted, CV_32F, centre * (4.F / 8.F), {-1, -1}, 0, kBorder);
  cv::boxFilter(image, mean, CV_32F, {window, window}, {-1, -1}, true, kBorder);
  return weighted - 4 * mean;
}

}  // namespace

cv::Mat ApplyPrefilter(const cv::Mat& image, const CostOptions& options) {
  if (options.prefilter == Prefilter::kNone) return image;
  if (image.type() != CV_8UC1)
    throw Error("prefilter",
                fmt::format("needs 8-bit images, got {}", cv::typeToString(image.type())));
  cv::Mat1f response;
  if (options.prefilter == Prefilter::kXSobel)
    cv::Sobel(image, response, CV_32F, 1, 0, 3, 1, 0, kBorder);
  else
    response = NormalizedResponse(image, options.prefilter_window);
  const double cap = options.prefilter_cap;
  cv::Mat1b filtered;
  cv::Mat(cv::min(cv::max(response, -cap), cap)).convertTo(filtered, CV_8U, 1, cap);
  return filtered;
}

}  // namespace sgf::stereo
