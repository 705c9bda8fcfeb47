#include <cmath>

#include <gtest/gtest.h>

#include <sgf/apps/image_change.h>

#include "support/error_message.h"

namespace sgf::apps {
namespace {

const cv::Mat1b kGrey(41, 61, uchar{100});

cv::Mat1f Fractional(ImageChange change) {
  change.quantise = false;
  return ApplyChange(kGrey, change, 1);
}

TEST(ImageChange, DefaultsChangeNothing) {
  cv::Mat1b ramp(5, 256);
  for (int x = 0; x < 256; ++x) ramp.col(x) = x;
  const cv::Mat changed = ApplyChange(ramp, {}, 1);
  ASSERT_EQ(changed.type(), CV_8U);
  EXPECT_EQ(cv::norm(changed, ramp, cv::NORM_INF), 0);
}

TEST(ImageChange, VignetteFallsWithTheSquaredRadiusToTheCorners) {
  const cv::Mat1f changed = Fractional({.exposure = 0.9, .vignette = 0.15});
  EXPECT_NEAR(changed(20, 30), 90, 1e-4);
  for (const cv::Point corner : {cv::Point(0, 0), cv::Point(60, 0), cv::Point(60, 40)})
    EXPECT_NEAR(changed(corner), 90 * 0.85, 1e-4);
  const double r2 = 30.0 * 30.0 / (30.0 * 30.0 + 20.0 * 20.0);
  EXPECT_NEAR(changed(20, 60), 90 * (1 - 0.15 * r2), 1e-4);
}

TEST(ImageChange, LocalLightHasItsFullStrengthInItsCentreOnly) {
  const cv::Mat1f changed =
      Fractional({.light = 0.5, .light_x = 10.5 / 61, .light_y = 5.5 / 41, .light_radius = 0.05});
  EXPECT_NEAR(changed(5, 10), 150, 1e-3);
  const double sigma_px = 0.05 * std::hypot(61, 41);
  EXPECT_NEAR(changed(8, 14), 100 * (1 + 0.5 * std::exp(-12.5 / (sigma_px * sigma_px))), 1e-3);
  EXPECT_NEAR(changed(40, 60), 100, 1e-3);
}

TEST(ImageChange, GammaTurnsExposureAndVignetteIntoThoseOfLight) {
  const cv::Mat1f encoded = Fractional({.gamma = 2.2, .exposure = 0.6, .vignette = 0.5});
  EXPECT_NEAR(encoded(20, 30), 100 * std::pow(0.6, 1 / 2.2), 1e-3);
  EXPECT_NEAR(encoded(0, 0), 100 * std::pow(0.3, 1 / 2.2), 1e-3);
  const cv::Mat1f linear =
      Fractional({.gamma = 2.2, .exposure = 0.6, .vignette = 0.5, .encode = false});
  EXPECT_NEAR(linear(20, 30), 255 * std::pow(100 / 255.0, 2.2) * 0.6, 1e-3);
  EXPECT_NEAR(linear(0, 0), 255 * std::pow(100 / 255.0, 2.2) * 0.3, 1e-3);
}

TEST(ImageChange, GammaAloneIsUndone) {
  cv::Mat1b ramp(5, 256);
  for (int x = 0; x < 256; ++x) ramp.col(x) = x;
  EXPECT_EQ(cv::norm(ApplyChange(ramp, {.gamma = 2.2}, 1), ramp, cv::NORM_INF), 0);
}

TEST(ImageChange, ChannelsChangeLikeGreyImages) {
  const ImageChange change{.blur = 1, .gamma = 2.2, .light = 0.3, .exposure = 0.8, .vignette = 0.4};
  std::vector<cv::Mat> channels;
  for (const int level : {0, 90, 180}) {
    channels.push_back(kGrey + level);
    channels.back().colRange(20, 25) = 7;
  }
  cv::Mat colour;
  cv::merge(channels, colour);
  std::vector<cv::Mat> changed;
  cv::split(ApplyChange(colour, change, 1), changed);
  ASSERT_EQ(changed.size(), 3u);
  for (int c = 0; c < 3; ++c)
    EXPECT_EQ(cv::norm(changed[c], ApplyChange(channels[c], change, 1), cv::NORM_INF), 0);
}

TEST(ImageChange, ChannelsHaveNoiseOfTheirOwn) {
  const cv::Mat3b grey(100, 100, cv::Vec3b(100, 100, 100));
  std::vector<cv::Mat> changed;
  cv::split(ApplyChange(grey, {.noise = 2, .quantise = false}, 1), changed);
  cv::Scalar mean, deviation;
  cv::meanStdDev(changed[0] - changed[2], mean, deviation);
  EXPECT_NEAR(deviation[0], 2 * std::sqrt(2), 0.1);
}

TEST(ImageChange, QuantisedGreyLevelsAreRoundedAndSaturate) {
  EXPECT_EQ(ApplyChange(kGrey, {.exposure = 0.994}, 1).at<uchar>(3, 3), 99);
  EXPECT_EQ(ApplyChange(kGrey, {.exposure = 0.996}, 1).at<uchar>(3, 3), 100);
  EXPECT_EQ(ApplyChange(kGrey, {.exposure = 3}, 1).at<uchar>(3, 3), 255);
  EXPECT_EQ(ApplyChange(kGrey, {.offset = -120}, 1).at<uchar>(3, 3), 0);
  EXPECT_EQ(Fractional({.offset = 200})(3, 3), 300);
}

TEST(ImageChange, BlurActsBeforeTheExposureAndKeepsTheMean) {
  cv::Mat1b step(21, 40, uchar{0});
  step.colRange(20, 40) = 200;
  const cv::Mat1f blurred = ApplyChange(step, {.blur = 2, .exposure = 0.5, .quantise = false}, 1);
  EXPECT_NEAR(blurred(10, 0), 0, 1e-3);
  EXPECT_NEAR(blurred(10, 39), 100, 1e-3);
  EXPECT_NEAR(blurred(10, 19) + blurred(10, 20), 100, 1e-3);
  // the kernel's central weight
  EXPECT_NEAR(blurred(10, 20) - blurred(10, 19), 100 / (2 * std::sqrt(2 * CV_PI)), 0.01);
}

TEST(ImageChange, NoiseHasItsStrengthAndFollowsTheSeed) {
  ImageChange change;
  change.noise = 2;
  change.quantise = false;
  const cv::Mat1b grey(200, 200, uchar{100});
  const cv::Mat one = ApplyChange(grey, change, 1), again = ApplyChange(grey, change, 1);
  const cv::Mat other = ApplyChange(grey, change, 2);
  cv::Scalar mean, deviation;
  cv::meanStdDev(one, mean, deviation);
  EXPECT_NEAR(mean[0], 100, 0.05);
  EXPECT_NEAR(deviation[0], 2, 0.04);
  EXPECT_EQ(cv::norm(one, again, cv::NORM_INF), 0);
  cv::meanStdDev(one - other, mean, deviation);
  EXPECT_NEAR(deviation[0], 2 * std::sqrt(2), 0.06) << "two seeds are independent";
}

TEST(ImageChange, NamesTheOptionThatIsOutOfRange) {
  const auto message = [](const ImageChange& change) {
    return ErrorMessage([&] { ApplyChange(kGrey, change, 1); });
  };
  EXPECT_EQ(message({.exposure = -0.5}), "exposure: must be finite and positive, got -0.5");
  EXPECT_EQ(message({.vignette = 1}), "vignette: must be in [0, 1), got 1");
  EXPECT_EQ(message({.vignette = -0.1}), "vignette: must be in [0, 1), got -0.1");
  EXPECT_EQ(message({.light = -1}), "light: must be finite and above -1, got -1");
  EXPECT_EQ(message({.light_radius = 0}), "light_radius: must be finite and positive, got 0");
  EXPECT_EQ(message({.gamma = 0}), "gamma: must be finite and positive, got 0");
  EXPECT_EQ(message({.blur = -1}), "blur: must be finite and not negative, got -1");
  EXPECT_EQ(message({.noise = NAN}), "noise: must be finite and not negative, got nan");
  EXPECT_EQ(message({.offset = INFINITY}), "light_x, light_y and offset: must be finite, got inf");
}

}  // namespace
}  // namespace sgf::apps
