#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/options.h>
#include <sgf/core/random.h>
#include <sgf/vio/inertial_initializer.h>

#include "unit/vio/flights.h"

namespace sgf::vio {
namespace {

using ::testing::HasSubstr;
using Problem = InitialisationProblem;

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kGravity = 9.81;

synth::ImuOptions Noisy(std::uint64_t seed) {
  synth::ImuOptions options = NoiseFree();
  options.noisy = true;
  options.seed = seed;
  return options;
}

// Angle (rad) between what two states hold to be down, in their bodies.
double TiltError(const BodyState& a, const BodyState& b) {
  const auto up = [](const BodyState& s) {
    return Eigen::Vector3d(s.T_world_body.R.conjugate() * Eigen::Vector3d::UnitZ());
  };
  return std::atan2(up(a).cross(up(b)).norm(), up(a).dot(up(b)));
}

std::vector<ImuSample> Rest(std::uint64_t seed, const Eigen::Vector3d& accel_bias,
                            BodyState* truth) {
  const synth::Trajectory rest(std::vector<SE3>(6, {ExpSO3({0.3, -0.5, 1}), {1, 2, 3}}), 10, false);
  synth::ImuOptions options = Noisy(seed);
  Eigen::Map<Eigen::Vector3d>(options.initial_accelerometer_bias.data()) = accel_bias;
  std::vector<BodyState> states;
  const auto samples = synth::SimulateImu(rest, 0, 1, options, 0, &states);
  *truth = states.back();
  return samples;
}

TEST(InitializeAtRest, FindsTiltAndTheGyroscopesBias) {
  double worst_tilt = 0, worst_bias = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    BodyState truth;
    const auto samples = Rest(seed, Eigen::Vector3d::Zero(), &truth);
    const auto result = InitializeAtRest(samples);
    ASSERT_TRUE(result.ok()) << Explain(result.problem);
    ASSERT_EQ(result.states.size(), 1u);
    const BodyState& state = result.states[0];
    EXPECT_EQ(state.time_ns, samples.back().time_ns);
    EXPECT_EQ(state.velocity, Eigen::Vector3d::Zero());
    worst_tilt = std::max(worst_tilt, TiltError(state, truth));
    worst_bias = std::max(worst_bias, (state.gyro_bias - truth.gyro_bias).norm());
    EXPECT_LT(state.accel_bias.norm(), 0.01);
  }
  RecordProperty("tilt_udeg", std::to_string(worst_tilt / kRadPerDeg * 1e6));
  RecordProperty("gyro_bias_u", std::to_string(worst_bias * 1e6));
  EXPECT_LT(worst_tilt, 0.3 * kRadPerDeg);
  EXPECT_LT(worst_bias, 1e-3);
}

TEST(InitializeAtRest, FindsTheAccelerometersBiasAlongGravity) {
  BodyState truth;
  Rest(0, Eigen::Vector3d::Zero(), &truth);
  const Eigen::Vector3d up = truth.T_world_body.R.conjugate() * Eigen::Vector3d::UnitZ();
  const auto samples = Rest(0, 0.2 * up, &truth);
  const auto result = InitializeAtRest(samples);
  ASSERT_TRUE(result.ok());
  EXPECT_NEAR(result.gravity, kGravity + 0.2, 0.02);
  EXPECT_LT((result.states[0].accel_bias - 0.2 * up).norm(), 0.02);
}

TEST(InitializeAtRest, PredictsRest) {
  BodyState truth;
  ImuBuffer buffer({});
  for (const auto& sample : Rest(1, {0, 0, 0.1}, &truth)) buffer.Add(sample);
  const auto result = InitializeAtRest(buffer, 0, 500'000'000);
  ASSERT_TRUE(result.ok());
  const BodyState& state = result.states[0];
  EXPECT_EQ(state.time_ns, 500'000'000);
  const auto motion =
      buffer.Between(500'000'000, 1'000'000'000, {state.gyro_bias, state.accel_bias});
  EXPECT_LT(motion->Predict(state, kGravity).velocity.norm(), 0.01);
}

TEST(InitializeAtRest, SaysWhyNot) {
  BodyState truth;
  const auto samples = Rest(0, Eigen::Vector3d::Zero(), &truth);
  const auto problem = [&](auto change) {
    auto changed = samples;
    for (ImuSample& s : changed) change(s);
    return InitializeAtRest(changed).problem;
  };
  EXPECT_EQ(problem([](ImuSample&) {}), Problem::kNone);
  EXPECT_EQ(problem([](ImuSample& s) { s.accel /= kGravity; }), Problem::kAccelerationInG);
  EXPECT_EQ(problem([](ImuSample& s) { s.accel *= 1.3; }), Problem::kGravityMagnitude);
  EXPECT_EQ(problem([](ImuSample& s) { s.gyro.x() += 0.5; }), Problem::kGyroscopeBias);
  EXPECT_EQ(problem([](ImuSample& s) { s.gyro.y() += 0.1 * std::sin(1e-8 * s.time_ns); }),
            Problem::kMoving);
  EXPECT_EQ(problem([](ImuSample& s) { s.accel.y() += std::sin(1e-8 * s.time_ns); }),
            Problem::kMoving);
  EXPECT_EQ(problem([](ImuSample& s) { s.accel.x() = std::nan(""); }), Problem::kMoving);
  EXPECT_EQ(InitializeAtRest(std::span(samples).first(90)).problem, Problem::kTooLittleData);
  EXPECT_EQ(InitializeAtRest({}).problem, Problem::kTooLittleData);
  const Flight flight(LivelyRide(), 1, 2, Noisy(0));
  EXPECT_EQ(InitializeAtRest(flight.samples).problem, Problem::kMoving);
}

/// A flight with visual poses in a frame that is turned against the world.
struct VisualFlight : Flight {
  static constexpr size_t kEvery = 50;  // samples: 0.25 s

  VisualFlight(const synth::TrajectoryOptions& ride, double from_s, double to_s, std::uint64_t seed,
               double rotation_sd = 1e-3, double position_sd_m = 3e-3)
      : Flight(ride, from_s, to_s, Noisy(seed)) {
    const SE3 T_visual_world = {ExpSO3({0.7, -0.4, 2}), {3, 1, -2}};
    for (size_t i = 0; i < truth.size(); i += kEvery) {
      const auto noise = [&](double sd, std::uint64_t stream) -> Eigen::Vector3d {
        const std::uint64_t s = Hash64(seed + 1000, stream);
        return sd *
               Eigen::Vector3d(Gaussian(s, 3 * i), Gaussian(s, 3 * i + 1), Gaussian(s, 3 * i + 2));
      };
      SE3 pose = T_visual_world * truth[i].T_world_body;
      pose.R = pose.R * ExpSO3(noise(rotation_sd, 0));
      pose.p += noise(position_sd_m, 1);
      poses.push_back({truth[i].time_ns, pose});
    }
  }

  template <class F>
  InertialInitialisation Initialize(F change,
                                    const InertialInitializerOptions& options = {}) const {
    ImuBuffer buffer({});
    for (ImuSample sample : samples) {
      change(sample);
      buffer.Add(sample);
    }
    return InitializeMoving(poses, buffer, options);
  }

  InertialInitialisation Initialize() const {
    return Initialize([](ImuSample&) {});
  }

  std::vector<TimedPose> poses;
};

struct Errors {
  double gyro_bias = 0, tilt = 0, velocity = 0, accel_bias = 0;
};

void Raise(Errors& worst, const VisualFlight& flight, const InertialInitialisation& result) {
  for (size_t k = 0; k < result.states.size(); ++k) {
    const BodyState& state = result.states[k];
    const BodyState& truth = flight.truth[k * VisualFlight::kEvery];
    EXPECT_EQ(state.time_ns, truth.time_ns);
    // Velocities in coordinates of the body, as yaw is free.
    const Eigen::Vector3d v = state.T_world_body.R.conjugate() * state.velocity,
                          v_true = truth.T_world_body.R.conjugate() * truth.velocity;
    worst.velocity = std::max(worst.velocity, (v - v_true).norm() / truth.velocity.norm());
    worst.tilt = std::max(worst.tilt, TiltError(state, truth));
    worst.gyro_bias = std::max(worst.gyro_bias, (state.gyro_bias - truth.gyro_bias).norm());
    worst.accel_bias = std::max(worst.accel_bias, (state.accel_bias - truth.accel_bias).norm());
  }
}

TEST(InitializeMoving, FindsBiasesGravityAndVelocities) {
  Errors worst;
  double rotation_error = 0, motion_error = 0, freely = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const VisualFlight flight(LivelyRide(), 0.5 * seed, 0.5 * seed + 4, seed);
    const auto result = flight.Initialize();
    ASSERT_TRUE(result.ok()) << Explain(result.problem);
    ASSERT_EQ(result.states.size(), flight.poses.size());
    Raise(worst, flight, result);
    rotation_error = std::max(rotation_error, result.rotation_error_rad);
    motion_error = std::max(motion_error, result.motion_error);
    freely = std::max(freely, std::abs(result.gravity - kGravity));
  }
  RecordProperty("gyro_bias_urad_s", std::to_string(worst.gyro_bias * 1e6));
  RecordProperty("tilt_mdeg", std::to_string(worst.tilt / kRadPerDeg * 1e3));
  RecordProperty("velocity_permille", std::to_string(worst.velocity * 1e3));
  RecordProperty("accel_bias_mm_s2", std::to_string(worst.accel_bias * 1e3));
  RecordProperty("gravity_off_mm_s2", std::to_string(freely * 1e3));
  RecordProperty("rotation_error_mrad", std::to_string(rotation_error * 1e3));
  RecordProperty("motion_error_sigma", std::to_string(motion_error));
  EXPECT_LT(worst.gyro_bias, 1e-3);
  EXPECT_LT(worst.tilt, 0.5 * kRadPerDeg);
  EXPECT_LT(worst.velocity, 0.02);
  EXPECT_LT(worst.accel_bias, 0.1);
}

TEST(InitializeMoving, IsExactWithoutNoise) {
  synth::ImuOptions options = NoiseFree();
  VisualFlight flight(LivelyRide(), 0, 4, 0, 0, 0);
  flight.samples = Flight(LivelyRide(), 0, 4, options).samples;
  for (BodyState& state : flight.truth) {
    state.gyro_bias = Eigen::Vector3d(options.initial_gyroscope_bias.data());
    state.accel_bias = Eigen::Vector3d(options.initial_accelerometer_bias.data());
  }
  InertialInitializerOptions exact;
  exact.accel_bias_sd = 10;
  const auto result = flight.Initialize([](ImuSample&) {}, exact);
  ASSERT_TRUE(result.ok()) << Explain(result.problem);
  Errors worst;
  Raise(worst, flight, result);
  EXPECT_LT(worst.gyro_bias, 1e-5);
  EXPECT_LT(worst.tilt, 1e-4);
  EXPECT_LT(worst.velocity, 1e-3);
  EXPECT_LT(worst.accel_bias, 1e-3);
}

TEST(InitializeMoving, KnowsHowWellItKnowsTheAccelerometersBias) {
  const auto turning = VisualFlight(LivelyRide(), 0, 4, 0).Initialize();
  ASSERT_TRUE(turning.ok());
  EXPECT_LT(turning.accel_bias_sd.maxCoeff(), 0.1);
  // Along a straight line a bias across gravity cannot be told from a tilt.
  synth::TrajectoryOptions straight;
  straight.waypoints = {{0, 0, 1, 0, 0, 0}, {2, 0, 1, 0, 0, 0}, {4, 0, 1, 0, 0, 0}};
  InertialInitializerOptions options;
  const auto result = VisualFlight(straight, 0, 4, 0).Initialize([](ImuSample&) {}, options);
  ASSERT_TRUE(result.ok()) << Explain(result.problem);
  EXPECT_GT(result.accel_bias_sd.maxCoeff(), 0.9 * options.accel_bias_sd);
  EXPECT_GT(result.tilt_sd_rad, 0.8 * options.accel_bias_sd / kGravity);
  options.max_tilt_sd_rad = 0.01;
  EXPECT_EQ(VisualFlight(straight, 0, 4, 0).Initialize([](ImuSample&) {}, options).problem,
            Problem::kTooLittleData);
}

TEST(InitializeMoving, StatesFollowFromOneAnother) {
  const VisualFlight flight(LivelyRide(), 0, 4, 3);
  const auto result = flight.Initialize();
  ASSERT_TRUE(result.ok());
  for (size_t k = 0; k + 1 < result.states.size(); ++k) {
    const BodyState& from = result.states[k];
    const size_t at = k * VisualFlight::kEvery;
    const auto motion =
        flight.Integrate(at, at + VisualFlight::kEvery, {from.gyro_bias, from.accel_bias});
    const StateVector error = motion.Residual(from, result.states[k + 1], kGravity);
    EXPECT_LT(error.segment<3>(kPosition).norm(), 0.025);
    EXPECT_LT(error.segment<3>(kVelocity).norm(), 0.025);
  }
}

TEST(InitializeMoving, DetectsWrongUnitsAndAxes) {
  const auto swap = [](Eigen::Vector3d& v) { v = Eigen::Vector3d(v.y(), v.x(), -v.z()).eval(); };
  const auto turn = [](Eigen::Vector3d& v) { v = Eigen::Vector3d(v.x(), -v.y(), -v.z()).eval(); };
  for (const auto& ride : {SmoothRide(), LivelyRide(), AggressiveRide()})
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      const VisualFlight flight(ride, 0.6 * seed, 0.6 * seed + 3, seed);
      const auto problem = [&](auto change) { return flight.Initialize(change).problem; };
      EXPECT_EQ(problem([](ImuSample&) {}), Problem::kNone);
      EXPECT_EQ(problem([](ImuSample& s) { s.gyro /= kRadPerDeg; }), Problem::kGyroscopeInDegrees);
      EXPECT_EQ(problem([](ImuSample& s) { s.accel /= kGravity; }), Problem::kAccelerationInG);
      EXPECT_EQ(problem([](ImuSample& s) { s.accel *= 1.5; }), Problem::kGravityMagnitude);
      for (const auto& wrong : {problem([&](ImuSample& s) { swap(s.gyro), swap(s.accel); }),
                                problem([&](ImuSample& s) { turn(s.gyro), turn(s.accel); }),
                                problem([&](ImuSample& s) { s.gyro = -s.gyro; })})
        EXPECT_TRUE(wrong == Problem::kSensorAxes || wrong == Problem::kGyroscopeBias)
            << EnumName(wrong);
      EXPECT_NE(problem([&](ImuSample& s) { swap(s.accel); }), Problem::kNone);
    }
}

TEST(InitializeMoving, DetectsPosesOfTheWrongScaleOrTime) {
  const VisualFlight flight(LivelyRide(), 0, 4, 0);
  VisualFlight large = flight;
  for (TimedPose& pose : large.poses) pose.pose.p *= 3;
  EXPECT_EQ(large.Initialize().problem, Problem::kMotionDisagrees);
  VisualFlight late = VisualFlight(AggressiveRide(), 0, 4, 0);
  late.poses.pop_back();
  for (TimedPose& pose : late.poses) pose.time_ns += 50'000'000;
  EXPECT_NE(late.Initialize().problem, Problem::kNone);
}

TEST(InitializeMoving, WantsEnoughPosesWithoutGaps) {
  VisualFlight flight(LivelyRide(), 0, 4, 0);
  const auto all = flight.poses;
  flight.poses.resize(4);
  EXPECT_EQ(flight.Initialize().problem, Problem::kTooLittleData);
  flight.poses = {};
  EXPECT_EQ(flight.Initialize().problem, Problem::kTooLittleData);
  flight.poses = all;
  flight.samples.erase(flight.samples.begin() + 300, flight.samples.begin() + 400);
  EXPECT_EQ(flight.Initialize().problem, Problem::kGapInData);
}

TEST(InitializeMoving, NamesWhatIsWrong) {
  const VisualFlight flight(LivelyRide(), 0, 4, 0);
  std::vector<Preintegration> motions;
  for (size_t i = 0; i + 50 < flight.samples.size(); i += 50)
    motions.push_back(flight.Integrate(i, i + 50, {}));
  EXPECT_TRUE(InitializeMoving(flight.poses, motions).ok());
  const auto error = [&](const InertialInitializerOptions& options) {
    return ErrorMessage([&] { InitializeMoving(flight.poses, motions, options); });
  };
  InertialInitializerOptions options;
  ReadOptions(YAML::Load("{min_poses: 2}"), options, "r.yaml");
  EXPECT_THAT(error(options), HasSubstr("start.min_poses: is 2"));
  options = {};
  options.accel_bias_sd = 0;
  EXPECT_THAT(error(options), HasSubstr("start.accel_bias_sd: is 0"));
  std::swap(motions[3], motions[4]);
  EXPECT_THAT(error({}), HasSubstr("motion 3 is not from pose 3"));
  motions.pop_back();
  EXPECT_THAT(error({}), HasSubstr("17 poses have 15 motions"));
}

TEST(InitialisationProblem, EachHasANameAndAnExplanation) {
  for (const auto& [name, problem] : EnumNames(Problem())) {
    EXPECT_EQ(EnumName(problem), name);
    EXPECT_STRNE(Explain(problem), "?");
  }
  EXPECT_THAT(Explain(Problem::kAccelerationInG), HasSubstr("acceleration in g?"));
}

}  // namespace
}  // namespace sgf::vio
