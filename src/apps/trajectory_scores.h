#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sgf/eval/trajectory.h>

namespace sgf::apps {

/// The frame whose poses a trajectory file holds.
enum class PoseFrame {
  kCamera,  ///< the left (or only) camera of the sequence, as it is calibrated: before
            ///< rectification
  kBody,    ///< the frame of the ground truth
};
std::span<const std::pair<const char*, PoseFrame>> EnumNames(PoseFrame);

/// How `sgf_eval trajectory` compares.
struct TrajectoryScoreOptions {
  TrajectoryOptions trajectory;
  PoseFrame frame = PoseFrame::kBody;

  template <class V>
  void VisitFields(V&& visit) {
    trajectory.VisitFields(visit);
    visit("frame", frame, "", "what the estimated poses are of, with --sequence: body or camera");
  }
};

/// What to score. Ground truth is that of a sequence or stands in a file of its own.
struct TrajectoryScoreRequest {
  std::string estimate;  ///< TUM file
  std::string sequence;  ///< folder as OpenOdometrySequence() takes it, or empty
  std::string truth;     ///< TUM file with poses of the frame of the estimate, or empty
  /// TUM files of other estimates: only poses at times that all of them have are compared. Coverage
  /// stays that of the estimate itself.
  std::vector<std::string> common;
  std::string covariances;     ///< of the estimate, a file as sgf_vio writes it, or empty
  std::string output;          ///< file to write: *.json, or else CSV; empty for none
  std::string aligned;         ///< TUM file to write: the body in the truth's world; empty for none
  std::string points;          ///< PLY file with points of the estimate's world, or empty
  std::string aligned_points;  ///< PLY file to write: these points in the truth's world
  TrajectoryScoreOptions options;
};

/// Scores a trajectory: a table to stdout, and the files that are asked for. Of an estimate that
/// cannot be compared nothing is aligned: the files of aligned poses and points hold none.
/// @throws Error for files that cannot be read or written and a sequence without ground truth.
void ScoreTrajectoryFile(const TrajectoryScoreRequest& request);

}  // namespace sgf::apps
