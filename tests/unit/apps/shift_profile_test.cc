#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/apps/shift_profile.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf::apps {
namespace {

using ::testing::ElementsAre;

constexpr int kSeeds = 20;

// Edges of the experiment's toy, as shifts of the reference in px.
constexpr int kStrongEdge = -80, kInvertedEdge = -40;

bool Near(int shift, int edge) { return std::abs(shift - edge) <= 1; }

bool Has(const std::vector<Minimum>& minima, int edge) {
  return std::any_of(minima.begin(), minima.end(),
                     [&](const Minimum& m) { return Near(m.shift, edge); });
}

int BestShift(const Profile& profile) {
  const auto least = std::min_element(profile.errors.begin(), profile.errors.end());
  return profile.first + static_cast<int>(least - profile.errors.begin());
}

// What the paper says below its Fig. 2, as questions to a profile.
struct Statements {
  bool single_minimum_at_truth, prefers_the_stronger_edge, minimum_at_inverted_edge;

  Statements(const Profile& profile, const ProfileOptions& options) {
    const std::vector<Minimum> minima = FindMinima(profile, options);
    single_minimum_at_truth = minima.size() == 1 && Near(minima[0].shift, 0);
    prefers_the_stronger_edge = Near(BestShift(profile), kStrongEdge);
    minimum_at_inverted_edge = Has(minima, kInvertedEdge);
  }
};

class FigureTwo : public ::testing::Test {
 protected:
  FigureTwo()
      : study_(ReadShiftStudy(std::string(SGF_EXPERIMENTS) + "/fig2.yaml")),
        toy_(MakeToy(study_.toy)) {}

  std::map<std::string, Statements> Row(double noise) const {
    const ShiftRow row = MakeShiftRow(study_, toy_, noise);
    std::map<std::string, Statements> statements;
    for (size_t m = 0; m < row.profiles.size(); ++m)
      statements.emplace(study_.profile.metrics[m], Statements(row.profiles[m], study_.profile));
    return statements;
  }

  static void ExpectThePapersMinima(const std::map<std::string, Statements>& row) {
    EXPECT_TRUE(row.at("sgf").single_minimum_at_truth);
    EXPECT_FALSE(row.at("sgf").prefers_the_stronger_edge);
    EXPECT_FALSE(row.at("sgf").minimum_at_inverted_edge);
    EXPECT_TRUE(row.at("ugf").prefers_the_stronger_edge);
    EXPECT_FALSE(row.at("ugf").single_minimum_at_truth);
    EXPECT_TRUE(row.at("mag").minimum_at_inverted_edge);
    EXPECT_FALSE(row.at("mag").single_minimum_at_truth);
    EXPECT_TRUE(row.at("photo").single_minimum_at_truth);
  }

  ShiftStudy study_;
  Toy toy_;
};

TEST_F(FigureTwo, ToyHasTheEdgesThatTheStatementsNeed) {
  ASSERT_THAT(toy_.edges, ElementsAre(kStrongEdge, kInvertedEdge, 0, 40, 80));
  const std::vector<double>& levels = study_.toy.levels;
  const double reference = levels[3] - levels[2];
  EXPECT_GT(levels[1] - levels[0], 3 * reference) << "a stronger edge of the same orientation";
  EXPECT_EQ(levels[2] - levels[1], -reference) << "an inverted edge of the same strength";
}

TEST_F(FigureTwo, NoiseFreeMinimaAreWhereThePaperPutsThem) { ExpectThePapersMinima(Row(0)); }

TEST_F(FigureTwo, NoisyMinimaAreWhereThePaperPutsThemForEverySeed) {
  ASSERT_GT(study_.noise, 1);
  for (study_.seed = 1; study_.seed <= kSeeds; ++study_.seed) {
    SCOPED_TRACE(study_.seed);
    ExpectThePapersMinima(Row(study_.noise));
  }
}

TEST(Toy, IsTheBoxesBeforeTheBlur) {
  const Toy toy = MakeToy({.levels = {10, 20, 30},
                           .reference_edge = 1,
                           .box_width = 4,
                           .box_height = 3,
                           .small_box = 2,
                           .small_rows = 1,
                           .small_levels = {1, 2},
                           .blur = 0});
  const cv::Mat1b expected = (cv::Mat1b(7, 12) << 1, 1, 2, 2, 1, 1, 2, 2, 1, 1, 2, 2,  //
                              1, 1, 2, 2, 1, 1, 2, 2, 1, 1, 2, 2,                      //
                              10, 10, 10, 10, 20, 20, 20, 20, 30, 30, 30, 30,          //
                              10, 10, 10, 10, 20, 20, 20, 20, 30, 30, 30, 30,          //
                              10, 10, 10, 10, 20, 20, 20, 20, 30, 30, 30, 30,          //
                              1, 1, 2, 2, 1, 1, 2, 2, 1, 1, 2, 2,                      //
                              1, 1, 2, 2, 1, 1, 2, 2, 1, 1, 2, 2);
  EXPECT_EQ(cv::norm(toy.image, expected, cv::NORM_INF), 0);
  EXPECT_EQ(toy.reference, cv::Point(8, 3));
  EXPECT_THAT(toy.edges, ElementsAre(-4, 0));
}

TEST(ShiftPatch, IsTheMeanOverThePatchAtEveryShift) {
  cv::Mat1b image(9, 30, uchar{50});
  image.col(12) = 80;
  const SampleField field(image, {});
  ProfileOptions options;
  options.patch_width = 3;
  options.patch_height = 5;
  const Profile profile = ShiftPatch(field, field, {12, 4}, "photo", options);
  ASSERT_EQ(profile.first, 2 - 12);
  ASSERT_EQ(profile.errors.size(), 26U);
  EXPECT_EQ(profile.errors[10], 0);   // no shift
  EXPECT_EQ(profile.errors[11], 20);  // 30 in two of three columns
  EXPECT_EQ(profile.errors[9], 20);   //
  EXPECT_EQ(profile.errors[14], 10);  // in one
  EXPECT_EQ(ShiftPatch(field, field, {12, 4}, "ncc", options).errors[10], 0) << "not divided";
  EXPECT_GT(ShiftPatch(field, field, {12, 4}, "ncc", options).errors[14], 0.02);
}

TEST(FindMinima, TakesTheLeastInReachThatIsDeepEnough) {
  //                       -2 -1  0  1  2  3  4  5  6  7  8
  const Profile profile{-2, {0, 9, 2, 9, 1, 9, 9, 5, 9, 9, 1}};
  const auto shifts = [&](double share, int distance) {
    std::vector<int> found;
    ProfileOptions options;
    options.minimum_share = share;
    options.minimum_distance = distance;
    for (const Minimum& m : FindMinima(profile, options)) found.push_back(m.shift);
    return found;
  };
  EXPECT_THAT(shifts(0.3, 1), ElementsAre(0, 2)) << "neither the ends nor the shallow one at 5";
  EXPECT_THAT(shifts(0.6, 1), ElementsAre(0, 2, 5));
  EXPECT_THAT(shifts(0.6, 3), ElementsAre(2)) << "the end at 8 is in reach of 5";
  const Profile flat{0, {3, 1, 1, 3, 3, 3, 3}};
  EXPECT_EQ(FindMinima(flat, {}).size(), 1U) << "the first of equals";
}

TEST(RunShiftProfile, WritesWhatTheFigureNeeds) {
  const TempDir folder;
  const std::string experiment = std::string(SGF_EXPERIMENTS) + "/fig2.yaml";
  RunShiftProfile({experiment, (folder.path() / "out").string()});
  for (const char* name : {"profiles.csv", "minima.csv", "edges.csv", "noise_free.png", "noisy.png",
                           "noise_free_ax.pfm", "noise_free_ay.pfm", "noisy_ax.pfm"})
    EXPECT_TRUE(std::filesystem::exists(folder.path() / "out" / name)) << name;
  std::ifstream minima(folder.path() / "out" / "minima.csv");
  std::string header, line;
  std::getline(minima, header);
  std::getline(minima, line);
  EXPECT_EQ(header, "row,metric,shift_px,error,least");
  EXPECT_TRUE(line.starts_with("noise_free,ugf,-80,")) << line;
}

TEST(RunShiftProfile, NamesWhatIsWrongInItsFile) {
  const TempDir folder;
  const auto message = [&](const char* yaml) {
    const std::string file = folder.Write("study.yaml", yaml).string();
    std::string text = ErrorMessage([&] { RunShiftProfile({file, folder.path().string()}); });
    return text.starts_with(file) ? text.substr(file.size()) : text;
  };
  EXPECT_EQ(message("name: x"), ": key 'study' is missing");
  EXPECT_EQ(message("study:\n  colour: red"), ":2: unknown key 'colour'");
  EXPECT_EQ(message("study: {toy: {levels: [1, 300]}}"), "levels: must be in [0, 255], got 300");
  EXPECT_EQ(message("study: {toy: {reference_edge: 5}}"), "reference_edge: 6 boxes have no edge 5");
  EXPECT_EQ(message("study: {toy: {small_box: 0}}"), "small_box: must be at least 1, got 0");
  EXPECT_EQ(message("study: {profile: {patch_width: 4}}"),
            "patch: sides must be odd and positive, got 4 x 41 px");
  EXPECT_EQ(message("study: {profile: {patch_height: 95}}"),
            "patch: 11 x 95 px do not fit into the image around (120, 48)");
  EXPECT_EQ(message("study: {profile: {metrics: [lssd]}}"),
            "metric: 'lssd' is no sum over the pixel pairs of a window");
  EXPECT_EQ(message("study: {profile: {minimum_distance: -1}}"),
            "minimum_distance: must be at least 1, got -1");
  EXPECT_EQ(message("study: {profile: {minimum_share: 0}}"),
            "minimum_share: must be in (0, 1], got 0");
  EXPECT_EQ(message("study: {noise: -1}"), "noise: must be finite and not negative, got -1");
}

}  // namespace
}  // namespace sgf::apps
