#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/direct/photometric_correction.h>

namespace sgf::direct {

PhotometricCorrection::PhotometricCorrection(const PhotometricCalibration& calibration,
                                             const cv::Size& size)
    : size_(size), lookup_(1, 256) {
  const std::vector<double>& response = calibration.inverse_response;
  if (!response.empty() && response.size() != 256)
    throw Error("inverse response",
                fmt::format("has {} values; it has to have 256, or none", response.size()));
  const auto falls = [](double a, double b) { return !(a < b && std::isfinite(a + b)); };
  if (std::adjacent_find(response.begin(), response.end(), falls) != response.end())
    throw Error("inverse response", "does not rise");
  for (int level = 0; level < 256; ++level)
    lookup_(level) = response.empty()
                         ? static_cast<float>(level)
                         : static_cast<float>(255 * (response[level] - response.front()) /
                                              (response.back() - response.front()));
  if (calibration.vignette.empty()) return;
  if (calibration.vignette.size() != size)
    throw Error("vignette", fmt::format("is {}x{} px; images have {}x{}", calibration.vignette.cols,
                                        calibration.vignette.rows, size.width, size.height));
  if (!cv::checkRange(calibration.vignette, true, nullptr, 1e-6, 1 + 1e-6))
    throw Error("vignette", "is not in (0, 1] everywhere");
  gain_ = 1 / calibration.vignette;
}

cv::Mat1f PhotometricCorrection::operator()(const cv::Mat1b& grey) const {
  if (grey.size() != size_)
    throw Error("image", fmt::format("is {}x{} px; the camera has {}x{}", grey.cols, grey.rows,
                                     size_.width, size_.height));
  cv::Mat1f corrected;
  cv::LUT(grey, lookup_, corrected);
  if (!gain_.empty()) corrected = corrected.mul(gain_);
  return corrected;
}

}  // namespace sgf::direct
