#include <string>

#include <gtest/gtest.h>
#include <support/error_message.h>
#include <support/temp_dir.h>

#include <sgf/io/ply.h>

namespace sgf {
namespace {

std::string Text(const std::string& count) {
  return "ply\nformat binary_little_endian 1.0\ncomment any\nelement vertex " + count +
         "\nproperty float x\nproperty float y\nproperty float z\nproperty float variance\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty int support\n"
         "end_header\n";
}

TEST(PointsPly, GivesBackWhatWasWritten) {
  const TempDir dir;
  const auto file = dir.path() / "points.ply";
  const std::vector<PlyPoint> points = {{{1, -2, 3.5f}, 17, 0.25f, 4},
                                        {{1e-3f, 1e9f, 0}, 255, 0, -1}};
  WritePointsPly(file, points, "units");
  const std::vector<PlyPoint> read = ReadPointsPly(file);
  ASSERT_EQ(read.size(), points.size());
  for (size_t k = 0; k < points.size(); ++k) {
    EXPECT_EQ(read[k].position, points[k].position);
    EXPECT_EQ(read[k].grey, points[k].grey);
    EXPECT_EQ(read[k].variance, points[k].variance);
    EXPECT_EQ(read[k].support, points[k].support);
  }
  WritePointsPly(file, {}, "units");
  EXPECT_TRUE(ReadPointsPly(file).empty());
}

TEST(PointsPly, IsWrittenAsPointsCome) {
  const TempDir dir;
  const auto file = dir.path() / "points.ply";
  constexpr int kPoints = 10'000;  // more than are held back
  PointsPlyWriter writer(file, "units");
  for (int k = 0; k < kPoints; ++k) writer.Add({{1, 2, 3}, 4, 5, k});
  EXPECT_FALSE(std::filesystem::exists(file));
  writer.Commit();
  EXPECT_EQ(writer.count(), kPoints);
  const std::vector<PlyPoint> read = ReadPointsPly(file);
  ASSERT_EQ(read.size(), size_t{kPoints});
  for (int k = 0; k < kPoints; ++k) ASSERT_EQ(read[k].support, k);
}

TEST(PointsPly, NamesAFileThatIsAnother) {
  const TempDir dir;
  const auto error = [&](const std::string& text) {
    return ErrorMessage([&] { ReadPointsPly(dir.Write("points.ply", text)); });
  };
  EXPECT_TRUE(error("").ends_with("points.ply: has no 'element vertex ' in its header"));
  EXPECT_TRUE(error(Text("2")).ends_with("points.ply: 0 bytes do not hold 2 points"));
  EXPECT_TRUE(error(Text("0") + "x").ends_with("points.ply: 1 bytes do not hold 0 points"));
  std::string no_ply = Text("0"), other_axes = Text("0");
  no_ply[0] = 'x';
  other_axes[other_axes.find(" z\n") + 1] = 'w';
  for (const std::string& text : {Text("-1"), Text("two"), Text("99999999999"), no_ply, other_axes})
    EXPECT_NE(error(text).find("points.ply: is no binary PLY file"), std::string::npos) << text;
}

}  // namespace
}  // namespace sgf
