#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/options.h>
#include <sgf/vio/imu_buffer.h>

#include "unit/vio/flights.h"

namespace sgf::vio {
namespace {

using ::testing::HasSubstr;

constexpr double kGravity = 9.81;

ImuSample At(std::int64_t ms) {
  return {ms * 1'000'000, Eigen::Vector3d::Zero(), {0, 0, kGravity}};
}

/// Samples every 5 ms from 0 to 1 s but for those between two times (ms).
ImuBuffer WithGap(int from_ms, int to_ms) {
  ImuBuffer buffer({});
  for (int t = 0; t <= 1000; t += 5)
    if (t <= from_ms || t >= to_ms) buffer.Add(At(t));
  return buffer;
}

constexpr std::int64_t kMs = 1'000'000;

TEST(ImuBuffer, IntegratesBetweenAnyTwoTimes) {
  const Flight flight(AggressiveRide(), 0, 1, NoiseFree());
  const auto trajectory = synth::MakeTrajectory(AggressiveRide(), SE3());
  ImuBuffer buffer({});
  for (const ImuSample& sample : flight.samples) EXPECT_TRUE(buffer.Add(sample));
  for (const auto& [from_s, to_s] : {std::pair(0.0, 0.5), std::pair(0.1013, 0.6041),
                                     std::pair(0.2049, 0.7001), std::pair(0.3011, 0.3012)}) {
    const auto state = [&](double t) {
      const synth::MotionState m = trajectory.At(t);
      return BodyState{Flight::kStart_ns + std::llround(t * 1e9), m.T_world_body, m.velocity,
                       flight.truth[0].gyro_bias, flight.truth[0].accel_bias};
    };
    const BodyState from = state(from_s), to = state(to_s);
    const auto sum = buffer.Between(from.time_ns, to.time_ns, flight.BiasAt(0));
    ASSERT_TRUE(sum);
    EXPECT_EQ(sum->from_ns(), from.time_ns);
    EXPECT_EQ(sum->to_ns(), to.time_ns);
    const StateVector error = Minus(sum->Predict(from, kGravity), to);
    EXPECT_LT(error.head<6>().norm(), 1e-4) << from_s;
    EXPECT_LT(error.segment<3>(kVelocity).norm(), 3e-4) << from_s;
  }
}

TEST(ImuBuffer, CoversWhatItsSamplesReach) {
  const ImuBuffer buffer = WithGap(0, 0);
  EXPECT_TRUE(buffer.Covers(0, 1000 * kMs));
  EXPECT_FALSE(buffer.Covers(-1, 1000 * kMs));
  EXPECT_FALSE(buffer.Covers(0, 1000 * kMs + 1));
  EXPECT_FALSE(ImuBuffer({}).Covers(0, 1));
  EXPECT_FALSE(buffer.Between(0, 1000 * kMs + 1, {}));
  EXPECT_FALSE(buffer.Between(-1, 1000 * kMs, {}));
  EXPECT_TRUE(buffer.Between(0, 1000 * kMs, {}));
  EXPECT_TRUE(std::isinf(buffer.LongestGap_s(0, 1001 * kMs)));
}

TEST(ImuBuffer, TellsTheAngularRateAtATime) {
  ImuBuffer buffer{ImuNoise()};
  EXPECT_FALSE(buffer.GyroAt(0));
  buffer.Add({.time_ns = 0, .gyro = {1, 0, 0}, .accel = {0, 0, 9.8}});
  buffer.Add({.time_ns = 10, .gyro = {2, 0, -1}, .accel = {0, 0, 9.8}});
  EXPECT_EQ(buffer.GyroAt(0), Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(buffer.GyroAt(5), Eigen::Vector3d(1.5, 0, -0.5));
  EXPECT_EQ(buffer.GyroAt(10), Eigen::Vector3d(2, 0, -1));
  EXPECT_FALSE(buffer.GyroAt(11));
  EXPECT_FALSE(buffer.GyroAt(-1));
}

TEST(ImuBuffer, RefusesAndCountsDuplicatesBackwardTimesAndNumbersThatAreNone) {
  ImuBuffer buffer({});
  EXPECT_TRUE(buffer.Add(At(5)));
  EXPECT_TRUE(buffer.Add(At(10)));
  EXPECT_FALSE(buffer.Add(At(10)));
  EXPECT_FALSE(buffer.Add(At(7)));
  EXPECT_FALSE(buffer.Add(At(5)));
  ImuSample bad = At(15);
  bad.gyro.z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(buffer.Add(bad));
  bad = At(15);
  bad.accel.x() = INFINITY;
  EXPECT_FALSE(buffer.Add(bad));
  EXPECT_TRUE(buffer.Add(At(15)));
  EXPECT_EQ(buffer.health().taken, 3);
  EXPECT_EQ(buffer.health().duplicates, 1);
  EXPECT_EQ(buffer.health().backwards, 2);
  EXPECT_EQ(buffer.health().not_finite, 2);
  EXPECT_EQ(buffer.health().gaps, 0);
  EXPECT_EQ(buffer.samples().size(), 3u);
}

TEST(ImuBuffer, BridgesAShortGapWithMoreNoiseAndNotALongOne) {
  const auto position_variance = [](const ImuBuffer& buffer) {
    return buffer.Between(0, 1000 * kMs, {})->covariance()(kPosition, kPosition);
  };
  const ImuBuffer whole = WithGap(0, 0), hardly = WithGap(400, 450), some = WithGap(400, 500);
  EXPECT_EQ(hardly.health().gaps, 0);
  EXPECT_EQ(some.health().gaps, 1);
  EXPECT_DOUBLE_EQ(some.health().longest_gap_s, 0.1);
  EXPECT_DOUBLE_EQ(some.LongestGap_s(0, 1000 * kMs), 0.1);
  EXPECT_DOUBLE_EQ(some.LongestGap_s(450 * kMs, 460 * kMs), 0.1);
  EXPECT_DOUBLE_EQ(some.LongestGap_s(500 * kMs, 1000 * kMs), 0.005);
  EXPECT_NEAR(position_variance(hardly) / position_variance(whole), 1, 0.05);
  EXPECT_GT(position_variance(some) / position_variance(whole), 100);
  // At rest what is bridged is right.
  BodyState rest;
  EXPECT_LT(Minus(some.Between(0, 1000 * kMs, {})->Predict(rest, kGravity), rest).norm(), 1e-12);

  const ImuBuffer broken = WithGap(400, 700);
  EXPECT_FALSE(broken.Between(0, 1000 * kMs, {}));
  EXPECT_FALSE(broken.Between(450 * kMs, 460 * kMs, {}));
  EXPECT_TRUE(broken.Between(0, 400 * kMs, {}));
  EXPECT_TRUE(broken.Between(700 * kMs, 1000 * kMs, {}));
}

TEST(ImuBuffer, RaisesTheNoiseOfASaturatedSensorOnly) {
  const auto run = [](double rate, double acceleration) {
    ImuBuffer buffer({});
    for (int t = 0; t <= 100; t += 5) {
      ImuSample sample = At(t);
      if (t == 50) sample.gyro.y() = -rate, sample.accel.x() = acceleration;
      buffer.Add(sample);
    }
    return buffer;
  };
  const auto variances = [](const ImuBuffer& buffer) {
    return Eigen::Matrix<double, 9, 1>(buffer.Between(0, 100 * kMs, {})->covariance().diagonal());
  };
  const ImuBuffer calm = run(1, 1), spun = run(17.45, 1), hit = run(1, 177);
  EXPECT_EQ(calm.health().saturated, 0);
  EXPECT_EQ(spun.health().saturated, 1);
  EXPECT_EQ(hit.health().saturated, 1);
  EXPECT_GT(variances(spun)(kRotation) / variances(calm)(kRotation), 1e4);
  EXPECT_GT(variances(hit)(kVelocity) / variances(calm)(kVelocity), 1e4);
  EXPECT_NEAR(variances(hit)(kRotation) / variances(calm)(kRotation), 1, 1e-9);
  // Away from the blow all is as ever.
  EXPECT_DOUBLE_EQ(hit.Between(60 * kMs, 100 * kMs, {})->covariance()(kVelocity, kVelocity),
                   calm.Between(60 * kMs, 100 * kMs, {})->covariance()(kVelocity, kVelocity));
}

TEST(ImuBuffer, ForgetsWhatIsNotNeededAndNoMore) {
  ImuBuffer buffer = WithGap(0, 0);
  buffer.DropBefore(502 * kMs);
  EXPECT_EQ(buffer.samples().front().time_ns, 500 * kMs);
  EXPECT_TRUE(buffer.Between(502 * kMs, 600 * kMs, {}));
  EXPECT_FALSE(buffer.Between(499 * kMs, 600 * kMs, {}));
  buffer.DropBefore(2000 * kMs);
  EXPECT_EQ(buffer.samples().size(), 1u);
}

TEST(ImuBuffer, IsBoundedEvenIfNobodyDrops) {
  ImuBufferOptions options;
  options.max_span_s = 0.1;
  ImuBuffer buffer({}, options);
  for (int t = 0; t <= 1000; t += 5) buffer.Add(At(t));
  EXPECT_EQ(buffer.samples().size(), 21u);
  EXPECT_EQ(buffer.health().overflowed, 180);
}

TEST(ImuBuffer, ReadsItsOptionsAndNamesTheOneAtFault) {
  ImuBufferOptions options;
  ReadOptions(YAML::Load("{max_gap_s: 0.3}"), options, "r.yaml");
  EXPECT_THAT(ErrorMessage([&] { ImuBuffer({}, options); }),
              HasSubstr("imu.max_bridge_s: is 0.25"));
  options = {};
  options.gap_noise_factor = 0.5;
  EXPECT_THAT(ErrorMessage([&] { ImuBuffer({}, options); }),
              HasSubstr("imu.gap_noise_factor: is 0.5"));
  options = {};
  options.gyro_full_scale = std::nan("");
  EXPECT_THAT(ErrorMessage([&] { ImuBuffer({}, options); }),
              HasSubstr("imu.gyro_full_scale: is nan"));
  ImuNoise noise;
  noise.gyroscope_noise_density = -1;
  EXPECT_THAT(ErrorMessage([&] { ImuBuffer buffer(noise); }),
              HasSubstr("gyroscope_noise_density is -1"));
  EXPECT_THAT(ErrorMessage([&] { ImuBuffer({}).Between(5, 5, {}); }), HasSubstr("not after 5 ns"));
}

}  // namespace
}  // namespace sgf::vio
