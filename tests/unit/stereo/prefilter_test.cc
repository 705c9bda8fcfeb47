#include <gtest/gtest.h>
#include <support/stereo_images.h>

#include <sgf/stereo/prefilter.h>

namespace sgf::stereo {
namespace {

CostOptions With(Prefilter prefilter) {
  CostOptions options;
  options.prefilter = prefilter;
  return options;
}

TEST(Prefilter, NoneReturnsTheImageItself) {
  const cv::Mat1b image = TexturedImage({20, 10}, 1);
  EXPECT_EQ(ApplyPrefilter(image, With(Prefilter::kNone)).data, image.data);
}

TEST(Prefilter, XSobelIsTheClippedHorizontalSobelResponse) {
  cv::Mat1b image(5, 7);
  for (int x = 0; x < 7; ++x) image.col(x) = 10 + 2 * x * x / 4;  // 10 10 12 14 18 22 28
  const cv::Mat1b filtered = ApplyPrefilter(image, With(Prefilter::kXSobel));
  EXPECT_EQ(filtered(2, 2), 31 + 4 * (14 - 10));
  EXPECT_EQ(filtered(2, 4), 62);  // 4 * (22 - 14) exceeds the cap of 31
}

TEST(Prefilter, NormalizedResponseIgnoresOffsetsAndKeepsContrast) {
  cv::Mat1b image(15, 15, uint8_t{100});
  image(7, 7) = 104;
  const cv::Mat1b filtered = ApplyPrefilter(image, With(Prefilter::kNormalizedResponse));
  // 4 (100 + 4 / 2 - (100 + 4 / 81)) at the spot, no response where the window does not hold it.
  EXPECT_EQ(filtered(7, 7), 31 + 8);
  EXPECT_EQ(filtered(0, 0), 31);
  const cv::Mat1b brighter = image + 50;
  EXPECT_EQ(
      cv::countNonZero(ApplyPrefilter(brighter, With(Prefilter::kNormalizedResponse)) != filtered),
      0);
}

TEST(Prefilter, StaysWithinTheCap) {
  const cv::Mat1b image = TexturedImage({60, 40}, 2);
  for (const auto prefilter : {Prefilter::kXSobel, Prefilter::kNormalizedResponse}) {
    CostOptions options = With(prefilter);
    options.prefilter_cap = 5;
    double low = 0, high = 0;
    cv::minMaxLoc(ApplyPrefilter(image, options), &low, &high);
    EXPECT_EQ(low, 0);
    EXPECT_EQ(high, 10);
  }
}

}  // namespace
}  // namespace sgf::stereo
