#include <iterator>
#include <string>

#include <fmt/format.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/rows.h>
#include <sgf/io/trajectory.h>

namespace sgf {

std::vector<TimedPose> ReadTrajectory(const std::filesystem::path& path) {
  std::vector<TimedPose> poses;
  ForEachRow(path, ' ', 8, [&](const Fields& fields, const std::string& where) {
    const auto number = [&](size_t i) { return NumberField<double>(fields[i], where); };
    const Eigen::Quaterniond q(number(7), number(4), number(5), number(6));
    AppendLater(
        poses,
        {SecondsField(fields[0], where), {UnitQuaternion(q, where), VectorField(fields, 1, where)}},
        where);
  });
  return poses;
}

void WriteTrajectory(const std::filesystem::path& path, std::span<const TimedPose> poses) {
  std::string text = "# time_s tx ty tz qx qy qz qw\n";
  std::int64_t last_ns = -1;
  for (const auto& [time_ns, pose] : poses) {
    if (time_ns < 0) throw Error(path.string(), fmt::format("time {} ns is negative", time_ns));
    if (time_ns <= last_ns)
      throw Error(path.string(),
                  fmt::format("time {} ns does not come after {} ns", time_ns, last_ns));
    fmt::format_to(std::back_inserter(text), "{} {} {}\n", FormatSeconds(time_ns),
                   fmt::join(pose.p, " "), fmt::join(pose.R.coeffs(), " "));
    last_ns = time_ns;
  }
  WriteTextFile(path, text);
}

std::vector<PoseCovariance> ReadPoseCovariances(const std::filesystem::path& path) {
  constexpr int kRows = 15, kPoseRows = 6;
  std::vector<PoseCovariance> covariances;
  ForEachRow(path, ',', 1 + kRows * (kRows + 1) / 2,
             [&](const Fields& fields, const std::string& where) {
               PoseCovariance read{NumberField<std::int64_t>(fields[0], where)};
               size_t field = 1;
               for (int row = 0; row < kPoseRows; ++row)
                 for (int column = 0; column <= row; ++column)
                   read.covariance(row, column) = read.covariance(column, row) =
                       NumberField<double>(fields[field++], where);
               AppendLater(covariances, read, where);
             });
  return covariances;
}

}  // namespace sgf
