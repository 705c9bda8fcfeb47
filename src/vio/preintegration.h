#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sgf/core/inertial.h>

/// Inertial measurements between two states as one measurement (Forster, Carlone, Dellaert,
/// Scaramuzza, "On-manifold preintegration for real-time visual-inertial odometry", IEEE Trans.
/// Robotics, 2017). World coordinates have z up; gravity is (0, 0, -gravity).
namespace sgf::vio {

/// The tangent of a BodyState: rotation (rad, R <- R Exp(d)), position (m, p <- p + d, in world
/// coordinates), velocity (m/s, in world coordinates), bias of the gyroscope (rad/s) and of the
/// accelerometer (m/s^2), three numbers each and in this order.
inline constexpr int kStateSize = 15;
inline constexpr int kRotation = 0;
inline constexpr int kPosition = 3;
inline constexpr int kVelocity = 6;
inline constexpr int kGyroBias = 9;
inline constexpr int kAccelBias = 12;
using StateVector = Eigen::Matrix<double, kStateSize, 1>;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;

/// The state moved along its tangent; the time stays.
BodyState Plus(const BodyState& state, const StateVector& delta);

/// The tangent at `from` that leads to `to`: Plus(from, Minus(to, from)) is `to` but for the time.
StateVector Minus(const BodyState& to, const BodyState& from);

/// What an inertial sensor adds to the truth, in body coordinates.
struct ImuBias {
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s^2
};

/// How much larger than the sensor's the standard deviation of white noise is in a stretch.
struct NoiseFactors {
  double gyro = 1;
  double accel = 1;
};

/// Rotation, velocity and position that inertial measurements add up to, in the frame of the body
/// at the beginning and without gravity, with covariance and derivatives by the biases.
class Preintegration {
 public:
  using Covariance9 = Eigen::Matrix<double, 9, 9>;

  /// @param linearization biases taken off the measurements; others are accounted for to first
  ///   order.
  /// @throws Error for noise that is not positive, as the information would be infinite, and for
  ///   biases that are not finite.
  Preintegration(std::int64_t from_ns, const ImuBias& linearization, const ImuNoise& noise);

  /// Adds the time between two samples. Where the stretch before is not much shorter, a parabola
  /// through the three samples is integrated, otherwise a straight line: Magnus' series to fourth
  /// order for the rotation, Simpson's rule for the velocity. (The mean of two samples is off by
  /// 0.01 deg in an aggressive flight; see tests/support/imu_integration.h.)
  /// @throws Error if `begin` is not at to_ns(), `end` not after it, or a number is not finite.
  void Integrate(const ImuSample& begin, const ImuSample& end, const NoiseFactors& factors = {});

  std::int64_t from_ns() const { return from_ns_; }
  std::int64_t to_ns() const { return to_ns_; }
  double dt_s() const { return 1e-9 * static_cast<double>(to_ns_ - from_ns_); }

  /// At the linearisation's biases: R_from_to, and what changes velocity (m/s) and position (m) in
  /// the frame of the body at the beginning.
  const Eigen::Quaterniond& delta_R() const { return delta_R_; }
  const Eigen::Vector3d& delta_v() const { return delta_v_; }
  const Eigen::Vector3d& delta_p() const { return delta_p_; }

  const ImuBias& linearization() const { return linearization_; }

  /// Mean of the measured angular rate, bias included (rad/s), zero before the first stretch.
  /// Unlike delta_R() it does not wrap around, which matters where its unit is in doubt.
  Eigen::Vector3d mean_gyro() const;

  /// Covariance of rotation (right tangent of delta_R), position and velocity.
  const Covariance9& covariance() const { return covariance9_; }

  /// Derivative of rotation (right tangent), position and velocity by the biases, gyroscope first.
  Eigen::Matrix<double, 9, 6> BiasJacobian() const { return transition_.topRightCorner<9, 6>(); }

  /// State at to_ns(), with the biases of `from`.
  BodyState Predict(const BodyState& from, double gravity) const;

  /// Error of two states, not whitened: rotation (rad), position (m) and velocity (m/s) in the
  /// frame of the body at the beginning, differences of the biases. Zero for to = Predict(from).
  /// (Forster et al., equation 45.)
  /// @param J_from, J_to if not null, derivatives by the tangents of the states, of first order as
  ///   the biases are in the residual: exact for this function.
  StateVector Residual(const BodyState& from, const BodyState& to, double gravity,
                       StateMatrix* J_from = nullptr, StateMatrix* J_to = nullptr) const;

  /// W with W^T W the inverse of the residual's covariance: white noise and the random walk of the
  /// biases, with what the walk does to rotation, position and velocity on the way.
  /// @throws Error before the first stretch.
  StateMatrix SquareRootInformation() const;

 private:
  struct Deltas {
    Eigen::Quaterniond R;
    Eigen::Vector3d p, v;
    Eigen::Vector3d turn;  // rotation vector by which the gyroscope's bias changes R
  };

  Deltas Corrected(const BodyState& state) const;

  /// Takes transition and covariance one step further.
  /// @param F transition of the step. @param variance of the inputs, gyroscope first.
  void Propagate(const StateMatrix& F, const Eigen::Matrix<double, 6, 1>& variance, double h);

  std::int64_t from_ns_, to_ns_;
  ImuBias linearization_;
  ImuNoise noise_;
  std::optional<ImuSample> before_;                  // the first sample of the last stretch
  Eigen::Vector3d angle_ = Eigen::Vector3d::Zero();  // integral of the measured rate, rad
  Eigen::Quaterniond delta_R_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d delta_v_ = Eigen::Vector3d::Zero(), delta_p_ = Eigen::Vector3d::Zero();
  StateMatrix transition_ = StateMatrix::Identity();  // of the residual, from beginning to end
  StateMatrix covariance_ = StateMatrix::Zero();      // of the residual
  Covariance9 covariance9_ = Covariance9::Zero();
};

}  // namespace sgf::vio
