#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <sgf/core/se3.h>
#include <sgf/core/timed_pose.h>

namespace sgf {

/// What an estimated trajectory is moved by before it is compared with ground truth. It is found in
/// closed form from all compared positions (Umeyama, "Least-squares estimation of transformation
/// parameters between two point patterns", PAMI 1991).
enum class TrajectoryAlignment {
  kNone,  ///< nothing: both are in one world
  kSe3,   ///< a rigid motion
  kSim3,  ///< a rigid motion and a scale, for estimates of unknown scale
};
std::span<const std::pair<const char*, TrajectoryAlignment>> EnumNames(TrajectoryAlignment);

/// How trajectories are compared.
struct TrajectoryOptions {
  TrajectoryAlignment align = TrajectoryAlignment::kSe3;
  double max_truth_gap_s = 0.02;

  template <class V>
  void VisitFields(V&& visit) {
    visit("align", align, "", "what the estimate is moved by: none, se3 or sim3");
    visit("max_truth_gap_s", max_truth_gap_s, "s",
          "ground truth is interpolated between poses no farther apart than this");
  }
};

/// Errors of the relative motion over a stretch of time (relative pose error, RPE).
struct RelativeErrors {
  int stretches = 0;           ///< that were compared
  double translation_m = 0;    ///< root mean square
  double rotation_deg = 0;     ///< root mean square
  double percent_of_path = 0;  ///< sum of translation errors / sum of path lengths

  template <class V>
  void VisitFields(V&& visit) {
    visit("stretches", stretches, "", "compared stretches");
    visit("translation_m", translation_m, "m", "RMSE of the relative translation");
    visit("rotation_deg", rotation_deg, "deg", "RMSE of the relative rotation");
    visit("percent_of_path", percent_of_path, "%", "translation errors over path lengths");
  }
};

/// Normalised estimation errors squared, e^T P^-1 e, averaged over poses. An estimator that knows
/// how good it is has as much as there are degrees of freedom: 6, 3 and 3.
struct Consistency {
  double pose = 0;
  double rotation = 0;
  double position = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("pose", pose, "", "of the pose (6 where the covariance is true)");
    visit("rotation", rotation, "", "of the rotation (3)");
    visit("position", position, "", "of the position (3)");
  }
};

/// Errors of a trajectory against ground truth. All but the counts are NaN where fewer than three
/// poses can be compared, and those of a stretch of time where no stretch can.
struct TrajectoryScores {
  int frames = 0;           ///< of the sequence, with ground truth; 0 where they are not known
  int poses = 0;            ///< estimated poses with ground truth: those that are compared
  double coverage_pct = 0;  ///< frames with an estimated pose; NaN where frames are not known
  double path_m = 0;        ///< length of the true path through the compared poses
  double scale = 1;         ///< by which the estimate was multiplied
  double ate_mean_m = 0;    ///< absolute trajectory error: of positions after alignment
  double ate_rmse_m = 0;
  double ate_median_m = 0;
  double ate_max_m = 0;
  double orientation_mean_deg = 0;  ///< angle between orientations after alignment
  double orientation_rmse_deg = 0;
  RelativeErrors rpe_half_second;  ///< over 0.5 s
  RelativeErrors rpe_one_second;   ///< over 1 s
  /// Of | |p_k - p_0| - |q_k - q_0| | over poses k, p estimated and q true positions.
  double scale_error_max_m = 0;
  double scale_error_median_m = 0;
  bool success_by_scale = false;  ///< scale errors of at most 1.5 m, median of at most 0.1 m
  bool success_by_ate = false;    ///< the same limits on the position errors
  Consistency nees;               ///< ScoreConsistency(); NaN where no covariances are known

  template <class V>
  void VisitFields(V&& visit) {
    visit("frames", frames, "", "frames of the sequence with ground truth; 0: not known");
    visit("poses", poses, "", "compared poses");
    visit("coverage_pct", coverage_pct, "%", "frames with a pose");
    visit("path_m", path_m, "m", "length of the true path");
    visit("scale", scale, "", "factor that the estimate was multiplied by");
    visit("ate_mean_m", ate_mean_m, "m", "mean position error");
    visit("ate_rmse_m", ate_rmse_m, "m", "root mean square position error");
    visit("ate_median_m", ate_median_m, "m", "median position error");
    visit("ate_max_m", ate_max_m, "m", "largest position error");
    visit("orientation_mean_deg", orientation_mean_deg, "deg", "mean orientation error");
    visit("orientation_rmse_deg", orientation_rmse_deg, "deg", "RMSE of the orientation");
    visit("rpe_half_second", rpe_half_second, "", "errors of the motion over 0.5 s");
    visit("rpe_one_second", rpe_one_second, "", "errors of the motion over 1 s");
    visit("scale_error_max_m", scale_error_max_m, "m",
          "largest error of the distance to the start");
    visit("scale_error_median_m", scale_error_median_m, "m", "its median");
    visit("success_by_scale", success_by_scale, "", "those at most 1.5 m and 0.1 m");
    visit("success_by_ate", success_by_ate, "", "position errors at most 1.5 m, median 0.1 m");
    visit("nees", nees, "", "normalised estimation error squared");
  }
};

/// Pose of a trajectory at a time: its own where it has one (to 1 us, the resolution of files that
/// hold epoch times as doubles), else interpolated between the two around it, linearly in position
/// and at constant angular rate.
/// @param trajectory poses of increasing times.
/// @return none before the first and after the last pose and where the two are more than
///   `max_gap_s` apart.
std::optional<SE3> InterpolatePose(std::span<const TimedPose> trajectory, std::int64_t time_ns,
                                   double max_gap_s);

/// What brings an estimate to ground truth: a place x of the estimate's world is at
/// motion * (scale * x) of the truth's.
struct TrajectoryMotion {
  double scale = 1;
  SE3 motion;  ///< from the scaled world of the estimate to that of the truth

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return motion * (scale * x); }

  /// The pose in the truth's world; its frame stays what it is.
  SE3 operator*(const SE3& pose) const { return motion * SE3{pose.R, scale * pose.p}; }
};

/// The poses of a trajectory at whose times (to 1 us) another one has a pose too. Errors of two
/// estimates are compared over the same poses only.
std::vector<TimedPose> KeepCommonTimes(std::span<const TimedPose> trajectory,
                                       std::span<const TimedPose> other);

/// What ScoreTrajectory() moves an estimate by, for all that was estimated with it, such as a map.
/// Arguments as there. None where fewer than three poses can be compared.
std::optional<TrajectoryMotion> AlignTrajectory(std::span<const TimedPose> estimate,
                                                std::span<const TimedPose> truth,
                                                const SE3& T_body_est,
                                                const TrajectoryOptions& options);

/// Scores an estimated trajectory; all errors are those of the body.
///
/// Estimated poses become poses of the body through T_body_est before anything is compared. With
/// kSim3 the scale is found before that, on the positions of frame `est` itself, since the lever
/// arm between the two has a known length. Stretches of time begin at every pose and end at the
/// pose nearest to their length, if that is within 10 % of it.
/// @param estimate T_any_est, of increasing times.
/// @param truth T_world_body, of increasing times.
/// @param T_body_est pose on the body of the frame that was estimated, such as a camera.
/// @param frame_times_ns those of the frames that should have a pose; empty where not known.
TrajectoryScores ScoreTrajectory(std::span<const TimedPose> estimate,
                                 std::span<const TimedPose> truth, const SE3& T_body_est,
                                 std::span<const std::int64_t> frame_times_ns,
                                 const TrajectoryOptions& options);

/// Compares the errors of poses with the covariances that are stated for them. Errors are those of
/// the pose relative to the first compared one, where the true trajectory is laid onto the
/// estimate.
/// @param estimate, truth of one frame, as ScoreTrajectory() takes them.
/// @param covariances of increasing times, of that frame. Singular ones are left out.
/// @return NaN where no pose but the first can be compared.
Consistency ScoreConsistency(std::span<const TimedPose> estimate,
                             std::span<const PoseCovariance> covariances,
                             std::span<const TimedPose> truth, double max_truth_gap_s);

}  // namespace sgf
