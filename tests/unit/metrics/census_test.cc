#include <cmath>

#include <gtest/gtest.h>

#include <sgf/core/error.h>

#include "unit/metrics/fields.h"

namespace sgf::metrics {
namespace {

TEST(Census, BitsAreTheDarkerNeighboursRowByRow) {
  const cv::Mat1b grey(7, 9, uint8_t{100});
  int bit = 0;
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 9; ++x) {
      if (y == 3 && x == 4) continue;
      cv::Mat1b image = grey.clone();
      image(y, x) = 99;
      EXPECT_EQ(ComputeCensus(image).Row(3)[4], uint64_t{1} << bit) << x << ", " << y;
      image(y, x) = 101;
      EXPECT_EQ(ComputeCensus(image).Row(3)[4], 0U) << x << ", " << y;
      ++bit;
    }
  EXPECT_EQ(bit, Census::kBits);
}

TEST(Census, CountsDifferingBits) {
  EXPECT_EQ(Census{}(0b1011, 0b0010), 2);
  EXPECT_EQ(Census{}(~uint64_t{0} >> 2, 0), Census::kBits);
}

TEST(Census, ReplicatesTheBorderAlsoOfASubimage) {
  cv::Mat1b frame(20, 20, uint8_t{0});
  cv::Mat1b inner = frame(cv::Rect(5, 5, 9, 7));
  inner.setTo(100);
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 9; ++x) EXPECT_EQ(ComputeCensus(inner).Row(y)[x], 0U) << x << ", " << y;
}

TEST(Census, IsTheSameForEveryPixelTypeAndIncreasingMap) {
  const cv::Mat1b image = testing::RandomTexture(12, 15, 4);
  cv::Mat1w wide(image.size());
  cv::Mat1f curved(image.size());
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      wide(y, x) = static_cast<uint16_t>(200 * image(y, x));
      curved(y, x) = std::sqrt(static_cast<float>(image(y, x))) - 3;
    }
  const CensusImage census = ComputeCensus(image);
  uint64_t any = 0;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      any |= census.Row(y)[x];
      EXPECT_EQ(ComputeCensus(wide).Row(y)[x], census.Row(y)[x]);
      EXPECT_EQ(ComputeCensus(curved).Row(y)[x], census.Row(y)[x]);
    }
  EXPECT_EQ(any, ~uint64_t{0} >> 2);
}

TEST(Census, RejectsWhatIsNotAGreyImage) {
  EXPECT_THROW(ComputeCensus(cv::Mat()), Error);
  EXPECT_THROW(ComputeCensus(cv::Mat(9, 9, CV_8UC3)), Error);
}

}  // namespace
}  // namespace sgf::metrics
