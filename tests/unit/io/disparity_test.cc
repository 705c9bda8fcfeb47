#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/io/pfm.h>

#include "support/encoded_images.h"
#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

TEST(Disparity, ReadsPfmWithInfinityAsNone) {
  const TempDir dir;
  WritePfm(dir.File("a.pfm"), (cv::Mat1f(1, 5) << 1.25, kInf, -kInf, kNan, 0));
  const cv::Mat1f disparity = ReadDisparity(dir.File("a.pfm"));
  EXPECT_EQ(disparity(0), 1.25F);
  for (int i = 1; i < 4; ++i) EXPECT_TRUE(std::isnan(disparity(i))) << i;
  EXPECT_EQ(disparity(4), 0.F) << "zero is a disparity in a PFM";
}

TEST(Disparity, ReadsSixteenBitPngInUnitsOf256th) {
  const TempDir dir;
  const cv::Mat levels = (cv::Mat_<uint16_t>(1, 4) << 0, 1, 640, 65535);
  const cv::Mat1f disparity = ReadDisparity(dir.Write("a.png", Encode(".png", levels)), 4);
  EXPECT_TRUE(std::isnan(disparity(0)));
  EXPECT_EQ(disparity(1), 1 / 256.F);
  EXPECT_EQ(disparity(2), 2.5F) << "the scale is that of 8-bit maps only";
  EXPECT_EQ(disparity(3), 65535 / 256.F);
}

TEST(Disparity, ReadsEightBitMapsByTheirScale) {
  const TempDir dir;
  const cv::Mat levels = (cv::Mat1b(1, 3) << 0, 60, 255);
  for (const char* extension : {".png", ".pgm"}) {
    const auto path = dir.Write("map", Encode(extension, levels));
    const cv::Mat1f third = ReadDisparity(path, 3);
    EXPECT_TRUE(std::isnan(third(0)));
    EXPECT_EQ(third(1), 20.F);
    EXPECT_EQ(third(2), 85.F);
    EXPECT_EQ(ReadDisparity(path)(1), 60.F);
  }
}

TEST(Disparity, RejectsColourBadScalesAndMissingFiles) {
  const TempDir dir;
  const auto colour = dir.Write("a.png", Encode(".png", RandomImage(3, 3, CV_8UC3)));
  EXPECT_THAT(ErrorMessage([&] { ReadDisparity(colour); }),
              EndsWith("a.png: a disparity map has one channel, this image has 3"));
  for (const double scale : {0., -4., double{kNan}, double{kInf}})
    EXPECT_THAT(ErrorMessage([&] { ReadDisparity(colour, scale); }),
                HasSubstr("disparity scale is"));
  EXPECT_THAT(ErrorMessage([&] { ReadDisparity(dir.path() / "missing.pfm"); }),
              EndsWith("missing.pfm: file does not exist"));
  EXPECT_THAT(ErrorMessage([&] { ReadDisparity(dir.Write("a.pfm", "PF\n1 1\n-1\n")); }),
              HasSubstr("is a colour PFM"));
}

TEST(Disparity, WritesNoneAsInfinityToPfm) {
  const TempDir dir;
  WriteDisparityPfm(dir.File("a.pfm"), (cv::Mat1f(1, 4) << 3.5, kNan, -kInf, kInf));
  const cv::Mat1f stored = ReadPfm(dir.File("a.pfm"));
  EXPECT_EQ(stored(0), 3.5F);
  for (int i = 1; i < 4; ++i) EXPECT_EQ(stored(i), kInf) << i;
}

TEST(Disparity, WritingToPfmLeavesTheMapAsItIs) {
  const TempDir dir;
  const cv::Mat1f map = (cv::Mat1f(1, 1) << kNan);
  WriteDisparityPfm(dir.File("a.pfm"), map);
  EXPECT_TRUE(std::isnan(map(0)));
}

TEST(Disparity, WritesSixteenBitLevels) {
  const TempDir dir;
  WriteDisparityPng16(dir.File("a.png"),
                      (cv::Mat1f(1, 7) << kNan, kInf, 0, 0.001, 2.5, 1.9990, 65535 / 256.));
  const cv::Mat levels = ReadImage(dir.File("a.png"), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(levels.type(), CV_16UC1);
  const cv::Mat expected = (cv::Mat_<uint16_t>(1, 7) << 0, 0, 1, 1, 640, 512, 65535);
  EXPECT_EQ(cv::norm(levels, expected, cv::NORM_INF), 0) << levels;
}

TEST(Disparity, RejectsWhatSixteenBitsCannotHold) {
  const TempDir dir;
  const auto message = [&](float value) {
    const cv::Mat1f map = (cv::Mat1f(2, 2) << 1, 2, 3, value);
    return ErrorMessage([&] { WriteDisparityPng16(dir.File("a.png"), map); });
  };
  EXPECT_THAT(message(256), EndsWith("a.png: disparity 256 at (1, 1) is outside of [0, 255.996]"));
  EXPECT_THAT(message(-0.25F), HasSubstr("disparity -0.25 at (1, 1)"));
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

// Twice a value in range for each none.
rc::Gen<float> Disparities() {
  return rc::gen::map(rc::gen::inRange(-600'000, 1'200'000), [](int n) {
    return n < 0 ? kNan : static_cast<float>(n * (kMaxDisparityPng16 / 1.2e6));
  });
}

RC_GTEST_PROP(DisparityProperty, Png16KeepsDisparitiesToHalfAStepAndNone, ()) {
  const auto values = *rc::gen::nonEmpty(rc::gen::container<std::vector<float>>(Disparities()));
  const cv::Mat1f map(1, static_cast<int>(values.size()), const_cast<float*>(values.data()));
  const TempDir dir;
  WriteDisparityPng16(dir.File("a.png"), map);
  const cv::Mat1f read = ReadDisparity(dir.File("a.png"));
  for (int i = 0; i < map.cols; ++i) {
    RC_ASSERT(std::isnan(read(i)) == std::isnan(map(i)));
    const float step = map(i) < 1 / 512.F ? 1 / 256.F : 1 / 512.F;
    RC_ASSERT(std::isnan(map(i)) || std::abs(read(i) - map(i)) <= step);
  }
}

}  // namespace
}  // namespace sgf
