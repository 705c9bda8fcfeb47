#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <sgf/core/inertial.h>
#include <sgf/synth/trajectory.h>

namespace sgf::synth {

/// A simulated inertial sensor; the defaults are EuRoC's.
struct ImuOptions {
  double rate_hz = 200;
  double gravity = 9.81;
  bool noisy = true;
  ImuNoise noise;
  std::array<double, 3> initial_gyroscope_bias{};
  std::array<double, 3> initial_accelerometer_bias{};
  std::uint64_t seed = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("rate_hz", rate_hz, "Hz", "samples a second");
    visit("gravity", gravity, "m/s^2", "magnitude of gravity, which points along -z of the world");
    visit("noisy", noisy, "", "false: no white noise, and the biases keep their initial values");
    visit("gyroscope_noise_density", noise.gyroscope_noise_density, "rad/s/sqrt(Hz)",
          "white noise of the angular rate");
    visit("gyroscope_random_walk", noise.gyroscope_random_walk, "rad/s^2/sqrt(Hz)",
          "random walk of the gyroscope's bias");
    visit("accelerometer_noise_density", noise.accelerometer_noise_density, "m/s^2/sqrt(Hz)",
          "white noise of the acceleration");
    visit("accelerometer_random_walk", noise.accelerometer_random_walk, "m/s^3/sqrt(Hz)",
          "random walk of the accelerometer's bias");
    visit("initial_gyroscope_bias", initial_gyroscope_bias, "rad/s", "bias of the first sample");
    visit("initial_accelerometer_bias", initial_accelerometer_bias, "m/s^2",
          "bias of the first sample");
    visit("seed", seed, "", "seed of all noise");
  }
};

/// @throws Error for options out of range. SimulateImu() checks them too.
void Check(const ImuOptions& options);

/// What an inertial sensor at the body's origin, with the body's axes, measures every 1 / rate_hz
/// seconds on a trajectory:
///
///     gyro  = omega + b_g + n_g,
///     accel = R_world_body^T (a - g) + b_a + n_a,  g = (0, 0, -gravity),
///
/// with discrete white noise n of standard deviation density * sqrt(rate_hz), and biases b that
/// after each sample take a normally distributed step of standard deviation random_walk /
/// sqrt(rate_hz).
/// @param from_s, to_s times on the trajectory of the first sample and not after which the last
/// comes.
/// @param start_ns time stamp of time 0 of the trajectory, so that cameras on it share the clock.
/// @param truth if not null, the state at every sample, with the true biases.
/// @throws Error for options out of range, to_s before from_s, or times outside an open trajectory.
std::vector<ImuSample> SimulateImu(const Trajectory& trajectory, double from_s, double to_s,
                                   const ImuOptions& options, std::int64_t start_ns,
                                   std::vector<BodyState>* truth = nullptr);

}  // namespace sgf::synth
