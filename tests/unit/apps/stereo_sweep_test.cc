#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/image_change.h>
#include <sgf/apps/stereo_sweep.h>
#include <sgf/io/image.h>
#include <sgf/io/pfm.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/stereo_images.h"
#include "support/temp_dir.h"

namespace sgf::apps {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kDisparity = 6;

// One pair, a sweep of two windows and some changes.
class StereoSweepTest : public ::testing::Test {
 protected:
  void SetUp() override {
    WritePair(ShiftedPair({100, 60}, kDisparity, 1));
    dir_.Write("sweep.yaml",
               "name: toy\nmatcher: stereo_bm\ncolumns:\n  sad: {options: {metric: sad}}\n"
               "  sgf: {options: {metric: sgf}}\noptions: {left_right_max: 1}\n"
               "grid: {windows: [5, 9], uniqueness: [0]}\n");
    dir_.Write("changes.yaml",
               "changes:\n  none: {}\n  dim: {gamma: 2.2, exposure: 0.6, vignette: 0.5}\n"
               "  fractional: {quantise: false}\n  odd: {exposition: 2}\n");
  }

  void WritePair(const std::pair<cv::Mat1b, cv::Mat1b>& pair) const {
    WritePng(dir_.File("data/Wall/im0.png"), pair.first);
    WritePng(dir_.File("data/Wall/im1.png"), pair.second);
    WritePfm(dir_.File("data/Wall/disp0GT.pfm"),
             cv::Mat1f(pair.first.size(), static_cast<float>(kDisparity)));
    dir_.Write("data/Wall/calib.txt", "width=100\nndisp=16\n");
  }

  StereoSweepRequest Request(const std::string& column) const {
    StereoSweepRequest request;
    request.experiment = dir_.path() / "sweep.yaml";
    request.dataset = "walls";
    request.column = column;
    request.output = dir_.path() / "scores.csv";
    request.options_output = dir_.path() / "options.yaml";
    return request;
  }
  StereoSweepRequest Changed(const std::string& column, const std::string& change) const {
    StereoSweepRequest request = Request(column);
    request.changes = dir_.path() / "changes.yaml";
    request.change = change;
    return request;
  }

  // The lines of the CSV file as maps from its header's names.
  std::vector<std::map<std::string, std::string>> Run(const StereoSweepRequest& request) const {
    StereoDatasetEntry entry;
    entry.name = request.dataset;
    RunStereoSweep(request, entry, dir_.path() / "data");
    std::istringstream csv(ReadFile(request.output));
    std::string header, line;
    std::getline(csv, header);
    std::vector<std::map<std::string, std::string>> lines;
    while (std::getline(csv, line)) {
      std::istringstream names(header), values(line);
      std::string name, value;
      lines.emplace_back();
      while (std::getline(names, name, ',') && std::getline(values, value, ','))
        lines.back()[name] = value;
    }
    return lines;
  }
  std::string Message(const StereoSweepRequest& request) const {
    return ErrorMessage([&] { Run(request); });
  }

  TempDir dir_;
};

TEST_F(StereoSweepTest, AChangeOfNothingChangesNothing) {
  EXPECT_EQ(Run(Changed("sad", "none")), Run(Request("sad")));
}

TEST_F(StereoSweepTest, AChangeIsMadeToTheRightImageOnly) {
  const auto changed = Run(Changed("sad", "dim"));
  auto pair = ShiftedPair({100, 60}, kDisparity, 1);
  pair.second = ApplyChange(pair.second, {.gamma = 2.2, .exposure = 0.6, .vignette = 0.5}, 1);
  WritePair(pair);
  EXPECT_EQ(changed, Run(Request("sad")));
}

TEST_F(StereoSweepTest, SgfStandsAChangeThatSadDoesNot) {
  const auto invalid = [&](const std::string& column) {
    const auto lines = Run(Changed(column, "dim"));
    return std::stod(lines.at(0).at("invalid_pct"));
  };
  EXPECT_LT(invalid("sgf"), 20);
  EXPECT_GT(invalid("sad"), 40);
}

TEST_F(StereoSweepTest, OptionsNameTheChange) {
  Run(Changed("sgf", "dim"));
  const YAML::Node options = LoadYamlFile(dir_.path() / "options.yaml");
  EXPECT_EQ(options["change"]["gamma"].as<double>(), 2.2);
  EXPECT_TRUE(options["change"]["encode"].as<bool>());
  Run(Request("sgf"));
  EXPECT_FALSE(LoadYamlFile(dir_.path() / "options.yaml")["change"]);
}

TEST_F(StereoSweepTest, OneWindowOfTheGrid) {
  StereoSweepRequest request = Request("sgf");
  const auto all = Run(request);
  ASSERT_EQ(all.size(), 2u);
  request.window = 9;
  EXPECT_THAT(Run(request), ElementsAre(all[1]));
  request.window = 7;
  EXPECT_THAT(Message(request), EndsWith("sweep.yaml: has no window 7 in its grid"));
}

TEST_F(StereoSweepTest, NamesWhatIsWrongWithAChange) {
  const std::string file = dir_.path() / "changes.yaml";
  EXPECT_EQ(Message(Changed("sgf", "dusk")), file + ": has no change 'dusk'");
  EXPECT_THAT(Message(Changed("sgf", "fractional")), StartsWith(file + ": quantise must be true"));
  EXPECT_EQ(Message(Changed("sgf", "odd")), file + ":5: unknown key 'exposition'");
  for (const char* text : {"[]", "change: {}", "changes: 3"}) {
    dir_.Write("changes.yaml", text);
    EXPECT_THAT(Message(Changed("sgf", "dim")), HasSubstr("a map 'changes'")) << text;
  }
}

}  // namespace
}  // namespace sgf::apps
