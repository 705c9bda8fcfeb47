#pragma once

#include <vector>

#include <opencv2/core.hpp>

namespace sgf::direct {

/// Photometric calibration of a camera, I = G(t V B) with response G, exposure time t, vignette V
/// and irradiance B (Engel, Usenko, Cremers, "A photometrically calibrated benchmark for monocular
/// visual odometry", 2016).
struct PhotometricCalibration {
  std::vector<double> inverse_response = {};  ///< G^-1 at levels 0 to 255, rising; empty: linear
  cv::Mat1f vignette = {};                    ///< V in (0, 1] at every pixel; empty: 1

  bool any() const { return !inverse_response.empty() || !vignette.empty(); }
};

/// Makes images linear in irradiance.
class PhotometricCorrection {
 public:
  /// @throws Error for a response of another length or that does not rise, and a vignette of
  /// another size or not in (0, 1].
  PhotometricCorrection(const PhotometricCalibration& calibration, const cv::Size& size);

  /// Irradiance times exposure, 255 G^-1(I) / V / (G^-1(255) - G^-1(0)), in grey levels; may exceed
  /// 255 towards the corners.
  /// @param grey 8-bit. @throws Error for another type or size.
  cv::Mat1f operator()(const cv::Mat1b& grey) const;

 private:
  cv::Size size_;
  cv::Mat1f lookup_;  ///< 1 x 256, grey levels
  cv::Mat1f gain_;    ///< 1 / V, or empty
};

}  // namespace sgf::direct
