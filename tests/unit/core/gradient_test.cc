#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <sgf/core/error.h>
#include <sgf/core/gradient.h>

namespace sgf {
namespace {

// I(x, y) = 3x + 2y + xy/4: both operators are exact on it away from the border.
cv::Mat1f Bilinear() {
  cv::Mat1f image(7, 9);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) image(y, x) = 3.F * x + 2.F * y + 0.25F * x * y;
  return image;
}

class GradientOperatorTest : public ::testing::TestWithParam<GradientOperator> {};

TEST_P(GradientOperatorTest, IsExactOnABilinearImageInGreyLevelsPerPixel) {
  const cv::Mat1f image = Bilinear();
  const GradientImage gradient = ComputeGradient(image, GetParam());
  for (int y = 1; y < image.rows - 1; ++y)
    for (int x = 1; x < image.cols - 1; ++x) {
      EXPECT_FLOAT_EQ(gradient.x(y, x), 3.F + 0.25F * y);
      EXPECT_FLOAT_EQ(gradient.y(y, x), 2.F + 0.25F * x);
    }
}

TEST_P(GradientOperatorTest, ReplicatesTheBorder) {
  const GradientImage gradient = ComputeGradient(Bilinear(), GetParam());
  const float expected = GetParam() == GradientOperator::kCentral ? 1.5F : 1.5F + 0.125F * 3 / 16;
  EXPECT_FLOAT_EQ(gradient.x(0, 0), expected);  // half of the one-sided difference
}

INSTANTIATE_TEST_SUITE_P(Both, GradientOperatorTest,
                         ::testing::Values(GradientOperator::kCentral, GradientOperator::kScharr));

TEST(Gradient, OperatorsDifferWhereTheImageCurvesAcross) {
  cv::Mat1b image = cv::Mat1b::zeros(5, 5);
  image(2, 3) = 100;
  EXPECT_FLOAT_EQ(ComputeGradient(image, GradientOperator::kCentral).x(2, 2), 50.F);
  EXPECT_FLOAT_EQ(ComputeGradient(image, GradientOperator::kScharr).x(2, 2), 31.25F);
  EXPECT_FLOAT_EQ(ComputeGradient(image, GradientOperator::kScharr).x(1, 2), 9.375F);
}

TEST(Gradient, OfAPartOfAnImageDoesNotSeeTheRest) {
  const cv::Mat1f image = Bilinear();
  const cv::Mat part = image(cv::Rect(2, 1, 5, 4));
  for (const auto op : {GradientOperator::kCentral, GradientOperator::kScharr}) {
    const GradientImage seen = ComputeGradient(part, op), alone = ComputeGradient(part.clone(), op);
    EXPECT_EQ(cv::norm(seen.x, alone.x, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(seen.y, alone.y, cv::NORM_INF), 0);
  }
}

TEST(Gradient, MeanSquaredGradientIsEquation6) {
  const cv::Mat1f image = (cv::Mat1f(1, 3) << 0, 2, 4);
  // x derivatives 1, 2, 1; y derivatives 0.
  EXPECT_DOUBLE_EQ(MeanSquaredGradient(ComputeGradient(image, GradientOperator::kCentral)), 2.0);
}

TEST(Gradient, RejectsWhatItCannotWorkOn) {
  EXPECT_THROW(ComputeGradient(cv::Mat(), GradientOperator::kCentral), Error);
  EXPECT_THROW(ComputeGradient(cv::Mat(4, 4, CV_8UC3), GradientOperator::kCentral), Error);
  EXPECT_THROW(ComputeGradient(cv::Mat(4, 4, CV_8S), GradientOperator::kCentral), Error);
}

}  // namespace
}  // namespace sgf
