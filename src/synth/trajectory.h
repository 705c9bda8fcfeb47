#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <sgf/core/se3.h>

/// Smooth motions of a rigid body and the recipes they are made from.
namespace sgf::synth {

/// Pose of a body B in the world W (z up) and its derivatives by time at one instant.
struct MotionState {
  SE3 T_world_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< in W, m/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();      ///< in W, m/s^2
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< of B against W, in B, rad/s
  Eigen::Vector3d angular_acceleration =
      Eigen::Vector3d::Zero();  ///< its derivative, in B, rad/s^2
};

/// A uniform cumulative B-spline of degree five through R^3 x SO(3) with analytic derivatives
/// (Sommer et al., "Efficient derivative computation for cumulative B-splines on Lie groups", CVPR
/// 2020). Position and rotation have four continuous derivatives.
///
/// The spline approximates its control poses, it does not pass through them: at time (i - 2) *
/// knot_interval_s control pose i weighs 66/120, its neighbours 26/120 and 1/120. Six equal control
/// poses in a row make the body rest for one interval.
class Trajectory {
 public:
  /// @param control T_world_body of the control poses.
  /// @param periodic whether the control poses wrap around. If so, the spline lasts control.size()
  ///   intervals and closes without a seam; an open one lasts control.size() - 5 intervals.
  /// @throws Error for fewer than two control poses (periodic) or six (open), for numbers that are
  ///   not finite, an interval that is not positive, and neighbours turned by 180 degrees against
  ///   each other.
  Trajectory(std::vector<SE3> control, double knot_interval_s, bool periodic);

  /// Length of an open spline or the period of a periodic one (s).
  double duration_s() const;

  bool periodic() const { return periodic_; }

  /// @param t_s any time if periodic, otherwise in [0, duration_s()].
  /// @throws Error for a time outside.
  MotionState At(double t_s) const;

 private:
  std::vector<SE3> control_;
  std::vector<Eigen::Vector3d> moves_, turns_;  // from each control pose to the next, m and rad
  double knot_interval_s_;
  bool periodic_;
};

/// A trajectory as a recipe describes it: where the left camera goes and where it looks.
struct TrajectoryOptions {
  /// Position of the camera (m, world z up), then yaw, pitch and roll of its view (degrees).
  using Waypoint = std::array<double, 6>;

  std::vector<Waypoint> waypoints;
  double knot_interval_s = 1.0;
  bool periodic = false;
  double hold_start_s = 0;
  double shake_interval_s = 0.1;
  double shake_position_m = 0;
  double shake_rotation_deg = 0;
  std::uint64_t shake_seed = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("waypoints", waypoints, "m, deg",
          "control points [x, y, z, yaw, pitch, roll] of the left camera; yaw 0 looks along +x, 90 "
          "along +y, positive pitch up, positive roll turns the camera clockwise; neighbours turn "
          "the short way, so -170 and 190 are the same yaw");
    visit("knot_interval_s", knot_interval_s, "s", "time from one waypoint to the next");
    visit("periodic", periodic, "",
          "whether the last waypoint leads back to the first; otherwise start and end are at rest");
    visit("hold_start_s", hold_start_s, "s",
          "the rig rests at the first waypoint for at least this time");
    visit("shake_interval_s", shake_interval_s, "s",
          "time between the control points of the shake");
    visit("shake_position_m", shake_position_m, "m",
          "standard deviation of the control points' shake along each axis");
    visit("shake_rotation_deg", shake_rotation_deg, "deg",
          "standard deviation of the control points' shake about each axis");
    visit("shake_seed", shake_seed, "", "seed of the shake");
  }
};

/// The trajectory of a recipe. The body poses at the waypoints are the spline's control poses, so
/// the path cuts corners. A periodic one without a hold is closest to waypoint i at i intervals.
/// Otherwise five copies of the first waypoint, and for an open one five of the last, make it start
/// and end at rest exactly at those waypoints; it starts to move after the hold and is closest to
/// waypoint i i + 2 intervals later. Shake replaces the spline by a finer one, whose control poses
/// are the smooth spline's poses each moved and turned by normally distributed amounts; there is
/// none while the rig rests.
/// @param T_body_cam pose of the left camera (z forward, x right, y down) on the body.
/// @throws Error naming the option at fault, or the waypoints between which the short way is not
///   defined.
Trajectory MakeTrajectory(const TrajectoryOptions& options, const SE3& T_body_cam);

/// How far and how fiercely a trajectory moves, from samples every 5 ms.
struct MotionSummary {
  double length_m = 0;                  ///< of the path; by the duration, the mean speed
  double turn_rad = 0;                  ///< all rotation; by the duration, the mean angular rate
  double max_speed = 0;                 ///< m/s
  double max_acceleration = 0;          ///< m/s^2, without gravity
  double max_angular_rate = 0;          ///< rad/s
  double max_angular_acceleration = 0;  ///< rad/s^2
};

/// Summary of the whole duration, or of one period.
MotionSummary SummarizeMotion(const Trajectory& trajectory);

}  // namespace sgf::synth
