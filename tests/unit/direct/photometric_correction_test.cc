#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/direct/photometric_correction.h>

namespace sgf::direct {
namespace {

using testing::HasSubstr;

TEST(PhotometricCorrection, LeavesALinearCameraAlone) {
  const PhotometricCorrection correct({}, {3, 1});
  const cv::Mat1b grey = (cv::Mat1b(1, 3) << 0, 100, 255);
  const cv::Mat1f corrected = correct(grey);
  for (int x = 0; x < 3; ++x) EXPECT_EQ(corrected(0, x), grey(0, x));
}

TEST(PhotometricCorrection, UndoesResponseAndVignette) {
  PhotometricCalibration calibration;
  for (int level = 0; level < 256; ++level)
    calibration.inverse_response.push_back(std::pow(level / 255., 2.2));
  calibration.vignette = (cv::Mat1f(1, 2) << 1, 0.5f);
  const PhotometricCorrection correct(calibration, {2, 1});
  const cv::Mat1f corrected = correct((cv::Mat1b(1, 2) << 128, 128));
  const double light = 255 * std::pow(128 / 255., 2.2);
  EXPECT_NEAR(corrected(0, 0), light, 1e-3);
  EXPECT_NEAR(corrected(0, 1), 2 * light, 1e-3);
}

TEST(PhotometricCorrection, RefusesACalibrationThatDoesNotFit) {
  const auto refusal = [](const PhotometricCalibration& calibration) {
    return ErrorMessage([&] { PhotometricCorrection(calibration, {4, 3}); });
  };
  EXPECT_THAT(refusal({.inverse_response = {0, 1}}), HasSubstr("has 2 values"));
  EXPECT_THAT(refusal({.inverse_response = std::vector<double>(256, 0.5)}), HasSubstr("not rise"));
  EXPECT_THAT(refusal({.vignette = cv::Mat1f(3, 3, 1.f)}), HasSubstr("3x3 px"));
  EXPECT_THAT(refusal({.vignette = cv::Mat1f(3, 4, 0.f)}), HasSubstr("(0, 1]"));
  const PhotometricCorrection correct({}, {4, 3});
  EXPECT_THAT(ErrorMessage([&] { correct(cv::Mat1b(3, 3)); }), HasSubstr("3x3 px"));
}

}  // namespace
}  // namespace sgf::direct
