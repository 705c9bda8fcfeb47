#include <algorithm>

#include <sgf/vio/inertial_start.h>

namespace sgf::vio {

using Eigen::Vector3d;
using Problem = InitialisationProblem;

namespace {

InertialInitialisation Because(Problem problem) {
  InertialInitialisation nothing;
  nothing.problem = problem;
  return nothing;
}

}  // namespace

std::optional<InertialInitialisation> InertialStart::Add(const TimedPose& pose,
                                                         const ImuBuffer& imu) {
  if (pose.time_ns < not_before_ns_) return std::nullopt;
  poses_.push_back(pose);
  // Poses from before the sensor's first sample, or from before a gap, say nothing of it.
  const auto covered = [&] { return imu.Covers(poses_.front().time_ns, pose.time_ns); };
  while (poses_.size() > 1 && !covered()) poses_.erase(poses_.begin());
  if (!covered()) return Because(Problem::kGapInData);
  const double span_s = 1e-9 * static_cast<double>(pose.time_ns - poses_.front().time_ns);
  if (span_s < span_s_ || poses_.size() < least_poses_) return std::nullopt;
  const InertialInitialisation found = Ask(imu);
  constexpr double kLongest = 5;  // times the span: what came first is not needed for ever
  if (!found.ok() && span_s > kLongest * span_s_) poses_.erase(poses_.begin());
  return found;
}

/// Rest tells nothing of axes and little of units: what motion has shown to be wrong stays so.
InertialInitialisation InertialStart::Ask(const ImuBuffer& imu) {
  if (IsAtRest()) return in_motion_ == Problem::kNone ? StartAtRest(imu) : Because(in_motion_);
  const InertialInitialisation found = InitializeMoving(poses_, imu, options_);
  if (found.problem != Problem::kTooLittleData && found.problem != Problem::kGapInData)
    in_motion_ = found.problem;
  return found;
}

void InertialStart::Refute(std::int64_t time_ns) {
  Clear();
  in_motion_ = Problem::kMotionDisagrees;
  not_before_ns_ = time_ns + static_cast<std::int64_t>(1e9 * pause_s_);
  pause_s_ *= 2;
}

/// As the images have it: the inertial sensor cannot tell rest from constant velocity.
bool InertialStart::IsAtRest() const {
  constexpr double kLeastMotion_m = 0.02, kLeastTurn_rad = 0.01;
  return std::all_of(poses_.begin(), poses_.end(), [&](const TimedPose& pose) {
    const SE3 motion = poses_.front().pose.Inverse() * pose.pose;
    return motion.p.norm() < kLeastMotion_m && LogSO3(motion.R).norm() < kLeastTurn_rad;
  });
}

InertialInitialisation InertialStart::StartAtRest(const ImuBuffer& imu) const {
  InertialInitialisation found =
      InitializeAtRest(imu, poses_.front().time_ns, poses_.back().time_ns, options_);
  if (!found.ok()) return found;
  const Vector3d up_body = found.states.back().T_world_body.R.conjugate() * Vector3d::UnitZ();
  found.T_world_visual.R = RotationBetween(poses_.back().pose.R * up_body, Vector3d::UnitZ());
  found.states.assign(poses_.size(), BodyState(found.states.back()));  // the same all the time
  return found;
}

}  // namespace sgf::vio
