#include <array>
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/io/ply.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::HasSubstr;

TEST(Ply, PointsHaveColourVarianceAndSupport) {
  const TempDir dir;
  const std::vector<PlyPoint> points = {{{1, 2, 3}, 300, 0.25F, 4}, {{-1, 0, 5}, 7.4F, 0.5F, 2}};
  WritePointsPly(dir.File("points.ply"), points, "of a test");
  const std::string text = ReadFile(dir.File("points.ply"));
  EXPECT_THAT(text, HasSubstr("element vertex 2\n"));
  EXPECT_THAT(text, HasSubstr("comment of a test\n"));
  const std::string end = "end_header\n";
  const size_t begin = text.find(end) + end.size();
  constexpr size_t kSize = 4 * sizeof(float) + 3 + sizeof(int);
  ASSERT_EQ(text.size(), begin + 2 * kSize);
  const auto read = [&](size_t point, size_t offset, auto& value) {
    std::memcpy(&value, text.data() + begin + point * kSize + offset, sizeof(value));
  };
  std::array<float, 4> numbers;
  std::array<unsigned char, 3> colour;
  int support;
  read(1, 0, numbers);
  EXPECT_THAT(numbers, testing::ElementsAre(-1, 0, 5, 0.5F));
  read(1, 16, colour);
  EXPECT_THAT(colour, testing::Each(7));
  read(0, 16, colour);
  EXPECT_THAT(colour, testing::Each(255)) << "cut";
  read(0, 19, support);
  EXPECT_EQ(support, 4);
}

TEST(Ply, ReportsAFileThatCannotBeWritten) {
  EXPECT_THAT(ErrorMessage([] { WritePointsPly("/nonexistent/p.ply", {}, ""); }),
              HasSubstr("/nonexistent"));
}

}  // namespace
}  // namespace sgf
