#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <sgf/core/timed_pose.h>
#include <sgf/vio/imu_buffer.h>
#include <sgf/vio/inertial_initializer.h>

namespace sgf::vio {

/// Gathers poses of images alone until the inertial sensor can be told where down is.
class InertialStart {
 public:
  /// @param span_s of poses before the sensor is asked for the first time.
  /// @param least_poses that a result has to have states for.
  InertialStart(const InertialInitializerOptions& options, double span_s, size_t least_poses)
      : options_(options), span_s_(span_s), least_poses_(least_poses) {}

  /// Takes the next pose, T_world_body.
  /// @return what was found, with a state for each of the last poses, or why nothing was; nothing
  ///   where it was too early to ask.
  std::optional<InertialInitialisation> Add(const TimedPose& pose, const ImuBuffer& imu);

  /// Forgets the poses.
  void Clear() { poses_.clear(); }

  /// What was found has turned out to be wrong: rest is no reason to believe the sensor any more,
  /// and it is not asked for a while, longer each time.
  void Refute(std::int64_t time_ns);

  /// From when on measurements are needed.
  std::optional<std::int64_t> first_ns() const {
    return poses_.empty() ? std::nullopt : std::optional(poses_.front().time_ns);
  }

 private:
  InertialInitialisation Ask(const ImuBuffer& imu);
  bool IsAtRest() const;
  InertialInitialisation StartAtRest(const ImuBuffer& imu) const;

  InertialInitializerOptions options_;
  double span_s_;
  size_t least_poses_;
  std::vector<TimedPose> poses_;
  InitialisationProblem in_motion_ = InitialisationProblem::kNone;  ///< when last asked there
  double pause_s_ = 5;
  std::int64_t not_before_ns_ = 0;
};

}  // namespace sgf::vio
