#include <cstdint>
#include <limits>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/io/read_file.h>
#include <sgf/io/rows.h>
#include <sgf/io/trajectory.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::EndsWith;

constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max();

TEST(Seconds, AreReadExactly) {
  EXPECT_EQ(ParseSeconds("1403636583.76356"), 1403636583763560000);
  EXPECT_EQ(ParseSeconds("1403636583.763560001"), 1403636583763560001);
  EXPECT_EQ(ParseSeconds("7"), 7'000'000'000);
  EXPECT_EQ(ParseSeconds("7."), 7'000'000'000);
  EXPECT_EQ(ParseSeconds("000.5"), 500'000'000);
  EXPECT_EQ(ParseSeconds("9223372036.854775806"), kMax - 1);
}

// As KITTI and numpy write them.
TEST(Seconds, MayHaveAnExponent) {
  EXPECT_EQ(ParseSeconds("0.000000e+00"), 0);
  EXPECT_EQ(ParseSeconds("1.036224e-01"), 103'622'400);
  EXPECT_EQ(ParseSeconds("1.403636583763560001E+09"), 1403636583763560001);
  EXPECT_EQ(ParseSeconds("25e1"), 250'000'000'000);
  EXPECT_EQ(ParseSeconds("123e-20"), 0);
}

TEST(Seconds, AreRoundedToNanoseconds) {
  EXPECT_EQ(ParseSeconds("0.0000000004"), 0);
  EXPECT_EQ(ParseSeconds("0.0000000005"), 1);
  EXPECT_EQ(ParseSeconds("1.9999999999"), 2'000'000'000);
  EXPECT_EQ(ParseSeconds("5e-10"), 1);
  EXPECT_EQ(ParseSeconds("5e-11"), 0);
}

TEST(Seconds, AreNothingElse) {
  for (const char* text :
       {"", ".", ".5", "-1", "+1", "x", "1.2.3", "1e", "1e+", "1e+-2", "1e99", "1e-99",
        "1e-2147483648", "1 2", "nan", "inf", "9223372036.854775807", "1e20"})
    EXPECT_EQ(ParseSeconds(text), std::nullopt) << text;
}

RC_GTEST_PROP(SecondsProperty, ReadWhatWasWritten, ()) {
  const auto time_ns = *rc::gen::inRange<std::int64_t>(0, kMax);
  RC_ASSERT(ParseSeconds(FormatSeconds(time_ns)) == time_ns);
}

RC_GTEST_PROP(TrajectoryProperty, ReadsTheBitsThatWereWritten, ()) {
  static const TempDir dir;
  const auto number = [] { return *rc::gen::inRange(-1'000'000, 1'000'000) / 3e3; };
  std::vector<TimedPose> poses(*rc::gen::inRange<size_t>(0, 5));
  std::int64_t time_ns = *rc::gen::inRange<std::int64_t>(0, 2'000'000'000'000'000'000);
  for (TimedPose& pose : poses) {
    pose = {time_ns,
            {ExpSO3({number(), number(), number()}).normalized(), {number(), number(), 0}}};
    time_ns += *rc::gen::inRange(1, 1'000'000'000);
  }
  WriteTrajectory(dir.path() / "t.txt", poses);
  const std::vector<TimedPose> read = ReadTrajectory(dir.path() / "t.txt");
  RC_ASSERT(read.size() == poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    RC_ASSERT(read[i].time_ns == poses[i].time_ns);
    RC_ASSERT(read[i].pose.p == poses[i].pose.p);
    RC_ASSERT(read[i].pose.R.coeffs() == poses[i].pose.R.coeffs());
  }
}

TEST(Trajectory, IsWrittenInTumFormat) {
  const TempDir dir;
  const auto path = dir.path() / "t.txt";
  WriteTrajectory(path, std::vector<TimedPose>{{1'500'000'001, {{0.8, 0, 0, 0.6}, {1, -2.5, 3}}}});
  EXPECT_EQ(ReadFile(path), "# time_s tx ty tz qx qy qz qw\n1.500000001 1 -2.5 3 0 0 0.6 0.8\n");
}

TEST(Trajectory, ReportsBadLines) {
  const TempDir dir;
  const auto message = [&](const char* text) {
    return ErrorMessage([&] { ReadTrajectory(dir.Write("t.txt", text)); });
  };
  EXPECT_THAT(message("1 0 0 0 0 0 0\n"), EndsWith("t.txt:1: has 7 columns, expected 8"));
  EXPECT_THAT(message("#\n1 0 x 0 0 0 0 1\n"), EndsWith("t.txt:2: 'x' is no number of its column"));
  EXPECT_THAT(message("a 0 0 0 0 0 0 1\n"), EndsWith("t.txt:1: 'a' is no time in seconds"));
  EXPECT_THAT(message("1 0 0 0 0 0 0 2\n"), EndsWith("t.txt:1: quaternion has norm 2, expected 1"));
  EXPECT_THAT(message("1 0 0 0 0 0 0 1\n1.0 0 0 0 0 0 0 1\n"),
              EndsWith("t.txt:2: time 1000000000 is not after 1000000000"));
}

TEST(PoseCovariances, AreTheFirstRowsOfAState) {
  const TempDir dir;
  std::string row;
  for (int k = 1; k <= 120; ++k) row += fmt::format(",{}", k);
  const auto read = [&](const std::string& text) {
    return ReadPoseCovariances(dir.Write("c.csv", text));
  };
  const auto covariances = read("# of states\n5" + row + "\n7" + row + "\n");
  ASSERT_EQ(covariances.size(), 2u);
  EXPECT_EQ(covariances[1].time_ns, 7);
  EXPECT_EQ(covariances[1].covariance(0, 0), 1);
  EXPECT_EQ(covariances[1].covariance(5, 0), 16);
  EXPECT_EQ(covariances[1].covariance(0, 5), 16);
  EXPECT_EQ(covariances[1].covariance(5, 5), 21);
  EXPECT_THAT(ErrorMessage([&] { read("5,1,2\n"); }),
              EndsWith("c.csv:1: has 3 columns, expected 121"));
  EXPECT_THAT(ErrorMessage([&] { read("5" + row + "\n5" + row + "\n"); }),
              EndsWith("c.csv:2: time 5 is not after 5"));
}

TEST(Trajectory, RefusesToWriteTimesOutOfOrder) {
  const TempDir dir;
  const auto message = [&](const std::vector<TimedPose>& poses) {
    return ErrorMessage([&] { WriteTrajectory(dir.path() / "t.txt", poses); });
  };
  EXPECT_THAT(message({{5, {}}, {5, {}}}), EndsWith("time 5 ns does not come after 5 ns"));
  EXPECT_THAT(message({{-7, {}}}), EndsWith("time -7 ns is negative"));
  EXPECT_FALSE(std::filesystem::exists(dir.path() / "t.txt"));
}

}  // namespace
}  // namespace sgf
