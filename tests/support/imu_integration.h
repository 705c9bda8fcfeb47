#pragma once

#include <vector>

#include <Eigen/Core>

#include <sgf/core/inertial.h>

namespace sgf {

/// The state at the last of an odd number of evenly spaced samples, by integration from `state`,
/// the one at the first; the biases are taken to stay those of `state`. Each step takes a parabola
/// through three samples: Magnus' series to fourth order for the rotation (the cross product is its
/// coning term), Simpson's rule for the velocity. The trapezoidal rule is not enough here: its
/// rotation error grows with the angular acceleration at the start, 0.01 deg in an aggressive
/// flight, and gravity turns that into centimetres within 10 s.
/// @param gravity magnitude, along -z of the world (m/s^2).
inline BodyState IntegrateImu(const std::vector<ImuSample>& samples, BodyState state,
                              double gravity) {
  SE3& T = state.T_world_body;
  for (size_t k = 2; k < samples.size(); k += 2) {
    const auto rate = [&](size_t i) { return Eigen::Vector3d(samples[i].gyro - state.gyro_bias); };
    const auto acceleration = [&](size_t i, const Eigen::Quaterniond& R_world_body) {
      return Eigen::Vector3d(R_world_body * (samples[i].accel - state.accel_bias) -
                             Eigen::Vector3d(0, 0, gravity));
    };
    const double h = 1e-9 * static_cast<double>(samples[k].time_ns - samples[k - 2].time_ns);
    const Eigen::Vector3d w0 = rate(k - 2), w1 = rate(k - 1), w2 = rate(k);
    const Eigen::Vector3d half_turn = h / 24 * (5 * w0 + 8 * w1 - w2) + h * h / 48 * w0.cross(w1);
    const Eigen::Vector3d turn = h / 6 * (w0 + 4 * w1 + w2) + h * h / 12 * w0.cross(w2);
    const Eigen::Quaterniond R0 = T.R, R1 = R0 * ExpSO3(half_turn);
    T.R = (R0 * ExpSO3(turn)).normalized();
    const Eigen::Vector3d a0 = acceleration(k - 2, R0), a1 = acceleration(k - 1, R1),
                          a2 = acceleration(k, T.R);
    T.p += h * state.velocity + h * h / 6 * (a0 + 2 * a1);
    state.velocity += h / 6 * (a0 + 4 * a1 + a2);
    state.time_ns = samples[k].time_ns;
  }
  return state;
}

}  // namespace sgf
