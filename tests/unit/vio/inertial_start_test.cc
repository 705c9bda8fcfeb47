#include <cmath>

#include <gtest/gtest.h>

#include <sgf/vio/inertial_start.h>

namespace sgf::vio {
namespace {

constexpr std::int64_t kPeriod = 5'000'000;  // ns, of the sensor

/// A body at rest that leans by 0.3 rad, from 1 s on.
ImuBuffer RestingUntil(double seconds) {
  ImuBuffer imu{ImuNoise()};
  const Eigen::Vector3d up = ExpSO3({0.3, 0, 0}).conjugate() * Eigen::Vector3d(0, 0, 9.81);
  for (std::int64_t t = 1'000'000'000; t <= static_cast<std::int64_t>(1e9 * seconds); t += kPeriod)
    imu.Add({t, {0.01, 0, 0}, up});
  return imu;
}

TimedPose PoseAt(double seconds, double x_m = 0) {
  return {static_cast<std::int64_t>(1e9 * seconds), SE3{ExpSO3({0.1, 0, 0}), {x_m, 0, 0}}};
}

TEST(InertialStart, HasAStateForEveryFrameThatNeedsOne) {
  InertialStart start({}, 1, 3);
  const ImuBuffer imu = RestingUntil(4);
  EXPECT_FALSE(start.Add(PoseAt(1), imu));
  EXPECT_FALSE(start.Add(PoseAt(2.2), imu)) << "long enough, but of two poses";
  const auto found = start.Add(PoseAt(3.4), imu);
  ASSERT_TRUE(found && found->ok());
  EXPECT_EQ(found->states.size(), 3U);
  EXPECT_NEAR(found->states[0].gyro_bias.x(), 0.01, 1e-9);
  // The body leans by 0.2 rad more than the images' world has it.
  EXPECT_NEAR(LogSO3(found->T_world_visual.R).x(), 0.2, 1e-6);
}

TEST(InertialStart, SaysThatThereAreNoMeasurementsAndForgetsPosesFromBefore) {
  InertialStart start({}, 1, 3);
  const ImuBuffer imu = RestingUntil(4);
  const auto found = start.Add(PoseAt(0.5), imu);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->problem, InitialisationProblem::kGapInData);
  start.Add(PoseAt(1.5), imu);
  EXPECT_EQ(start.first_ns(), 1'500'000'000);
  start.Clear();
  EXPECT_FALSE(start.first_ns());
}

/// Asks at rest every 0.1 s. @return the answer to the last question.
std::optional<InertialInitialisation> Rest(InertialStart& start, const ImuBuffer& imu,
                                           double from_s, double to_s) {
  std::optional<InertialInitialisation> found;
  for (double t = from_s; t < to_s; t += 0.1) found = start.Add(PoseAt(t), imu);
  return found;
}

TEST(InertialStart, AtRestDoesNotForgetWhatMotionHasShown) {
  InertialStart start({}, 1, 3);
  const ImuBuffer imu = RestingUntil(30);
  ASSERT_TRUE(Rest(start, imu, 1, 2.5)->ok());
  start.Clear();
  // Images turn, the gyroscope does not.
  std::optional<InertialInitialisation> found;
  for (double t = 3; t < 5; t += 0.1) {
    TimedPose pose = PoseAt(t);
    pose.pose.R = ExpSO3({0, 0, std::sin(3 * t)});
    found = start.Add(pose, imu);
  }
  ASSERT_TRUE(found);
  EXPECT_EQ(found->problem, InitialisationProblem::kSensorAxes);
  start.Clear();
  EXPECT_EQ(Rest(start, imu, 6, 8)->problem, InitialisationProblem::kSensorAxes);
}

TEST(InertialStart, WaitsLongerEachTimeAfterItWasWrong) {
  InertialStart start({}, 1, 3);
  const ImuBuffer imu = RestingUntil(40);
  start.Refute(1'000'000'000);
  EXPECT_FALSE(Rest(start, imu, 1.1, 5.9));
  const auto found = Rest(start, imu, 6.1, 8);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->problem, InitialisationProblem::kMotionDisagrees) << "rest is no reason";
  start.Refute(10'000'000'000);
  EXPECT_FALSE(Rest(start, imu, 10, 19.9));
  EXPECT_TRUE(Rest(start, imu, 20.1, 22));
}

TEST(InertialStart, DoesNotTakeConstantVelocityForRest) {
  InertialStart start({}, 1, 3);
  const ImuBuffer imu = RestingUntil(4);
  std::optional<InertialInitialisation> found;
  for (int k = 0; k < 15; ++k) found = start.Add(PoseAt(1 + 0.1 * k, 0.05 * k), imu);
  ASSERT_TRUE(found);
  for (const BodyState& state : found->states) EXPECT_GT(state.velocity.norm(), 0.3);
}

}  // namespace
}  // namespace sgf::vio
