#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/camera.h>

namespace sgf::synth {

/// Fall-off of the image towards its borders.
enum class VignetteModel {
  kNone,
  kPolynomial,  ///< V(r) = 1 + v2 r^2 + v4 r^4 + ...
  kCos4,        ///< V = cos^4 of the angle between the pixel's ray and the optical axis
};

/// Shape of the camera response: output level over irradiance, both from 0 to 1 (saturation).
enum class ResponseModel {
  kLinear,
  kGamma,  ///< output = irradiance^(1 / gamma)
  kTable,  ///< linear between the table's values
};

std::span<const std::pair<const char*, VignetteModel>> EnumNames(VignetteModel);
std::span<const std::pair<const char*, ResponseModel>> EnumNames(ResponseModel);

struct VignetteOptions {
  VignetteModel model = VignetteModel::kNone;
  std::vector<double> coefficients;

  template <class V>
  void VisitFields(V&& visit) {
    visit("model", model, "", "none, polynomial or cos4");
    visit("coefficients", coefficients, "",
          "polynomial: v2, v4, v6, ... of r, the distance to the principal point; r = 1 at the "
          "corner pixel farthest from it");
  }
};

struct SensorNoiseOptions {
  bool shot = true;
  double full_well_e = 10000;
  double read_noise_e = 10;

  template <class V>
  void VisitFields(V&& visit) {
    visit("shot", shot, "", "Poisson noise of the photo-electrons");
    visit("full_well_e", full_well_e, "electrons", "signal at saturation");
    visit("read_noise_e", read_noise_e, "electrons", "standard deviation of Gaussian read noise");
  }
};

struct ResponseOptions {
  ResponseModel model = ResponseModel::kLinear;
  double gamma = 2.2;
  std::vector<double> table;

  template <class V>
  void VisitFields(V&& visit) {
    visit("model", model, "", "linear, gamma or table");
    visit("gamma", gamma, "", "gamma: output = irradiance^(1 / gamma)");
    visit("table", table, "",
          "table: outputs at equally spaced irradiances, strictly increasing from 0 to 1");
  }
};

struct PhotometryOptions {
  double full_scale_ms = 10;
  VignetteOptions vignette;
  SensorNoiseOptions noise;
  ResponseOptions response;
  int bits = 8;

  template <class V>
  void VisitFields(V&& visit) {
    visit("full_scale_ms", full_scale_ms, "ms",
          "sensitivity: the exposure time at which radiance 1 just saturates where V = 1");
    visit("vignette", vignette, "", "fall-off towards the image borders");
    visit("noise", noise, "", "shot and read noise");
    visit("response", response, "", "camera response curve");
    visit("bits", bits, "", "bits per pixel of the image: 8 or 16");
  }
};

/// Response curve f of a camera and its inverse. Both are strictly increasing from 0 at 0 to 1 at
/// 1; arguments outside of [0, 1] are clamped.
class CameraResponse {
 public:
  /// @throws Error for a gamma that is not positive, or a table that does not increase strictly
  ///   from 0 to 1.
  explicit CameraResponse(ResponseOptions options);

  /// Output in [0, 1] of an irradiance in [0, 1].
  double Forward(double irradiance) const;

  /// Irradiance in [0, 1] that gives an output in [0, 1].
  double Inverse(double output) const;

  /// Irradiances of all levels: f^-1(i / (levels - 1)).
  std::vector<double> InverseTable(int levels) const;

 private:
  ResponseOptions options_;
};

/// Response curve and rounding to the nearest level in one step: of irradiance x in [0, 1], the
/// level round(f(x) * (levels - 1)), found by comparing x with f^-1 of where levels meet.
class Quantizer {
 public:
  /// @param levels at most 65536.
  Quantizer(const CameraResponse& response, int levels);

  int Level(float irradiance) const {
    int level = guide_[static_cast<size_t>(irradiance * static_cast<float>(kBins))];
    while (irradiance >= thresholds_[level]) ++level;
    return level;
  }

 private:
  static constexpr int kBins = 1 << 16;

  std::vector<float> thresholds_;  // [i]: least irradiance of level i + 1; the last: infinity
  std::vector<uint16_t> guide_;    // [b]: number of thresholds that are at most b / kBins
};

/// Luminance of linear RGB (in this order) by the weights of ITU-R BT.709.
cv::Mat1f Luminance(const cv::Mat3f& rgb);

/// Linear RGB for people to look at: 8-bit BGR, gamma 2.2, radiance 1 is white.
cv::Mat3b ForScreen(const cv::Mat3f& radiance);

/// @throws Error naming the option that is out of range whatever the camera; PhotometricCamera
/// checks the same.
void Check(const PhotometryOptions& options);

/// Seed of one frame's noise, another one for every camera and frame of a sequence.
uint64_t FrameSeed(uint64_t seed, int camera, int frame);

/// What a real camera makes of linear radiance. At each pixel, in the physical order:
///
///   mean electrons  = radiance * exposure_ms / full_scale_ms * V * full_well_e
///   electrons       = Poisson(mean electrons) + read_noise_e * Gaussian
///   irradiance      = electrons / full_well_e, clipped to [0, 1]
///   level           = f(irradiance) * (2^bits - 1), rounded to the nearest
///
/// Motion blur comes before all that: average the radiance images of several instants within the
/// exposure and expose the average.
class PhotometricCamera {
 public:
  /// @param camera size, principal point and, for cos^4, the rays of the pixels.
  /// @param threads threads to use; 0 for all cores. Images do not depend on it.
  /// @throws Error naming the option at fault and its value: a full_scale_ms or full_well_e that is
  ///   not positive, negative read noise, bits other than 8 and 16, a vignette that is not in (0,
  ///   1] at some pixel, coefficients or a table for a model without, or a bad response curve.
  PhotometricCamera(const Camera& camera, const PhotometryOptions& options, int threads = 0);

  /// Image of the camera's size, one channel of 8 or 16 bit.
  /// @param radiance linear, not negative; 1 is about white in full light.
  /// @param frame_seed noise depends on this and the pixel alone; see FrameSeed().
  /// @throws Error for an exposure time that is not positive, an image of another size, or a
  /// radiance
  ///   that is negative or not finite.
  cv::Mat Expose(const cv::Mat1f& radiance, double exposure_ms, uint64_t frame_seed) const;

  /// Radiance that an image shows: undoes quantisation, response, vignette and exposure time. Where
  /// the image is saturated this is the least radiance it may have been.
  /// @throws Error for an exposure time that is not positive or an image of another type or size.
  cv::Mat1f Radiance(const cv::Mat& image, double exposure_ms) const;

  /// V at every pixel, in (0, 1].
  const cv::Mat1f& vignette() const { return vignette_; }

  const CameraResponse& response() const { return response_; }

  /// Irradiance in [0, 1] of every level of the image: 256 or 65536 values.
  const std::vector<double>& inverse_response() const { return inverse_response_; }

 private:
  template <class Level>
  void ExposeRow(const float* radiance, int y, double exposure_ms, uint64_t seed,
                 Level* levels) const;
  template <class Level>
  void RadianceRow(const Level* levels, int y, double exposure_ms, float* radiance) const;
  void CheckCall(const cv::Mat& image, int type, double exposure_ms) const;

  PhotometryOptions options_;
  int threads_;
  CameraResponse response_;
  std::vector<double> inverse_response_;
  Quantizer quantizer_;
  cv::Mat1f vignette_;
};

}  // namespace sgf::synth
