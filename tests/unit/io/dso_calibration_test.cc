#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <sgf/io/dso_calibration.h>
#include <sgf/io/image.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::vector<double> Gamma() {
  std::vector<double> values(256);
  for (int i = 0; i < 256; ++i) values[i] = std::pow(i / 255., 2.2);
  return values;
}

class DsoCalibration : public ::testing::Test {
 protected:
  std::string PcalibMessage(const std::string& text) const {
    return ErrorMessage([&] { ReadPcalib(dir_.Write("pcalib.txt", text)); });
  }
  std::string TimesMessage(const std::string& text) const {
    return ErrorMessage([&] { ReadFrameTimes(dir_.Write("times.txt", text)); });
  }
  std::string WriteTimesMessage(const std::vector<FrameTime>& times) const {
    return ErrorMessage([&] { WriteFrameTimes(dir_.File("times.txt"), times); });
  }
  // 0, 1, ... 255 with another number at one place.
  static std::string Line(int at, const std::string& other) {
    std::string line;
    for (int i = 0; i < 256; ++i) line += (i == at ? other : std::to_string(i)) + " ";
    return line;
  }
  const TempDir dir_;
};

TEST_F(DsoCalibration, CameraIsReadInAllItsForms) {
  const auto camera = [&](const std::string& text) {
    return ReadCameraTxt(dir_.Write("camera.txt", text));
  };
  const Camera fisheye = camera("0.5 0.75 0.25 0.5 0.9\n640 480\ncrop\n640 480\n");
  EXPECT_EQ(fisheye.width, 640);
  EXPECT_EQ(fisheye.height, 480);
  EXPECT_EQ(fisheye.fx, 320);
  EXPECT_EQ(fisheye.fy, 360);
  EXPECT_EQ(fisheye.cx, 159.5);
  EXPECT_EQ(fisheye.cy, 239.5);
  EXPECT_EQ(fisheye.omega, 0.9);
  EXPECT_EQ(camera("FOV 300 310 320 240 0.9\n640 480\n").cx, 320);
  EXPECT_EQ(camera("Pinhole 1.25 1.9 0.5 0.5 0\n640 480\n").fy, 912) << "a long lens";
  EXPECT_FALSE(camera("Pinhole 300 310 320 240 0\n640 480\n").distorted());
  const Camera radtan = camera("RadTan 300 310 320 240 -0.2 0.1 0.01 0.02\n640 480\n");
  EXPECT_EQ(radtan.k1, -0.2);
  EXPECT_EQ(radtan.p2, 0.02);
}

TEST_F(DsoCalibration, CameraReportsWhatIsWrong) {
  const auto message = [&](const std::string& text) {
    return ErrorMessage([&] { ReadCameraTxt(dir_.Write("camera.txt", text)); });
  };
  EXPECT_THAT(message(""), HasSubstr("camera.txt:1: camera model '' is unknown"));
  EXPECT_THAT(message("1 2 3 4\n640 480"), HasSubstr("FOV has 4 numbers, expected 5"));
  EXPECT_THAT(message("EquiDistant 1 2 3 4 0 0 0 0\n640 480"), HasSubstr("is unknown"));
  EXPECT_THAT(message("300 300 x 240 0\n640 480"), HasSubstr("is no number"));
  EXPECT_THAT(message("Pinhole 300 300 320 240 1\n640 480"), HasSubstr("instead of 0"));
  EXPECT_THAT(message("300 300 320 240 0\n640"), HasSubstr("camera.txt:2: expected width"));
  EXPECT_THAT(message("300 300 320 240 4\n640 480"), HasSubstr("omega is 4"));
  EXPECT_THAT(message("-300 300 320 240 0\n640 480"), HasSubstr("focal lengths"));
}

TEST_F(DsoCalibration, InverseResponseReadsBack) {
  const auto path = dir_.File("pcalib.txt");
  WritePcalib(path, Gamma());
  const auto values = ReadPcalib(path);
  ASSERT_EQ(values.size(), 256U);
  for (int i = 0; i < 256; ++i) EXPECT_NEAR(values[i], Gamma()[i], 1e-15);
}

TEST_F(DsoCalibration, InverseResponseIsOneLineOf256ValuesFrom0To255) {
  const auto path = dir_.File("pcalib.txt");
  std::vector<double> linear(256);
  for (int i = 0; i < 256; ++i) linear[i] = i / 255.;
  WritePcalib(path, linear);
  const std::string text = ReadFile(path);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(std::count(text.begin(), text.end(), ' '), 255);
  EXPECT_THAT(text, StartsWith("0 1 2 3 "));
  EXPECT_THAT(text, EndsWith(" 254 255\n"));
}

TEST_F(DsoCalibration, InverseResponseIsScaledAsByDso) {
  std::string line;
  for (int i = 0; i < 256; ++i) line += std::to_string(10 + 2 * i) + " ";
  const auto values = ReadPcalib(dir_.Write("pcalib.txt", line + "\r\n"));
  EXPECT_EQ(values.front(), 0);
  EXPECT_DOUBLE_EQ(values[51], 0.2);
  EXPECT_EQ(values.back(), 1);
}

TEST_F(DsoCalibration, ABadInverseResponseIsAnErrorWithFileAndLine) {
  const std::string where = (dir_.path() / "pcalib.txt:1: ").string();
  EXPECT_EQ(PcalibMessage("0 1 2"), where + "inverse response has 3 values instead of 256");
  EXPECT_EQ(PcalibMessage(""), where + "value 0 is ''");
  EXPECT_EQ(PcalibMessage(Line(7, "x7")), where + "value 7 is 'x7'");
  EXPECT_EQ(PcalibMessage(Line(7, "nan")), where + "value 7 is 'nan'");
  EXPECT_EQ(PcalibMessage(Line(7, "6")),
            where + "inverse response is 6 at level 7 after 6; it has to increase");
  EXPECT_EQ(PcalibMessage(Line(7, "2.5")),
            where + "inverse response is 2.5 at level 7 after 6; it has to increase");
  EXPECT_EQ(PcalibMessage(Line(-1, "") + "256"),
            where + "inverse response has 257 values instead of 256");
  EXPECT_THAT(PcalibMessage(Line(-1, "") + "\n0 1 2"), EndsWith("pcalib.txt:2: expected one line"));
  EXPECT_EQ(PcalibMessage(Line(-1, "")), "no error");
  EXPECT_THAT(ErrorMessage([&] { ReadPcalib(dir_.path() / "none"); }),
              EndsWith("file does not exist"));
}

TEST_F(DsoCalibration, WritesNoInverseResponseThatDsoWouldRefuse) {
  const auto path = dir_.File("pcalib.txt");
  const auto message = [&](int at, double value) {
    auto values = Gamma();
    values[at] = value;
    return ErrorMessage([&] { WritePcalib(path, values); });
  };
  EXPECT_THAT(message(100, 0.9), HasSubstr("at level 101 after 0.9; it has to increase"));
  EXPECT_THAT(message(100, NAN), HasSubstr("inverse response is nan at level 100"));
  EXPECT_THAT(message(0, -0.5), HasSubstr("runs from -0.5 to 1 instead of 0 to 1"));
  EXPECT_THAT(message(255, 1.5), HasSubstr("runs from 0 to 1.5 instead of 0 to 1"));
  EXPECT_THAT(ErrorMessage([&] {
                WritePcalib(path, {0, 1});
              }),
              HasSubstr("has 2 values instead of 256"));
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(DsoCalibration, VignetteReadsBackTo16Bit) {
  cv::Mat1f vignette(20, 30);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 30; ++x) vignette(y, x) = 1 - 0.001F * static_cast<float>(x * y);
  const auto path = dir_.File("vignette.png");
  WriteVignette(path, vignette);
  EXPECT_LE(cv::norm(ReadVignette(path), vignette, cv::NORM_INF), 0.5001 / 65535);
  const cv::Mat levels = ReadImage(path, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(levels.type(), CV_16UC1);
  EXPECT_EQ(levels.at<uint16_t>(0, 0), 65535);
}

TEST_F(DsoCalibration, AVignetteThatIsNotInZeroToOneIsAnError) {
  const auto path = dir_.File("vignette.png");
  for (const float bad : {0.F, -0.1F, 1.001F, 1e-7F, std::nanf("")}) {
    cv::Mat1f vignette(4, 5, 1.F);
    vignette(1, 3) = bad;
    EXPECT_THAT(ErrorMessage([&] { WriteVignette(path, vignette); }),
                HasSubstr("at pixel (3, 1); it has to be in (0, 1]"))
        << bad;
    EXPECT_FALSE(std::filesystem::exists(path));
  }
  cv::Mat_<uint16_t> levels(4, 5, uint16_t{9});
  levels(1, 3) = 0;
  WritePng(path, levels);
  EXPECT_THAT(ErrorMessage([&] { ReadVignette(path); }), EndsWith("vignette is 0 at pixel (3, 1)"));
  WritePng(path, cv::Mat1b(4, 5, uint8_t{9}));
  EXPECT_THAT(ErrorMessage([&] { ReadVignette(path); }), HasSubstr("this image is CV_8UC1"));
  EXPECT_THAT(ErrorMessage([&] { WriteVignette(path, {}); }), HasSubstr("0x0"));
}

TEST_F(DsoCalibration, FrameTimesReadBackToTheNanosecond) {
  const std::vector<FrameTime> times = {{"00000", 5, 0.02},
                                        {"00001", 1403636579763555584, 5},
                                        {"1403636579813555456", 1403636579813555456, 1 / 3.}};
  const auto path = dir_.File("times.txt");
  WriteFrameTimes(path, times);
  EXPECT_EQ(ReadFrameTimes(path), times);
  EXPECT_THAT(ReadFile(path), StartsWith("00000 0.000000005 0.02\n00001 1403636579.763555584 5\n"));
}

TEST_F(DsoCalibration, FrameTimesMayHaveFewerDecimals) {
  const auto times = ReadFrameTimes(dir_.Write("times.txt", "0 1.5 2.5\r\n1 2  1e-1\n2 3. 4"));
  EXPECT_THAT(times, ElementsAre(FrameTime{"0", 1500000000, 2.5}, FrameTime{"1", 2000000000, 0.1},
                                 FrameTime{"2", 3000000000, 4}));
}

TEST_F(DsoCalibration, BadFrameTimesAreErrorsWithFileAndLine) {
  const std::string where = (dir_.path() / "times.txt:").string();
  EXPECT_EQ(TimesMessage("0 1 2\n1 2"),
            where + "2: expected id, seconds and milliseconds, got '1 2'");
  EXPECT_THAT(TimesMessage("0 1 2 3"), StartsWith(where + "1: expected id"));
  EXPECT_THAT(TimesMessage("0 1 2\n\n1 2 3"), StartsWith(where + "2: expected id"));
  EXPECT_EQ(TimesMessage("a 1 2"), where + "1: id is 'a', expected digits");
  EXPECT_EQ(TimesMessage("0 -1 2"), where + "1: time is '-1'");
  EXPECT_EQ(TimesMessage("0 .5 2"), where + "1: time is '.5'");
  EXPECT_EQ(TimesMessage("0 1.2.3 2"), where + "1: time is '1.2.3'");
  EXPECT_EQ(TimesMessage("0 9223372036854775807 2"), where + "1: time is '9223372036854775807'");
  EXPECT_EQ(TimesMessage("0 99999999999999999999 2"), where + "1: time is '99999999999999999999'");
  EXPECT_EQ(TimesMessage("0 1 2ms"), where + "1: exposure time is '2ms'");
  EXPECT_EQ(TimesMessage("0 1 0"), where + "1: exposure time is 0 ms; it has to be positive");
  EXPECT_EQ(TimesMessage("0 1 -2"), where + "1: exposure time is -2 ms; it has to be positive");
  EXPECT_EQ(TimesMessage("0 2 1\n1 2 1"),
            where + "2: time 2000000000 ns does not come after 2000000000 ns");
}

TEST_F(DsoCalibration, WritesNoFrameTimesThatItWouldNotRead) {
  EXPECT_THAT(WriteTimesMessage({{"0", 1, 1}, {"left 1", 2, 1}}),
              EndsWith("times.txt:2: id is 'left 1', expected digits"));
  EXPECT_THAT(WriteTimesMessage({{"", 1, 1}}), EndsWith("times.txt:1: id is '', expected digits"));
  EXPECT_THAT(WriteTimesMessage({{"0", -1, 1}}), EndsWith("times.txt:1: time is -1 ns"));
  EXPECT_THAT(WriteTimesMessage({{"0", 1, NAN}}), HasSubstr("exposure time is nan ms"));
  EXPECT_THAT(WriteTimesMessage({{"0", 2, 1}, {"1", 1, 1}}), HasSubstr("does not come after"));
  EXPECT_FALSE(std::filesystem::exists(dir_.path() / "times.txt"));
}

}  // namespace
}  // namespace sgf
