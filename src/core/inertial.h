#pragma once

#include <cstdint>

#include <Eigen/Core>

#include <sgf/core/se3.h>

/// Measurements and states of a body with an inertial sensor. World W has z up (gravity along -z);
/// body B is the frame of the inertial sensor S, as in the EuRoC datasets.
namespace sgf {

/// Noise of an inertial sensor in continuous time: white noise densities and those of the white
/// noise that drives the biases' random walks. The defaults are those of EuRoC's ADIS16448.
struct ImuNoise {
  double gyroscope_noise_density = 1.6968e-4;      ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 1.9393e-5;        ///< rad/s^2/sqrt(Hz)
  double accelerometer_noise_density = 2.0000e-3;  ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 3.0000e-3;    ///< m/s^3/sqrt(Hz)
};

/// Time from one moment to another, s.
inline double Seconds(std::int64_t from_ns, std::int64_t to_ns) {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}

/// One measurement of an inertial sensor, in body coordinates.
struct ImuSample {
  std::int64_t time_ns = 0;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< angular rate of B against W, rad/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< acceleration minus gravity, m/s^2
};

/// Where a body is, how it moves and what its inertial sensor's biases are.
struct BodyState {
  std::int64_t time_ns = 0;
  SE3 T_world_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    ///< in world coordinates, m/s
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< in body coordinates, rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< in body coordinates, m/s^2
};

}  // namespace sgf
