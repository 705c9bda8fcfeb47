#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sgf/core/inertial.h>
#include <sgf/core/se3.h>
#include <sgf/vio/calibration.h>
#include <sgf/vio/preintegration.h>
#include <sgf/vio/prior.h>

/// A window of frames and the landmarks that they see, refined together (Usenko, Demmel, Schubert,
/// Stückler, Cremers, "Visual-inertial mapping with non-linear factor recovery", RA-L 2020;
/// Leutenegger et al., "Keyframe-based visual-inertial odometry using nonlinear optimization", IJRR
/// 2015).
namespace sgf::vio {

/// A frame of the window.
struct Frame {
  int id = 0;
  BodyState state;
  BodyState linearization;  ///< where derivatives are taken if the prior knows the frame
  bool in_prior = false;
  bool inertial = false;  ///< velocity and biases are estimated as well
  bool keyframe = false;
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< of the body, rad/s
  /// What the inertial sensor has measured since the frame before, which is the one before in the
  /// window.
  std::optional<Preintegration> since_last = std::nullopt;
};

/// How a landmark is seen: the ray at depth 1 in a camera's coordinates.
struct LandmarkSight {
  int frame = 0;
  int camera = 0;  ///< 0 left, 1 right
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();
};

/// A point in the left camera of its host frame: (x, y, 1) / inverse depth.
struct Landmark {
  int host = 0;
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();
  double inverse_depth = 0;  ///< 1/m
  double inverse_depth_variance = 0;
  float grey = 0;  ///< of its pixel, grey levels
  std::vector<LandmarkSight> sights = {};
};

/// The cameras on the body, as ideal ones: rays have no distortion.
struct VioRig {
  std::vector<SE3> T_body_cam;  ///< left and right
  double focal_px = 0;          ///< what turns a ray's error into pixels
};

struct WindowOptions {
  int max_iterations = 5;
  double sigma_px = 0.5;
  double huber_sigmas = 2;
  double outlier_px = 3;
  double tolerance = 1e-3;
  double gravity = 9.81;

  template <class V>
  void VisitFields(V&& visit) {
    visit("max_iterations", max_iterations, "", "of the solver at each frame");
    visit("sigma_px", sigma_px, "px", "standard deviation of where a landmark is seen");
    visit("huber_sigmas", huber_sigmas, "", "beyond so many deviations an error counts linearly");
    visit("outlier_px", outlier_px, "px", "beyond it a sight of a landmark is taken out");
    visit("tolerance", tolerance, "", "stop where a step lowers the cost by less than this share");
    visit("gravity", gravity, "m/s^2", "magnitude of gravity");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const WindowOptions& options);

struct WindowSummary {
  int iterations = 0;
  int sights = 0;    ///< that were kept
  int outliers = 0;  ///< that were taken out
  double cost = 0;   ///< of half the squared errors in deviations
  /// RMS of the inertial sensor's errors in deviations: beyond 1 it did not measure what the images
  /// show.
  double inertial_error = 0;
  bool usable = false;
};

/// How well a frame of the window is known, given all measurements and the prior.
struct FrameCovariance {
  /// Of the state in the order of Plus(): pose and, where the frame is inertial, motion; else 0.
  StateMatrix state = StateMatrix::Zero();
  /// Of the pose in coordinates of the frame before, in the same order; 0 for the oldest frame.
  Eigen::Matrix<double, kPoseParameters, kPoseParameters> motion =
      Eigen::Matrix<double, kPoseParameters, kPoseParameters>::Zero();
  /// Of the calibration; 0 where it is not estimated.
  CalibrationMatrix calibration = CalibrationMatrix::Zero();
};

/// What the cameras' calibration against the inertial sensor is estimated with.
struct CalibrationEstimate {
  Calibration value;
  Calibration linearization;  ///< where derivatives are taken
};

/// Frames, oldest first, landmarks by their track's id, and what is known from before. Same bits
/// for any number of threads.
class Window {
 public:
  /// @throws Error as CheckOptions().
  Window(const VioRig& rig, const WindowOptions& options, int threads);

  std::deque<Frame> frames;
  std::map<std::int64_t, Landmark> landmarks;

  const Frame* Find(int id) const;
  Frame* Find(int id);

  const VioRig& rig() const { return rig_; }
  const WindowOptions& options() const { return options_; }
  const SquareRootPrior& prior() const { return prior_; }

  const Calibration& calibration() const { return calibration_.value; }

  /// T_world_cam of a frame's camera, as it is now, with what the calibration is off by.
  SE3 PoseOf(const Frame& frame, int camera) const;

  /// Holds a frame's pose to what it is now, with standard deviations of rotations (rad) about the
  /// axes of the world, as what gravity tells has to be apart from what it does not, and of the
  /// position (m).
  void AnchorPose(Frame& frame, const Eigen::Matrix<double, kPoseParameters, 1>& sigmas);

  /// Makes a frame inertial and holds its motion, as it is now, with standard deviations of
  /// velocity and biases.
  void AnchorMotion(Frame& frame, const Eigen::Matrix<double, kMotionParameters, 1>& sigmas);

  /// Sets the calibration and, with standard deviations of it, has it estimated until the prior is
  /// dropped. One that is 0 is held.
  void SetCalibration(const Calibration& calibration) { calibration_ = {calibration, calibration}; }
  void AnchorCalibration(const CalibrationVector& sigmas);
  bool calibrates() const { return prior_.Has(kCalibrationBlock); }

  /// Forgets all that was known before, to be anchored anew.
  void DropPrior();

  /// Forgets all that the inertial sensor told: velocities, biases, and the prior. Poses stay where
  /// they are; the oldest one is held by these deviations.
  void DropInertial(const Eigen::Matrix<double, kPoseParameters, 1>& sigmas);

  /// Refines all frames and landmarks.
  WindowSummary Refine();

  /// Takes out sights that are off by more than the limit, and landmarks without depth or sights.
  /// @return the number of sights taken out.
  int RemoveOutliers();

  /// Takes frames out: what is known from the landmarks that they host, from the inertial sensor
  /// and of themselves stays as the prior. Their sights of other landmarks are dropped.
  /// @param frames ids. @param motions ids of frames whose motion alone leaves.
  void Marginalize(std::span<const int> frames, std::span<const int> motions);

  FrameCovariance CovarianceOf(const Frame& frame) const;

 private:
  CalibrationEstimate calibration_;
  VioRig rig_;
  WindowOptions options_;
  int threads_ = 1;
  SquareRootPrior prior_;
};

}  // namespace sgf::vio
