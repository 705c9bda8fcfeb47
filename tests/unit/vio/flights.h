#pragma once

#include <vector>

#include <sgf/core/inertial.h>
#include <sgf/synth/imu.h>
#include <sgf/vio/imu_buffer.h>

/// Simulated flights for the tests of sgf::vio.
namespace sgf::vio {

/// Round a room in 14 s, with the calm motion of a walk.
inline synth::TrajectoryOptions SmoothRide() {
  synth::TrajectoryOptions o;
  o.waypoints = {{0, 0, 1, 0, 0, 0},     {2, 0, 1.2, 40, 0, 0},    {4, 1, 1.5, 90, 10, 0},
                 {4, 3, 1.4, 150, 0, 5}, {2, 4, 1.2, 200, -10, 0}, {0, 3, 1, 260, 0, -5},
                 {-1, 1, 1, 320, 5, 0}};
  o.knot_interval_s = 2;
  o.periodic = true;
  return o;
}

/// Beyond what EuRoC's difficult sequences show, with rotor-like shake: over 10 m/s^2 and 3 rad/s.
inline synth::TrajectoryOptions AggressiveRide() {
  synth::TrajectoryOptions o = SmoothRide();
  o.knot_interval_s = 0.5;
  o.shake_position_m = 0.03;
  o.shake_rotation_deg = 6;
  return o;
}

/// A smooth flight with some banking: a drone that inspects something.
inline synth::TrajectoryOptions LivelyRide() {
  synth::TrajectoryOptions o = SmoothRide();
  o.knot_interval_s = 1;
  o.shake_interval_s = 0.4;
  o.shake_position_m = 0.05;
  o.shake_rotation_deg = 6;
  return o;
}

/// Samples and true states of a flight that starts at an epoch as real ones do.
struct Flight {
  static constexpr std::int64_t kStart_ns = 1403636579763555584;

  Flight(const synth::TrajectoryOptions& ride, double from_s, double to_s,
         const synth::ImuOptions& options)
      : samples(synth::SimulateImu(synth::MakeTrajectory(ride, SE3()), from_s, to_s, options,
                                   kStart_ns, &truth)) {}

  /// @param from, to indices of samples.
  Preintegration Integrate(size_t from, size_t to, const ImuBias& bias,
                           const ImuNoise& noise = {}) const {
    Preintegration sum(samples[from].time_ns, bias, noise);
    for (size_t i = from; i < to; ++i) sum.Integrate(samples[i], samples[i + 1]);
    return sum;
  }

  ImuBias BiasAt(size_t i) const { return {truth[i].gyro_bias, truth[i].accel_bias}; }

  std::vector<BodyState> truth;
  std::vector<ImuSample> samples;
};

inline synth::ImuOptions NoiseFree() {
  synth::ImuOptions options;
  options.noisy = false;
  options.initial_gyroscope_bias = {0.01, -0.02, 0.08};
  options.initial_accelerometer_bias = {-0.05, 0.1, 0.06};
  return options;
}

}  // namespace sgf::vio
