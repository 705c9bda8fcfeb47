#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <sgf/apps/convergence.h>
#include <sgf/core/random.h>
#include <sgf/io/image.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf::apps {
namespace {

using ::testing::HasSubstr;

constexpr const char* kStudy = R"(
study:
  points: 60
  start_px: [1, 10]
  resamples: 20
columns:
  photo: {residual: photo, compared: true}
  ngv: {residual: ngv, compared: true}
  ngv_tile: {residual: ngv, epsilon: {scope: tile}}
cases:
  plain: {}
  offset: {change: {offset: 40}}
  roll: {roll_deg: 15, motion: se2, start_px: [1], start_deg: [10]}
  scale: {scale: 1.2, motion: similarity, start_px: [1], start_pct: [10]}
  pyramid: {levels: 3, start_px: [10]}
)";

// The study with one thing changed.
std::string With(const std::string& what, const std::string& by) {
  std::string study = kStudy;
  return study.replace(study.find(what), what.size(), by);
}

// Blobs of a few pixels, at grey levels that an offset of 40 does not clip.
cv::Mat1b Blobs(cv::Size size, uint64_t seed) {
  cv::Mat1f noise(size);
  uint64_t index = 0;
  for (float& value : noise) value = static_cast<float>(Gaussian(seed, index++));
  cv::GaussianBlur(noise, noise, cv::Size(), 3);
  cv::normalize(noise, noise, 20, 200, cv::NORM_MINMAX);
  cv::Mat1b image;
  noise.convertTo(image, CV_8U);
  return image;
}

class ConvergenceTest : public ::testing::Test {
 protected:
  std::string Run(const std::string& study, int threads) {
    ConvergenceRequest request;
    request.experiment = folder_.Write("study.yaml", study).string();
    request.output = folder_.File("out.csv").string();
    request.threads = threads;
    for (const int k : {0, 1}) {
      request.images.push_back(folder_.File(std::to_string(k) + ".png").string());
      WritePng(request.images.back(), Blobs({200, 160}, k));
    }
    return ErrorMessage([&] { RunConvergence(request); });
  }

  std::string Table() const { return ReadFile(folder_.path() / "out.csv"); }

  // Value of a field of a line that starts with the key.
  double Value(const std::string& key, const std::string& field) const {
    std::istringstream lines(Table());
    std::string header, line;
    std::getline(lines, header);
    while (std::getline(lines, line))
      if (line.starts_with(key + ",")) return std::stod(Field(header, line, field));
    ADD_FAILURE() << "no line " << key;
    return 0;
  }

 private:
  static std::string Field(const std::string& header, const std::string& line,
                           const std::string& field) {
    std::istringstream names(header), values(line);
    std::string name, value;
    while (std::getline(names, name, ',') && std::getline(values, value, ','))
      if (name == field) return value;
    return "";
  }

  TempDir folder_;
};

TEST_F(ConvergenceTest, WritesALinePerCaseStartAndColumn) {
  ASSERT_EQ(Run(kStudy, 1), "no error");
  const std::string table = Table();
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + 3 * (2 + 2 + 2 + 2 + 1));
  EXPECT_THAT(table, HasSubstr("\nplain,translation,1,px,1,ngv_tile,ngv,tile,false,60,"));
  EXPECT_THAT(table, HasSubstr("\nroll,se2,1,deg,10,photo,photo,image,true,60,"));
  EXPECT_THAT(table, HasSubstr("\nscale,similarity,1,pct,10,ngv,ngv,image,true,60,"));
}

TEST_F(ConvergenceTest, IsTheSameOnAnyNumberOfThreads) {
  ASSERT_EQ(Run(kStudy, 1), "no error");
  const std::string one = Table();
  ASSERT_EQ(Run(kStudy, 3), "no error");
  EXPECT_EQ(Table(), one);
}

TEST_F(ConvergenceTest, FindsTheTruePlaceUnderEveryMotion) {
  ASSERT_EQ(Run(kStudy, 2), "no error");
  for (const std::string line : {"plain,translation,1,px,1", "roll,se2,1,px,1", "roll,se2,1,deg,10",
                                 "scale,similarity,1,px,1", "scale,similarity,1,pct,10"})
    for (const std::string column : {",photo", ",ngv"}) {
      EXPECT_GE(Value(line + column, "converged"), 55) << line << column;
      EXPECT_LT(Value(line + column, "own_median_px"), 0.03) << line << column;
    }
}

TEST_F(ConvergenceTest, TellsWhatAnOffsetDoesToWhom) {
  ASSERT_EQ(Run(kStudy, 2), "no error");
  const std::string line = "offset,translation,1,px,1,";
  EXPECT_GE(Value(line + "ngv", "converged"), 55);
  EXPECT_LE(Value(line + "photo", "converged"), 40);
  // The common set has no more than either, and its size is the same for both.
  EXPECT_LE(Value(line + "ngv", "common"), Value(line + "photo", "converged"));
  EXPECT_EQ(Value(line + "ngv", "common"), Value(line + "photo", "common"));
  EXPECT_EQ(Value(line + "ngv_tile", "common"), 0) << "not compared";
}

TEST_F(ConvergenceTest, ReachesFartherWithAPyramid) {
  ASSERT_EQ(Run(kStudy, 2), "no error");
  EXPECT_GE(Value("pyramid,translation,3,px,10,photo", "converged"),
            Value("plain,translation,1,px,10,photo", "converged") + 15);
}

TEST_F(ConvergenceTest, TracksWithDerivativesAsExtracted) {
  ASSERT_EQ(Run(With("photo: {residual: photo", "exact: {residual: sgf3"), 2), "no error");
  const double exact = Value("plain,translation,1,px,1,exact", "own_median_px");
  ASSERT_EQ(Run(With("photo: {residual: photo", "as_extracted: {residual: sgf3_as_extracted"), 2),
            "no error");
  EXPECT_GT(Value("plain,translation,1,px,1,as_extracted", "own_median_px"), exact);
}

TEST_F(ConvergenceTest, NamesWhatIsWrong) {
  EXPECT_THAT(Run(With("columns:", "colums:"), 1), HasSubstr("expected a map under the key 'col"));
  EXPECT_THAT(Run(With("points: 60", "pints: 60"), 1), HasSubstr(":3: unknown key 'pints'"));
  EXPECT_THAT(Run(With("points: 60", "points: 6000"), 1), HasSubstr("case plain: the images have"));
  EXPECT_THAT(Run(With("residual: ngv", "residual: ngx"), 1), HasSubstr("'ngx' is unknown"));
  EXPECT_THAT(Run(With("residual: ngv", "residual: bit_planes"), 1),
              HasSubstr("columns.ngv: 'bit_planes' cannot be tracked here"));
  EXPECT_THAT(Run(With("motion: se2", "motion: translation"), 1),
              HasSubstr("cases.roll: start_deg needs motion se2 or similarity"));
  EXPECT_THAT(Run(With("scale: 1.2", "scale: 0"), 1),
              HasSubstr("cases.scale: scale must be finite and positive"));
  EXPECT_THAT(Run(With("start_px: [1, 10]", "start_px: [0]"), 1),
              HasSubstr("cases.plain: starts must be above 0"));
}

}  // namespace
}  // namespace sgf::apps
