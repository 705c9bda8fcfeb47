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

  void Clear() { poses_.clear(); }

  /// From when on measurements are needed.
  std::optional<std::int64_t> first_ns() const {
    return poses_.empty() ? std::nullopt : std::optional(poses_.front().time_ns);
  }

 private:
  bool IsAtRest() const;
  InertialInitialisation StartAtRest(const ImuBuffer& imu) const;

  InertialInitializerOptions options_;
  double span_s_;
  size_t least_poses_;
  std::vector<TimedPose> poses_;
};

}  // namespace sgf::vio
