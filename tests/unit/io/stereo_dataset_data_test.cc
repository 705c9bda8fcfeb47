#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/io/stereo_dataset.h>

// Reads the datasets under SGF_DATA. Expected counts and means were taken from the files with
// NumPy.

namespace sgf {
namespace {

struct TruthFacts {
  int pixels = 0;
  double mean_px = 0;
};

TruthFacts FactsOf(const cv::Mat1f& truth) {
  TruthFacts facts;
  for (const float d : truth)
    if (std::isfinite(d)) {
      ++facts.pixels;
      facts.mean_px += d;
    }
  facts.mean_px /= facts.pixels;
  return facts;
}

StereoPair Load(const std::vector<StereoScene>& scenes, const std::string& name) {
  for (const auto& scene : scenes)
    if (scene.name == name) return LoadStereoScene(scene);
  ADD_FAILURE() << "no scene " << name;
  return {};
}

const std::filesystem::path kRoot = std::getenv("SGF_DATA");

TEST(StereoData, MiddleburyQuarterSize) {
  const auto scenes = ListStereoScenes(kRoot / "middlebury2014/MiddEval3/trainingQ",
                                       StereoLayout::kMiddleburyEval3);
  EXPECT_EQ(scenes.size(), 15U);
  for (const auto& scene : scenes) {
    const StereoPair pair = LoadStereoScene(scene);
    EXPECT_EQ(pair.left.type(), CV_8UC3) << scene.name;
    EXPECT_GT(pair.num_disparities, 0) << scene.name;
    EXPECT_LT(FactsOf(pair.truth_noc).pixels, FactsOf(pair.truth_all).pixels) << scene.name;
  }
  const StereoPair teddy = Load(scenes, "Teddy");
  EXPECT_EQ(teddy.left.size(), cv::Size(450, 375));
  EXPECT_EQ(teddy.num_disparities, 64);
  EXPECT_EQ(FactsOf(teddy.truth_all).pixels, 164812);
  EXPECT_NEAR(FactsOf(teddy.truth_all).mean_px, 27.409337608911972, 1e-9);
  EXPECT_EQ(FactsOf(teddy.truth_noc).pixels, 146765);
}

TEST(StereoData, Kitti2015) {
  const auto scenes =
      ListStereoScenes(kRoot / "kitti2015/data_scene_flow/training", StereoLayout::kKitti2015);
  EXPECT_GE(scenes.size(), 12U);
  const StereoPair first = Load(scenes, "000001");
  EXPECT_EQ(first.left.size(), cv::Size(1242, 375));
  EXPECT_EQ(first.num_disparities, 0);
  EXPECT_EQ(FactsOf(first.truth_all).pixels, 107175);
  EXPECT_EQ(FactsOf(first.truth_noc).pixels, 106133);
  EXPECT_NEAR(FactsOf(first.truth_noc).mean_px, 36.05330443288138, 1e-9);
  const StereoPair second = Load(scenes, "000002");
  EXPECT_EQ(FactsOf(second.truth_noc).pixels, 100125);
}

}  // namespace
}  // namespace sgf
