#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <support/error_message.h>
#include <support/stereo_images.h>

#include <sgf/core/error.h>
#include <sgf/metrics/registry.h>
#include <sgf/stereo/block_matcher.h>

namespace sgf::stereo {
namespace {

cv::Mat1s Compute(const BlockMatcherOptions& options, const cv::Mat& left, const cv::Mat& right) {
  cv::Mat1s disparity;
  BlockMatcher(options).Compute(left, right, disparity);
  return disparity;
}

BlockMatcherOptions With(const std::string& metric) {
  BlockMatcherOptions options;
  options.metric = metric;
  options.num_disparities = 24;
  return options;
}

// Share of the pixels whose disparity is within a tolerance, of those at least 24 px from the
// border.
double ShareWithin(const BlockMatcherOptions& options, const cv::Mat1s& disparity, double truth,
                   double tolerance) {
  const cv::Mat1f values = BlockMatcher(options).ToFloat(disparity);
  const cv::Mat1f inner = values(cv::Rect(24, 12, values.cols - 36, values.rows - 24));
  int good = 0;
  for (const float value : inner) good += std::abs(value - truth) <= tolerance;
  return good / static_cast<double>(inner.total());
}

std::vector<std::string> StereoMetrics() {
  std::vector<std::string> names;
  for (const auto& metric : metrics::AllMetrics())
    if (metric.traits.kind != metrics::MetricKind::kPatch) names.emplace_back(metric.name);
  return names;
}

class EveryMetricTest : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryMetricTest, FindsTheDisparityOfAShiftedTexture) {
  BlockMatcherOptions options = With(GetParam());
  options.uniqueness_pct = 0;
  const auto [left, right] = ShiftedPair({120, 60}, 7, 1);
  // ngf and ugf are not 0 at equality: they prefer strong edges nearby (Fig. 3 of the paper).
  const bool prefers_strong_edges = GetParam() == "ngf" || GetParam() == "ugf";
  EXPECT_GT(ShareWithin(options, Compute(options, left, right), 7, 0.5),
            prefers_strong_edges ? 0.7 : 0.999);
}

TEST_P(EveryMetricTest, GivesTheSameBitsForAnyNumberOfThreads) {
  BlockMatcherOptions options = With(GetParam());
  const auto [left, right] = ShiftedPair({90, 150}, 5.3, 2);
  const cv::Mat1s one = Compute(options, left, right);
  for (const int threads : {2, 3, 8}) {
    options.threads = threads;
    EXPECT_EQ(cv::countNonZero(Compute(options, left, right) != one), 0) << threads;
  }
}

TEST_P(EveryMetricTest, SweepsThresholdsAsIfMatchedAnew) {
  BlockMatcherOptions options = With(GetParam());
  options.speckle_window = 10;
  const auto [left, right] = ShiftedPair({90, 40}, 5.3, 2);
  const Matches matches = BlockMatcher(options).Match(left, right);
  for (const double uniqueness : {0., 5., 15., 60.}) {
    options.uniqueness_pct = uniqueness;
    const cv::Mat1s filtered = BlockMatcher(options).Filter(matches, left, uniqueness);
    EXPECT_EQ(cv::countNonZero(filtered != Compute(options, left, right)), 0) << uniqueness;
  }
}

INSTANTIATE_TEST_SUITE_P(Table, EveryMetricTest, ::testing::ValuesIn(StereoMetrics()),
                         [](const auto& test) { return test.param; });

TEST(BlockMatcher, InterpolatesFractionsOfAPixel) {
  for (const double truth : {6.25, 6.5, 6.8}) {
    const auto [left, right] = ShiftedPair({120, 60}, truth, 5);
    for (const auto subpixel : {Subpixel::kEquiangular, Subpixel::kParabola}) {
      BlockMatcherOptions options = With("sgf");
      options.subpixel = subpixel;
      EXPECT_GT(ShareWithin(options, Compute(options, left, right), truth, 0.2), 0.95) << truth;
    }
  }
}

TEST(BlockMatcher, FindsTheSameUnderGainAndOffsetOfOneImage) {
  const auto [left, right] = ShiftedPair({120, 60}, 7.4, 6);
  cv::Mat1f changed, original;
  right.convertTo(changed, CV_32F, 0.4, 30);
  left.convertTo(original, CV_32F);
  BlockMatcherOptions options = With("sgf");
  const cv::Mat1s expected = Compute(options, left, right);
  EXPECT_LT(cv::norm(Compute(options, original, changed), expected, cv::NORM_L1) / expected.total(),
            0.02);
  options.metric = "sad";
  EXPECT_LT(ShareWithin(options, Compute(options, original, changed), 7.4, 0.5), 0.5);
}

TEST(BlockMatcher, MatchesTheLeftBorderWithinTheImage) {
  const auto [left, right] = ShiftedPair({80, 40}, 4, 7);
  BlockMatcherOptions options = With("sgf");
  options.num_disparities = 40;
  const cv::Mat1f disparity = BlockMatcher(options).ToFloat(Compute(options, left, right));
  EXPECT_GT(cv::countNonZero(cv::abs(disparity.colRange(6, 40) - 4) < 0.5), 0.95 * 34 * 40);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) EXPECT_FALSE(disparity(y, x) > static_cast<float>(x) + 0.5F);
}

TEST(BlockMatcher, AgreesWithOpenCvOnItsOwnCost) {
  const auto [left, right] = ShiftedPair({200, 80}, 9.4, 8);
  BlockMatcherOptions options = With("sad");
  options.num_disparities = 32;
  options.prefilter = Prefilter::kXSobel;
  options.left_right_max = -1;
  options.uniqueness_pct = 15;
  const cv::Mat1s ours = Compute(options, left, right);
  const auto bm = cv::StereoBM::create(32, options.window);
  bm->setTextureThreshold(0);
  cv::Mat1s opencv;
  bm->compute(left, right, opencv);
  const cv::Mat both = (ours >= 0) & (opencv >= 0);
  ASSERT_GT(cv::countNonZero(both), 8000);
  cv::Mat1b close = cv::abs(ours - opencv) <= 1;
  // Not all: the two round their sub-pixel fractions differently.
  EXPECT_GT(cv::countNonZero(close & both), 0.995 * cv::countNonZero(both));
}

TEST(BlockMatcher, DropsMatchesWithoutTexture) {
  auto [left, right] = ShiftedPair({120, 60}, 7, 1);
  left(cv::Rect(50, 20, 30, 30)) = 100;
  right(cv::Rect(43, 20, 30, 30)) = 100;
  BlockMatcherOptions options = With("sgf");
  options.uniqueness_pct = 0;
  options.left_right_max = -1;
  const cv::Rect flat(55, 25, 20, 20);
  EXPECT_EQ(cv::countNonZero(Compute(options, left, right)(flat) >= 0), 400);
  options.texture_threshold = 1;
  const cv::Mat1s filtered = Compute(options, left, right);
  EXPECT_EQ(cv::countNonZero(filtered(flat) >= 0), 0);
  EXPECT_EQ(cv::countNonZero(filtered(cv::Rect(24, 0, 20, 60)) >= 0), 1200);
}

TEST(BlockMatcher, DropsSpeckles) {
  const auto pair = ShiftedPair({120, 60}, 7, 1);
  const cv::Mat1b left = pair.first, right = pair.second;
  ShiftedPair({9, 9}, 0, 4).first.copyTo(left(cv::Rect(60, 30, 9, 9)));
  ShiftedPair({9, 9}, 0, 4).first.copyTo(right(cv::Rect(45, 30, 9, 9)));  // at disparity 15
  BlockMatcherOptions options = With("sgf");
  options.window = 5;
  const auto is_speckle = [&] {
    return std::abs(Compute(options, left, right)(34, 64) - 16 * 15) < 8;
  };
  EXPECT_TRUE(is_speckle());
  options.speckle_window = 300;
  EXPECT_FALSE(is_speckle());
}

TEST(BlockMatcher, TakesAPartOfAnImageAsAnImageOfItsOwn) {
  const auto [left, right] = ShiftedPair({120, 60}, 7, 1);
  const cv::Rect part(10, 5, 90, 50);
  for (const std::string metric : {"sgf", "agm", "census", "zncc"}) {
    BlockMatcherOptions options = With(metric);
    options.texture_threshold = 1;
    const cv::Mat1s seen = Compute(options, left(part), right(part));
    const cv::Mat1s alone = Compute(options, left(part).clone(), right(part).clone());
    EXPECT_EQ(cv::countNonZero(seen != alone), 0) << metric;
  }
}

TEST(BlockMatcher, RejectsImagesThatDoNotFit) {
  const BlockMatcher matcher(With("sgf"));
  cv::Mat1s out;
  const auto message = [&](const cv::Mat& left, const cv::Mat& right) {
    return ErrorMessage([&] { matcher.Compute(left, right, out); });
  };
  const cv::Mat good(30, 40, CV_8U, cv::Scalar(0));
  EXPECT_EQ(message(cv::Mat(), good), "left image: image is empty");
  EXPECT_EQ(message(good, cv::Mat(30, 40, CV_8UC3)), "right image: expected one channel, got 3");
  EXPECT_EQ(message(good, cv::Mat(30, 41, CV_8U)),
            "right image: is 41x30 CV_8UC1, the left image 40x30 CV_8UC1");
  EXPECT_EQ(message(good, cv::Mat(30, 40, CV_32F)),
            "right image: is 40x30 CV_32FC1, the left image 40x30 CV_8UC1");
  EXPECT_EQ(message(cv::Mat(30, 40, CV_8S), good), "left image: unsupported pixel type CV_8SC1");
  EXPECT_EQ(message(cv::Mat(30, 20, CV_8U), cv::Mat(30, 20, CV_8U)),
            "num_disparities: 24 exceeds the image's width of 20");
  EXPECT_EQ(message(cv::Mat(8, 40, CV_8U), cv::Mat(8, 40, CV_8U)),
            "window: 9 exceeds the image of 40x8");
  EXPECT_TRUE(out.empty());
  EXPECT_THROW(matcher.Filter(Matches{}, good, 100), Error);
}

TEST(BlockMatcher, RejectsAPatchMetricAndAPrefilterOnFloats) {
  const cv::Mat good(30, 40, CV_8U, cv::Scalar(0));
  EXPECT_EQ(ErrorMessage([&] { Compute(With("lssd"), good, good); }),
            "metric: 'lssd' compares patches and cannot be a stereo cost");
  BlockMatcherOptions options = With("sad");
  options.prefilter = Prefilter::kXSobel;
  const cv::Mat floats(30, 40, CV_32F, cv::Scalar(0));
  EXPECT_EQ(ErrorMessage([&] { Compute(options, floats, floats); }),
            "prefilter: needs 8-bit images, got CV_32FC1");
}

}  // namespace
}  // namespace sgf::stereo
