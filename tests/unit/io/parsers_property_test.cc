#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <rapidcheck/gtest.h>

#include <sgf/core/error.h>
#include <sgf/io/calib.h>
#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/io/pfm.h>
#include <sgf/io/stereo_layouts.h>
#include <sgf/io/trajectory.h>

#include "support/encoded_images.h"
#include "support/temp_dir.h"

// Whatever stands in a file, a parser gives a result or an sgf::Error: no other exception
// (rapidcheck reports one as a failure), no crash. Files are random bytes, which mostly test the
// first checks, and valid files with a few bytes changed, which get past them.

namespace sgf {
namespace {

using Bytes = std::string;

rc::Gen<Bytes> RandomBytes() { return rc::gen::container<Bytes>(rc::gen::arbitrary<char>()); }

// Random bytes behind one of the given beginnings.
rc::Gen<Bytes> RandomBytesAfter(const std::vector<Bytes>& beginnings) {
  return rc::gen::apply([](const Bytes& begin, const Bytes& rest) { return begin + rest; },
                        rc::gen::elementOf(beginnings), RandomBytes());
}

// Replaces, inserts or removes one byte, doubles a part, or cuts the file.
Bytes Edit(Bytes bytes, int kind, size_t position, char value) {
  if (bytes.empty()) return bytes;
  position %= bytes.size();
  switch (kind) {
    case 0:
      return bytes.insert(position, 1, value);
    case 1:
      return bytes.erase(position, 1);
    case 2:
      return bytes + bytes.substr(position);
    case 3:
      return bytes.substr(0, position);
    default:
      bytes[position] = value;
      return bytes;
  }
}

// Few edits, so that some files stay valid.
rc::Gen<Bytes> Mutated(const Bytes& valid) {
  using Edits = std::vector<std::tuple<int, size_t, char>>;
  const auto edit = rc::gen::tuple(rc::gen::inRange(0, 12), rc::gen::arbitrary<size_t>(),
                                   rc::gen::arbitrary<char>());
  const auto edits = rc::gen::mapcat(
      rc::gen::inRange(1, 5), [edit](int count) { return rc::gen::container<Edits>(count, edit); });
  return rc::gen::map(edits, [valid](const Edits& chosen) {
    Bytes bytes = valid;
    for (const auto& [kind, position, value] : chosen) bytes = Edit(bytes, kind, position, value);
    return bytes;
  });
}

rc::Gen<Bytes> MutatedWithRightChecksums(const Bytes& png) {
  return rc::gen::map(Mutated(png), WithRightPngChecksums);
}

// Calls `parse` on a file of these bytes; true when it gave a result.
bool Parses(const Bytes& bytes, const std::function<void(const std::filesystem::path&)>& parse) {
  static const TempDir dir;
  const auto path = dir.Write("input", bytes);
  try {
    parse(path);
  } catch (const Error& error) {
    RC_ASSERT(std::string(error.what()).starts_with(path.string()));
    return false;
  }
  return true;
}

void ReadAnyImage(const std::filesystem::path& path) {
  const cv::Mat image = ReadImage(path, cv::IMREAD_UNCHANGED);
  RC_ASSERT(!image.empty());
}

void ParsesOrFails(const rc::Gen<Bytes>& files,
                   const std::function<void(const std::filesystem::path&)>& parse) {
  const Bytes bytes = *files;
  RC_CLASSIFY(Parses(bytes, parse), "parsed");
}

const Bytes kPfm = "Pf\n3 2\n-0.5\n" + Bytes(24, 'x');
const Bytes kCalib =
    "cam0=[1500 0 199; 0 1500 187; 0 0 1]\ndoffs=52\nbaseline=80\nwidth=450\nheight=375\n"
    "ndisp=64\n";
const Bytes kPng8 = Encode(".png", RandomImage(5, 7, CV_8UC3));
const Bytes kPng16 = Encode(".png", RandomImage(5, 7, CV_16UC1));
const Bytes kJpeg = Encode(".jpg", RandomImage(9, 10, CV_8UC3));
const Bytes kPpm = Encode(".ppm", RandomImage(3, 4, CV_8UC3));
const Bytes kLayouts =
    "a:\n  title: 'A'\n  layout: kitti2015\n  folders: &x [a/b, \"c\"]\n  scenes: 3\n"
    "b: {title: B, layout: kitti2012, folders: *x}\n";
const Bytes kTrajectory = "# t x y z\n1.5 0 0 0 0 0 0 1\n2.5e+00 1 2 3 0.5 0.5 0.5 0.5\n";

TEST(ParserProperty, MutationsStartFromValidFiles) {
  EXPECT_TRUE(Parses(kPfm, ReadPfm));
  EXPECT_TRUE(Parses(kCalib, ReadCalibNdisp));
  EXPECT_TRUE(Parses(kCalib, ReadMiddleburyCalib));
  EXPECT_TRUE(Parses(kLayouts, ReadStereoLayouts));
  EXPECT_TRUE(Parses(kTrajectory, ReadTrajectory));
  EXPECT_TRUE(Parses(kPng8, ReadAnyImage));
  EXPECT_TRUE(Parses(kPng16, ReadAnyImage));
  EXPECT_TRUE(Parses(kJpeg, ReadAnyImage));
  EXPECT_TRUE(Parses(kPpm, ReadAnyImage));
}

RC_GTEST_PROP(ParserProperty, PfmFromRandomBytes, ()) {
  ParsesOrFails(RandomBytesAfter({"", "Pf", "Pf\n", "Pf\n1 1\n", "Pf\n1 1\n-1\n"}), ReadPfm);
}

RC_GTEST_PROP(ParserProperty, PfmFromMutatedFiles, ()) { ParsesOrFails(Mutated(kPfm), ReadPfm); }

RC_GTEST_PROP(ParserProperty, CalibFromRandomBytes, ()) {
  ParsesOrFails(RandomBytesAfter({"", "ndisp=", "ndisp=1"}), ReadCalibNdisp);
}

RC_GTEST_PROP(ParserProperty, CalibFromMutatedFiles, ()) {
  ParsesOrFails(Mutated(kCalib), ReadMiddleburyCalib);
}

RC_GTEST_PROP(ParserProperty, StereoLayoutsFromRandomBytes, ()) {
  ParsesOrFails(RandomBytesAfter({"", "a: ", "a: {", "a:\n  folders: [", "- &a"}),
                ReadStereoLayouts);
}

RC_GTEST_PROP(ParserProperty, StereoLayoutsFromMutatedFiles, ()) {
  ParsesOrFails(Mutated(kLayouts), ReadStereoLayouts);
}

RC_GTEST_PROP(ParserProperty, TrajectoryFromMutatedFiles, ()) {
  ParsesOrFails(Mutated(kTrajectory), ReadTrajectory);
}

RC_GTEST_PROP(ParserProperty, ImageFromRandomBytes, ()) {
  ParsesOrFails(RandomBytesAfter({"", "\x89PNG\r\n\x1a\n", "\xFF\xD8\xFF", "P5", "P6 1 1 255\n"}),
                ReadAnyImage);
}

RC_GTEST_PROP(ParserProperty, PngFromMutatedFiles, ()) {
  ParsesOrFails(Mutated(kPng8), ReadAnyImage);
}

RC_GTEST_PROP(ParserProperty, PngFromMutatedFilesWithRightChecksums, ()) {
  ParsesOrFails(MutatedWithRightChecksums(kPng16), ReadAnyImage);
}

RC_GTEST_PROP(ParserProperty, JpegFromMutatedFiles, ()) {
  ParsesOrFails(Mutated(kJpeg), ReadAnyImage);
}

RC_GTEST_PROP(ParserProperty, PnmFromMutatedFiles, ()) {
  ParsesOrFails(Mutated(kPpm), ReadAnyImage);
}

RC_GTEST_PROP(ParserProperty, DisparityFromMutatedFiles, ()) {
  ParsesOrFails(MutatedWithRightChecksums(kPng16),
                [](const std::filesystem::path& path) { ReadDisparity(path); });
}

}  // namespace
}  // namespace sgf
