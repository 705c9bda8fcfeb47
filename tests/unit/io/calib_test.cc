#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/io/calib.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::EndsWith;

class CalibTest : public ::testing::Test {
 protected:
  int Read(const std::string& text) const { return ReadCalibNdisp(dir_.Write("calib.txt", text)); }
  std::string Message(const std::string& text) const {
    return ErrorMessage([&] { Read(text); });
  }
  const TempDir dir_;
};

TEST_F(CalibTest, ReadsNdispAmongTheOtherKeys) {
  EXPECT_EQ(
      Read("cam0=[1500 0 199; 0 1500 187; 0 0 1]\ndoffs=52\nbaseline=80\nndisp=64\nisint=0\n"), 64);
}

TEST_F(CalibTest, ReadsBlanksEmptyLinesAndWindowsLineEnds) {
  EXPECT_EQ(Read("\r\n  ndisp = 280 \r\n\r\nvmin=3\r\n"), 280);
}

TEST_F(CalibTest, NamesFileAndKeyWithoutNdisp) {
  EXPECT_THAT(Message("width=450\n"), EndsWith("calib.txt: has no key ndisp"));
  EXPECT_THAT(Message(""), EndsWith("calib.txt: has no key ndisp"));
  EXPECT_THAT(Message("ndisparities=64\n"), EndsWith("calib.txt: has no key ndisp"));
}

TEST_F(CalibTest, NamesFileAndLineOfWhatItCannotRead) {
  EXPECT_THAT(Message("width=450\nndisp 64\n"),
              EndsWith("calib.txt:2: expected key=value, got 'ndisp 64'"));
  for (const char* value : {"", "0", "-5", "64.5", "many", "99999999999"})
    EXPECT_THAT(
        Message(std::string("width=450\nheight=3\nndisp=") + value),
        EndsWith(std::string("calib.txt:3: ndisp is '") + value + "', expected a positive number"));
}

constexpr const char* kWhole =
    "cam0=[994.978 0 311.193; 0 994.978 254.5; 0 0 1]\n"
    "cam1=[994.978 0 343.971; 0 994.978 254.5; 0 0 1]\n"
    "doffs=32.778\nbaseline=193.001\nwidth=741\nheight=497\nndisp=70\nisint=0\n";

TEST_F(CalibTest, ReadsAWholeCalibration) {
  const MiddleburyCalib calib = ReadMiddleburyCalib(dir_.Write("calib.txt", kWhole));
  EXPECT_EQ(calib.f, 994.978);
  EXPECT_EQ(calib.cx, 311.193);
  EXPECT_EQ(calib.cy, 254.5);
  EXPECT_EQ(calib.doffs, 32.778);
  EXPECT_DOUBLE_EQ(calib.baseline_m, 0.193001);
  EXPECT_EQ(calib.width, 741);
  EXPECT_EQ(calib.height, 497);
  EXPECT_EQ(calib.ndisp, 70);
  EXPECT_DOUBLE_EQ(calib.Depth(17.222), 994.978 * 0.193001 / 50);
}

// A line of the whole calibration in the place of another.
struct BadValue {
  std::string line, by, message;
};

class BadCalibTest : public CalibTest, public ::testing::WithParamInterface<BadValue> {};

TEST_P(BadCalibTest, NamesKeyAndValue) {
  std::string text = kWhole;
  const size_t at = text.find(GetParam().line);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, text.find('\n', at) - at, GetParam().by);
  const auto path = dir_.Write("calib.txt", text);
  EXPECT_THAT(ErrorMessage([&] { ReadMiddleburyCalib(path); }), EndsWith(GetParam().message));
}

constexpr const char* kCamera = ", expected [f 0 cx; 0 f cy; 0 0 1] with f > 0";

INSTANTIATE_TEST_SUITE_P(
    All, BadCalibTest,
    ::testing::Values(
        BadValue{"cam0", "", "calib.txt: has no key cam0"},
        BadValue{"cam0", "cam0=[1 0 2; 0 1 3]",
                 std::string("calib.txt:1: cam0 is '[1 0 2; 0 1 3]'") + kCamera},
        BadValue{"cam0", "cam0=[1 0 2; 0 2 3; 0 0 1]",
                 std::string("calib.txt:1: cam0 is '[1 0 2; 0 2 3; 0 0 1]'") + kCamera},
        BadValue{"cam0", "cam0=[x 0 2; 0 x 3; 0 0 1]",
                 std::string("calib.txt:1: cam0 is '[x 0 2; 0 x 3; 0 0 1]'") + kCamera},
        BadValue{"cam0", "cam0=[-1 0 2; 0 -1 3; 0 0 1]",
                 std::string("calib.txt:1: cam0 is '[-1 0 2; 0 -1 3; 0 0 1]'") + kCamera},
        BadValue{"doffs", "doffs=inf", "calib.txt:3: doffs is 'inf', expected a number"},
        BadValue{"baseline", "baseline=0",
                 "calib.txt:4: baseline is '0', expected a positive number"},
        BadValue{"width", "width=7.5", "calib.txt:5: width is '7.5', expected a positive number"},
        BadValue{"height", "height=-1",
                 "calib.txt:6: height is '-1', expected a positive number"}));

TEST_F(CalibTest, NamesAMissingFile) {
  EXPECT_THAT(ErrorMessage([&] { ReadCalibNdisp(dir_.path() / "none.txt"); }),
              EndsWith("none.txt: file does not exist"));
}

}  // namespace
}  // namespace sgf
