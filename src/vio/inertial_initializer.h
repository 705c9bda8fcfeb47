#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sgf/core/inertial.h>
#include <sgf/core/timed_pose.h>
#include <sgf/vio/imu_buffer.h>
#include <sgf/vio/preintegration.h>

/// First states of a body with an inertial sensor: where down is, velocities and biases.
namespace sgf::vio {

/// Why a body's first states are not known, or not believed.
enum class InitialisationProblem {
  kNone,
  kTooLittleData,       ///< or too little motion in it for gravity and biases to be told apart
  kGapInData,           ///< no measurements, or not all, of the time of the poses
  kMoving,              ///< where rest was expected
  kGyroscopeInDegrees,  ///< rates are about 180/pi times those of the poses
  kSensorAxes,          ///< rotations do not fit those of the poses, whatever the bias
  kGyroscopeBias,       ///< larger than max_gyro_bias
  kAccelerationInG,     ///< gravity is about 1 where m/s^2 are expected
  kGravityMagnitude,    ///< off by more than a tenth
  kMotionDisagrees      ///< acceleration does not fit the motion of the poses
};

std::span<const std::pair<const char*, InitialisationProblem>> EnumNames(InitialisationProblem);

/// The problem in a few words for the user, with the likely cause as a question.
const char* Explain(InitialisationProblem problem);

struct InertialInitializerOptions {
  double gravity = 9.81;  ///< m/s^2; the odometry's is set with its window's options
  double min_rest_s = 0.5;
  double rest_gyro_sd = 0.03;
  double rest_accel_sd = 0.3;
  double max_gyro_bias = 0.3;
  int min_poses = 5;
  double visual_rotation_sd_rad = 0.002;
  double visual_position_sd_m = 0.005;
  double accel_bias_sd = 0.2;
  double max_tilt_sd_rad = 0.05;
  double max_motion_error = 2.5;

  template <class V>
  void VisitFields(V&& visit) {
    visit("min_rest_s", min_rest_s, "s", "shortest rest to begin from");
    visit("rest_gyro_sd", rest_gyro_sd, "rad/s",
          "standard deviation of the angular rate about an axis up to which the body is at rest");
    visit("rest_accel_sd", rest_accel_sd, "m/s^2", "the same for the acceleration");
    visit("max_gyro_bias", max_gyro_bias, "rad/s",
          "larger biases of the gyroscope are not believed");
    visit("min_poses", min_poses, "", "fewest visual poses to begin from in motion");
    visit("visual_rotation_sd_rad", visual_rotation_sd_rad, "rad",
          "expected error of a visual rotation about each axis");
    visit("visual_position_sd_m", visual_position_sd_m, "m",
          "expected error of a visual position along each axis");
    visit("accel_bias_sd", accel_bias_sd, "m/s^2",
          "expected size of the accelerometer's bias along each axis");
    visit("max_tilt_sd_rad", max_tilt_sd_rad, "rad",
          "largest standard deviation of gravity's direction to begin with");
    visit("max_motion_error", max_motion_error, "sigma",
          "error of the visual motion against the accelerometer's beyond which they disagree");
  }
};

/// @throws Error for an option out of range; it is named as that of the odometry, `start.`.
void CheckOptions(const InertialInitializerOptions& options);

/// First states, if there is no problem, and what was found on the way.
struct InertialInitialisation {
  InitialisationProblem problem = InitialisationProblem::kTooLittleData;
  bool ok() const { return problem == InitialisationProblem::kNone; }

  SE3 T_world_visual;             ///< turns gravity to (0, 0, -g) by the smallest rotation; p is 0
  std::vector<BodyState> states;  ///< one for each visual pose, or one at the end of a rest
  double gravity = 0;             ///< its magnitude as measured, m/s^2
  double tilt_sd_rad = 0;         ///< standard deviation of its direction, in the worst direction
  double rotation_error_rad = 0;  ///< RMS of the gyroscope's rotations against the visual ones
  double motion_error = 0;        ///< of the motion against the accelerometer; about 1 is expected
  Eigen::Vector3d gyro_bias_sd = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d accel_bias_sd = Eigen::Vector3d::Zero();  ///< m/s^2; that of the options where
                                                            ///< the motion does not show the bias
};

/// From a body at rest: the gyroscope's bias is its mean rate; roll and pitch are those that turn
/// the mean acceleration up by the smallest rotation, which leaves yaw to chance. The
/// accelerometer's bias is known along gravity only and zero across it; hence tilt_sd_rad.
/// Motion at constant velocity and rate cannot be told from rest.
/// @throws Error as CheckOptions().
InertialInitialisation InitializeAtRest(std::span<const ImuSample> samples,
                                        const InertialInitializerOptions& options = {});

/// The same over a stretch of the buffer.
InertialInitialisation InitializeAtRest(const ImuBuffer& buffer, std::int64_t from_ns,
                                        std::int64_t to_ns,
                                        const InertialInitializerOptions& options = {});

/// From metric visual poses of the moving body and the measurements between them: the gyroscope's
/// bias from the rotations, then velocities, gravity and, as far as the motion shows it, the
/// accelerometer's bias by linear least squares, gravity's magnitude first free and then held while
/// its direction is refined (Qin, Li, Shen, "VINS-Mono", IEEE Trans. Robotics, 2018, Section V-B;
/// weights and a prior on the accelerometer's bias as in Campos, Montiel, Tardos, "Inertial-only
/// optimization for visual-inertial initialization", ICRA 2020).
/// @param poses T_visual_body in any metric frame at rest, in order of time.
/// @param motions from each pose to the next. Large biases cost accuracy of second order: give the
///   result's biases to new ones, or the buffer to the function below.
/// @throws Error as CheckOptions(), and for motions that are not between the poses.
InertialInitialisation InitializeMoving(std::span<const TimedPose> poses,
                                        std::span<const Preintegration> motions,
                                        const InertialInitializerOptions& options = {});

/// The same with the buffer's measurements, integrated anew with the biases found.
InertialInitialisation InitializeMoving(std::span<const TimedPose> poses, const ImuBuffer& buffer,
                                        const InertialInitializerOptions& options = {});

}  // namespace sgf::vio
