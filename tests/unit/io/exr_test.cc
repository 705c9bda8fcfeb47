#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <ImfChannelList.h>
#include <ImfDeepScanLineOutputFile.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfThreading.h>
#include <ImfTiledOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <sgf/core/error.h>
#include <sgf/io/exr.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/file_size_limit.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr float kInf = std::numeric_limits<float>::infinity();

// Random multiples of 1/256 below 8, which half floats hold exactly.
cv::Mat3f RandomColour(cv::Size size, uint64_t seed) {
  cv::RNG rng(seed);
  cv::Mat3i levels(size);
  rng.fill(levels, cv::RNG::UNIFORM, 0, 2048);
  cv::Mat3f colour;
  levels.convertTo(colour, CV_32F, 1.0 / 256);
  return colour;
}

ExrImage Rendered(cv::Size size = {20, 37}) {
  ExrImage image;
  SetLayer(image, "", RandomColour(size, 1));
  SetLayer(image, "light.lamp", RandomColour(size, 2));
  SetLayer(image, "N", RandomColour(size, 3), "XYZ");
  cv::Mat1f depth(size);
  cv::RNG(4).fill(depth, cv::RNG::UNIFORM, 0.5, 50.0);
  depth(0, 0) = kInf;
  image.channels["Z"] = {depth, ExrStorage::kFloat};
  cv::Mat1i id(size);
  cv::RNG(5).fill(id, cv::RNG::UNIFORM, 0, 100);
  id(1, 1) = std::numeric_limits<int>::max();
  image.channels["id"] = {id, ExrStorage::kUint};
  image.attributes = {{"recipe", "living room"}, {"empty", ""}};
  image.camera =
      Camera{size.width, size.height, 458.654, 457.296, 0.1, 1.0 / 3, -0.28, 0.07, 1.9e-4, 1.76e-5};
  image.T_world_cam = SE3{ExpSO3({0.3, -1.2, 2.0 / 3}), {1.1, -2.2, 1e-17}};
  return image;
}

void ExpectEqual(const ExrImage& a, const ExrImage& b) {
  EXPECT_EQ(a.size, b.size);
  EXPECT_EQ(a.attributes, b.attributes);
  ASSERT_EQ(a.channels.size(), b.channels.size());
  for (const auto& [name, channel] : a.channels) {
    ASSERT_TRUE(b.channels.contains(name)) << name;
    EXPECT_EQ(channel.storage, b.channels.at(name).storage) << name;
    ASSERT_EQ(channel.values.type(), b.channels.at(name).values.type()) << name;
    EXPECT_EQ(cv::countNonZero(channel.values != b.channels.at(name).values), 0) << name;
  }
}

std::string ReadError(const std::filesystem::path& path) {
  return ErrorMessage([&] { ReadExr(path); });
}

std::string WriteError(const ExrImage& image) {
  const TempDir dir;
  const auto path = dir.File("a.exr");
  const std::string message = ErrorMessage([&] { WriteExr(path, image); });
  EXPECT_THAT(message, StartsWith(path.string()));
  EXPECT_FALSE(std::filesystem::exists(path));
  return message;
}

TEST(Exr, GivesBackAllLayersAndTexts) {
  const TempDir dir;
  const ExrImage image = Rendered();
  WriteExr(dir.File("a.exr"), image);
  ExpectEqual(image, ReadExr(dir.File("a.exr")));
}

TEST(Exr, GivesBackCameraAndPoseToTheLastBit) {
  const TempDir dir;
  const ExrImage image = Rendered();
  WriteExr(dir.File("a.exr"), image);
  const ExrImage read = ReadExr(dir.File("a.exr"));
  ASSERT_TRUE(read.camera && read.T_world_cam);
  EXPECT_EQ(std::memcmp(&*read.camera, &*image.camera, sizeof(Camera)), 0);
  EXPECT_EQ(read.T_world_cam->R.coeffs(), image.T_world_cam->R.coeffs());
  EXPECT_EQ(read.T_world_cam->p, image.T_world_cam->p);
}

TEST(Exr, NeedsNeitherCameraNorPose) {
  const TempDir dir;
  ExrImage image;
  SetLayer(image, "", RandomColour({3, 2}, 1));
  WriteExr(dir.File("a.exr"), image);
  const ExrImage read = ReadExr(dir.File("a.exr"));
  ExpectEqual(image, read);
  EXPECT_FALSE(read.camera || read.T_world_cam);
}

TEST(Exr, StoresThePoseAsOpenExrsStandardAttributeToo) {
  const TempDir dir;
  const ExrImage image = Rendered();
  WriteExr(dir.File("a.exr"), image);
  const Imf::InputFile file(dir.File("a.exr").c_str());
  ASSERT_TRUE(Imf::hasWorldToCamera(file.header()));
  const Eigen::Vector3d in_camera(0.5, -0.25, 4);
  const Eigen::Vector3d in_world = *image.T_world_cam * in_camera;
  Imath::V3f point;
  Imf::worldToCamera(file.header())
      .multVecMatrix(Imath::V3f(static_cast<float>(in_world.x()), static_cast<float>(in_world.y()),
                                static_cast<float>(in_world.z())),
                     point);
  EXPECT_NEAR(point.x, 0.5, 1e-5);
  EXPECT_NEAR(point.y, 0.25, 1e-5) << "y points up in OpenEXR's camera space";
  EXPECT_NEAR(point.z, 4, 1e-5);
}

TEST(Exr, StoresChannelsAsAsked) {
  const TempDir dir;
  WriteExr(dir.File("a.exr"), Rendered());
  const Imf::InputFile file(dir.File("a.exr").c_str());
  const Imf::ChannelList& channels = file.header().channels();
  EXPECT_EQ(channels["R"].type, Imf::HALF);
  EXPECT_EQ(channels["light.lamp.B"].type, Imf::HALF);
  EXPECT_EQ(channels["Z"].type, Imf::FLOAT);
  EXPECT_EQ(channels["id"].type, Imf::UINT);
  EXPECT_EQ(file.header().compression(), Imf::ZIP_COMPRESSION);
}

TEST(Exr, RoundsToTheNearestHalf) {
  const TempDir dir;
  ExrImage image;
  // Halves have 10 bits behind the point in [1, 2): one below, one above the middle.
  SetLayer(image, "", cv::Mat3f(1, 1, cv::Vec3f(1 + 0.49F / 1024, 1 + 0.51F / 1024, kInf)));
  WriteExr(dir.File("a.exr"), image);
  const cv::Vec3f read = GetLayer(ReadExr(dir.File("a.exr")), "", "a.exr")(0, 0);
  EXPECT_EQ(read, cv::Vec3f(1, 1 + 1.0F / 1024, kInf));
}

TEST(Exr, TakesMatricesThatAreParts) {
  const TempDir dir;
  const cv::Mat3f large = RandomColour({30, 20}, 7);
  cv::Mat1f depth(20, 30);
  cv::RNG(8).fill(depth, cv::RNG::UNIFORM, 0, 1);
  const cv::Rect part(3, 2, 11, 9);
  ExrImage image;
  SetLayer(image, "", large(part));
  image.channels["Z"] = {depth(part), ExrStorage::kFloat};
  WriteExr(dir.File("a.exr"), image);
  ExpectEqual(image, ReadExr(dir.File("a.exr")));
}

TEST(Exr, EqualImagesGiveEqualBytesForAnyNumberOfThreads) {
  const TempDir dir;
  const ExrImage image = Rendered({64, 100});
  WriteExr(dir.File("none.exr"), image);
  Imf::setGlobalThreadCount(3);
  WriteExr(dir.File("three.exr"), image);
  const ExrImage read = ReadExr(dir.File("three.exr"));
  Imf::setGlobalThreadCount(0);
  EXPECT_EQ(ReadFile(dir.File("none.exr")), ReadFile(dir.File("three.exr")));
  ExpectEqual(image, read);
}

// ---- Other programs

TEST(Exr, OpenCvReadsTheColours) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  const TempDir dir;
  const ExrImage image = Rendered();
  WriteExr(dir.File("a.exr"), image);
  const cv::Mat bgr = cv::imread(dir.File("a.exr").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(bgr.type(), CV_32FC3);
  ASSERT_EQ(bgr.size(), image.size);
  std::vector<cv::Mat> planes;
  cv::split(bgr, planes);
  for (int i = 0; i < 3; ++i) {
    const cv::Mat& values = image.channels.at(std::string(1, "BGR"[i])).values;
    EXPECT_EQ(cv::norm(planes[i], values, cv::NORM_INF), 0) << "BGR"[i];
  }
}

std::string OutputOf(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string output;
  for (int c = std::fgetc(pipe.get()); c != EOF; c = std::fgetc(pipe.get()))
    output += static_cast<char>(c);
  return output;
}

TEST(Exr, ExrheaderListsChannelsAndCamera) {
  const TempDir dir;
  WriteExr(dir.File("a.exr"), Rendered());
  const std::string output = OutputOf("exrheader '" + dir.File("a.exr").string() + "' 2>&1");
  for (const char* line :
       {"    B, 16-bit floating-point", "    N.X, 16-bit floating-point",
        "    Z, 32-bit floating-point", "    id, 32-bit unsigned integer",
        "    light.lamp.R, 16-bit floating-point", "zip", "worldToCamera (type m44f)",
        "intrinsics (type string): \"458.654 457.296 0.1 0.3333333333333333\"",
        "recipe (type string): \"living room\""})
    EXPECT_THAT(output, HasSubstr(line)) << "package openexr has to be installed";
}

// ---- Files that cannot be read

TEST(Exr, ReportsAFileCutAnywhere) {
  const TempDir dir;
  WriteExr(dir.File("whole.exr"), Rendered({4, 20}));  // two blocks of lines
  const std::string bytes = ReadFile(dir.File("whole.exr"));
  const auto path = dir.File("cut.exr");
  for (size_t length = 0; length < bytes.size(); ++length) {
    dir.Write("cut.exr", std::string_view(bytes).substr(0, length));
    ASSERT_THAT(ReadError(path), StartsWith(path.string())) << length << " of " << bytes.size();
  }
}

// A writer fills in the table of blocks, of 8 bytes each behind the header, when it ends.
TEST(Exr, ReportsAFileWhoseWriterWasInterrupted) {
  const TempDir dir;
  WriteExr(dir.File("whole.exr"), Rendered({4, 20}));
  const std::string bytes = ReadFile(dir.File("whole.exr"));
  uint64_t first_block = 0, second_block = 0;
  size_t table = 0;
  do {
    std::memcpy(&first_block, bytes.data() + ++table, sizeof first_block);
  } while (first_block != table + 16);
  std::memcpy(&second_block, bytes.data() + table + 8, sizeof second_block);
  std::string interrupted = bytes.substr(0, second_block);
  interrupted.replace(table, 16, 16, '\0');
  EXPECT_THAT(ReadError(dir.Write("a.exr", interrupted)), HasSubstr("missing"));
}

TEST(Exr, ReportsAMissingFileAndOneOfAnotherKind) {
  const TempDir dir;
  const auto missing = dir.File("missing.exr");
  EXPECT_EQ(ReadError(missing), missing.string() + ": file does not exist");
  const auto other = dir.Write("other.exr", "P6 1 1 255\n1234567890");
  EXPECT_EQ(ReadError(other), other.string() + ": is no OpenEXR file");
}

TEST(Exr, GivesAnImageOrAnErrorForChangedBytes) {
  const TempDir dir;
  WriteExr(dir.File("whole.exr"), Rendered({9, 20}));
  const std::string bytes = ReadFile(dir.File("whole.exr"));
  cv::RNG rng(1);
  int errors = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::string changed = bytes;
    // Half of the changes in the header, which is a part of the file only.
    const int range = static_cast<int>(trial % 2 == 0 ? bytes.size() : bytes.size() / 4);
    for (int i = rng.uniform(0, 3); i >= 0; --i)
      changed[static_cast<size_t>(rng.uniform(0, range))] = static_cast<char>(rng.uniform(0, 256));
    const auto path = dir.Write("changed.exr", changed);
    const std::string message = ReadError(path);
    if (message == "no error") continue;
    ASSERT_THAT(message, StartsWith(path.string()));
    ++errors;
  }
  EXPECT_GT(errors, 1000);
}

// The error for a file whose header begins with an attribute of this type and content.
std::string ErrorWithAttribute(const std::string& type, const std::string& data) {
  const TempDir dir;
  WriteExr(dir.File("whole.exr"), Rendered());
  std::string bytes = ReadFile(dir.File("whole.exr"));
  std::string size(4, '\0');
  size[0] = static_cast<char>(data.size());
  bytes.insert(8, std::string("a\0", 2) + type + '\0' + size + data);
  return ReadError(dir.Write("a.exr", bytes));
}

// The library would take what follows for another attribute and allocate what that claims to have.
TEST(Exr, ReportsAttributesWithoutTheSizeOfTheirType) {
  const std::string channel = std::string("R\0", 2) + std::string(16, '\1');
  const std::string pixels(12, '\1');  // 16843009x16843009
  for (const auto& [type, data] : {std::pair<std::string, std::string>{"int", "123"},
                                   {"box2i", "1234"},
                                   {"floatvector", "12345"},
                                   {"chlist", channel + std::string("\0x", 2)},
                                   {"preview", pixels}})
    EXPECT_THAT(ErrorWithAttribute(type, data), HasSubstr("damaged header")) << type;
  EXPECT_THAT(ErrorWithAttribute("stringvector", "\xff\xff\xff\x7f"), HasSubstr("truncated"));
  EXPECT_THAT(ErrorWithAttribute("chlist", channel), HasSubstr("truncated"));
}

TEST(Exr, TakesAttributesOfAllKinds) {
  const std::string one("\1\0\0\0", 4);
  for (const auto& [type, data] : {std::pair<std::string, std::string>{"int", "1234"},
                                   {"floatvector", "12345678"},
                                   {"chlist", std::string("R\0", 2) + std::string(16, '\1') + '\0'},
                                   {"stringvector", one + "a" + one + "b"},
                                   {"preview", one + one + "rgba"},
                                   {"somebody's", "12345"}})
    EXPECT_THAT(ErrorWithAttribute(type, data), Not(HasSubstr("header"))) << type;
}

Imf::Header PlainHeader(int width = 8, int height = 8) {
  Imf::Header header(width, height);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  return header;
}

void WriteTiled(const std::filesystem::path& path) {
  Imf::Header header = PlainHeader();
  header.setTileDescription(Imf::TileDescription(8, 8, Imf::ONE_LEVEL));
  std::vector<float> values(64);
  Imf::FrameBuffer frame;
  frame.insert("Y", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), 4, 32));
  Imf::TiledOutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writeTile(0, 0);
}

void WriteScanLines(const std::filesystem::path& path, const Imf::Header& header) {
  std::vector<float> values(64);
  Imf::FrameBuffer frame;
  const Imath::V2i origin = header.dataWindow().min;
  const Imf::Channel& channel = header.channels()["Y"];
  frame.insert(
      "Y", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data() - origin.x - 8 * origin.y),
                      4, 32, channel.xSampling, channel.ySampling));
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(frame);
  file.writePixels(8);
}

TEST(Exr, RefusesOtherKindsOfOpenExrFiles) {
  const TempDir dir;
  WriteTiled(dir.File("tiled.exr"));
  EXPECT_THAT(ReadError(dir.File("tiled.exr")), HasSubstr("tiled.exr: is tiled"));

  Imf::Header deep = PlainHeader();
  deep.setType(Imf::DEEPSCANLINE);
  deep.compression() = Imf::ZIPS_COMPRESSION;
  { const Imf::DeepScanLineOutputFile file(dir.File("deep.exr").c_str(), deep); }
  EXPECT_THAT(ReadError(dir.File("deep.exr")), HasSubstr("deep.exr: is a deep image"));

  std::vector<Imf::Header> parts(2, PlainHeader());
  for (int i = 0; i < 2; ++i) {
    parts[i].setName(std::to_string(i));
    parts[i].setType(Imf::SCANLINEIMAGE);
  }
  { const Imf::MultiPartOutputFile file(dir.File("parts.exr").c_str(), parts.data(), 2); }
  EXPECT_THAT(ReadError(dir.File("parts.exr")), HasSubstr("parts.exr: has several parts"));
}

TEST(Exr, RefusesSubSampledChannelsAndPartsOfImages) {
  const TempDir dir;
  Imf::Header sampled(8, 8);
  sampled.channels().insert("Y", Imf::Channel(Imf::FLOAT, 2, 2));
  WriteScanLines(dir.File("sampled.exr"), sampled);
  EXPECT_THAT(ReadError(dir.File("sampled.exr")), HasSubstr("channel Y is sub-sampled"));

  Imf::Header part = PlainHeader();
  part.displayWindow().max.x = 15;
  WriteScanLines(dir.File("part.exr"), part);
  EXPECT_THAT(ReadError(dir.File("part.exr")), HasSubstr("a part of a larger image"));
}

TEST(Exr, ReadsImagesWhoseWindowsBeginElsewhere) {
  const TempDir dir;
  Imf::Header moved = PlainHeader();
  moved.dataWindow() = moved.displayWindow() = Imath::Box2i({-3, 5}, {4, 12});
  WriteScanLines(dir.File("moved.exr"), moved);
  const ExrImage image = ReadExr(dir.File("moved.exr"));
  EXPECT_EQ(image.size, cv::Size(8, 8));
  EXPECT_EQ(cv::countNonZero(image.channels.at("Y").values), 0);
}

// Writes other corners into the data and display windows of a file.
std::string WithWindow(std::string bytes, const std::array<int32_t, 4>& window) {
  for (const std::string name : {"dataWindow", "displayWindow"}) {
    const std::string head = name + '\0' + "box2i" + '\0' + '\x10' + std::string(3, '\0');
    const size_t at = bytes.find(head) + head.size();
    std::memcpy(bytes.data() + at, window.data(), sizeof window);
  }
  return bytes;
}

TEST(Exr, AllocatesNothingForWindowsThatTheFileCannotFill) {
  const TempDir dir;
  WriteExr(dir.File("whole.exr"), Rendered());
  const std::string bytes = ReadFile(dir.File("whole.exr"));
  ASSERT_EQ(WithWindow(bytes, {0, 0, 19, 36}), bytes);
  for (const std::array<int32_t, 4>& window : {std::array{0, 0, 60000, 60000},
                                               {0, 0, 1999999999, 1},
                                               {INT32_MIN, INT32_MIN, INT32_MAX, INT32_MAX},
                                               {0, 0, -1, 36},
                                               {5, 0, 4, 36}}) {
    const auto path = dir.Write("large.exr", WithWindow(bytes, window));
    EXPECT_THAT(ReadError(path), HasSubstr("damaged header")) << window[2];
  }
}

TEST(Exr, ReportsAHeaderWhoseCameraCannotBeRead) {
  const TempDir dir;
  WriteExr(dir.File("whole.exr"), Rendered());
  const std::string bytes = ReadFile(dir.File("whole.exr"));
  const auto with = [&](const std::string& old_text, const std::string& new_text) {
    EXPECT_EQ(old_text.size(), new_text.size());
    std::string changed = bytes;
    return ReadError(
        dir.Write("a.exr", changed.replace(changed.find(old_text), old_text.size(), new_text)));
  };
  EXPECT_THAT(with("pinhole radial", "fisheye radial"), HasSubstr("unknown camera model 'fish"));
  EXPECT_THAT(with("458.654", "458,654"), HasSubstr("intrinsics is '458,654 457.296"));
  EXPECT_THAT(with("458.654", "-58.654"), HasSubstr("focal lengths are -58.654, 457.296 px"));
  EXPECT_THAT(with("458.654 ", "458.6540"), HasSubstr("expected 4 numbers"));
  EXPECT_THAT(with("distortion", "distorsion"), HasSubstr("no header attribute distortion"));
  EXPECT_THAT(with("1.1 -2.2", "1.1 -x.2"), HasSubstr("worldFromCamera is '1.1 -x.2"));
}

// ---- Images that cannot be written

TEST(Exr, RefusesChannelsOfAnotherSizeOrType) {
  ExrImage image = Rendered();
  image.channels["Z"] = {cv::Mat1f(37, 21, 0.F), ExrStorage::kFloat};
  EXPECT_THAT(WriteError(image), HasSubstr("channel Z is 21x37, the image 20x37"));
  image.channels["Z"] = {cv::Mat1d(37, 20, 0.0), ExrStorage::kFloat};
  EXPECT_THAT(WriteError(image), HasSubstr("channel Z is of type CV_64FC1"));
  image = Rendered();
  image.channels["id"].storage = ExrStorage::kHalf;
  EXPECT_THAT(WriteError(image), HasSubstr("channel id is of type CV_32SC1"));
  image = Rendered();
  image.camera->width = 21;
  EXPECT_THAT(WriteError(image), HasSubstr("the image is 20x37, its camera 21x37"));
  EXPECT_THAT(WriteError({}), HasSubstr("nothing to write"));
}

TEST(Exr, RefusesValuesBeyondTheirStorage) {
  ExrImage image = Rendered();
  image.channels["R"].values.at<float>(3, 2) = 70000;
  EXPECT_THAT(WriteError(image), HasSubstr("channel R is 70000 at (2, 3)"));
  image = Rendered();
  image.channels["id"].values.at<int>(3, 2) = -1;
  EXPECT_THAT(WriteError(image), HasSubstr("channel id is -1 at (2, 3)"));
}

TEST(Exr, RefusesNamesThatTheHeaderCannotHold) {
  for (const std::string& name : {std::string(), std::string(256, 'x'), std::string("a\0b", 3)}) {
    ExrImage image = Rendered();
    image.attributes[name] = "text";
    EXPECT_THAT(WriteError(image), HasSubstr("is no name"));
    image = Rendered();
    image.channels[name] = image.channels["Z"];
    EXPECT_THAT(WriteError(image), HasSubstr("is no name"));
  }
  for (const char* name : {"compression", "intrinsics", "worldToCamera"}) {
    ExrImage image = Rendered();
    image.attributes[name] = "text";
    EXPECT_THAT(WriteError(image), HasSubstr(name));
  }
}

TEST(Exr, LeavesNoPartOfAFileOnAFullDisk) {
  const TempDir dir;
  const auto path = dir.File("a.exr");
  {
    const FileSizeLimit limit(1000);
    EXPECT_EQ(ErrorMessage([&] { WriteExr(path, Rendered()); }),
              path.string() + ": cannot be written: File too large");
  }
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

// ---- Layers

TEST(ExrLayer, NamesItsChannels) {
  ExrImage image;
  const cv::Mat3f colour = RandomColour({4, 3}, 1);
  SetLayer(image, "", colour);
  SetLayer(image, "N", 2 * colour, "XYZ", ExrStorage::kFloat);
  std::vector<std::string> names;
  for (const auto& [name, channel] : image.channels) names.push_back(name);
  EXPECT_THAT(names, ElementsAre("B", "G", "N.X", "N.Y", "N.Z", "R"));
  EXPECT_EQ(image.size, colour.size());
  EXPECT_EQ(image.channels["G"].values.at<float>(1, 2), colour(1, 2)[1]);
  EXPECT_EQ(image.channels["N.Z"].storage, ExrStorage::kFloat);
  EXPECT_EQ(cv::norm(GetLayer(image, "N", "a.exr", "XYZ"), 2 * colour, cv::NORM_INF), 0);
}

TEST(ExrLayer, ReportsAbsentChannels) {
  ExrImage image;
  SetLayer(image, "N", RandomColour({4, 3}, 1), "XYZ");
  EXPECT_EQ(ErrorMessage([&] { GetLayer(image, "light.lamp", "a.exr"); }),
            "a.exr: has no channel light.lamp.R; it has N.X, N.Y, N.Z");
  EXPECT_EQ(ErrorMessage([&] {
              RequireChannels(image, {"N.X", "Z"}, "a.exr");
            }),
            "a.exr: has no channel Z; it has N.X, N.Y, N.Z");
  image.channels["N.Y"].values = cv::Mat1i(3, 4, 0);
  EXPECT_EQ(ErrorMessage([&] { GetLayer(image, "N", "a.exr", "XYZ"); }),
            "a.exr: channel N.Y holds integers");
}

}  // namespace
}  // namespace sgf
