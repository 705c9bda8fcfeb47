#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <sgf/core/timed_pose.h>

/// Trajectories in the text format of the TUM RGB-D benchmark (Sturm et al., IROS 2012): a pose a
/// line, "time tx ty tz qx qy qz qw" with the time in s and the position in m; '#' begins a
/// comment.
namespace sgf {

/// Reads a trajectory. Times are exact (see ParseSeconds()). A file without poses gives none.
/// @throws Error naming file and line: a wrong number of columns, a number that is none, times that
///   do not increase, a quaternion whose norm is not 1; as ReadFile().
std::vector<TimedPose> ReadTrajectory(const std::filesystem::path& path);

/// Writes a trajectory from which ReadTrajectory() gives the same bits back.
/// @param poses of increasing times, not negative.
/// @throws Error naming the file for times out of order and a file that cannot be written.
void WriteTrajectory(const std::filesystem::path& path, std::span<const TimedPose> poses);

/// Reads the covariances of poses from a file of covariances of whole states: rows of the time (ns)
/// and the lower triangle, row by row, of a matrix of 15 rows whose first six are a pose's.
/// @throws Error naming file and line: a wrong number of columns, a number that is none, times that
///   do not increase; as ReadFile().
std::vector<PoseCovariance> ReadPoseCovariances(const std::filesystem::path& path);

}  // namespace sgf
