#include <algorithm>

#include <sgf/vio/inertial_start.h>

namespace sgf::vio {

using Eigen::Vector3d;

std::optional<InertialInitialisation> InertialStart::Add(const TimedPose& pose,
                                                         const ImuBuffer& imu) {
  poses_.push_back(pose);
  // Poses from before the sensor's first sample, or from before a gap, say nothing of it.
  const auto covered = [&] { return imu.Covers(poses_.front().time_ns, pose.time_ns); };
  while (poses_.size() > 1 && !covered()) poses_.erase(poses_.begin());
  if (!covered()) return InertialInitialisation{};  // too little data
  const double span_s = 1e-9 * static_cast<double>(pose.time_ns - poses_.front().time_ns);
  if (span_s < span_s_ || poses_.size() < least_poses_) return std::nullopt;
  const InertialInitialisation found =
      IsAtRest() ? StartAtRest(imu) : InitializeMoving(poses_, imu, options_);
  constexpr double kLongest = 5;  // times the span: what came first is not needed for ever
  if (!found.ok() && span_s > kLongest * span_s_) poses_.erase(poses_.begin());
  return found;
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
  found.T_world_visual.R =
      Eigen::Quaterniond::FromTwoVectors(poses_.back().pose.R * up_body, Vector3d::UnitZ());
  found.states.assign(poses_.size(), BodyState(found.states.back()));  // the same all the time
  return found;
}

}  // namespace sgf::vio
