#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <sgf/io/image.h>

#include "support/encoded_images.h"
#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

bool SameImage(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

std::string ReadMessage(const std::filesystem::path& path) {
  return ErrorMessage([&] { ReadImage(path, cv::IMREAD_UNCHANGED); });
}

struct Format {
  const char* extension;
  int type;
};

class ImageFormatTest : public ::testing::TestWithParam<Format> {
 protected:
  const TempDir dir_;
  const cv::Mat image_ = RandomImage(5, 6, GetParam().type);
  const std::string bytes_ = Encode(GetParam().extension, image_);
};

TEST_P(ImageFormatTest, ReadsWhatWasWritten) {
  const cv::Mat read = ReadImage(dir_.Write("image", bytes_), cv::IMREAD_UNCHANGED);
  if (std::string(GetParam().extension) == ".jpg")
    EXPECT_TRUE(
        SameImage(read, cv::imread((dir_.path() / "image").string(), cv::IMREAD_UNCHANGED)));
  else
    EXPECT_TRUE(SameImage(read, image_));
}

TEST_P(ImageFormatTest, RejectsTheFileTruncatedAnywhere) {
  for (size_t length = 0; length < bytes_.size(); ++length) {
    const auto path = dir_.Write("image", bytes_.substr(0, length));
    EXPECT_THAT(ReadMessage(path), StartsWith(path.string() + ": ")) << length << " bytes";
  }
}

INSTANTIATE_TEST_SUITE_P(All, ImageFormatTest,
                         ::testing::Values(Format{".png", CV_8UC1}, Format{".png", CV_8UC3},
                                           Format{".png", CV_8UC4}, Format{".png", CV_16UC1},
                                           Format{".jpg", CV_8UC1}, Format{".jpg", CV_8UC3},
                                           Format{".pgm", CV_8UC1}, Format{".pgm", CV_16UC1},
                                           Format{".ppm", CV_8UC3}));

TEST(Image, NamesAFileThatIsMissingOrAFolderOrEmpty) {
  const TempDir dir;
  const auto missing = dir.path() / "missing.png";
  EXPECT_EQ(ReadMessage(missing), missing.string() + ": file does not exist");
  EXPECT_EQ(ReadMessage(dir.path()), dir.path().string() + ": is not a regular file");
  EXPECT_THAT(ReadMessage(dir.Write("empty.png", "")), EndsWith("empty.png: file is empty"));
}

TEST(Image, NamesTheFormatsItReads) {
  const TempDir dir;
  EXPECT_THAT(ReadMessage(dir.Write("a.bmp", Encode(".bmp", RandomImage(4, 4, CV_8UC1)))),
              HasSubstr("not a PNG, JPEG or binary PGM or PPM image"));
}

TEST(Image, SaysWhereAPngIsTruncated) {
  const TempDir dir;
  const std::string png = Encode(".png", RandomImage(20, 20, CV_8UC1));
  EXPECT_THAT(ReadMessage(dir.Write("a.png", png.substr(0, 100))),
              HasSubstr("truncated PNG: chunk 'IDAT' has"));
  EXPECT_THAT(ReadMessage(dir.Write("a.png", png.substr(0, png.size() - 12))),
              HasSubstr("truncated PNG: ends before its IEND chunk"));
}

TEST(Image, RejectsAPngWithAnyByteChanged) {
  const TempDir dir;
  const std::string png = Encode(".png", RandomImage(6, 7, CV_8UC1));
  for (size_t i = 0; i < png.size(); ++i) {
    std::string damaged = png;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    EXPECT_NE(ReadMessage(dir.Write("a.png", damaged)), "no error") << "byte " << i;
  }
}

TEST(Image, NamesTheChunkOfAPngThatIsDamaged) {
  const TempDir dir;
  std::string png = Encode(".png", RandomImage(6, 7, CV_8UC1));
  png[png.find("IDAT") + 10] ^= 1;
  EXPECT_THAT(ReadMessage(dir.Write("a.png", png)),
              EndsWith("a.png: corrupt PNG: wrong checksum of chunk 'IDAT'"));
}

TEST(Image, DoesNotBelieveSizesThatTheDataCannotHold) {
  const TempDir dir;
  const std::string png = Encode(".png", RandomImage(6, 7, CV_8UC1));
  const auto message = [&](uint32_t width, uint32_t height) {
    return ReadMessage(dir.Write("a.png", WithPngHeader(png, width, height, 8, 0)));
  };
  EXPECT_THAT(message(1 << 20, 1 << 10), HasSubstr("cannot hold an image of 1048576x1024"));
  EXPECT_THAT(message(0xFFFFFFFF, 0xFFFFFFFF), HasSubstr("cannot hold"));
  EXPECT_THAT(message(0, 6), HasSubstr("image size is 0x6"));
  EXPECT_THAT(ReadMessage(dir.Write("a.pgm", "P5 30000 30000 255\nabc")),
              HasSubstr("truncated PGM or PPM: 3 bytes for 30000x30000 pixels"));
}

TEST(Image, ReadsAPngCompressedAsFarAsPossible) {
  const TempDir dir;
  const cv::Mat1b black = cv::Mat1b::zeros(3000, 3000);
  std::vector<uchar> bytes;
  cv::imencode(".png", black, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9});
  const auto path = dir.Write("black.png", std::string(bytes.begin(), bytes.end()));
  EXPECT_TRUE(SameImage(ReadImage(path, cv::IMREAD_UNCHANGED), black));
}

TEST(Image, ReadsAProgressiveJpegCompressedAsFarAsPossible) {
  const TempDir dir;
  std::vector<uchar> bytes;
  cv::imencode(".jpg", cv::Mat1b::zeros(3000, 3000), bytes,
               {cv::IMWRITE_JPEG_PROGRESSIVE, 1, cv::IMWRITE_JPEG_OPTIMIZE, 1});
  const auto path = dir.Write("black.jpg", std::string(bytes.begin(), bytes.end()));
  EXPECT_EQ(ReadImage(path, cv::IMREAD_UNCHANGED).size(), cv::Size(3000, 3000));
}

TEST(Image, ReadsAJpegWithRestartMarkers) {
  const TempDir dir;
  std::vector<uchar> bytes;
  cv::imencode(".jpg", RandomImage(64, 64, CV_8UC1), bytes, {cv::IMWRITE_JPEG_RST_INTERVAL, 4});
  const std::string jpeg(bytes.begin(), bytes.end());
  ASSERT_NE(jpeg.find("\xFF\xD1"), std::string::npos);
  EXPECT_EQ(ReadMessage(dir.Write("a.jpg", jpeg)), "no error");
}

TEST(Image, RejectsPngDataThatDoesNotDecode) {
  const TempDir dir;
  const std::string png = std::string("\x89PNG\r\n\x1a\n") + std::string(25, ' ') +
                          PngChunkBytes("IDAT", "this is not deflated data") +
                          PngChunkBytes("IEND", "");
  EXPECT_THAT(ReadMessage(dir.Write("a.png", WithPngHeader(png, 4, 4, 8, 0))),
              EndsWith("a.png: cannot be decoded: corrupt image data"));
  EXPECT_THAT(ReadMessage(dir.Write("a.png", WithPngHeader(png, 4, 4, 8, 5))),
              HasSubstr("colour type 5 with 8 bits"));
}

TEST(Image, ReadsCommentsInPgmHeaders) {
  const TempDir dir;
  const cv::Mat read = ReadImage(dir.Write("a.pgm", "P5\n# made by hand\n2 1 # size\n255\nab"),
                                 cv::IMREAD_UNCHANGED);
  EXPECT_TRUE(SameImage(read, (cv::Mat1b(1, 2) << 'a', 'b')));
}

TEST(Image, ConvertsColourToTheSameGreyInEveryFormat) {
  const TempDir dir;
  const cv::Mat colour = RandomImage(9, 8, CV_8UC3);
  cv::Mat1b expected;
  cv::cvtColor(colour, expected, cv::COLOR_BGR2GRAY);
  for (const char* extension : {".png", ".ppm"})
    EXPECT_TRUE(SameImage(ReadGrey(dir.Write("image", Encode(extension, colour))), expected));
  const cv::Mat grey = RandomImage(9, 8, CV_8UC1);
  EXPECT_TRUE(SameImage(ReadGrey(dir.Write("image", Encode(".png", grey))), grey));
}

TEST(Image, ReducesSixteenBitGreyToEight) {
  const TempDir dir;
  const cv::Mat wide = (cv::Mat_<uint16_t>(1, 2) << 0x1234, 0xFF00);
  const cv::Mat1b grey = ReadGrey(dir.Write("image", Encode(".png", wide)));
  EXPECT_EQ(grey(0), 0x12);
  EXPECT_EQ(grey(1), 0xFF);
}

TEST(Image, WritesWhatItReads) {
  const TempDir dir;
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3}) {
    const cv::Mat image = RandomImage(5, 6, type);
    WritePng(dir.File("image.png"), image);
    EXPECT_TRUE(SameImage(ReadImage(dir.File("image.png"), cv::IMREAD_UNCHANGED), image))
        << cv::typeToString(type);
  }
}

TEST(Image, RejectsWhatAPngCannotHoldAndLeavesNoFile) {
  const TempDir dir;
  for (const cv::Mat& image : {cv::Mat(), cv::Mat(2, 2, CV_32FC1), cv::Mat(2, 2, CV_8UC2)})
    EXPECT_THAT(ErrorMessage([&] { WritePng(dir.File("image.png"), image); }),
                HasSubstr("image.png: a PNG cannot hold an image of "));
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

}  // namespace
}  // namespace sgf
