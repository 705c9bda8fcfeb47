#include <algorithm>
#include <iomanip>
#include <sstream>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include <sgf/apps/trajectory_scores.h>
#include <sgf/core/options.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/fields.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/io/ply.h>
#include <sgf/io/trajectory.h>

namespace sgf::apps {
namespace {

// What an estimate is compared with.
struct Reference {
  std::vector<TimedPose> truth;
  SE3 T_body_est;
  std::vector<std::int64_t> frame_times_ns;
};

Reference SequenceReference(const std::string& folder, PoseFrame frame) {
  OdometrySequence sequence = OpenOdometrySequence(folder);
  if (sequence.truth.empty()) throw Error(folder, "has no ground truth");
  Reference reference;
  reference.truth = std::move(sequence.truth);
  if (frame == PoseFrame::kCamera) reference.T_body_est = sequence.cameras.front().T_body_cam;
  for (const OdometryFrame& f : sequence.frames) reference.frame_times_ns.push_back(f.time_ns);
  return reference;
}

Reference FileReference(const std::string& file) {
  Reference reference;
  reference.truth = ReadTrajectory(file);
  if (reference.truth.empty()) throw Error(file, "has no poses");
  return reference;
}

// The poses that are compared.
std::vector<TimedPose> Compared(const std::vector<TimedPose>& estimate,
                                const TrajectoryScoreRequest& request) {
  std::vector<TimedPose> common = estimate;
  for (const std::string& file : request.common)
    common = KeepCommonTimes(common, ReadTrajectory(file));
  return common;
}

// @param compared those of the estimate's poses that are compared.
TrajectoryScores Score(const std::vector<TimedPose>& estimate,
                       const std::vector<TimedPose>& compared, const Reference& reference,
                       const TrajectoryScoreRequest& request) {
  const auto score = [&](const std::vector<TimedPose>& poses) {
    return ScoreTrajectory(poses, reference.truth, reference.T_body_est, reference.frame_times_ns,
                           request.options.trajectory);
  };
  TrajectoryScores scores = score(compared);
  if (!request.covariances.empty())
    scores.nees = ScoreConsistency(compared, ReadPoseCovariances(request.covariances),
                                   reference.truth, request.options.trajectory.max_truth_gap_s);
  if (request.common.empty()) return scores;
  scores.coverage_pct = score(estimate).coverage_pct;
  return scores;
}

// The list of fields that documents options prints scores as well, "default" being the score.
using Scores = std::vector<OptionDoc>;

void PrintTable(const Scores& scores) {
  for (const OptionDoc& score : scores) {
    const auto number = ParseNumber<double>(score.default_value);
    fmt::print("{:<31} {:>12} {:<3}  {}\n", score.name,
               number ? fmt::format("{:.6g}", *number) : score.default_value, score.unit,
               score.text);
  }
}

// The request and the scores as names and values; values are not yet quoted.
struct Record {
  std::vector<std::pair<std::string, std::string>> texts;
  Scores scores;
};

Record MakeRecord(const TrajectoryScoreRequest& request, Scores scores) {
  Record record{{{"estimate", request.estimate},
                 {"truth", request.sequence.empty() ? request.truth : request.sequence}},
                std::move(scores)};
  for (const OptionDoc& option : DescribeOptions(request.options))
    record.texts.emplace_back(option.name, option.default_value);
  return record;
}

std::string ToCsv(const Record& record) {
  std::ostringstream names, values;
  for (const auto& [name, value] : record.texts) {
    names << name << ",";
    values << std::quoted(value, '"', '"') << ",";
  }
  const char* separator = "";
  for (const OptionDoc& score : record.scores) {
    names << separator << score.name;
    values << separator << score.default_value;
    separator = ",";
  }
  return names.str() + "\n" + values.str() + "\n";
}

// Numbers that are none become null, which is all that JSON has for them.
std::string ToJson(const Record& record) {
  nlohmann::ordered_json json;
  for (const auto& [name, value] : record.texts) json[name] = value;
  for (const OptionDoc& score : record.scores) {
    const bool finite = ParseNumber<double>(score.default_value).has_value();
    const bool truth_value = score.default_value == "true" || score.default_value == "false";
    json[score.name] = finite || truth_value ? nlohmann::ordered_json::parse(score.default_value)
                                             : nlohmann::ordered_json();
  }
  return json.dump(2) + "\n";
}

// Writes poses and points in the world of the truth, as far as they are asked for.
void WriteAligned(const std::vector<TimedPose>& estimate, const std::vector<TimedPose>& compared,
                  const Reference& reference, const TrajectoryScoreRequest& request) {
  const auto motion =
      AlignTrajectory(compared, reference.truth, reference.T_body_est, request.options.trajectory);
  if (!request.aligned.empty()) {
    const SE3 T_est_body = reference.T_body_est.Inverse();
    std::vector<TimedPose> body;
    if (motion)
      for (const auto& [time_ns, pose] : estimate)
        body.push_back({time_ns, *motion * pose * T_est_body});
    WriteTrajectory(request.aligned, body);
  }
  if (request.points.empty()) return;
  std::vector<PlyPoint> points = ReadPointsPly(request.points);
  if (!motion) points.clear();
  for (PlyPoint& point : points) {
    const cv::Point3d p = point.position;
    const Eigen::Vector3d moved = *motion * Eigen::Vector3d(p.x, p.y, p.z);
    point.position = cv::Point3d(moved.x(), moved.y(), moved.z());
  }
  WritePointsPly(request.aligned_points, points,
                 "world of the ground truth, m; variance as it was");
}

}  // namespace

std::span<const std::pair<const char*, PoseFrame>> EnumNames(PoseFrame) {
  static constexpr std::pair<const char*, PoseFrame> kNames[] = {{"body", PoseFrame::kBody},
                                                                 {"camera", PoseFrame::kCamera}};
  return kNames;
}

void ScoreTrajectoryFile(const TrajectoryScoreRequest& request) {
  const Reference reference = request.sequence.empty()
                                  ? FileReference(request.truth)
                                  : SequenceReference(request.sequence, request.options.frame);
  const std::vector<TimedPose> estimate = ReadTrajectory(request.estimate);
  const std::vector<TimedPose> compared = Compared(estimate, request);
  const Scores scores = DescribeOptions(Score(estimate, compared, reference, request));
  PrintTable(scores);
  WriteAligned(estimate, compared, reference, request);
  if (request.output.empty()) return;
  const Record record = MakeRecord(request, scores);
  WriteTextFile(request.output, request.output.ends_with(".json") ? ToJson(record) : ToCsv(record));
}

}  // namespace sgf::apps
