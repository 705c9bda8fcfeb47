#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/core/camera.h>
#include <sgf/core/inertial.h>
#include <sgf/core/se3.h>
#include <sgf/flow/stereo_flow.h>
#include <sgf/vio/calibration.h>
#include <sgf/vio/imu_buffer.h>
#include <sgf/vio/inertial_initializer.h>
#include <sgf/vio/window.h>

/// Stereo-inertial odometry (Usenko, Demmel, Schubert, Stückler, Cremers, "Visual-inertial mapping
/// with non-linear factor recovery", RA-L 2020) with the dissimilarity in its optical flow.
namespace sgf::vio {

/// Parameters of StereoInertialOdometry.
struct VioOptions {
  flow::FlowOptions flow;
  ImuBufferOptions imu;
  WindowOptions window;
  bool inertial = true;
  int states = 3;
  int keyframes = 7;
  double keyframe_share = 0.7;
  int keyframe_gap = 3;
  double least_parallax = 0.01;
  int least_sights = 12;
  double blind_s = 2;
  InertialInitializerOptions start;
  double start_s = 1;
  double max_inertial_error = 1.5;
  CalibrationOptions calibration;
  bool covariance = true;
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("flow", flow, "", "tracks of points");
    visit("imu", imu, "", "gaps and saturation of the inertial sensor");
    visit("window", window, "", "joint refinement");
    visit("inertial", inertial, "", "use the inertial sensor; else images alone");
    visit("states", states, "", "newest frames of the window that have velocity and biases");
    visit("keyframes", keyframes, "", "older frames of the window, at most");
    visit("keyframe_share", keyframe_share, "",
          "a key-frame is made when fewer of the tracks are landmarks");
    visit("keyframe_gap", keyframe_gap, "frames", "no two key-frames are nearer to each other");
    visit("least_parallax", least_parallax, "rad", "between two rays that make a landmark");
    visit("least_sights", least_sights, "",
          "landmarks seen that a frame needs; with fewer it is predicted or lost");
    visit("blind_s", blind_s, "s", "after so long without sight a new map is begun");
    visit("start", start, "", "when the inertial sensor takes part, which images alone begin");
    visit("start_s", start_s, "s", "of images alone before it is asked for the first time");
    visit("max_inertial_error", max_inertial_error, "sigma",
          "error of the inertial sensor against the images beyond which, if it stays, it is left "
          "out until a later start");
    visit("calibration", calibration, "",
          "estimate of what the cameras are off by against the inertial sensor");
    visit("covariance", covariance, "", "state the covariance of every frame");
    visit("threads", threads, "", "0 for all cores. The result does not depend on it");
  }
};

/// @throws Error for an option out of range.
void CheckOptions(const VioOptions& options);

/// What became of a frame.
enum class VioState {
  kInitialising,  ///< no landmarks yet
  kTracked,
  kPredicted,  ///< too little was seen: the inertial sensor alone
  kLost,       ///< no state
};
std::span<const std::pair<const char*, VioState>> EnumNames(VioState);

/// Time spent on a frame, s.
struct VioTimes {
  double flow_s = 0;
  double refinement_s = 0;
  double marginalization_s = 0;
  double total_s = 0;
};

/// What is known right after a frame.
struct VioFrameResult {
  std::int64_t time_ns = 0;
  VioState state = VioState::kInitialising;
  int segment = 0;  ///< number of the map
  BodyState body = {};
  /// World coordinates to those of a world whose z points up exactly; identity until it is found.
  Eigen::Quaterniond R_gravity_world = Eigen::Quaterniond::Identity();
  bool inertial = false;  ///< the inertial sensor takes part
  /// Why not: at the frame where it is left out, and at those where it was asked in vain.
  InitialisationProblem problem = InitialisationProblem::kNone;
  /// Of the state, in the order of Plus(). Of velocity and biases 0 without inertial sensor.
  StateMatrix covariance = StateMatrix::Zero();
  /// The body in its coordinates at the frame before, as both are known now: not what is between
  /// the poses that were given out, as that of the frame before has been refined since. Identity
  /// and 0 for the first frame of a map.
  SE3 motion = {};
  /// Of the motion, in the order of Plus().
  Eigen::Matrix<double, kPoseParameters, kPoseParameters> motion_covariance =
      Eigen::Matrix<double, kPoseParameters, kPoseParameters>::Zero();
  /// Where the cameras and their clock are against the inertial sensor: as estimated while
  /// VioOptions::calibration says so and the sensor takes part; its covariance is 0 otherwise.
  Calibration calibration = {};
  CalibrationMatrix calibration_covariance = CalibrationMatrix::Zero();
  bool new_keyframe = false;
  int tracks = 0, stereo_tracks = 0;
  int landmarks = 0;  ///< seen in this frame
  WindowSummary window = {};
  flow::FlowTimes flow = {};
  VioTimes times = {};
};

/// A landmark that has left the window, or is in it.
struct VioPoint {
  std::int64_t host_ns = 0;                            ///< time of its key-frame
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< world, m
  double inverse_depth = 0;           ///< along its key-frame's left optical axis, 1/m
  double inverse_depth_variance = 0;  ///< 1/m^2
  int support = 0;                    ///< sights in the window when it left
  float grey = 0;                     ///< of its pixel in the left image, grey levels
  int segment = 0;                    ///< number of its map
};

/// Odometry of a stereo camera and an inertial sensor. Frames are handed over one at a time; a
/// frame's pose is not changed later, nor is its world: z points up as the accelerometer has it
/// when a map begins, and where up is found to be later is said apart (R_gravity_world). Same
/// input, same bits, for any number of threads. Memory does not grow with the sequence, but for
/// points that nobody takes. Calls of one object must not overlap; objects share no state.
class StereoInertialOdometry {
 public:
  /// @param rig raw cameras. @param T_body_left left camera's coordinates to the body's.
  /// @throws Error for a camera or an option out of range.
  StereoInertialOdometry(const flow::StereoRig& rig, const SE3& T_body_left, const ImuNoise& noise,
                         const VioOptions& options);
  ~StereoInertialOdometry();
  StereoInertialOdometry(StereoInertialOdometry&&) noexcept;
  StereoInertialOdometry& operator=(StereoInertialOdometry&&) noexcept;

  /// Takes a measurement of the inertial sensor; those up to a frame's time have to come before the
  /// frame. Bad ones are counted (ImuBuffer).
  void AddImu(const ImuSample& sample);

  /// @param left, right raw 8-bit grey images of the cameras' sizes; the right one may be empty.
  /// @throws Error as flow::StereoFlow::Process(). The state is as before the call.
  VioFrameResult Process(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right);

  const ImuHealth& imu_health() const;

  /// Landmarks that have left the window since the last call.
  std::vector<VioPoint> TakeFinishedPoints();

  /// Landmarks of the window.
  std::vector<VioPoint> ActivePoints() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sgf::vio
