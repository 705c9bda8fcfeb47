#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/random.h>
#include <sgf/synth/trajectory.h>

namespace sgf::synth {

namespace {

constexpr int kOrder = 6;  // control poses that act on one interval; the degree is kOrder - 1
constexpr double kMinInterval_s = 1e-3, kMaxInterval_s = 3600;
constexpr double kMaxControlPoses = 1e6;  // an hour's shake has less than a tenth
constexpr double kRadPerDeg = std::numbers::pi / 180;

using Basis = std::array<std::array<double, kOrder>, kOrder>;

constexpr double Binomial(int n, int k) {
  double value = 1;
  for (int i = 0; i < k; ++i) value = value * (n - i) / (i + 1);
  return value;
}

constexpr double Power(double x, int n) { return n == 0 ? 1 : x * Power(x, n - 1); }

// Row j holds the coefficients of the powers of u in [0, 1] of the cumulative basis function j: the
// sum of the basis functions j to kOrder - 1 (Sommer et al., equations 3 and 6).
constexpr Basis CumulativeBasis() {
  Basis m{};
  for (int j = kOrder - 1; j >= 0; --j)
    for (int n = 0; n < kOrder; ++n) {
      double sum = 0;
      for (int l = j; l < kOrder; ++l)
        sum += ((l - j) % 2 ? -1 : 1) * Binomial(kOrder, l - j) *
               Power(kOrder - 1 - l, kOrder - 1 - n);
      m[j][n] = Binomial(kOrder - 1, n) * sum + (j + 1 < kOrder ? m[j + 1][n] : 0);
    }
  return m;  // integers: kOrder - 1 factorial times the functions
}

constexpr double kFactorial = 120;
constexpr Basis kBasis = CumulativeBasis();
static_assert(kBasis[0][0] == kFactorial && kBasis[1][0] == kFactorial - 1);

/// A cumulative basis function and its derivatives by time.
struct Blend {
  double value, first, second;
};

Blend BlendAt(int j, double u, double interval_s) {
  double value = 0, first = 0, second = 0;  // Horner's scheme; `second` gathers half the derivative
  for (int n = kOrder - 1; n >= 0; --n) {
    second = second * u + first;
    first = first * u + value;
    value = value * u + kBasis[j][n];
  }
  return {value / kFactorial, first / (kFactorial * interval_s),
          2 * second / (kFactorial * interval_s * interval_s)};
}

[[noreturn]] void Fail(const std::string& what) { throw Error("trajectory", what); }

void CheckInterval(double interval_s, const char* name) {
  if (!(interval_s >= kMinInterval_s && interval_s <= kMaxInterval_s))
    Fail(fmt::format("{} is {} s; it has to lie in [{}, {}]", name, interval_s, kMinInterval_s,
                     kMaxInterval_s));
}

/// Keeps a slip of the pen from deciding how much memory is allocated.
void CheckPoses(double count, const char* name) {
  if (count > kMaxControlPoses)
    Fail(
        fmt::format("{} asks for {} control poses; the most is {}", name, count, kMaxControlPoses));
}

/// Fails where the rotation from a pose to the next (or the last to the first) has no short way.
void CheckTurns(const std::vector<SE3>& poses, bool periodic, const char* plural) {
  constexpr double kMaxTurn = std::numbers::pi - 1e-6;
  for (size_t i = 0; i + (periodic ? 0 : 1) < poses.size(); ++i) {
    const size_t next = (i + 1) % poses.size();
    if (LogSO3(poses[i].R.conjugate() * poses[next].R).norm() > kMaxTurn)
      Fail(fmt::format("{} {} and {} are turned by 180 deg against each other: no way is shorter",
                       plural, i, next));
  }
}

/// T_world_cam of a waypoint.
SE3 CameraPose(const TrajectoryOptions::Waypoint& w) {
  const auto turn = [](double deg, const Eigen::Vector3d& axis) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(deg * kRadPerDeg, axis));
  };
  const Eigen::Quaterniond forward(0.5, -0.5, 0.5, -0.5);  // z to +x, x to -y, y to -z
  const Eigen::Quaterniond R = turn(w[3], Eigen::Vector3d::UnitZ()) *
                               turn(-w[4], Eigen::Vector3d::UnitY()) *
                               turn(w[5], Eigen::Vector3d::UnitX()) * forward;
  return {R, {w[0], w[1], w[2]}};
}

std::vector<SE3> BodyPoses(const std::vector<TrajectoryOptions::Waypoint>& waypoints,
                           const SE3& T_body_cam) {
  std::vector<SE3> poses;
  for (size_t i = 0; i < waypoints.size(); ++i) {
    for (const double value : waypoints[i])
      if (!std::isfinite(value)) Fail(fmt::format("waypoint {} holds {}", i, value));
    poses.push_back(CameraPose(waypoints[i]) * T_body_cam.Inverse());
  }
  return poses;
}

void CheckOptions(const TrajectoryOptions& o) {
  constexpr double kMaxHold_s = 3600;
  CheckInterval(o.knot_interval_s, "knot_interval_s");
  CheckInterval(o.shake_interval_s, "shake_interval_s");
  if (o.waypoints.empty() || (o.periodic && o.waypoints.size() < 2))
    Fail(fmt::format("{} waypoints; an open trajectory needs at least 1, a periodic one 2",
                     o.waypoints.size()));
  if (!(o.hold_start_s >= 0 && o.hold_start_s <= kMaxHold_s))
    Fail(fmt::format("hold_start_s is {} s; it has to lie in [0, {}]", o.hold_start_s, kMaxHold_s));
  for (const auto& [name, value] : {std::pair("shake_position_m", o.shake_position_m),
                                    std::pair("shake_rotation_deg", o.shake_rotation_deg)})
    if (!(value >= 0 && std::isfinite(value)))
      Fail(fmt::format("{} is {}; it has to be 0 or more", name, value));
}

/// The control poses of the smooth spline: see MakeTrajectory.
std::vector<SE3> ControlPoses(std::vector<SE3> waypoints, const TrajectoryOptions& o) {
  if (o.periodic && o.hold_start_s == 0) {
    std::rotate(waypoints.begin(), waypoints.end() - 2, waypoints.end());
    return waypoints;
  }
  const size_t hold_intervals = std::ceil(o.hold_start_s / o.knot_interval_s);
  CheckPoses(static_cast<double>(hold_intervals), "hold_start_s");
  waypoints.insert(waypoints.begin(), kOrder - 2 + hold_intervals, SE3(waypoints.front()));
  if (!o.periodic) waypoints.insert(waypoints.end(), kOrder - 2, SE3(waypoints.back()));
  return waypoints;
}

SE3 Shaken(const SE3& pose, const TrajectoryOptions& o, std::uint64_t index) {
  const auto normal = [&](std::uint64_t axis) { return Gaussian(o.shake_seed, 6 * index + axis); };
  const Eigen::Vector3d move(normal(0), normal(1), normal(2)),
      turn(normal(3), normal(4), normal(5));
  return {pose.R * ExpSO3(o.shake_rotation_deg * kRadPerDeg * turn),
          pose.p + o.shake_position_m * move};
}

Trajectory Shake(const Trajectory& smooth, const TrajectoryOptions& o) {
  const double end_s = smooth.duration_s();
  CheckPoses(end_s / o.shake_interval_s, "shake_interval_s");
  const long intervals = std::max(2L, std::lround(end_s / o.shake_interval_s));
  const double interval_s = end_s / intervals;
  // A control pose acts this long before and after its time. Those that act on a rest keep still.
  const double reach_s = 0.5 * kOrder * interval_s;
  const bool rests = !o.periodic || o.hold_start_s > 0;
  std::vector<SE3> control;
  for (long i = 0; i < intervals + (o.periodic ? 0 : kOrder - 1); ++i) {
    double t_s = (i - 2) * interval_s;
    if (o.periodic && t_s < 0) t_s += end_s;
    const bool starts = rests && t_s - reach_s < o.hold_start_s;
    const bool ends = rests && t_s + reach_s > end_s;
    const SE3 pose = smooth.At(starts ? 0 : ends ? end_s : t_s).T_world_body;
    control.push_back(starts || ends ? pose : Shaken(pose, o, i));
  }
  return Trajectory(std::move(control), interval_s, o.periodic);
}

}  // namespace

Trajectory::Trajectory(std::vector<SE3> control, double knot_interval_s, bool periodic)
    : control_(std::move(control)), knot_interval_s_(knot_interval_s), periodic_(periodic) {
  const size_t minimum = periodic ? 2 : kOrder;
  if (control_.size() < minimum)
    Fail(fmt::format("{} control poses; at least {} are needed", control_.size(), minimum));
  if (!(knot_interval_s > 0 && std::isfinite(knot_interval_s)))
    Fail(fmt::format("the knot interval is {} s; it has to be positive", knot_interval_s));
  for (size_t i = 0; i < control_.size(); ++i)
    if (!control_[i].p.allFinite() || !control_[i].R.coeffs().allFinite())
      Fail(fmt::format("control pose {} is not finite", i));
  CheckTurns(control_, periodic, "control poses");
  for (size_t i = 0; i < control_.size(); ++i) {
    const SE3& next = control_[(i + 1) % control_.size()];
    moves_.push_back(next.p - control_[i].p);
    turns_.push_back(LogSO3(control_[i].R.conjugate() * next.R));
  }
}

double Trajectory::duration_s() const {
  const size_t intervals = periodic_ ? control_.size() : control_.size() - (kOrder - 1);
  return static_cast<double>(intervals) * knot_interval_s_;
}

MotionState Trajectory::At(double t_s) const {
  constexpr double kSlack_s = 1e-9;  // rounding in the caller's sums
  const double end_s = duration_s();
  if (!std::isfinite(t_s) || (!periodic_ && (t_s < -kSlack_s || t_s > end_s + kSlack_s)))
    Fail(fmt::format("time {} s lies outside [0, {}] s", t_s, end_s));
  const double knots = (periodic_ ? t_s - end_s * std::floor(t_s / end_s) : t_s) / knot_interval_s_;
  const double last = std::lround(end_s / knot_interval_s_) - 1;
  const double interval = std::clamp(std::floor(knots), 0.0, last);

  size_t i = interval;
  MotionState state;
  SE3& pose = state.T_world_body = control_[i];
  Eigen::Vector3d &rate = state.angular_velocity, &acceleration = state.angular_acceleration;
  for (int j = 1; j < kOrder; ++j, i = (i + 1) % control_.size()) {
    const Blend blend = BlendAt(j, knots - interval, knot_interval_s_);
    pose.p += blend.value * moves_[i];
    state.velocity += blend.first * moves_[i];
    state.acceleration += blend.second * moves_[i];

    const Eigen::Vector3d& turn = turns_[i];
    const Eigen::Quaterniond step = ExpSO3(blend.value * turn);
    pose.R = pose.R * step;
    rate = step.conjugate() * rate + blend.first * turn;
    acceleration =
        step.conjugate() * acceleration + blend.first * rate.cross(turn) + blend.second * turn;
  }
  pose.R.normalize();
  return state;
}

Trajectory MakeTrajectory(const TrajectoryOptions& options, const SE3& T_body_cam) {
  CheckOptions(options);
  std::vector<SE3> poses = BodyPoses(options.waypoints, T_body_cam);
  CheckTurns(poses, options.periodic, "waypoints");
  const Trajectory smooth(ControlPoses(std::move(poses), options), options.knot_interval_s,
                          options.periodic);
  const bool shakes = options.shake_position_m > 0 || options.shake_rotation_deg > 0;
  return shakes ? Shake(smooth, options) : smooth;
}

MotionSummary SummarizeMotion(const Trajectory& trajectory) {
  constexpr double kStep_s = 5e-3;
  MotionSummary summary;
  const long steps = std::max(1L, std::lround(trajectory.duration_s() / kStep_s));
  const double step_s = trajectory.duration_s() / steps;
  const auto raise = [](double& maximum, const Eigen::Vector3d& v) {
    maximum = std::max(maximum, v.norm());
  };
  for (long i = 0; i <= steps; ++i) {
    const MotionState state = trajectory.At(i * step_s);
    const double weight_s = i % steps == 0 ? 0.5 * step_s : step_s;  // trapezoidal rule
    summary.length_m += weight_s * state.velocity.norm();
    summary.turn_rad += weight_s * state.angular_velocity.norm();
    raise(summary.max_speed, state.velocity);
    raise(summary.max_acceleration, state.acceleration);
    raise(summary.max_angular_rate, state.angular_velocity);
    raise(summary.max_angular_acceleration, state.angular_acceleration);
  }
  return summary;
}

}  // namespace sgf::synth
