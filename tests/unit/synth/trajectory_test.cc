#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/options.h>
#include <sgf/core/random.h>
#include <sgf/synth/trajectory.h>

namespace sgf::synth {
namespace {

using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;
constexpr double kInterval_s = 0.4;

// Poses scattered in a room, each turned by up to some 150 degrees against the one before.
std::vector<SE3> ScatteredPoses(int count, std::uint64_t seed) {
  std::vector<SE3> poses(count);
  for (int i = 0; i < count; ++i) {
    const auto uniform = [&](int axis) { return 2 * Uniform01(seed, 6 * i + axis) - 1; };
    const Eigen::Quaterniond before = i ? poses[i - 1].R : Eigen::Quaterniond::Identity();
    poses[i] = {before * ExpSO3(1.5 * Eigen::Vector3d(uniform(0), uniform(1), uniform(2))),
                Eigen::Vector3d(uniform(3), uniform(4), uniform(5))};
  }
  return poses;
}

class TrajectoryTest : public ::testing::TestWithParam<bool> {
 protected:
  const Trajectory trajectory_{ScatteredPoses(11, 5), kInterval_s, GetParam()};
};

double Difference(const SE3& a, const SE3& b) {
  return (a.p - b.p).norm() + LogSO3(a.R.conjugate() * b.R).norm();
}

TEST_P(TrajectoryTest, DerivativesAreThoseOfThePose) {
  constexpr double kStep_s = 1e-4;
  for (double t_s = 0.013; t_s < trajectory_.duration_s(); t_s += 0.037) {
    const MotionState before = trajectory_.At(t_s - kStep_s), at = trajectory_.At(t_s),
                      after = trajectory_.At(t_s + kStep_s);
    const auto derivative = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return Eigen::Vector3d((b - a) / (2 * kStep_s));
    };
    const SE3 &T_before = before.T_world_body, &T_after = after.T_world_body;
    const Eigen::Vector3d rate = LogSO3(T_before.R.conjugate() * T_after.R) / (2 * kStep_s);
    EXPECT_LT((derivative(T_before.p, T_after.p) - at.velocity).norm(), 1e-5);
    EXPECT_LT((derivative(before.velocity, after.velocity) - at.acceleration).norm(), 1e-4);
    EXPECT_LT((rate - at.angular_velocity).norm(), 1e-4);
    EXPECT_LT(
        (derivative(before.angular_velocity, after.angular_velocity) - at.angular_acceleration)
            .norm(),
        1e-3);
  }
}

// Second derivatives of the acceleration, from the left and from the right of a knot.
TEST_P(TrajectoryTest, FourDerivativesAreContinuousAcrossKnots) {
  constexpr double kStep_s = 1e-4;
  const auto one_sided = [&](double t_s, double side, Eigen::Vector3d MotionState::*member) {
    const auto at = [&](int i) { return trajectory_.At(t_s + side * i * kStep_s).*member; };
    return Eigen::Vector3d((2 * at(0) - 5 * at(1) + 4 * at(2) - at(3)) / (kStep_s * kStep_s));
  };
  for (const auto member : {&MotionState::acceleration, &MotionState::angular_acceleration})
    for (double t_s = kInterval_s; t_s < trajectory_.duration_s() - 0.1; t_s += kInterval_s) {
      const Eigen::Vector3d before = one_sided(t_s, -1, member), after = one_sided(t_s, 1, member);
      EXPECT_GT(before.norm(), 10);
      EXPECT_LT((after - before).norm(), 0.01 * before.norm());
    }
}

TEST_P(TrajectoryTest, RotationStaysAUnitQuaternion) {
  for (double t_s = 0; t_s < trajectory_.duration_s(); t_s += 0.01)
    EXPECT_NEAR(trajectory_.At(t_s).T_world_body.R.norm(), 1, 4e-16);
}

INSTANTIATE_TEST_SUITE_P(OpenAndPeriodic, TrajectoryTest, ::testing::Bool());

TEST(Trajectory, PeriodicOneClosesWithoutASeam) {
  for (const int count : {2, 3, 5, 9}) {
    const Trajectory loop(ScatteredPoses(count, 8), 0.3, true);
    const double period_s = loop.duration_s();
    EXPECT_DOUBLE_EQ(period_s, 0.3 * count);
    for (const double t_s : {0.0, 1e-12, 0.1, 0.3, period_s - 1e-12})
      for (const double turns : {-1.0, 1.0, 2.0}) {
        const MotionState a = loop.At(t_s), b = loop.At(t_s + turns * period_s);
        EXPECT_LT(Difference(a.T_world_body, b.T_world_body), 1e-13);
        EXPECT_LT((a.velocity - b.velocity).norm(), 1e-12);
        EXPECT_LT((a.acceleration - b.acceleration).norm(), 1e-10);
        EXPECT_LT((a.angular_velocity - b.angular_velocity).norm(), 1e-12);
        EXPECT_LT((a.angular_acceleration - b.angular_acceleration).norm(), 1e-10);
      }
  }
}

TEST(Trajectory, EqualControlPosesAreRest) {
  const SE3 pose = ScatteredPoses(3, 2).back();
  const Trajectory rest(std::vector<SE3>(7, pose), 0.5, false);
  for (double t_s = 0; t_s <= 1; t_s += 0.05) {
    const MotionState state = rest.At(t_s);
    EXPECT_EQ(state.T_world_body.p, pose.p);
    EXPECT_LT(Difference(state.T_world_body, pose), 1e-15);
    EXPECT_EQ(state.velocity, Eigen::Vector3d::Zero());
    EXPECT_EQ(state.acceleration, Eigen::Vector3d::Zero());
    EXPECT_EQ(state.angular_velocity, Eigen::Vector3d::Zero());
    EXPECT_EQ(state.angular_acceleration, Eigen::Vector3d::Zero());
  }
}

TEST(Trajectory, EvenStepsAlongALineAndAboutAnAxisAreUniformMotion) {
  const Eigen::Vector3d move(0.3, -0.1, 0.2), turn = 0.7 * Eigen::Vector3d(0, 0.6, 0.8);
  std::vector<SE3> control;
  for (int i = 0; i < 9; ++i) control.push_back({ExpSO3(i * turn), i * move});
  const Trajectory trajectory(control, 0.25, false);
  for (double t_s = 0; t_s <= trajectory.duration_s(); t_s += 0.01) {
    const MotionState state = trajectory.At(t_s);
    const double i = t_s / 0.25 + 2;  // control pose i is passed at (i - 2) intervals
    EXPECT_LT(Difference(state.T_world_body, {ExpSO3(i * turn), i * move}), 1e-13);
    EXPECT_LT((state.velocity - move / 0.25).norm(), 1e-13);
    EXPECT_LT((state.angular_velocity - turn / 0.25).norm(), 1e-13);
    EXPECT_LT(state.acceleration.norm(), 1e-11);
    EXPECT_LT(state.angular_acceleration.norm(), 1e-11);
  }
}

TEST(Trajectory, WeighsControlPosesAsAUniformQuinticBSpline) {
  std::vector<SE3> control(11);
  control[5].p.x() = 120;
  const Trajectory trajectory(control, 2, false);
  EXPECT_NEAR(trajectory.At(2).T_world_body.p.x(), 1, 1e-12);
  EXPECT_NEAR(trajectory.At(4).T_world_body.p.x(), 26, 1e-12);
  EXPECT_NEAR(trajectory.At(6).T_world_body.p.x(), 66, 1e-12);
  EXPECT_NEAR(trajectory.At(8).T_world_body.p.x(), 26, 1e-12);
  EXPECT_NEAR(trajectory.At(12).T_world_body.p.x(), 0, 1e-12);
}

TEST(Trajectory, NamesWhatItCannotUse) {
  std::vector<SE3> poses = ScatteredPoses(6, 1);
  const auto error = [&](double interval_s, bool periodic) {
    return ErrorMessage([&] { Trajectory(poses, interval_s, periodic); });
  };
  EXPECT_EQ(error(0.1, false), "no error");
  EXPECT_THAT(error(0, false), HasSubstr("knot interval is 0 s; it has to be positive"));
  EXPECT_THAT(error(std::nan(""), false), HasSubstr("knot interval is nan s"));
  poses.pop_back();
  EXPECT_THAT(error(0.1, false), HasSubstr("5 control poses; at least 6 are needed"));
  EXPECT_EQ(error(0.1, true), "no error");
  poses[2].p.y() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(error(0.1, true), HasSubstr("control pose 2 is not finite"));
  poses[2].p.y() = 0;
  poses[4].R = poses[0].R * ExpSO3({0, kPi, 0});
  EXPECT_THAT(error(0.1, true), HasSubstr("control poses 4 and 0 are turned by 180 deg"));
  poses.resize(1);
  EXPECT_THAT(error(0.1, true), HasSubstr("1 control poses; at least 2 are needed"));
}

TEST(Trajectory, OpenOneHasNoStateOutsideItsRange) {
  const Trajectory trajectory(ScatteredPoses(6, 1), 0.5, false);
  EXPECT_EQ(ErrorMessage([&] { trajectory.At(0.5); }), "no error");
  for (const double t_s : {-0.001, 0.501, std::nan("")})
    EXPECT_THAT(ErrorMessage([&] { trajectory.At(t_s); }), HasSubstr("outside [0, 0.5] s"));
}

// EuRoC's cam0.
SE3 BodyFromCamera() {
  Eigen::Matrix3d R;
  R << 0.0148655429818, -0.999880929698, 0.00414029679422,  //
      0.999557249008, 0.0149672133247, 0.025715529948,      //
      -0.0257744366974, 0.00375618835797, 0.999660727178;
  return {Eigen::Quaterniond(R).normalized(),
          {-0.0216401454975, -0.064676986768, 0.00981073058949}};
}

TrajectoryOptions Options(std::vector<TrajectoryOptions::Waypoint> waypoints, bool periodic) {
  TrajectoryOptions options;
  options.waypoints = std::move(waypoints);
  options.periodic = periodic;
  return options;
}

SE3 CameraAt(const Trajectory& trajectory, double t_s) {
  return trajectory.At(t_s).T_world_body * BodyFromCamera();
}

const Eigen::Vector3d kRight = Eigen::Vector3d::UnitX(), kDown = Eigen::Vector3d::UnitY(),
                      kAhead = Eigen::Vector3d::UnitZ();

Eigen::Quaterniond ViewOf(double yaw, double pitch, double roll) {
  return CameraAt(MakeTrajectory(Options({{1, 2, 3, yaw, pitch, roll}}, false), BodyFromCamera()),
                  1)
      .R;
}

TEST(MakeTrajectory, WaypointsAreTheLeftCamerasPlaceAndView) {
  const Trajectory still = MakeTrajectory(Options({{1, 2, 3, 0, 0, 0}}, false), BodyFromCamera());
  EXPECT_LT((CameraAt(still, 0.5).p - Eigen::Vector3d(1, 2, 3)).norm(), 1e-14);
  EXPECT_LT((ViewOf(0, 0, 0) * kAhead - Eigen::Vector3d(1, 0, 0)).norm(), 1e-14);
  EXPECT_LT((ViewOf(0, 0, 0) * kRight - Eigen::Vector3d(0, -1, 0)).norm(), 1e-14);
  EXPECT_LT((ViewOf(0, 0, 0) * kDown - Eigen::Vector3d(0, 0, -1)).norm(), 1e-14);
  EXPECT_LT((ViewOf(90, 0, 0) * kAhead - Eigen::Vector3d(0, 1, 0)).norm(), 1e-14);
  EXPECT_LT((ViewOf(90, 30, 20) * kAhead - Eigen::Vector3d(0, std::sqrt(0.75), 0.5)).norm(), 1e-14);
  EXPECT_LT((ViewOf(0, 0, 90) * kRight - Eigen::Vector3d(0, 0, -1)).norm(), 1e-14);
}

TEST(MakeTrajectory, YawGoesTheShortWayWrappedOrNot) {
  const auto speed = [](double from, double to) {
    const auto options = Options({{0, 0, 0, from, 0, 0}, {0, 0, 0, to, 0, 0}}, false);
    return SummarizeMotion(MakeTrajectory(options, BodyFromCamera())).max_angular_rate;
  };
  const double expected = speed(0, 20);
  EXPECT_GT(expected, 0.1);
  EXPECT_NEAR(speed(170, 190), expected, 1e-12);
  EXPECT_NEAR(speed(170, -170), expected, 1e-12);
  EXPECT_NEAR(speed(-10, 370), expected, 1e-12);
  EXPECT_NEAR(speed(0, 340), expected, 1e-12);
}

TEST(MakeTrajectory, OpenOneRestsAtBothEndsAndFollowsTheWaypoints) {
  auto options = Options({{0, 0, 1, 0, 0, 0},
                          {1, 0, 1, 0, 0, 0},
                          {2, 0, 1, 0, 0, 0},
                          {3, 0, 1, 0, 0, 0},
                          {4, 0, 1, 0, 0, 0}},
                         false);
  options.knot_interval_s = 0.5;
  options.hold_start_s = 2.2;  // rounds up to five intervals
  const Trajectory trajectory = MakeTrajectory(options, BodyFromCamera());
  const double end_s = trajectory.duration_s();
  EXPECT_DOUBLE_EQ(end_s, 0.5 * (5 + 8));
  for (const double t_s : {0.0, 1.1, 2.2, 2.5, end_s}) {
    const MotionState state = trajectory.At(t_s);
    EXPECT_LT(state.velocity.norm(), 1e-14);
    EXPECT_LT(state.acceleration.norm(), 1e-13);
    EXPECT_NEAR(CameraAt(trajectory, t_s).p.x(), t_s == end_s ? 4 : 0, 1e-14);
  }
  EXPECT_GT(trajectory.At(2.6).velocity.norm(), 1e-4);
  // Waypoint 2 is the middle one of a straight, even row: closest two intervals after its turn.
  EXPECT_NEAR(CameraAt(trajectory, 2.5 + 0.5 * (2 + 2)).p.x(), 2, 1e-12);
}

TEST(MakeTrajectory, PeriodicOnePassesWaypointIAtIIntervals) {
  const Trajectory loop = MakeTrajectory(
      Options(
          {{2, 0, 1, 90, 0, 0}, {0, 2, 1, 180, 0, 0}, {-2, 0, 1, 270, 0, 0}, {0, -2, 1, 360, 0, 0}},
          true),
      BodyFromCamera());
  EXPECT_DOUBLE_EQ(loop.duration_s(), 4);
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d p = CameraAt(loop, i).p;
    EXPECT_NEAR(std::remainder(std::atan2(p.y(), p.x()) - i * kPi / 2, 2 * kPi), 0, 0.05);
    EXPECT_GT(loop.At(i).velocity.norm(), 0.5);
  }
}

TEST(MakeTrajectory, PeriodicOneWithAHoldStartsAtRestAndReturnsToIt) {
  auto options = Options({{0, 0, 0, 0, 0, 0}, {1, 0, 0, 30, 0, 0}, {1, 1, 0, 60, 0, 0}}, true);
  options.hold_start_s = 3;
  options.shake_position_m = 0.05;
  options.shake_rotation_deg = 2;
  const Trajectory loop = MakeTrajectory(options, BodyFromCamera());
  EXPECT_NEAR(loop.duration_s(), 3 + 3 + 4, 1e-12);
  for (const double t_s : {0.0, 1.0, 2.0, 2.999, 10.0, 12.999}) {
    EXPECT_LT(loop.At(t_s).velocity.norm(), 1e-12);
    EXPECT_LT(loop.At(t_s).angular_velocity.norm(), 1e-12);
    EXPECT_LT(CameraAt(loop, t_s).p.norm(), 1e-13);
  }
  EXPECT_GT(loop.At(6).velocity.norm(), 0.01);
}

TrajectoryOptions Ride(bool periodic) {
  auto options = Options({{0, 0, 1, 0, 0, 0},
                          {2, 0, 1, 60, 5, 0},
                          {3, 2, 1.5, 120, -5, 10},
                          {1, 3, 1, 200, 0, 0},
                          {-1, 1, 1, 280, 0, -5}},
                         periodic);
  options.hold_start_s = periodic ? 0 : 1;
  return options;
}

TEST(MakeTrajectory, ShakeHasTheSizeAskedForAndTheSamePath) {
  for (const bool periodic : {false, true}) {
    const TrajectoryOptions calm = Ride(periodic);
    TrajectoryOptions shaken = calm;
    shaken.shake_position_m = 0.02;
    shaken.shake_rotation_deg = 1.5;
    const Trajectory a = MakeTrajectory(calm, BodyFromCamera());
    const Trajectory b = MakeTrajectory(shaken, BodyFromCamera());
    ASSERT_NEAR(a.duration_s(), b.duration_s(), 1e-12);
    double position = 0, rotation = 0;
    int count = 0;
    for (double t_s = 1.5; t_s < a.duration_s() - 0.5; t_s += 0.01, ++count) {
      const SE3 Ta = a.At(t_s).T_world_body, Tb = b.At(t_s).T_world_body;
      position += (Ta.p - Tb.p).squaredNorm() / 3;
      rotation += LogSO3(Ta.R.conjugate() * Tb.R).squaredNorm() / 3;
    }
    // A quintic B-spline passes 0.62 of the standard deviation of independent control points.
    EXPECT_NEAR(std::sqrt(position / count), 0.62 * 0.02, 0.003);
    EXPECT_NEAR(std::sqrt(rotation / count) * 180 / kPi, 0.62 * 1.5, 0.25);
  }
}

TEST(MakeTrajectory, ShakeSparesTheRestAndDependsOnTheSeedAlone) {
  TrajectoryOptions options = Ride(false);
  options.shake_position_m = 0.05;
  options.shake_interval_s = 0.16;  // does not divide the hold
  const Trajectory a = MakeTrajectory(options, BodyFromCamera());
  const Trajectory b = MakeTrajectory(options, BodyFromCamera());
  options.shake_seed = 1;
  const Trajectory other = MakeTrajectory(options, BodyFromCamera());
  for (const double t_s : {0.0, 0.5, 1.0, a.duration_s()}) {
    EXPECT_LT(a.At(t_s).velocity.norm(), 1e-12);
    EXPECT_LT(a.At(t_s).acceleration.norm(), 1e-11);
  }
  for (const double t_s : {2.0, 3.3, 5.0}) {
    EXPECT_EQ(a.At(t_s).T_world_body.p, b.At(t_s).T_world_body.p);
    EXPECT_GT((a.At(t_s).T_world_body.p - other.At(t_s).T_world_body.p).norm(), 1e-3);
  }
}

TEST(MakeTrajectory, ShakenLoopStillCloses) {
  TrajectoryOptions options = Ride(true);
  options.shake_position_m = 0.05;
  options.shake_rotation_deg = 3;
  options.shake_interval_s = 0.13;  // does not divide the period
  const Trajectory loop = MakeTrajectory(options, BodyFromCamera());
  const MotionState a = loop.At(0), b = loop.At(loop.duration_s() - 1e-9);
  EXPECT_LT(Difference(a.T_world_body, b.T_world_body), 1e-7);
  EXPECT_LT((a.acceleration - b.acceleration).norm(), 1e-5);
}

TEST(MakeTrajectory, ReadsARecipeAndWritesIt) {
  TrajectoryOptions options;
  ReadOptions(YAML::Load("{waypoints: [[0, 0, 1, 0, 0, 0], [1, 0, 1.5, 45, -5, 0]], "
                         "knot_interval_s: 0.5, shake_seed: 7}"),
              options, "r.yaml");
  EXPECT_THAT(options.waypoints[1], ::testing::ElementsAre(1, 0, 1.5, 45, -5, 0));
  TrajectoryOptions copy;
  ReadOptions(WriteOptions(options), copy, "copy");
  EXPECT_EQ(copy.waypoints, options.waypoints);
  EXPECT_EQ(copy.shake_seed, 7u);
  EXPECT_THAT(ErrorMessage([&] {
                ReadOptions(YAML::Load("{waypoints: [[0, 0, 1, 0, 0]]}"), options, "r.yaml");
              }),
              HasSubstr("r.yaml:1: cannot read"));
}

TEST(MakeTrajectory, NamesTheOptionAtFault) {
  const auto error = [](auto change) {
    TrajectoryOptions options = Ride(false);
    change(options);
    return ErrorMessage([&] { MakeTrajectory(options, BodyFromCamera()); });
  };
  using O = TrajectoryOptions;
  EXPECT_EQ(error([](O&) {}), "no error");
  EXPECT_THAT(error([](O& o) { o.waypoints.clear(); }), HasSubstr("0 waypoints"));
  EXPECT_THAT(error([](O& o) { o.periodic = true, o.waypoints.resize(1); }),
              HasSubstr("1 waypoints"));
  EXPECT_THAT(error([](O& o) { o.waypoints[3][2] = std::nan(""); }),
              HasSubstr("waypoint 3 holds nan"));
  EXPECT_THAT(error([](O& o) { o.waypoints[2][3] = 240, o.waypoints[2][4] = -5; }),
              HasSubstr("waypoints 1 and 2 are turned by 180 deg"));
  EXPECT_THAT(error([](O& o) { o.knot_interval_s = -1; }), HasSubstr("knot_interval_s is -1 s"));
  EXPECT_THAT(error([](O& o) { o.knot_interval_s = 1e308; }),
              HasSubstr("knot_interval_s is 1e+308 s"));
  EXPECT_THAT(error([](O& o) { o.knot_interval_s = 1e-3, o.hold_start_s = 3600; }),
              HasSubstr("hold_start_s asks for 3600000 control poses"));
  EXPECT_THAT(error([](O& o) {
                o.knot_interval_s = 3600, o.shake_position_m = 0.1, o.shake_interval_s = 1e-3;
              }),
              HasSubstr("shake_interval_s asks for"));
  EXPECT_THAT(error([](O& o) { o.hold_start_s = -2; }), HasSubstr("hold_start_s is -2 s"));
  EXPECT_THAT(error([](O& o) { o.shake_interval_s = 0; }), HasSubstr("shake_interval_s is 0 s"));
  EXPECT_THAT(error([](O& o) { o.shake_position_m = -1; }), HasSubstr("shake_position_m is -1"));
  EXPECT_THAT(error([](O& o) { o.shake_rotation_deg = -1; }), HasSubstr("shake_rotation_deg is"));
}

TEST(SummarizeMotion, MeasuresUniformMotion) {
  std::vector<SE3> control;
  for (int i = 0; i < 15; ++i) control.push_back({ExpSO3({0, 0, 0.2 * i}), {0.5 * i, 0, 0}});
  const MotionSummary summary = SummarizeMotion(Trajectory(control, 0.5, false));
  EXPECT_NEAR(summary.length_m, 5, 1e-12);
  EXPECT_NEAR(summary.turn_rad, 2, 1e-12);
  EXPECT_NEAR(summary.max_speed, 1, 1e-12);
  EXPECT_NEAR(summary.max_angular_rate, 0.4, 1e-12);
  EXPECT_LT(summary.max_acceleration, 1e-12);
  EXPECT_LT(summary.max_angular_acceleration, 1e-12);
}

// The path x(t) from rest to rest over one waypoint: a B-spline's step response.
TEST(SummarizeMotion, FindsThePeaks) {
  auto options = Options({{0, 0, 0, 0, 0, 0}, {1, 0, 0, 0, 0, 0}}, false);
  const Trajectory trajectory = MakeTrajectory(options, SE3());
  const MotionSummary summary = SummarizeMotion(trajectory);
  EXPECT_NEAR(summary.length_m, 1, 1e-6);
  EXPECT_NEAR(summary.max_speed, 115. / 192, 1e-12);      // the quartic basis function's peak
  EXPECT_NEAR(summary.max_acceleration, 0.545423, 1e-5);  // of its derivative, at (5 + sqrt(5)) / 4
}

}  // namespace
}  // namespace sgf::synth
