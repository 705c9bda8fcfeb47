#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/io/calib.h>
#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/io/read_file.h>
#include <sgf/io/stereo_dataset.h>

#include "support/encoded_images.h"
#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::StartsWith;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

std::vector<std::string> Names(const std::vector<StereoScene>& scenes) {
  std::vector<std::string> names;
  for (const auto& scene : scenes) names.push_back(scene.name);
  return names;
}

class StereoDatasetTest : public ::testing::Test {
 protected:
  // A grey image of one level, so that a test can tell which file was read.
  void WriteImage(const std::string& file, int rows, int cols, int level,
                  int type = CV_8UC1) const {
    dir_.Write(file, Encode(file.substr(file.rfind('.')),
                            cv::Mat(rows, cols, type, cv::Scalar::all(level))));
  }
  void WriteEval3Scene(const std::string& name) const {
    WriteImage(name + "/im0.png", 1, 3, 10, CV_8UC3);
    WriteImage(name + "/im1.png", 1, 3, 20, CV_8UC3);
    WriteDisparityPfm(dir_.File(name + "/disp0GT.pfm"), (cv::Mat1f(1, 3) << 1.5, kNan, 2));
    dir_.Write(name + "/mask0nocc.png", Encode(".png", (cv::Mat1b(1, 3) << 255, 255, 128)));
    dir_.Write(name + "/calib.txt", "width=3\nndisp=64\n");
  }
  // A scene of another Middlebury layout: 8-bit truth of one level.
  StereoPair LoadOnly(StereoLayout layout) const {
    const auto scenes = ListStereoScenes(dir_.path(), layout);
    EXPECT_EQ(scenes.size(), 1U);
    return LoadStereoScene(scenes.at(0));
  }
  std::string ListMessage(const std::filesystem::path& folder, StereoLayout layout) const {
    return ErrorMessage([&] { ListStereoScenes(folder, layout); });
  }
  std::string LoadMessage(StereoLayout layout) const {
    return ErrorMessage([&] { LoadOnly(layout); });
  }
  const TempDir dir_;
};

TEST_F(StereoDatasetTest, LoadsAMiddleburyEval3Scene) {
  WriteEval3Scene("Teddy");
  const StereoPair pair = LoadOnly(StereoLayout::kMiddleburyEval3);
  EXPECT_EQ(pair.name, "Teddy");
  EXPECT_EQ(pair.num_disparities, 64);
  ASSERT_EQ(pair.left.type(), CV_8UC3);
  EXPECT_EQ(pair.left.at<cv::Vec3b>(0), cv::Vec3b(10, 10, 10));
  EXPECT_EQ(pair.right.at<cv::Vec3b>(0), cv::Vec3b(20, 20, 20));
  EXPECT_EQ(pair.truth_all(0), 1.5F);
  EXPECT_TRUE(std::isnan(pair.truth_all(1)));
  EXPECT_EQ(pair.truth_all(2), 2.F);
  EXPECT_EQ(pair.truth_noc(0), 1.5F);
  EXPECT_TRUE(std::isnan(pair.truth_noc(1)));
  EXPECT_TRUE(std::isnan(pair.truth_noc(2))) << "the mask is 128 there";
}

TEST_F(StereoDatasetTest, ListsScenesByNameAndLeavesOtherFoldersOut) {
  for (const char* name : {"b", "a", "c"}) WriteEval3Scene(name);
  dir_.Write("notes/readme.txt", "no scene");
  dir_.Write("im0.png", "a file beside the scenes");
  EXPECT_THAT(Names(ListStereoScenes(dir_.path(), StereoLayout::kMiddleburyEval3)),
              ElementsAre("a", "b", "c"));
}

TEST_F(StereoDatasetTest, LoadsAnEval3SceneWithoutMaskCalibrationAndTruth) {
  WriteImage("Test/im0.png", 2, 2, 1);
  WriteImage("Test/im1.png", 2, 2, 2);
  const StereoPair pair = LoadOnly(StereoLayout::kMiddleburyEval3);
  EXPECT_EQ(pair.left.type(), CV_8UC1);
  EXPECT_TRUE(pair.truth_all.empty());
  EXPECT_TRUE(pair.truth_noc.empty());
  EXPECT_EQ(pair.num_disparities, 0);
  WriteDisparityPfm(dir_.File("Test/disp0.pfm"), cv::Mat1f(2, 2, 3.F));
  EXPECT_EQ(LoadOnly(StereoLayout::kMiddleburyEval3).truth_all(1, 1), 3.F);
  EXPECT_TRUE(LoadOnly(StereoLayout::kMiddleburyEval3).truth_noc.empty());
}

TEST_F(StereoDatasetTest, NamesABadCalibration) {
  WriteEval3Scene("Teddy");
  dir_.Write("Teddy/calib.txt", "width=3\n");
  EXPECT_EQ(ListMessage(dir_.path(), StereoLayout::kMiddleburyEval3),
            dir_.File("Teddy/calib.txt").string() + ": has no key ndisp");
}

TEST_F(StereoDatasetTest, LoadsMiddlebury2001WithItsTwoScales) {
  WriteImage("venus/im2.ppm", 2, 4, 1, CV_8UC3);
  WriteImage("venus/im6.ppm", 2, 4, 2, CV_8UC3);
  WriteImage("venus/disp2.pgm", 2, 4, 100);
  WriteImage("tsukuba/scene1.row3.col3.ppm", 2, 4, 3, CV_8UC3);
  WriteImage("tsukuba/scene1.row3.col4.ppm", 2, 4, 4, CV_8UC3);
  WriteImage("tsukuba/truedisp.row3.col3.pgm", 2, 4, 72);
  const auto scenes = ListStereoScenes(dir_.path(), StereoLayout::kMiddlebury2001);
  ASSERT_THAT(Names(scenes), ElementsAre("tsukuba", "venus"));
  const StereoPair tsukuba = LoadStereoScene(scenes[0]);
  EXPECT_EQ(tsukuba.truth_all(0), 4.5F);
  EXPECT_EQ(tsukuba.right.at<cv::Vec3b>(0)[0], 4);
  const StereoPair venus = LoadStereoScene(scenes[1]);
  EXPECT_EQ(venus.truth_all(0), 12.5F);
  EXPECT_EQ(venus.left.at<cv::Vec3b>(0)[0], 1);
  EXPECT_EQ(venus.right.at<cv::Vec3b>(0)[0], 2);
  EXPECT_TRUE(venus.truth_noc.empty());
}

struct SizedTruth {
  StereoLayout layout;
  int rows, cols, level;
  float disparity;
};

class ScaledTruthTest : public StereoDatasetTest,
                        public ::testing::WithParamInterface<SizedTruth> {};

TEST_P(ScaledTruthTest, TellsTheScaleFromTheSize) {
  const SizedTruth& p = GetParam();
  const bool is_2003 = p.layout == StereoLayout::kMiddlebury2003;
  WriteImage(is_2003 ? "cones/im2.png" : "cones/view1.png", p.rows, p.cols, 1);
  WriteImage(is_2003 ? "cones/im6.png" : "cones/view5.png", p.rows, p.cols, 2);
  WriteImage(is_2003 ? "cones/disp2.png" : "cones/disp1.png", p.rows, p.cols, p.level);
  const StereoPair pair = LoadOnly(p.layout);
  EXPECT_EQ(pair.left.at<uint8_t>(0), 1);
  EXPECT_EQ(pair.right.at<uint8_t>(0), 2);
  EXPECT_EQ(pair.truth_all(0), p.disparity);
}

INSTANTIATE_TEST_SUITE_P(
    All, ScaledTruthTest,
    ::testing::Values(SizedTruth{StereoLayout::kMiddlebury2003, 3, 450, 90, 22.5F},
                      SizedTruth{StereoLayout::kMiddlebury2003, 3, 900, 90, 45.F},
                      SizedTruth{StereoLayout::kMiddlebury2003, 3, 1800, 90, 90.F},
                      SizedTruth{StereoLayout::kMiddlebury2006, 1110, 3, 60, 60.F},
                      SizedTruth{StereoLayout::kMiddlebury2006, 555, 3, 60, 30.F},
                      SizedTruth{StereoLayout::kMiddlebury2006, 370, 3, 60, 20.F}));

TEST_F(StereoDatasetTest, RejectsASizeThatTellsNoScale) {
  WriteImage("cones/im2.png", 3, 451, 1);
  WriteImage("cones/im6.png", 3, 451, 2);
  WriteImage("cones/disp2.png", 3, 451, 90);
  EXPECT_EQ(LoadMessage(StereoLayout::kMiddlebury2003),
            dir_.File("cones/disp2.png").string() +
                ": image width is 451, which tells no disparity scale");
}

TEST_F(StereoDatasetTest, LoadsMiddlebury2003FromPpm) {
  WriteImage("teddyH/im2.ppm", 3, 900, 1, CV_8UC3);
  WriteImage("teddyH/im6.ppm", 3, 900, 2, CV_8UC3);
  WriteImage("teddyH/disp2.pgm", 3, 900, 3);
  EXPECT_EQ(LoadOnly(StereoLayout::kMiddlebury2003).truth_all(0), 1.5F);
}

TEST_F(StereoDatasetTest, LoadsKitti2015WithEitherKindOfTruth) {
  for (const char* file : {"000000_10.png", "000001_10.png", "000001_11.png"}) {
    WriteImage(std::string("image_2/") + file, 2, 3, 1, CV_8UC3);
    WriteImage(std::string("image_3/") + file, 2, 3, 2, CV_8UC3);
  }
  WriteDisparityPng16(dir_.File("disp_occ_0/000000_10.png"), cv::Mat1f(2, 3, 5.5F));
  WriteDisparityPng16(dir_.File("disp_noc_0/000001_10.png"), cv::Mat1f(2, 3, 6.5F));
  const auto scenes = ListStereoScenes(dir_.path(), StereoLayout::kKitti2015);
  ASSERT_THAT(Names(scenes), ElementsAre("000000", "000001"));
  const StereoPair occ = LoadStereoScene(scenes[0]);
  ASSERT_FALSE(occ.truth_all.empty());
  EXPECT_EQ(occ.truth_all(0), 5.5F);
  EXPECT_TRUE(occ.truth_noc.empty());
  EXPECT_EQ(occ.num_disparities, 0);
  EXPECT_EQ(occ.right.at<cv::Vec3b>(0)[0], 2);
  const StereoPair noc = LoadStereoScene(scenes[1]);
  EXPECT_TRUE(noc.truth_all.empty());
  EXPECT_EQ(noc.truth_noc(0), 6.5F);
}

TEST_F(StereoDatasetTest, LoadsKitti2012InColourOrGrey) {
  WriteImage("image_0/000007_10.png", 2, 3, 1);
  WriteImage("image_1/000007_10.png", 2, 3, 2);
  WriteDisparityPng16(dir_.File("disp_occ/000007_10.png"), cv::Mat1f(2, 3, 5.F));
  WriteDisparityPng16(dir_.File("disp_noc/000007_10.png"), cv::Mat1f(2, 3, 6.F));
  const StereoPair grey = LoadOnly(StereoLayout::kKitti2012);
  EXPECT_EQ(grey.left.type(), CV_8UC1);
  EXPECT_EQ(grey.right.at<uint8_t>(0), 2);
  EXPECT_EQ(grey.truth_all(0), 5.F);
  EXPECT_EQ(grey.truth_noc(0), 6.F);
  WriteImage("colored_0/000007_10.png", 2, 3, 3, CV_8UC3);
  WriteImage("colored_1/000007_10.png", 2, 3, 4, CV_8UC3);
  const StereoPair colour = LoadOnly(StereoLayout::kKitti2012);
  EXPECT_EQ(colour.left.type(), CV_8UC3);
  EXPECT_EQ(colour.right.at<cv::Vec3b>(0)[0], 4);
}

TEST_F(StereoDatasetTest, NamesAFolderThatIsMissingOrHoldsNoScene) {
  const auto missing = dir_.path() / "missing";
  for (const auto& [name, layout] : EnumNames(StereoLayout{})) {
    EXPECT_EQ(ListMessage(missing, layout), missing.string() + ": folder does not exist") << name;
    EXPECT_EQ(ListMessage(dir_.path(), layout),
              dir_.path().string() + ": holds no stereo pair of the expected layout")
        << name;
  }
}

TEST_F(StereoDatasetTest, NamesAMissingRightImage) {
  WriteEval3Scene("Teddy");
  std::filesystem::remove(dir_.File("Teddy/im1.png"));
  EXPECT_EQ(LoadMessage(StereoLayout::kMiddleburyEval3),
            dir_.File("Teddy/im1.png").string() + ": file does not exist");
}

TEST_F(StereoDatasetTest, NamesTheFileOfAnotherSizeAndBothSizes) {
  const auto but_left = [&] { return ", but " + dir_.File("Teddy/im0.png").string() + " is 3x1"; };
  WriteEval3Scene("Teddy");
  WriteImage("Teddy/mask0nocc.png", 2, 2, 255);
  EXPECT_EQ(LoadMessage(StereoLayout::kMiddleburyEval3),
            dir_.File("Teddy/mask0nocc.png").string() + ": is 2x2" + but_left());
  WriteDisparityPfm(dir_.File("Teddy/disp0GT.pfm"), cv::Mat1f(1, 6, 1.F));
  EXPECT_EQ(LoadMessage(StereoLayout::kMiddleburyEval3),
            dir_.File("Teddy/disp0GT.pfm").string() + ": is 6x1" + but_left());
  WriteImage("Teddy/im1.png", 3, 1, 0);
  EXPECT_EQ(LoadMessage(StereoLayout::kMiddleburyEval3),
            dir_.File("Teddy/im1.png").string() + ": is 1x3" + but_left());
}

TEST_F(StereoDatasetTest, NamesATruncatedTruth) {
  WriteEval3Scene("Teddy");
  dir_.Write("Teddy/disp0GT.pfm", "Pf\n3 1\n-1\nabc");
  EXPECT_THAT(LoadMessage(StereoLayout::kMiddleburyEval3),
              EndsWith("disp0GT.pfm: truncated PFM: 3x1 values of 4 bytes, but 3 bytes of data"));
}

// --- Writing in Middlebury's layout ---

class WriteMiddleburySceneTest : public ::testing::Test {
 protected:
  static cv::Mat Noise(int type) {
    cv::Mat image(3, 4, type);
    cv::RNG(5).fill(image, cv::RNG::UNIFORM, 0, 256);
    return image;
  }

  // Visible but for an occluded pixel and one of unknown disparity.
  static StereoPair Pair() {
    StereoPair pair;
    pair.left = Noise(CV_8UC3);
    pair.right = 255 - pair.left;
    pair.truth_all = (cv::Mat1f(3, 4) << 1.25, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12.5);
    pair.truth_all(1, 2) = kNan;
    pair.truth_noc = pair.truth_all.clone();
    pair.truth_noc(2, 0) = kNan;
    return pair;
  }

  static MiddleburyCalib Calib() { return {458.25, 1.5, 1.25, 0.75, 0.11, 4, 3, 64}; }

  std::string Message(const StereoPair& pair, const MiddleburyCalib& calib) const {
    return ErrorMessage([&] { WriteMiddleburyScene(folder_, pair, calib); });
  }

  const TempDir dir_;
  const std::filesystem::path folder_ = dir_.path() / "pairs" / "room_0";
};

bool SameOrBothNan(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }

void ExpectSameTruth(const cv::Mat1f& a, const cv::Mat1f& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), SameOrBothNan)) << a << '\n' << b;
}

TEST_F(WriteMiddleburySceneTest, IsReadBackAsItWas) {
  const StereoPair written = Pair();
  WriteMiddleburyScene(folder_, written, Calib());
  const StereoPair read = LoadStereoScene(FindMiddleburyScene(folder_));
  EXPECT_EQ(read.name, "room_0");
  EXPECT_EQ(read.num_disparities, 64);
  EXPECT_EQ(cv::norm(read.left, written.left, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(read.right, written.right, cv::NORM_INF), 0);
  ExpectSameTruth(read.truth_all, written.truth_all);
  ExpectSameTruth(read.truth_noc, written.truth_noc);
}

TEST_F(WriteMiddleburySceneTest, MarksVisibleOccludedAndUnknownPixels) {
  WriteMiddleburyScene(folder_, Pair(), Calib());
  const cv::Mat1b mask = ReadGrey(folder_ / "mask0nocc.png");
  const cv::Mat1b expected =
      (cv::Mat1b(3, 4) << 255, 255, 255, 255, 255, 255, 0, 255, 128, 255, 255, 255);
  EXPECT_EQ(cv::norm(mask, expected, cv::NORM_INF), 0) << mask;
}

TEST_F(WriteMiddleburySceneTest, WritesTheCalibrationInMiddleburysForm) {
  WriteMiddleburyScene(folder_, Pair(), Calib());
  EXPECT_EQ(ReadFile(folder_ / "calib.txt"),
            "cam0=[458.25 0 1.5; 0 458.25 1.25; 0 0 1]\n"
            "cam1=[458.25 0 2.25; 0 458.25 1.25; 0 0 1]\n"
            "doffs=0.75\nbaseline=110\nwidth=4\nheight=3\nndisp=64\nisint=0\n"
            "vmin=1\nvmax=13\ndyavg=0\ndymax=0\n");
  const MiddleburyCalib read = ReadMiddleburyCalib(folder_ / "calib.txt");
  EXPECT_EQ(read.f, 458.25);
  EXPECT_EQ(read.cx, 1.5);
  EXPECT_EQ(read.cy, 1.25);
  EXPECT_EQ(read.doffs, 0.75);
  EXPECT_DOUBLE_EQ(read.baseline_m, 0.11);
  EXPECT_EQ(cv::Size(read.width, read.height), cv::Size(4, 3));
  EXPECT_EQ(read.ndisp, 64);
}

TEST_F(WriteMiddleburySceneTest, NamesWhatIsMissingOrOfAnotherSizeAndWritesNothing) {
  StereoPair pair = Pair();
  pair.truth_noc.release();
  EXPECT_EQ(Message(pair, Calib()),
            folder_.string() + ": truth_noc is 0x0, the calibration's size 4x3");
  MiddleburyCalib calib = Calib();
  calib.width = 5;
  EXPECT_EQ(Message(Pair(), calib),
            folder_.string() + ": left image is 4x3, the calibration's size 5x3");
  pair = Pair();
  pair.truth_all.setTo(kNan);
  EXPECT_EQ(Message(pair, Calib()), folder_.string() + ": the ground truth knows no disparity");
  EXPECT_FALSE(std::filesystem::exists(folder_));
}

TEST_F(WriteMiddleburySceneTest, NamesAFolderThatCannotBeMadeOrFound) {
  dir_.Write("pairs", "a file");
  EXPECT_THAT(Message(Pair(), Calib()), StartsWith(folder_.string() + ": cannot be made: "));
  EXPECT_EQ(ErrorMessage([&] { FindMiddleburyScene(folder_); }),
            folder_.string() + ": folder does not exist");
}

}  // namespace
}  // namespace sgf
