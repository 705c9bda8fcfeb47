#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/eval/disparity.h>

#include "support/error_message.h"

namespace sgf {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

TEST(ScoreDisparity, GivesHandComputedScores) {
  // Errors: 0, 1.5, 2.5, 5, unmatched, without truth.
  const cv::Mat1f truth = (cv::Mat1f(2, 3) << 10, 10, 10, 200, 10, kNan);
  const cv::Mat1f estimate = (cv::Mat1f(2, 3) << 10, 11.5, 7.5, 205, kNan, 3);
  const DisparityScores scores = ScoreDisparity(estimate, truth);
  EXPECT_EQ(scores.truth_px, 5);
  EXPECT_EQ(scores.matched_px, 4);
  EXPECT_DOUBLE_EQ(scores.mean_px, 2.25);
  EXPECT_DOUBLE_EQ(scores.bad1_pct, 75);
  EXPECT_DOUBLE_EQ(scores.bad2_pct, 50);
  EXPECT_DOUBLE_EQ(scores.bad4_pct, 25);
  EXPECT_DOUBLE_EQ(scores.d1_pct, 0) << "5 px of 200 are below 5 %";
  EXPECT_DOUBLE_EQ(scores.invalid_pct, 20);
}

TEST(ScoreDisparity, CountsAnErrorAsBadAboveTheThresholdOnly) {
  const cv::Mat1f truth = (cv::Mat1f(1, 4) << 50, 50, 50, 50);
  const DisparityScores at = ScoreDisparity((cv::Mat1f(1, 4) << 51, 48, 46, 50), truth);
  EXPECT_EQ(at.bad1_pct, 50);
  EXPECT_EQ(at.bad2_pct, 25);
  EXPECT_EQ(at.bad4_pct, 0);
}

TEST(ScoreDisparity, CountsD1AboveThreePixelsAndFivePercent) {
  const auto d1 = [](float truth, float estimate) {
    return ScoreDisparity(cv::Mat1f(1, 1, estimate), cv::Mat1f(1, 1, truth)).d1_pct;
  };
  EXPECT_EQ(d1(10, 13), 0) << "3 px";
  EXPECT_EQ(d1(10, 13.25F), 100);
  EXPECT_EQ(d1(10, 6.75F), 100) << "below the truth";
  EXPECT_EQ(d1(80, 84), 0) << "5 %";
  EXPECT_EQ(d1(80, 84.25F), 100);
  EXPECT_EQ(d1(0, 3.25F), 100);
}

TEST(ScoreDisparity, HasNoMeanWithoutMatchedPixels) {
  const DisparityScores scores = ScoreDisparity(cv::Mat1f(2, 2, kNan), cv::Mat1f(2, 2, 7.F));
  EXPECT_EQ(scores.truth_px, 4);
  EXPECT_EQ(scores.matched_px, 0);
  for (const double value :
       {scores.mean_px, scores.bad1_pct, scores.bad2_pct, scores.bad4_pct, scores.d1_pct})
    EXPECT_TRUE(std::isnan(value));
  EXPECT_EQ(scores.invalid_pct, 100);
}

TEST(ScoreDisparity, TakesInfinityForNone) {
  const DisparityScores scores =
      ScoreDisparity((cv::Mat1f(1, 3) << 2, kInf, 3), (cv::Mat1f(1, 3) << 2, 2, -kInf));
  EXPECT_EQ(scores.truth_px, 2);
  EXPECT_EQ(scores.matched_px, 1);
  EXPECT_EQ(scores.mean_px, 0);
}

TEST(ScoreDisparity, SumsInDoublePrecision) {
  const cv::Mat1f truth(2000, 2000, 1.F);
  const cv::Mat1f estimate(2000, 2000, 1.1F);  // a float sum is off in the third digit
  EXPECT_NEAR(ScoreDisparity(estimate, truth).mean_px, double{1.1F} - 1, 1e-9);
}

TEST(ScoreDisparity, ScoresPartsOfImages) {
  const cv::Mat1f truth = (cv::Mat1f(2, 2) << 1, 50, 1, 50);
  const cv::Mat1f estimate = (cv::Mat1f(2, 2) << 1, 0, 2, 0);
  EXPECT_EQ(ScoreDisparity(estimate.col(0), truth.col(0)).mean_px, 0.5);
}

TEST(ScoreDisparity, RejectsOtherSizesAndNoTruth) {
  EXPECT_EQ(ErrorMessage([] { ScoreDisparity(cv::Mat1f(2, 3, 1.F), cv::Mat1f(3, 2, 1.F)); }),
            "ground truth: is 2x3, but the disparity map is 3x2");
  EXPECT_EQ(ErrorMessage([] { ScoreDisparity(cv::Mat1f(2, 3, 1.F), cv::Mat1f(2, 3, kNan)); }),
            "ground truth: none of 3x2 pixels has a value");
  EXPECT_EQ(ErrorMessage([] { ScoreDisparity({}, {}); }),
            "ground truth: none of 0x0 pixels has a value");
}

RC_GTEST_PROP(ScoreDisparityProperty, RatesAreOrderedAndInvalidCountsTheRest, ()) {
  const int n = *rc::gen::inRange(1, 60);
  cv::Mat1f truth(1, n), estimate(1, n);
  for (int i = 0; i < n; ++i) {
    truth(i) = *rc::gen::inRange(0, 8) == 0 ? kNan : *rc::gen::inRange(0, 640) / 8.F;
    estimate(i) = *rc::gen::inRange(0, 4) == 0 ? kNan : *rc::gen::inRange(0, 640) / 8.F;
  }
  truth(0) = estimate(0) = 1;
  const DisparityScores scores = ScoreDisparity(estimate, truth);
  RC_ASSERT(scores.bad1_pct >= scores.bad2_pct);
  RC_ASSERT(scores.bad2_pct >= scores.d1_pct);
  RC_ASSERT(scores.bad2_pct >= scores.bad4_pct);
  const double matched_pct =
      100. * static_cast<double>(scores.matched_px) / static_cast<double>(scores.truth_px);
  RC_ASSERT(std::abs(scores.invalid_pct + matched_pct - 100) < 1e-9);
}

}  // namespace
}  // namespace sgf
