#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/allan.h>
#include <support/error_message.h>
#include <support/imu_integration.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/options.h>
#include <sgf/synth/imu.h>

namespace sgf::synth {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kStart_ns = 1403636579763555584;

ImuOptions NoiseFree() {
  ImuOptions options;
  options.noisy = false;
  return options;
}

// A walk round a room.
TrajectoryOptions SmoothRide() {
  TrajectoryOptions o;
  o.waypoints = {{0, 0, 1, 0, 0, 0},     {2, 0, 1.2, 40, 0, 0},    {4, 1, 1.5, 90, 10, 0},
                 {4, 3, 1.4, 150, 0, 5}, {2, 4, 1.2, 200, -10, 0}, {0, 3, 1, 260, 0, -5},
                 {-1, 1, 1, 320, 5, 0}};
  o.knot_interval_s = 2;
  o.periodic = true;
  return o;
}

// A flight beyond what EuRoC's difficult sequences show, with rotor-like shake.
TrajectoryOptions AggressiveRide() {
  TrajectoryOptions o = SmoothRide();
  o.knot_interval_s = 0.5;
  o.shake_position_m = 0.03;
  o.shake_rotation_deg = 6;
  return o;
}

// Rest for three hours and a little.
Trajectory Rest() {
  return Trajectory(std::vector<SE3>(9, {ExpSO3({0.3, -0.5, 1}), {1, 2, 3}}), 3600, false);
}

// Largest position and rotation error at the end of 10 s windows.
struct Drift {
  double position_m = 0, rotation_deg = 0;
};

Drift DriftOver10s(const Trajectory& trajectory, const ImuOptions& options) {
  Drift worst;
  for (double from_s = 0; from_s < 7; from_s += 0.7) {
    std::vector<BodyState> truth;
    const auto samples = SimulateImu(trajectory, from_s, from_s + 10, options, kStart_ns, &truth);
    const BodyState end = IntegrateImu(samples, truth.front(), options.gravity);
    EXPECT_EQ(end.time_ns - truth.front().time_ns, 10'000'000'000);
    const SE3 error = truth.back().T_world_body.Inverse() * end.T_world_body;
    worst.position_m = std::max(worst.position_m, error.p.norm());
    worst.rotation_deg =
        std::max(worst.rotation_deg, LogSO3(error.R).norm() * 180 / std::numbers::pi);
  }
  return worst;
}

class ImuIntegration : public ::testing::TestWithParam<bool> {};

TEST_P(ImuIntegration, OfTheNoiseFreeImuReproducesTheTruth) {
  const auto ride = GetParam() ? AggressiveRide() : SmoothRide();
  const Trajectory trajectory = MakeTrajectory(ride, SE3());
  ImuOptions options = NoiseFree();
  options.initial_gyroscope_bias = {0.01, -0.02, 0.08};
  options.initial_accelerometer_bias = {-0.05, 0.1, 0.06};
  const Drift drift = DriftOver10s(trajectory, options);
  const MotionSummary motion = SummarizeMotion(trajectory);
  RecordProperty("position_um", std::to_string(drift.position_m * 1e6));
  RecordProperty("rotation_udeg", std::to_string(drift.rotation_deg * 1e6));
  RecordProperty("max_speed", std::to_string(motion.max_speed));
  RecordProperty("max_acceleration", std::to_string(motion.max_acceleration));
  RecordProperty("max_angular_rate", std::to_string(motion.max_angular_rate));
  EXPECT_LT(drift.position_m, 0.01);
  EXPECT_LT(drift.rotation_deg, 0.05);
  if (GetParam()) {
    EXPECT_GT(motion.max_acceleration, 10);
    EXPECT_GT(motion.max_angular_rate, 3);
  }
}

INSTANTIATE_TEST_SUITE_P(SmoothAndAggressive, ImuIntegration, ::testing::Bool());

AllanFit FitAxes(const std::vector<ImuSample>& samples, Eigen::Vector3d ImuSample::*sensor,
                 double rate_hz) {
  std::vector<std::vector<double>> signals(3);
  for (int axis = 0; axis < 3; ++axis)
    for (const auto& sample : samples) signals[axis].push_back((sample.*sensor)[axis]);
  return FitAllanVariance(signals, rate_hz, 200);
}

TEST(SimulateImu, ShowsTheNoiseAskedForInThreeHoursAtRest) {
  ImuOptions options;
  const auto samples = SimulateImu(Rest(), 0, 3 * 3600, options, kStart_ns);
  ASSERT_EQ(samples.size(), 3u * 3600 * 200 + 1);
  const auto expect = [](const char* name, double measured, double asked) {
    RecordProperty(std::string(name) + "_percent_off",
                   std::to_string(100 * (measured / asked - 1)));
    EXPECT_NEAR(measured / asked, 1, 0.1) << name;
  };
  const AllanFit gyro = FitAxes(samples, &ImuSample::gyro, options.rate_hz);
  expect("gyroscope_noise_density", gyro.noise_density, 1.6968e-4);
  expect("gyroscope_random_walk", gyro.random_walk, 1.9393e-5);
  const AllanFit accel = FitAxes(samples, &ImuSample::accel, options.rate_hz);
  expect("accelerometer_noise_density", accel.noise_density, 2e-3);
  expect("accelerometer_random_walk", accel.random_walk, 3e-3);
}

TEST(SimulateImu, MeasuresGravityAtRest) {
  const auto samples = SimulateImu(Rest(), 0, 0.1, NoiseFree(), kStart_ns);
  ASSERT_EQ(samples.size(), 21u);
  const Eigen::Vector3d up = Rest().At(0).T_world_body.R.conjugate() * Eigen::Vector3d(0, 0, 9.81);
  for (const auto& sample : samples) {
    EXPECT_EQ(sample.gyro, Eigen::Vector3d::Zero());
    EXPECT_LT((sample.accel - up).norm(), 1e-14);
  }
}

TEST(SimulateImu, TruthIsTheTrajectoryWithTheBiasesThatWereAdded) {
  const Trajectory trajectory = MakeTrajectory(SmoothRide(), SE3());
  ImuOptions noisy;
  noisy.initial_gyroscope_bias = {0.01, 0.02, 0.03};
  noisy.noise.gyroscope_noise_density = noisy.noise.accelerometer_noise_density = 0;
  std::vector<BodyState> truth(3);
  const auto measured = SimulateImu(trajectory, 1, 3, noisy, kStart_ns, &truth);
  const auto clean = SimulateImu(trajectory, 1, 3, NoiseFree(), kStart_ns);
  ASSERT_EQ(measured.size(), 401u);
  ASSERT_EQ(truth.size(), 401u);
  EXPECT_EQ(truth[0].gyro_bias, Eigen::Vector3d(0.01, 0.02, 0.03));
  EXPECT_EQ(truth[0].accel_bias, Eigen::Vector3d::Zero());
  for (size_t k = 0; k < truth.size(); ++k) {
    const std::int64_t time_ns =
        kStart_ns + 1'000'000'000 + 5'000'000 * static_cast<std::int64_t>(k);
    EXPECT_EQ(measured[k].time_ns, time_ns);
    EXPECT_EQ(truth[k].time_ns, time_ns);
    const MotionState state = trajectory.At(1 + 0.005 * k);
    EXPECT_LT((truth[k].T_world_body.p - state.T_world_body.p).norm(), 1e-12);
    EXPECT_LT((truth[k].velocity - state.velocity).norm(), 1e-12);
    EXPECT_LT((measured[k].gyro - truth[k].gyro_bias - clean[k].gyro).norm(), 1e-15);
    EXPECT_LT((measured[k].accel - truth[k].accel_bias - clean[k].accel).norm(), 1e-14);
    EXPECT_NE(truth[k].accel_bias, truth[k ? k - 1 : 1].accel_bias);
  }
}

TEST(SimulateImu, NoiseDependsOnTheSeedAlone) {
  ImuOptions options;
  const auto run = [&] { return SimulateImu(Rest(), 0, 1, options, 0); };
  const auto a = run(), b = run();
  options.seed = 1;
  const auto other = run();
  for (size_t k = 0; k < a.size(); ++k) {
    EXPECT_EQ(a[k].gyro, b[k].gyro);
    EXPECT_EQ(a[k].accel, b[k].accel);
    EXPECT_NE(a[k].gyro, other[k].gyro);
    EXPECT_NE(a[k].gyro.x(), a[k].gyro.y());
  }
}

TEST(SimulateImu, StampsDoNotDriftWhenTheRateDoesNotDivideASecond) {
  ImuOptions options;
  options.rate_hz = 300;
  const auto samples = SimulateImu(Rest(), 0, 100, options, 0);
  ASSERT_EQ(samples.size(), 30001u);
  EXPECT_EQ(samples[1].time_ns, 3333333);
  EXPECT_EQ(samples.back().time_ns, 100'000'000'000);
}

TEST(SimulateImu, ReadsAndWritesItsOptions) {
  ImuOptions options;
  ReadOptions(YAML::Load("{initial_gyroscope_bias: [1, 2, 3], gyroscope_random_walk: 0.5}"),
              options, "r.yaml");
  EXPECT_EQ(options.initial_gyroscope_bias[2], 3);
  EXPECT_EQ(options.noise.gyroscope_random_walk, 0.5);
  EXPECT_EQ(WriteOptions(options)["accelerometer_noise_density"].as<double>(), 2e-3);
  EXPECT_EQ(WriteOptions(options)["initial_gyroscope_bias"][1].as<double>(), 2);
}

TEST(SimulateImu, NamesTheOptionAtFault) {
  const auto error = [](auto change, double from_s = 0, double to_s = 1) {
    ImuOptions options;
    change(options);
    const Trajectory rest(std::vector<SE3>(6), 2, false);
    return ErrorMessage([&] { SimulateImu(rest, from_s, to_s, options, 0); });
  };
  using O = ImuOptions;
  EXPECT_EQ(error([](O&) {}), "no error");
  EXPECT_THAT(error([](O& o) { o.rate_hz = 0; }), HasSubstr("rate_hz is 0"));
  EXPECT_THAT(error([](O& o) { o.gravity = -9.81; }), HasSubstr("gravity is -9.81"));
  EXPECT_THAT(error([](O& o) { o.noise.accelerometer_random_walk = std::nan(""); }),
              HasSubstr("accelerometer_random_walk is nan"));
  EXPECT_THAT(error([](O& o) { o.initial_accelerometer_bias[1] = INFINITY; }),
              HasSubstr("an initial bias is inf"));
  EXPECT_THAT(error([](O&) {}, 2, 1), HasSubstr("from 2 s to 1 s"));
  EXPECT_THAT(error([](O&) {}, 0, 3), HasSubstr("outside [0, 2] s"));
}

}  // namespace
}  // namespace sgf::synth
