#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/io/pfm.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

// 1.5, -2 and 4 in both byte orders.
const std::string kLittle("\x00\x00\xC0\x3F\x00\x00\x00\xC0\x00\x00\x80\x40", 12);
const std::string kBig("\x3F\xC0\x00\x00\xC0\x00\x00\x00\x40\x80\x00\x00", 12);

class PfmTest : public ::testing::Test {
 protected:
  cv::Mat1f Read(const std::string& bytes) const { return ReadPfm(dir_.Write("a.pfm", bytes)); }
  std::string Message(const std::string& bytes) const {
    return ErrorMessage([&] { Read(bytes); });
  }
  const TempDir dir_;
};

TEST_F(PfmTest, ReadsBothByteOrders) {
  for (const cv::Mat1f& image : {Read("Pf\n3 1\n-1\n" + kLittle), Read("Pf\n3 1\n1\n" + kBig)}) {
    ASSERT_EQ(image.size(), cv::Size(3, 1));
    EXPECT_EQ(image(0, 0), 1.5F);
    EXPECT_EQ(image(0, 1), -2.F);
    EXPECT_EQ(image(0, 2), 4.F);
  }
}

TEST_F(PfmTest, TakesValuesAsStoredForAnyMagnitudeOfTheScale) {
  for (const char* scale : {"-0.003922", "-255", "-1e30", "-1.000000"})
    EXPECT_EQ(Read(std::string("Pf\n3 1\n") + scale + "\n" + kLittle)(0, 0), 1.5F) << scale;
  for (const char* scale : {"0.003922", "255"})
    EXPECT_EQ(Read(std::string("Pf\n3 1\n") + scale + "\n" + kBig)(0, 0), 1.5F) << scale;
}

TEST_F(PfmTest, GivesTheTopRowFirstThoughTheFileHasTheBottomRowFirst) {
  const cv::Mat1f image = Read("Pf 1 3 -1\n" + kLittle);
  EXPECT_EQ(image(0, 0), 4.F);
  EXPECT_EQ(image(1, 0), -2.F);
  EXPECT_EQ(image(2, 0), 1.5F);
}

TEST_F(PfmTest, TakesOneBlankAfterTheScaleSoThatDataMayBeginWithOne) {
  EXPECT_EQ(Read("Pf\n1 1\n-1\n\n\n\n\n")(0), std::bit_cast<float>(0x0A0A0A0AU));
}

TEST_F(PfmTest, KeepsInfinityAndNan) {
  const cv::Mat1f image =
      Read("Pf\n2 1\n-1\n" + std::string("\x00\x00\x80\x7F\x00\x00\xC0\x7F", 8));
  EXPECT_TRUE(std::isinf(image(0)));
  EXPECT_TRUE(std::isnan(image(1)));
}

TEST_F(PfmTest, RejectsColour) {
  EXPECT_THAT(Message("PF\n1 1\n-1\n" + kLittle),
              EndsWith("a.pfm: is a colour PFM (PF); one channel (Pf) is needed"));
}

TEST_F(PfmTest, RejectsOtherFiles) {
  EXPECT_THAT(Message("P5\n1 1\n255\na"), EndsWith("a.pfm: is no PFM: begins with 'P5'"));
  EXPECT_THAT(Message(""), EndsWith("a.pfm: is no PFM: begins with ''"));
  EXPECT_THAT(Message(std::string("\x89PNG\0", 5)), EndsWith("begins with '?PNG?'"));
  EXPECT_THAT(ErrorMessage([&] { ReadPfm(dir_.path() / "missing.pfm"); }),
              EndsWith("missing.pfm: file does not exist"));
}

TEST_F(PfmTest, RejectsBadSizes) {
  EXPECT_THAT(Message("Pf\n0 1\n-1\n" + kLittle), EndsWith("PFM size is 0x1"));
  EXPECT_THAT(Message("Pf\n3 -1\n-1\n" + kLittle), EndsWith("PFM size is 3x-1"));
  EXPECT_THAT(Message("Pf\nthree 1\n-1\n" + kLittle), EndsWith("PFM width is 'three'"));
  EXPECT_THAT(Message("Pf\n3 1.5\n-1\n" + kLittle), EndsWith("PFM height is '1.5'"));
  EXPECT_THAT(Message("Pf\n99999999999 1\n-1\n" + kLittle), EndsWith("PFM width is '99999999999'"));
  EXPECT_THAT(Message("Pf\n3"), EndsWith("PFM height is ''"));
}

TEST_F(PfmTest, DoesNotBelieveSizesThatTheDataCannotHold) {
  EXPECT_THAT(Message("Pf\n2147483647 2147483647\n-1\n" + kLittle),
              HasSubstr("truncated PFM: 2147483647x2147483647 values of 4 bytes, but 12 bytes"));
}

TEST_F(PfmTest, RejectsBadScales) {
  for (const char* scale : {"0", "-0.0", "inf", "-inf", "nan", "1e999", "one", "1x"})
    EXPECT_THAT(Message(std::string("Pf\n3 1\n") + scale + "\n" + kLittle),
                HasSubstr("PFM scale is "))
        << scale;
}

TEST_F(PfmTest, RejectsTruncatedDataAndBytesTooMany) {
  EXPECT_THAT(Message("Pf\n3 1\n-1\n" + kLittle.substr(1)),
              EndsWith("truncated PFM: 3x1 values of 4 bytes, but 11 bytes of data"));
  EXPECT_THAT(Message("Pf\n3 1\n-1\n"), HasSubstr("truncated PFM"));
  EXPECT_THAT(Message("Pf\n3 1\n-1\n" + kLittle + "\n"),
              EndsWith("PFM has 1 bytes after its 3x1 values"));
  EXPECT_THAT(Message("Pf\n3 1\n-1\r\n" + kLittle),
              EndsWith("PFM has 1 bytes after its 3x1 values"));
}

TEST_F(PfmTest, WritesLittleEndianBottomRowFirst) {
  WritePfm(dir_.File("out.pfm"), (cv::Mat1f(3, 1) << 4, -2, 1.5));
  EXPECT_EQ(ReadFile(dir_.File("out.pfm")), "Pf\n1 3\n-1\n" + kLittle);
}

TEST_F(PfmTest, WritesPartsOfImages) {
  const cv::Mat1f image = (cv::Mat1f(2, 3) << 1, 2, 3, 4, 5, 6);
  WritePfm(dir_.File("out.pfm"), image.colRange(1, 3));
  EXPECT_EQ(cv::norm(ReadPfm(dir_.File("out.pfm")), image.colRange(1, 3)), 0);
}

TEST_F(PfmTest, RejectsAnEmptyImageAndLeavesNoFile) {
  EXPECT_THAT(ErrorMessage([&] { WritePfm(dir_.File("out.pfm"), {}); }),
              EndsWith("out.pfm: cannot write an empty image"));
  EXPECT_TRUE(std::filesystem::is_empty(dir_.path()));
}

RC_GTEST_PROP(PfmProperty, ReadsTheBitsItWrote, ()) {
  const int width = *rc::gen::inRange(1, 20);
  const int height = *rc::gen::inRange(1, 20);
  cv::Mat1f image(height, width);
  for (float& value : image) value = std::bit_cast<float>(*rc::gen::arbitrary<uint32_t>());
  const TempDir dir;
  WritePfm(dir.File("a.pfm"), image);
  const cv::Mat1f read = ReadPfm(dir.File("a.pfm"));
  RC_ASSERT(read.size() == image.size());
  RC_ASSERT(std::memcmp(read.data, image.data, image.total() * sizeof(float)) == 0);
}

}  // namespace
}  // namespace sgf
