#pragma once

#include <cstdint>

#include <Eigen/Core>

#include <sgf/core/se3.h>

namespace sgf {

/// A pose at a time: an element of a trajectory. Which frames it relates is said where it is used.
struct TimedPose {
  std::int64_t time_ns = 0;
  SE3 pose;  ///< m
};

/// What an estimator says of a pose: covariance of its tangent, a rotation on the right (rad), then
/// the position in the world (m).
struct PoseCovariance {
  std::int64_t time_ns = 0;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

}  // namespace sgf
