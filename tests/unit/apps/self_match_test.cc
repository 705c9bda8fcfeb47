#include <algorithm>
#include <cmath>
#include <fstream>
#include <span>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <sgf/apps/image_change.h>
#include <sgf/apps/self_match.h>
#include <sgf/core/random.h>
#include <sgf/io/image.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf::apps {
namespace {

using ::testing::HasSubstr;

cv::Mat1b RandomImage(int rows, int cols, uint64_t seed) {
  cv::Mat1b image(rows, cols);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x)
      image(y, x) = cv::saturate_cast<uchar>(256 * Uniform01(seed, uint64_t(y) * cols + x) - 0.5);
  return image;
}

SelfMatchResult Match(const cv::Mat& left, const cv::Mat& right, const std::string& metric,
                      const DisparityRange& range = {}, int threads = 1) {
  return MatchSelf(SampleField(left, {}), SampleField(right, {}), metric, {}, 3, range, threads);
}

const char* const kMetrics[] = {"photo", "gn", "mag", "pm", "gom", "ngf", "ugf", "sgf", "ncc"};

TEST(MatchSelf, FindsTheShiftOfTheRightImage) {
  const cv::Mat1b wide = RandomImage(20, 80, 1);
  const cv::Mat1b left = wide.colRange(0, 70), right = wide.colRange(3, 73);
  for (const char* metric : {"photo", "mag", "pm", "gom", "sgf", "ncc", "zncc"}) {
    SCOPED_TRACE(metric);
    const auto [error_px, scores] = Match(left, right, metric);
    // window and gradient reach 2 px, disparities 19 px
    EXPECT_EQ(scores.pixels, (70 - 2 - 2 - 19) * (20 - 2 - 2));
    EXPECT_EQ(scores.mean_px, 3);
    EXPECT_EQ(scores.median_px, 3);
    EXPECT_EQ(scores.bad1_pct, 100);
    EXPECT_EQ(scores.ties_pct, 0);
    EXPECT_EQ(error_px(10, 40), 3);
    EXPECT_EQ(error_px(2, 21), 3);
    for (const cv::Point outside : {cv::Point(20, 10), cv::Point(68, 10), cv::Point(40, 1)})
      EXPECT_TRUE(std::isnan(error_px(outside)));
  }
}

TEST(MatchSelf, NegativeDisparitiesAreMetOnTheOtherSide) {
  const cv::Mat1b wide = RandomImage(12, 90, 2);
  const auto [error_px, scores] =
      Match(wide.colRange(5, 85), wide.colRange(0, 80), "sgf", {.first = -20, .count = 40});
  EXPECT_EQ(scores.mean_px, 5);
  EXPECT_EQ(scores.pixels, (80 - 4 - 19 - 20) * 8);
  EXPECT_EQ(error_px(5, 57), 5);
  EXPECT_TRUE(std::isnan(error_px(5, 58)));
}

TEST(MatchSelf, TiedDisparitiesScoreTheirMean) {
  const cv::Mat1b flat(10, 60, uchar{7});
  for (const char* metric : kMetrics) {
    SCOPED_TRACE(metric);
    const SelfMatchScores forward = Match(flat, flat, metric).scores;
    EXPECT_EQ(forward.mean_px, 9.5);
    EXPECT_EQ(forward.first_px, 0);
    EXPECT_EQ(forward.median_px, 9.5);
    EXPECT_EQ(forward.ties_pct, 100);
    const SelfMatchScores both = Match(flat, flat, metric, {.first = -20, .count = 40}).scores;
    EXPECT_EQ(both.mean_px, 10);
    EXPECT_EQ(both.first_px, 20);
  }
}

TEST(MatchSelf, RepeatedStructureTiesAtItsPeriod) {
  cv::Mat1b stripes(10, 60);
  for (int x = 0; x < 60; ++x) stripes.col(x) = 40 * (x % 4) * (x % 4);
  // at 0, 4, 8, 12 and 16 px
  const SelfMatchScores scores = Match(stripes, stripes, "sgf").scores;
  EXPECT_EQ(scores.mean_px, 8);
  EXPECT_EQ(scores.ties_pct, 100);
}

// Cost of two windows by the dissimilarity's own operator.
template <class Metric>
double DirectCost(const Metric& metric, const std::vector<metrics::Sample<double>>& i,
                  const std::vector<metrics::Sample<double>>& j) {
  if constexpr (metrics::WindowMetric<Metric>) {
    return metric(std::span(i), std::span(j));
  } else if constexpr (metrics::PointMetric<Metric>) {
    double sum = 0;
    for (size_t k = 0; k < i.size(); ++k) {
      if constexpr (Metric::kDim == 1)
        sum += std::abs(metric(i[k], j[k]));
      else
        sum += metric(i[k], j[k]).norm();
    }
    return sum;
  } else {
    return NAN;
  }
}

std::vector<metrics::Sample<double>> Window(const SampleField& field, int y, int x) {
  std::vector<metrics::Sample<double>> window;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) window.push_back(field.At(y + dy, x + dx));
  return window;
}

float MeanIndexOfLeast(const std::vector<double>& costs) {
  const double least = *std::min_element(costs.begin(), costs.end());
  float count = 0, sum = 0;
  for (size_t d = 0; d < costs.size(); ++d)
    if (costs[d] < least + 1e-9) {
      ++count;
      sum += static_cast<float>(d);
    }
  return sum / count;
}

TEST(MatchSelf, AgreesWithTheDissimilaritysOwnDefinition) {
  const SampleField left(RandomImage(24, 40, 3), {}), right(RandomImage(24, 40, 4), {});
  for (const char* metric : kMetrics) {
    SCOPED_TRACE(metric);
    const cv::Mat1f error = MatchSelf(left, right, metric, {}, 3, {}, 1).error_px;
    for (const cv::Point p : {cv::Point(21, 2), cv::Point(30, 9), cv::Point(37, 21)}) {
      std::vector<double> costs;
      for (int d = 0; d < 20; ++d)
        costs.push_back(metrics::VisitMetric(metric, [&](const auto& e) {
          return DirectCost(e, Window(left, p.y, p.x), Window(right, p.y, p.x - d));
        }));
      EXPECT_EQ(error(p), MeanIndexOfLeast(costs));
    }
  }
}

TEST(MatchSelf, GainAndOffsetMoveOnlyWhatIsNotInvariantToThem) {
  cv::Mat1b image = RandomImage(60, 90, 5);
  cv::GaussianBlur(image, image, cv::Size(), 2);
  const cv::Mat changed =
      ApplyChange(image, {.exposure = 0.8, .offset = 15, .noise = 0, .quantise = false}, 1);
  EXPECT_EQ(Match(image, changed, "sgf").scores.mean_px, 0);
  EXPECT_EQ(Match(image, changed, "gom").scores.mean_px, 0);
  EXPECT_EQ(Match(image, changed, "zncc").scores.mean_px, 0);
  EXPECT_GT(Match(image, changed, "photo").scores.mean_px, 1);
}

TEST(MatchSelf, ThreadsDoNotChangeTheResult) {
  const cv::Mat1b left = RandomImage(70, 90, 6), right = RandomImage(70, 90, 7);
  for (const char* metric : {"sgf", "ncc"}) {
    const SelfMatchResult one = Match(left, right, metric, {}, 1);
    const SelfMatchResult three = Match(left, right, metric, {}, 3);
    EXPECT_EQ(one.scores.mean_px, three.scores.mean_px);
    const cv::Rect area(21, 2, 67, 66);
    EXPECT_EQ(cv::norm(one.error_px(area), three.error_px(area), cv::NORM_INF), 0);
  }
}

TEST(MatchSelf, RefusesWhatItCannotMatch) {
  const SampleField small(RandomImage(10, 23, 1), {}), tall(RandomImage(11, 23, 1), {});
  const auto message = [&](const SampleField& right, const char* metric, int window) {
    return ErrorMessage([&] { MatchSelf(small, right, metric, {}, window, {}, 1); });
  };
  EXPECT_EQ(message(small, "sgf", 3), "image: 23x10 pixels are too few for disparities 0 to 19 px");
  EXPECT_EQ(message(small, "sgf", 2), "window: must be odd and positive, got 2");
  EXPECT_EQ(message(tall, "sgf", 1), "image: the two sides differ in size");
  EXPECT_EQ(message(small, "census", 1),
            "metric: 'census' is no sum over the pixel pairs of a window");
  EXPECT_THAT(message(small, "sdf", 1), HasSubstr("'sdf' is unknown; known: photo"));
}

constexpr const char* kStudy = R"(
matching: {window: 3, ranges: [[0, 20], [-5, 5]]}
columns:
  photo: {metric: photo}
  wide: {metric: sgf, samples: {epsilon: {scope: window}}, extra: true}
cases:
  plain: {exposure: 0.9}
  noisy: {noise: 2}
curves:
  vignette: [0, 0.5]
)";

class RunSelfMatchTest : public ::testing::Test {
 protected:
  std::string Run(const std::string& study) {
    request_.name = "toy";
    request_.threads = 1;
    request_.experiment = folder_.Write("study.yaml", study).string();
    request_.image = folder_.File("image.png").string();
    WritePng(request_.image, image_);
    request_.output = folder_.File("out.csv").string();
    request_.maps = (folder_.path() / "maps").string();
    std::string text = ErrorMessage([&] { RunSelfMatch(request_); });
    const std::string& file = request_.experiment;
    return text.starts_with(file) ? text.substr(file.size()) : text;
  }

  std::vector<std::string> Lines() const {
    std::ifstream file(request_.output);
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);) lines.push_back(line);
    return lines;
  }

  TempDir folder_;
  cv::Mat1b image_ = RandomImage(30, 50, 8);
  SelfMatchRequest request_;
};

TEST_F(RunSelfMatchTest, WritesALinePerChangeRangeAndColumn) {
  ASSERT_EQ(Run(kStudy), "no error");
  const std::vector<std::string> lines = Lines();
  ASSERT_EQ(lines.size(), 1U + 2 * 2 * 2 + 2 * 2);  // curves: the first range only
  EXPECT_EQ(lines[0],
            "image,change,value,column,first_disparity,end_disparity,pixels,mean_px,first_px,"
            "median_px,bad1_pct,ties_pct");
  EXPECT_TRUE(lines[2].starts_with("toy,plain,,wide,0,20,702,0.")) << lines[2];
  EXPECT_TRUE(lines[3].starts_with("toy,plain,,photo,-5,5,962,")) << lines[3];
  EXPECT_TRUE(lines[9].starts_with("toy,vignette,0,photo,0,20,702,0.000000,")) << lines[9];
  EXPECT_TRUE(lines[12].starts_with("toy,vignette,0.5,wide,0,20,702,")) << lines[12];
}

TEST_F(RunSelfMatchTest, WritesThePicturesOfItsCases) {
  ASSERT_EQ(Run(kStudy), "no error");
  const auto maps = folder_.path() / "maps";
  EXPECT_EQ(cv::norm(ReadGrey(maps / "plain/left.png"), image_, cv::NORM_INF), 0);
  EXPECT_EQ(ReadGrey(maps / "plain/right.png")(7, 9), std::lrint(0.9 * image_(7, 9)));
  EXPECT_GT(
      cv::norm(ReadGrey(maps / "noisy/left.png"), ReadGrey(maps / "noisy/right.png"), cv::NORM_INF),
      4)
      << "both sides have noise of their own";
  const cv::Mat1b errors = ReadGrey(maps / "plain/photo.png");
  const cv::Mat1f expected =
      Match(image_, ApplyChange(image_, {.exposure = 0.9}, 0), "photo").error_px;
  EXPECT_EQ(errors(0, 0), 255);
  for (int x = 21; x < 48; ++x) EXPECT_EQ(errors(12, x), std::lrint(10 * expected(12, x)));
  EXPECT_FALSE(std::filesystem::exists(maps / "vignette"));
}

TEST_F(RunSelfMatchTest, NamesWhatIsWrongInItsFile) {
  const auto with = [](const std::string& what, const std::string& by) {
    std::string study = kStudy;
    return study.replace(study.find(what), what.size(), by);
  };
  EXPECT_EQ(Run(with("columns:", "colums:")), ": expected a map under the key 'columns'");
  EXPECT_EQ(Run(with("window: 3", "widow: 3")), ":2: unknown key 'widow'");
  EXPECT_EQ(Run(with("exposure: 0.9", "exposure: -0.9")),
            ": plain: exposure: must be finite and positive, got -0.9");
  EXPECT_EQ(Run(with("0, 0.5", "0, 1.5")), ": vignette: vignette: must be in [0, 1), got 1.5");
  EXPECT_EQ(Run(with("vignette: [", "vigete: [")), ": unknown key 'vigete'");
  EXPECT_EQ(Run(with("[0, 0.5]", "{a: 0.5}")), ":10: curves.vignette: expected a list of values");
  EXPECT_EQ(Run(with("[-5, 5]", "[5, -5]")),
            ": ranges: expected pairs of a first disparity and a larger end");
  EXPECT_THAT(Run(with("metric: photo", "metric: foto")), HasSubstr("'foto' is unknown"));
  EXPECT_EQ(Run(with("exposure: 0.9", "exposure: dark")),
            ":7: cannot read 'dark' as the value of exposure");
}

}  // namespace
}  // namespace sgf::apps
