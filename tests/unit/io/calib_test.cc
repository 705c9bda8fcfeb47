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

TEST_F(CalibTest, NamesAMissingFile) {
  EXPECT_THAT(ErrorMessage([&] { ReadCalibNdisp(dir_.path() / "none.txt"); }),
              EndsWith("none.txt: file does not exist"));
}

}  // namespace
}  // namespace sgf
