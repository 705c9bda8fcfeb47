#include <limits>

#include <gtest/gtest.h>

#include <sgf/stereo/refine.h>

namespace sgf::stereo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

cv::Mat1f Filled(cv::Mat1f disparity) {
  FillHoles(disparity);
  return disparity;
}

void ExpectEqual(const cv::Mat1f& actual, const cv::Mat1f& expected) {
  EXPECT_EQ(cv::norm(actual, expected, cv::NORM_INF), 0) << actual;
}

TEST(FillHoles, TakesTheSmallerOfTheNearestValuesOnTheRow) {
  const cv::Mat1f row = (cv::Mat1f(1, 9) << kNone, 4, kNone, kNone, 7, kNone, 2, 9, kNone);
  ExpectEqual(Filled(row), (cv::Mat1f(1, 9) << 4, 4, 4, 4, 7, 2, 2, 9, 9));
}

TEST(FillHoles, TakesTheNearestRowForARowWithoutValues) {
  cv::Mat1f map(7, 2, kNone);
  map(1, 0) = 3;
  map(5, 1) = 8;
  const cv::Mat1f filled = Filled(map);
  ExpectEqual(filled.col(0).t(), (cv::Mat1f(1, 7) << 3, 3, 3, 3, 8, 8, 8));
  ExpectEqual(filled.col(1).t(), filled.col(0).t());
}

TEST(FillHoles, TreatsInfinityAsAHoleAndKeepsValuesAsTheyAre) {
  const float infinity = std::numeric_limits<float>::infinity();
  ExpectEqual(Filled((cv::Mat1f(1, 4) << -2, infinity, 0, -infinity)),
              (cv::Mat1f(1, 4) << -2, -2, 0, 0));
}

TEST(FillHoles, LeavesAMapWithoutAnyValue) {
  const cv::Mat1f filled = Filled(cv::Mat1f(3, 4, kNone));
  EXPECT_EQ(cv::countNonZero(filled != filled), 12);
  EXPECT_TRUE(Filled(cv::Mat1f()).empty());
}

TEST(FillHoles, WorksOnAPartOfAMap) {
  cv::Mat1f map(3, 5, 1.F);
  map(1, 2) = kNone;
  cv::Mat1f part = map(cv::Rect(2, 0, 2, 3));
  part(1, 1) = 6;
  FillHoles(part);
  EXPECT_EQ(map(1, 2), 6);
}

}  // namespace
}  // namespace sgf::stereo
