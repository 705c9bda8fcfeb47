#pragma once

#include <cmath>
#include <cstdint>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace sgf {

/// Textured 8-bit image: smoothed noise at two scales, stretched to the whole range.
inline cv::Mat1b TexturedImage(cv::Size size, uint64_t seed) {
  cv::RNG rng(seed);
  cv::Mat1f fine(size), coarse(size);
  rng.fill(fine, cv::RNG::NORMAL, 0, 1);
  rng.fill(coarse, cv::RNG::NORMAL, 0, 4);
  cv::GaussianBlur(fine, fine, {}, 1.0);
  cv::GaussianBlur(coarse, coarse, {}, 4.0);
  const cv::Mat1f sum = fine + coarse;
  cv::Mat1b image;
  cv::normalize(sum, image, 0, 255, cv::NORM_MINMAX, CV_8U);
  return image;
}

/// Left and right view of a fronto-parallel texture at a disparity in px, which may be fractional:
/// right(x - disparity) = left(x). Intensities are those of one smooth function, rounded.
inline std::pair<cv::Mat1b, cv::Mat1b> ShiftedPair(cv::Size size, double disparity, uint64_t seed) {
  const int margin = static_cast<int>(std::ceil(std::abs(disparity))) + 2;
  const cv::Mat1b wide = TexturedImage({size.width + 2 * margin, size.height}, seed);
  const auto view = [&](double shift) {
    cv::Mat1b image;
    const cv::Matx23d from_view(1, 0, margin + shift, 0, 1, 0);
    cv::warpAffine(wide, image, from_view, size, cv::INTER_CUBIC | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
    return image;
  };
  return {view(0), view(disparity)};
}

}  // namespace sgf
