#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <type_traits>

#include <Eigen/Geometry>

#include <sgf/eval/statistics.h>
#include <sgf/eval/trajectory.h>

namespace sgf {
namespace {

constexpr std::int64_t kSameTime_ns = 1000;
constexpr size_t kMinPoses = 3;
constexpr double kMaxSuccess_m = 1.5, kMedianSuccess_m = 0.1;

// An estimated and a true pose at the same time.
struct PosePair {
  std::int64_t time_ns = 0;
  SE3 estimate;
  SE3 truth;
};
using PosePairs = std::vector<PosePair>;

SE3 Interpolate(const SE3& a, const SE3& b, double share) {
  return {a.R.slerp(share, b.R), a.p + share * (b.p - a.p)};
}

bool Earlier(const TimedPose& pose, std::int64_t time_ns) { return pose.time_ns < time_ns; }

bool HasPoseAt(std::span<const TimedPose> trajectory, std::int64_t time_ns) {
  const auto it =
      std::lower_bound(trajectory.begin(), trajectory.end(), time_ns - kSameTime_ns, Earlier);
  return it != trajectory.end() && it->time_ns <= time_ns + kSameTime_ns;
}

PosePairs Associate(std::span<const TimedPose> estimate, std::span<const TimedPose> truth,
                    double max_gap_s) {
  PosePairs pairs;
  for (const auto& [time_ns, pose] : estimate)
    if (const auto true_pose = InterpolatePose(truth, time_ns, max_gap_s))
      pairs.push_back({time_ns, pose, *true_pose});
  return pairs;
}

// ---- Alignment

// The transformation that maps estimated to true positions best.
Eigen::Matrix4d Umeyama(const PosePairs& pairs, bool with_scale) {
  Eigen::Matrix3Xd estimate(3, pairs.size()), truth(3, pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    estimate.col(static_cast<Eigen::Index>(i)) = pairs[i].estimate.p;
    truth.col(static_cast<Eigen::Index>(i)) = pairs[i].truth.p;
  }
  return Eigen::umeyama(estimate, truth, with_scale);
}

// The scale of the estimate, found on the positions of the estimated frame; 1 for an estimate that
// never moves, which has none.
double FindScale(PosePairs pairs, const SE3& T_body_est) {
  for (PosePair& pair : pairs) pair.truth = pair.truth * T_body_est;
  const double scale = Umeyama(pairs, true).topLeftCorner<3, 3>().col(0).norm();
  return std::isfinite(scale) ? scale : 1;
}

// Makes estimated poses those of the body, in the world of the truth; returns what moved them.
TrajectoryMotion Align(const SE3& T_body_est, TrajectoryAlignment align, PosePairs& pairs) {
  TrajectoryMotion found;
  if (align == TrajectoryAlignment::kSim3) found.scale = FindScale(pairs, T_body_est);
  const SE3 T_est_body = T_body_est.Inverse();
  for (PosePair& pair : pairs) {
    pair.estimate.p *= found.scale;
    pair.estimate = pair.estimate * T_est_body;
  }
  if (align == TrajectoryAlignment::kNone) return found;
  const Eigen::Matrix4d m = Umeyama(pairs, false);
  found.motion = {Eigen::Quaterniond(m.topLeftCorner<3, 3>()).normalized(),
                  m.topRightCorner<3, 1>()};
  for (PosePair& pair : pairs) pair.estimate = found.motion * pair.estimate;
  return found;
}

// ---- Errors

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double RootMeanSquare(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double Largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

double AngleDeg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return LogSO3(a.conjugate() * b).norm() * 180 / std::numbers::pi;
}

// Length of the true path from the first pose to each.
std::vector<double> PathLengths(const PosePairs& pairs) {
  std::vector<double> lengths{0};
  for (size_t i = 1; i < pairs.size(); ++i)
    lengths.push_back(lengths.back() + (pairs[i].truth.p - pairs[i - 1].truth.p).norm());
  return lengths;
}

// Index of the pair that ends a stretch of time from pair `first` on; none if there is none near.
std::optional<size_t> StretchEnd(const PosePairs& pairs, size_t first, std::int64_t length_ns) {
  const std::int64_t end_ns = pairs[first].time_ns + length_ns;
  const auto distance = [&](size_t i) { return std::abs(pairs[i].time_ns - end_ns); };
  const auto later = std::lower_bound(
      pairs.begin(), pairs.end(), end_ns,
      [](const PosePair& pair, std::int64_t time_ns) { return pair.time_ns < time_ns; });
  size_t i = std::min(static_cast<size_t>(later - pairs.begin()), pairs.size() - 1);
  if (i > first && distance(i - 1) <= distance(i)) --i;
  return i > first && distance(i) <= length_ns / 10 ? std::optional(i) : std::nullopt;
}

RelativeErrors ScoreStretches(const PosePairs& pairs, const std::vector<double>& path,
                              std::int64_t length_ns) {
  std::vector<double> translations, rotations;
  double path_m = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto j = StretchEnd(pairs, i, length_ns);
    if (!j) continue;
    const SE3 estimate = pairs[i].estimate.Inverse() * pairs[*j].estimate;
    const SE3 truth = pairs[i].truth.Inverse() * pairs[*j].truth;
    translations.push_back((truth.Inverse() * estimate).p.norm());
    rotations.push_back(AngleDeg(truth.R, estimate.R));
    path_m += path[*j] - path[i];
  }
  const auto count = static_cast<double>(translations.size());
  return {static_cast<int>(translations.size()), RootMeanSquare(translations),
          RootMeanSquare(rotations), 100 * Mean(translations) * count / path_m};
}

void ScorePositions(const PosePairs& pairs, TrajectoryScores& scores) {
  std::vector<double> errors, scale_errors;
  const PosePair& first = pairs.front();
  for (const PosePair& pair : pairs) {
    errors.push_back((pair.estimate.p - pair.truth.p).norm());
    scale_errors.push_back(std::abs((pair.estimate.p - first.estimate.p).norm() -
                                    (pair.truth.p - first.truth.p).norm()));
  }
  scores.ate_mean_m = Mean(errors);
  scores.ate_rmse_m = RootMeanSquare(errors);
  scores.ate_median_m = Median(errors);
  scores.ate_max_m = Largest(errors);
  scores.scale_error_max_m = Largest(scale_errors);
  scores.scale_error_median_m = Median(scale_errors);
  const auto succeeds = [](double max, double median) {
    return max <= kMaxSuccess_m && median <= kMedianSuccess_m;
  };
  scores.success_by_ate = succeeds(scores.ate_max_m, scores.ate_median_m);
  scores.success_by_scale = succeeds(scores.scale_error_max_m, scores.scale_error_median_m);
}

void ScoreOrientations(const PosePairs& pairs, TrajectoryScores& scores) {
  std::vector<double> errors;
  for (const PosePair& pair : pairs) errors.push_back(AngleDeg(pair.truth.R, pair.estimate.R));
  scores.orientation_mean_deg = Mean(errors);
  scores.orientation_rmse_deg = RootMeanSquare(errors);
}

void ScoreCoverage(std::span<const TimedPose> estimate, std::span<const TimedPose> truth,
                   std::span<const std::int64_t> frame_times_ns, double max_gap_s,
                   TrajectoryScores& scores) {
  int covered = 0;
  for (const std::int64_t time_ns : frame_times_ns) {
    if (!InterpolatePose(truth, time_ns, max_gap_s)) continue;
    ++scores.frames;
    covered += HasPoseAt(estimate, time_ns);
  }
  scores.coverage_pct = 100.0 * covered / scores.frames;  // NaN without frames
}

// Scores of a trajectory that cannot be compared.
TrajectoryScores NoScores() {
  TrajectoryScores scores;
  const auto clear = [](auto& value) {
    if constexpr (std::is_same_v<decltype(value), double&>)
      value = std::numeric_limits<double>::quiet_NaN();
  };
  scores.VisitFields([&](const char*, auto& value, const char*, const char*) {
    if constexpr (std::is_class_v<std::remove_reference_t<decltype(value)>>)
      value.VisitFields([&](const char*, auto& inner, const char*, const char*) { clear(inner); });
    else
      clear(value);
  });
  return scores;
}

}  // namespace

std::span<const std::pair<const char*, TrajectoryAlignment>> EnumNames(TrajectoryAlignment) {
  static constexpr std::pair<const char*, TrajectoryAlignment> kNames[] = {
      {"none", TrajectoryAlignment::kNone},
      {"se3", TrajectoryAlignment::kSe3},
      {"sim3", TrajectoryAlignment::kSim3}};
  return kNames;
}

std::optional<SE3> InterpolatePose(std::span<const TimedPose> trajectory, std::int64_t time_ns,
                                   double max_gap_s) {
  const auto later = std::lower_bound(trajectory.begin(), trajectory.end(), time_ns, Earlier);
  const bool has_later = later != trajectory.end(), has_earlier = later != trajectory.begin();
  if (has_later && later->time_ns - time_ns <= kSameTime_ns) return later->pose;
  if (has_earlier && time_ns - std::prev(later)->time_ns <= kSameTime_ns)
    return std::prev(later)->pose;
  if (!has_later || !has_earlier) return std::nullopt;
  const TimedPose& earlier = *std::prev(later);
  const auto gap_ns = static_cast<double>(later->time_ns - earlier.time_ns);
  if (gap_ns > max_gap_s * 1e9) return std::nullopt;
  return Interpolate(earlier.pose, later->pose,
                     static_cast<double>(time_ns - earlier.time_ns) / gap_ns);
}

std::vector<TimedPose> KeepCommonTimes(std::span<const TimedPose> trajectory,
                                       std::span<const TimedPose> other) {
  std::vector<TimedPose> common;
  for (const TimedPose& pose : trajectory)
    if (HasPoseAt(other, pose.time_ns)) common.push_back(pose);
  return common;
}

std::optional<TrajectoryMotion> AlignTrajectory(std::span<const TimedPose> estimate,
                                                std::span<const TimedPose> truth,
                                                const SE3& T_body_est,
                                                const TrajectoryOptions& options) {
  PosePairs pairs = Associate(estimate, truth, options.max_truth_gap_s);
  if (pairs.size() < kMinPoses) return std::nullopt;
  return Align(T_body_est, options.align, pairs);
}

TrajectoryScores ScoreTrajectory(std::span<const TimedPose> estimate,
                                 std::span<const TimedPose> truth, const SE3& T_body_est,
                                 std::span<const std::int64_t> frame_times_ns,
                                 const TrajectoryOptions& options) {
  PosePairs pairs = Associate(estimate, truth, options.max_truth_gap_s);
  TrajectoryScores scores = NoScores();
  ScoreCoverage(estimate, truth, frame_times_ns, options.max_truth_gap_s, scores);
  scores.poses = static_cast<int>(pairs.size());
  if (pairs.size() < kMinPoses) return scores;
  scores.scale = Align(T_body_est, options.align, pairs).scale;
  const std::vector<double> path = PathLengths(pairs);
  scores.path_m = path.back();
  ScorePositions(pairs, scores);
  ScoreOrientations(pairs, scores);
  scores.rpe_half_second = ScoreStretches(pairs, path, 500'000'000);
  scores.rpe_one_second = ScoreStretches(pairs, path, 1'000'000'000);
  return scores;
}

Consistency ScoreConsistency(std::span<const TimedPose> estimate,
                             std::span<const PoseCovariance> covariances,
                             std::span<const TimedPose> truth, double max_truth_gap_s) {
  const PosePairs pairs = Associate(estimate, truth, max_truth_gap_s);
  std::vector<double> pose, rotation, position;
  auto known = covariances.begin();
  for (size_t k = 1; k < pairs.size(); ++k) {
    known = std::find_if(known, covariances.end(),
                         [&](const PoseCovariance& c) { return c.time_ns >= pairs[k].time_ns; });
    if (known == covariances.end()) break;
    if (known->time_ns != pairs[k].time_ns) continue;
    const SE3 expected = pairs.front().estimate * (pairs.front().truth.Inverse() * pairs[k].truth);
    Eigen::Matrix<double, 6, 1> error;
    error << LogSO3(pairs[k].estimate.R.conjugate() * expected.R), expected.p - pairs[k].estimate.p;
    const Eigen::LLT<Eigen::Matrix<double, 6, 6>> factor(known->covariance);
    if (factor.info() != Eigen::Success) continue;
    const auto part = [&](int begin) {
      const Eigen::Vector3d e = error.segment<3>(begin);
      return e.dot(known->covariance.block<3, 3>(begin, begin).llt().solve(e));
    };
    pose.push_back(error.dot(factor.solve(error)));
    rotation.push_back(part(0));
    position.push_back(part(3));
  }
  return {Mean(pose), Mean(rotation), Mean(position)};
}

}  // namespace sgf
