#pragma once

#include <Eigen/Core>

#include <sgf/core/se3.h>

/// What the cameras' calibration against the inertial sensor is off by.
namespace sgf::vio {

/// Rotation (rad, on the right), position (m), time (s).
inline constexpr int kCalibrationParameters = 7;
using CalibrationVector = Eigen::Matrix<double, kCalibrationParameters, 1>;
using CalibrationMatrix = Eigen::Matrix<double, kCalibrationParameters, kCalibrationParameters>;

/// The cameras as one rigid rig on the body, and their clock.
struct Calibration {
  /// From the body where the rig's own T_body_cam have it to the body: identity where they are
  /// right.
  SE3 T_body_rig;
  /// A frame was taken so much later on the inertial sensor's clock than its time stamp says
  /// (Kalibr's timeshift_cam_imu), s.
  double time_offset_s = 0;

  bool IsIdentity() const {
    return T_body_rig.p.isZero(0) && T_body_rig.R.vec().isZero(0) && time_offset_s == 0;
  }
};

/// The calibration moved along its tangent: R <- R Exp(d), the other numbers are added.
Calibration Plus(const Calibration& calibration, const CalibrationVector& delta);

/// The tangent at `from` that leads to `to`: Plus(from, Minus(to, from)) is `to`.
CalibrationVector Minus(const Calibration& to, const Calibration& from);

/// How a body moves: in world coordinates (m/s) and about its own axes (rad/s).
struct BodyVelocity {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();
};

/// What is known of it at first.
struct CalibrationOptions {
  double time_offset_sd_s = 0;
  double rotation_sd_rad = 0;
  double position_sd_m = 0;

  /// Whether nothing is to be estimated.
  bool IsHeld() const {
    return time_offset_sd_s == 0 && rotation_sd_rad == 0 && position_sd_m == 0;
  }

  template <class V>
  void VisitFields(V&& visit) {
    visit("time_offset_sd_s", time_offset_sd_s, "s",
          "standard deviation of the cameras' clock against the inertial sensor's, to estimate the "
          "offset online; 0: it is right");
    visit("rotation_sd_rad", rotation_sd_rad, "rad",
          "the same for the rotation of the stereo camera on the body");
    visit("position_sd_m", position_sd_m, "m", "the same for its position");
  }
};

/// Where the cameras see the body that is at a pose at the frame's time stamp; velocities are taken
/// as constant over the time offset (as Qin and Shen, "Online temporal calibration for monocular
/// visual-inertial systems", 2018, take those of features).
SE3 AsSeen(const SE3& T_world_body, const BodyVelocity& velocity, const Calibration& calibration);

/// Derivatives of AsSeen(), rotations on the right and positions in the world on both sides.
struct AsSeenJacobian {
  Eigen::Matrix<double, 6, 6> by_pose;
  Eigen::Matrix<double, 6, kCalibrationParameters> by_calibration;
};
AsSeenJacobian JacobianOfAsSeen(const SE3& T_world_body, const BodyVelocity& velocity,
                                const Calibration& calibration);

}  // namespace sgf::vio
