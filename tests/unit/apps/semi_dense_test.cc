#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <sgf/apps/semi_dense.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/stereo_images.h"
#include "support/temp_dir.h"

namespace sgf::apps {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kF = 100, kBaseline = 0.2, kDoffs = 10;

MiddleburyCalib Calib(cv::Size size) {
  return {kF, 0.5 * size.width, 0.5 * size.height, kDoffs, kBaseline, size.width, size.height, 32};
}

SemiDenseOptions Options(const std::string& metric, int left_right_max) {
  SemiDenseOptions options;
  options.matcher.metric = metric;
  options.matcher.window = 5;
  options.matcher.gradient = GradientOperator::kCentral;
  options.matcher.uniqueness_pct = 0;
  options.matcher.left_right_max = left_right_max;
  return options;
}

// Vertical steps: from column x on, a row is brighter by `height`.
struct Step {
  int x, height;
};

cv::Mat1b Steps(cv::Size size, const std::vector<Step>& steps) {
  cv::Mat1b image(size, 40);
  for (const Step& step : steps) image.colRange(step.x, size.width) += step.height;
  return image;
}

StereoPair Pair(const cv::Mat1b& left, const cv::Mat1b& right, const cv::Mat1f& truth) {
  StereoPair pair;
  pair.name = "toy";
  pair.left = left;
  pair.right = right;
  pair.truth_all = truth;
  pair.truth_noc = truth.clone();
  return pair;
}

// --- Selection ---

TEST(SelectPixelsTest, TakesStrongGradientsThatTheRowShows) {
  cv::Mat1b image = Steps({40, 30}, {{10, 10}, {20, 8}});  // gradients 5 and 4 on two columns each
  image.rowRange(20, 30) += 100;
  const cv::Mat1b selected = SelectPixels(image, Options("sgf", 1));
  cv::Mat1b expected = cv::Mat1b::zeros(image.size());
  expected.colRange(9, 11).setTo(255);
  expected(cv::Range(19, 21), cv::Range(19, 21)).setTo(255);  // 4 along the row, 50 across
  EXPECT_EQ(cv::norm(selected, expected, cv::NORM_INF), 0) << selected;
}

// --- A slanted plane, whose exact points are known ---

constexpr double kAt0 = 4, kPerColumn = 0.05, kPerRow = 0.03;

double PlaneDisparity(double x, double y) { return kAt0 + kPerColumn * x + kPerRow * y; }

// right(x - d(x, y)) = left(x) for the disparities of the plane.
StereoPair SlantedPlane(cv::Size size) {
  const cv::Mat1b left = TexturedImage(size, 7);
  cv::Mat1f truth(size), from_x(size), from_y(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      truth(y, x) = static_cast<float>(PlaneDisparity(x, y));
      from_x(y, x) = static_cast<float>((x + kAt0 + kPerRow * y) / (1 - kPerColumn));
      from_y(y, x) = static_cast<float>(y);
    }
  cv::Mat1b right;
  cv::remap(left, right, from_x, from_y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return Pair(left, right, truth);
}

constexpr int kWidth = 160, kHeight = 90;

TEST(SemiDensePlane, TruePointsLieOnThePlane) {
  const MiddleburyCalib calib = Calib({kWidth, kHeight});
  const SemiDenseDepth depth =
      TrueSemiDense(SlantedPlane({kWidth, kHeight}), calib, Options("sgf", 1));
  ASSERT_GT(depth.points.size(), 1000U);
  // (d + doffs) Z = f B, with d affine in x = cx + f X / Z and y = cy + f Y / Z
  const double at_centre = PlaneDisparity(calib.cx, calib.cy) + kDoffs;
  for (const SemiDensePoint& p : depth.points) {
    const auto [x, y, z] = p.position;
    EXPECT_NEAR(at_centre * z + kPerColumn * kF * x + kPerRow * kF * y, kF * kBaseline, 1e-4);
    EXPECT_EQ(p.depth_error, 0);
  }
  EXPECT_EQ(depth.scores.kept_pct, 100);
  EXPECT_EQ(depth.scores.p90_m, 0);
  EXPECT_EQ(depth.scores.bad_pct, 0);
}

TEST(SemiDensePlane, SgfFindsIt) {
  const SemiDenseDepth depth = ReconstructSemiDense(SlantedPlane({kWidth, kHeight}),
                                                    Calib({kWidth, kHeight}), Options("sgf", 1));
  EXPECT_GT(depth.scores.candidates, 1000);
  EXPECT_GT(depth.scores.kept_pct, 90);
  EXPECT_LT(depth.scores.median_pct, 0.5);
  EXPECT_LT(depth.scores.p90_pct, 2);
  EXPECT_LT(depth.scores.bad_pct, 2);
}

// --- Fig. 3: a strong edge beside a weak one of the same direction ---

constexpr int kToyShift = 5;
const cv::Size kToySize(64, 24);

// Two candidates a row on the strong edge, two on the weak one.
StereoPair TwoEdges() {
  const std::vector<Step> left{{20, 100}, {40, 20}};
  const std::vector<Step> right{{20 - kToyShift, 100}, {40 - kToyShift, 20}};
  return Pair(Steps(kToySize, left), Steps(kToySize, right), cv::Mat1f(kToySize, kToyShift));
}

SemiDenseScores ScoresOfTwoEdges(const std::string& metric, int left_right_max) {
  return ReconstructSemiDense(TwoEdges(), Calib(kToySize), Options(metric, left_right_max)).scores;
}

TEST(SemiDenseAssociation, UgfAndNgfTakeTheStrongerEdgeForTheWeakOne) {
  for (const char* metric : {"ugf", "ngf"}) {
    const SemiDenseScores scores = ScoresOfTwoEdges(metric, -1);
    EXPECT_EQ(scores.candidates, 4 * kToySize.height) << metric;
    EXPECT_EQ(scores.kept_pct, 100) << metric;
    EXPECT_EQ(scores.bad_pct, 50) << metric;
    EXPECT_EQ(scores.bad_stronger_pct, 100) << metric;
  }
}

TEST(SemiDenseAssociation, SgfTakesEachEdgeForItself) {
  for (const int left_right_max : {-1, 1}) {
    const SemiDenseScores scores = ScoresOfTwoEdges("sgf", left_right_max);
    EXPECT_EQ(scores.kept_pct, 100);
    EXPECT_EQ(scores.bad_pct, 0);
    EXPECT_TRUE(std::isnan(scores.bad_stronger_pct)) << "there is no bad point";
    EXPECT_LT(scores.p90_pct, 1e-3);
  }
}

TEST(SemiDenseAssociation, TheLeftRightCheckDropsWhatTheStrongerEdgeTook) {
  const SemiDenseScores scores = ScoresOfTwoEdges("ugf", 1);
  EXPECT_EQ(scores.kept_pct, 50);
  EXPECT_EQ(scores.bad_pct, 0);
}

TEST(SemiDenseAssociation, StrengthIsRelativeToTheImage) {
  StereoPair pair = TwoEdges();
  pair.right.convertTo(pair.right, -1, 0.15);  // the strong edge has become the weaker one
  const SemiDenseScores scores =
      ReconstructSemiDense(pair, Calib(kToySize), Options("ugf", -1)).scores;
  EXPECT_EQ(scores.bad_pct, 50);
  EXPECT_EQ(scores.bad_stronger_pct, 100);
}

// --- Scores ---

// Two candidates a row, found at disparity 0 (the images are equal) while the truth of row y is
// 0.1 y: depth f B / 10 where f B / (10 + 0.1 y) is true, y % off.
SemiDenseDepth OffByRows(int rows) {
  const cv::Mat1b image = Steps({40, rows}, {{20, 50}});
  cv::Mat1f truth(image.size());
  for (int y = 0; y < rows; ++y) truth.row(y).setTo(0.1 * y);
  SemiDenseOptions options = Options("sgf", 1);
  options.bad_pct = 5.5;
  return ReconstructSemiDense(Pair(image, image, truth), Calib(image.size()), options);
}

TEST(SemiDenseScores, AreThoseOfKnownErrors) {
  const SemiDenseDepth depth = OffByRows(10);
  const SemiDenseScores& scores = depth.scores;
  EXPECT_EQ(scores.candidates, 20);
  EXPECT_EQ(scores.kept, 20);
  EXPECT_NEAR(scores.median_pct, 4, 1e-4);  // 0 0 1 1 ... 9 9
  EXPECT_NEAR(scores.p90_pct, 8, 1e-4);
  const double found_m = kF * kBaseline / kDoffs;
  EXPECT_NEAR(scores.median_m, found_m - found_m / 1.04, 1e-6);
  EXPECT_NEAR(scores.p90_m, found_m - found_m / 1.08, 1e-6);
  EXPECT_EQ(scores.bad_pct, 40);
  EXPECT_EQ(scores.bad_stronger_pct, 0);
  ASSERT_EQ(depth.points.size(), 20U);
  const SemiDensePoint& last = depth.points.back();
  EXPECT_NEAR(last.position[0], (20 - 20.) / kF * found_m, 1e-6);
  EXPECT_NEAR(last.position[1], (9 - 5.) / kF * found_m, 1e-6);
  EXPECT_NEAR(last.position[2], found_m, 1e-6);
  EXPECT_NEAR(last.depth_error, found_m - found_m / 1.09, 1e-6);
  EXPECT_EQ(last.grey, 90);
}

TEST(SemiDenseScores, DisparitiesWithoutDepthAreNotKept) {
  const cv::Mat1b image = Steps(kToySize, {{20, 50}});
  MiddleburyCalib calib = Calib(kToySize);
  calib.doffs = 0;
  const SemiDenseScores scores =
      ReconstructSemiDense(Pair(image, image, cv::Mat1f(kToySize, 3)), calib, Options("sgf", 1))
          .scores;
  EXPECT_EQ(scores.candidates, 2 * kToySize.height);
  EXPECT_EQ(scores.kept, 0);
  EXPECT_EQ(scores.kept_pct, 0);
  EXPECT_TRUE(std::isnan(scores.median_m));
  EXPECT_TRUE(std::isnan(scores.bad_pct));
}

TEST(SemiDenseScores, PixelsOfUnknownDepthAreNoCandidates) {
  StereoPair pair = TwoEdges();
  pair.truth_all.rowRange(0, 10).setTo(std::numeric_limits<float>::quiet_NaN());
  const SemiDenseScores scores =
      ReconstructSemiDense(pair, Calib(kToySize), Options("sgf", 1)).scores;
  EXPECT_EQ(scores.candidates, 4 * (kToySize.height - 10));
}

TEST(ReconstructSemiDenseTest, NamesAPairThatIsNoKnownScene) {
  StereoPair pair = TwoEdges();
  const auto message = [&](const MiddleburyCalib& calib) {
    return ErrorMessage([&] { ReconstructSemiDense(pair, calib, Options("sgf", 1)); });
  };
  EXPECT_EQ(message(Calib({65, 24})), "toy: images are 64x24, calib.txt says 65x24");
  pair.truth_all.release();
  EXPECT_EQ(message(Calib(kToySize)), "toy: has no ground truth");
}

// --- Files ---

TEST(ToPlyTest, HoldsPointsInBinary) {
  const std::string text = ToPly({{{1.F, -2.F, 0.5F}, 200, -0.25F}});
  EXPECT_THAT(text, StartsWith("ply\nformat binary_little_endian 1.0\nelement vertex 1\n"));
  const std::string header_end = "property float depth_error\nend_header\n";
  const std::string data = text.substr(text.find(header_end) + header_end.size());
  const std::string expected(
      "\x00\x00\x80\x3f\x00\x00\x00\xc0\x00\x00\x00\x3f\xc8\xc8\xc8\x00\x00\x80\xbe", 19);
  EXPECT_EQ(data, expected);
}

constexpr const char* kExperiment =
    "name: toy\n"
    "study: {min_gradient: 5, matcher: {gradient: central, window: 5, uniqueness_pct: 0}}\n"
    "cases:\n"
    "  search: {matcher: {left_right_max: -1}}\n"
    "  changed: {matcher: {left_right_max: 1}, right: {exposure: 0.5}}\n"
    "columns:\n"
    "  ugf: {options: {metric: ugf}}\n"
    "  sgf: {options: {metric: sgf}}\n"
    "  photo: {options: {metric: sad}, extra: true}\n";

class RunSemiDenseTest : public ::testing::Test {
 protected:
  RunSemiDenseTest() { WriteMiddleburyScene(dir_.path() / "toy", TwoEdges(), Calib(kToySize)); }

  void Run(const std::string& experiment, const std::string& out, int threads = 1) const {
    const auto file = dir_.Write("experiment.yaml", experiment);
    RunSemiDense(
        {file.string(), (dir_.path() / "toy").string(), (dir_.path() / out).string(), threads});
  }

  // The experiment with one text in the place of another.
  static std::string With(const std::string& text, const std::string& by) {
    std::string experiment = kExperiment;
    return experiment.replace(experiment.find(text), text.size(), by);
  }

  std::string MessageWith(const std::string& text, const std::string& by) const {
    return ErrorMessage([&] { Run(With(text, by), "out"); });
  }

  std::string Read(const std::string& file) const { return ReadFile(dir_.path() / file); }

  const TempDir dir_;
};

TEST_F(RunSemiDenseTest, WritesScoresOfAllAndPointsOfWhatIsDrawn) {
  Run(kExperiment, "out");
  const std::string scores = Read("out/scores.csv");
  EXPECT_THAT(scores, StartsWith("pair,case,column,candidates,kept,kept_pct,median_m,p90_m,"
                                 "median_pct,p90_pct,bad_pct,bad_stronger_pct\n"
                                 "toy,search,ugf,96,96,100.0000,"));
  EXPECT_THAT(scores, HasSubstr("\ntoy,changed,ugf,96,48,50.0000,"));
  EXPECT_THAT(scores, HasSubstr("\ntoy,changed,sgf,96,96,100.0000,"));
  EXPECT_THAT(scores, HasSubstr("\ntoy,changed,photo,96,"));
  EXPECT_THAT(Read("out/truth.ply"), HasSubstr("element vertex 96\n"));
  EXPECT_THAT(Read("out/changed/ugf.ply"), HasSubstr("element vertex 48\n"));
  EXPECT_THAT(Read("out/options.yaml"), HasSubstr("exposure: 0.5"));
  EXPECT_FALSE(std::filesystem::exists(dir_.path() / "out/search/photo.ply"));
}

TEST_F(RunSemiDenseTest, ChangesTheRightImage) {
  Run(kExperiment, "changed");
  Run(With("exposure: 0.5", "exposure: 1"), "unchanged");
  EXPECT_NE(Read("changed/scores.csv"), Read("unchanged/scores.csv")) << "photo does not withstand";
}

TEST_F(RunSemiDenseTest, ThreadsDoNotShow) {
  Run(kExperiment, "one", 1);
  Run(kExperiment, "two", 2);
  for (const char* file : {"/scores.csv", "/search/sgf.ply", "/changed/ugf.ply"})
    EXPECT_EQ(Read(std::string("one") + file), Read(std::string("two") + file)) << file;
}

TEST_F(RunSemiDenseTest, NamesWhatIsWrongInTheExperiment) {
  EXPECT_THAT(MessageWith("study:", "studies:"),
              EndsWith("experiment.yaml: key 'study' is missing or no map"));
  EXPECT_THAT(MessageWith("min_gradient: 5", "gradient: 5"),
              EndsWith("experiment.yaml:2: unknown key 'gradient'"));
  EXPECT_THAT(MessageWith("right:", "left:"), EndsWith("experiment.yaml:5: unknown key 'left'"));
  EXPECT_THAT(MessageWith("metric: ugf", "metric: abc"),
              StartsWith("metric: 'abc' is unknown; known: "));
  EXPECT_THAT(MessageWith("window: 5", "window: 4"), EndsWith("window: is 4; it has to be odd"));
  EXPECT_THAT(MessageWith("min_gradient: 5", "min_gradient: -5"),
              EndsWith("min_gradient: must not be negative, got -5"));
  EXPECT_THAT(MessageWith("min_gradient: 5", "bad_pct: .nan"),
              EndsWith("bad_pct: must not be negative, got nan"));
  EXPECT_THAT(MessageWith("exposure: 0.5", "exposure: -1"), HasSubstr("exposure"));
}

TEST_F(RunSemiDenseTest, NamesAMissingPair) {
  std::filesystem::remove_all(dir_.path() / "toy");
  EXPECT_EQ(ErrorMessage([&] { Run(kExperiment, "out"); }),
            (dir_.path() / "toy").string() + ": folder does not exist");
}

}  // namespace
}  // namespace sgf::apps
