#include <cmath>

#include <gtest/gtest.h>

#include <sgf/core/error.h>
#include <sgf/metrics/sample_image.h>

#include "unit/metrics/fields.h"

namespace sgf::metrics {
namespace {

void ExpectSameBits(const Sample<float>& actual, const Sample<float>& expected) {
  EXPECT_EQ(actual.intensity, expected.intensity);
  EXPECT_EQ(actual.gx, expected.gx);
  EXPECT_EQ(actual.gy, expected.gy);
  EXPECT_EQ(actual.norm, expected.norm);
  EXPECT_EQ(actual.reg_norm, expected.reg_norm);
  EXPECT_EQ(actual.ax, expected.ax);
  EXPECT_EQ(actual.ay, expected.ay);
  EXPECT_EQ(actual.r, expected.r);
}

class SampleImageTest : public ::testing::TestWithParam<int> {};

TEST_P(SampleImageTest, HoldsTheSampleOfEveryPixel) {
  cv::Mat image;
  testing::RandomTexture(17, 23, 6).convertTo(image, GetParam());
  const EpsilonOptions options{.scope = EpsilonScope::kWindow, .window_px = 5};
  const double tau = 0.01;
  const SampleImage samples = MakeSampleImage(image, GradientOperator::kScharr, options, tau);
  const GradientImage gradient = ComputeGradient(image, GradientOperator::kScharr);
  const cv::Mat1f epsilon = ComputeEpsilon(gradient, options);
  const cv::Mat1f intensity = image;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      ExpectSameBits(samples.At(y, x), MakeSample<float>(intensity(y, x), gradient.x(y, x),
                                                         gradient.y(y, x), epsilon(y, x), tau));
}

INSTANTIATE_TEST_SUITE_P(Depths, SampleImageTest, ::testing::Values(CV_8U, CV_16U, CV_32F));

TEST(MakeSample, IsItsDefinition) {
  const auto sample = MakeSample<double>(7, 3, -4, 11);
  EXPECT_EQ(sample.intensity, 7);
  EXPECT_EQ(sample.norm, 5);
  EXPECT_EQ(sample.reg_norm, 6);
  EXPECT_DOUBLE_EQ(sample.ax, 0.5);
  EXPECT_DOUBLE_EQ(sample.ay, -2.0 / 3);
  EXPECT_DOUBLE_EQ(sample.r, 36.0 / 25);
  EXPECT_DOUBLE_EQ((MakeSample<double>(7, 3, -4, 11, 0.9).r), 1 / 0.9);
}

TEST(SampleImage, OfABlankImageHasNoNaN) {
  for (const EpsilonScope scope :
       {EpsilonScope::kImage, EpsilonScope::kTile, EpsilonScope::kWindow}) {
    const SampleImage samples =
        MakeSampleImage(cv::Mat1b(8, 9, uint8_t{77}), GradientOperator::kCentral, {.scope = scope});
    ExpectSameBits(samples.At(3, 4), {77, 0, 0, 0, 0, 0, 0, static_cast<float>(1 / kTau)});
  }
}

// Powers of two change no bits of the quotients.
TEST(SampleImage, NormalisedGradientIsExactlyInvariantToGainAndOffset) {
  const cv::Mat1b image = testing::RandomTexture(20, 30, 7);
  cv::Mat1w brighter;
  image.convertTo(brighter, CV_16U, 4, 10);
  const SampleImage before = MakeSampleImage(image, GradientOperator::kCentral, {});
  const SampleImage after = MakeSampleImage(brighter, GradientOperator::kCentral, {});
  EXPECT_EQ(cv::norm(before.ax, after.ax), 0);
  EXPECT_EQ(cv::norm(before.ay, after.ay), 0);
  EXPECT_EQ(cv::norm(before.r, after.r), 0);
  EXPECT_EQ(cv::norm(4 * before.norm, after.norm), 0);
}

std::string MessageFor(const cv::Mat& image, double tau) {
  try {
    MakeSampleImage(image, GradientOperator::kCentral, {}, tau);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(SampleImage, NamesWhatItCannotWorkOn) {
  cv::Mat1f image = cv::Mat1f::zeros(4, 5);
  EXPECT_EQ(MessageFor(image, 0), "tau: is 0; it has to be in [1e-30, 1]");
  EXPECT_EQ(MessageFor(image, 2), "tau: is 2; it has to be in [1e-30, 1]");
  EXPECT_EQ(MessageFor(image, std::nan("")), "tau: is nan; it has to be in [1e-30, 1]");
  EXPECT_EQ(MessageFor(cv::Mat(), kTau), "image: image is empty");
  EXPECT_EQ(MessageFor(cv::Mat(4, 4, CV_8UC3), kTau), "image: expected one channel, got 3");
  image(2, 3) = std::nanf("");
  EXPECT_EQ(MessageFor(image, kTau), "image: pixel (3, 2) is nan, not a usable intensity");
  image(2, 3) = -HUGE_VALF;
  EXPECT_EQ(MessageFor(image, kTau), "image: pixel (3, 2) is -inf, not a usable intensity");
  image(2, 3) = 1e20F;
  EXPECT_EQ(MessageFor(image, kTau), "image: pixel (3, 2) is 1e+20, not a usable intensity");
}

}  // namespace
}  // namespace sgf::metrics
