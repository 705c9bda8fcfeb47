#include <cmath>
#include <cstdio>
#include <string>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <sgf/vio/window.h>

#include "unit/vio/tracks.h"

namespace sgf::vio {
namespace {

constexpr int kRuns = 60, kFrames = 25;

/// Normalised estimation errors squared, averaged over flights through rooms with all noise drawn
/// anew: of the newest pose, its parts, the velocity, and the motion since the frame before.
struct Nees {
  double pose = 0, rotation = 0, position = 0, velocity = 0, motion = 0;
};

/// The later state's pose in coordinates of the earlier one.
BodyState MotionOf(const BodyState& before, const BodyState& now) {
  return {.time_ns = now.time_ns, .T_world_body = before.T_world_body.Inverse() * now.T_world_body};
}

/// @param states, keyframes of the window.
Nees Measure(int states, int keyframes, const SimulatedWindow::Options& options) {
  Nees nees;
  for (int run = 0; run < kRuns; ++run) {
    synth::ImuOptions imu;
    imu.seed = 1000 + run;
    const Flight flight(LivelyRide(), 0.1 * (run % 7), 0.1 * (run % 7) + 0.1 * kFrames + 0.1, imu);
    SimulatedWindow simulated(
        flight, Sightings(TestRig(), WallPoints(150, run), options.window.sigma_px, 500 + run),
        options);
    Window& window = simulated.window;
    for (int k = 0; k < kFrames; ++k) {
      // The truth is as likely, given where the first frame is held, as the anchor says.
      simulated.Push(Disturbed(simulated.TruthOf(0), AnchorSigmas(), 77 + run));
      if (k == 0) Anchor(window.frames[0], AnchorSigmas(), window);
      window.Refine();
      if (k + 1 < kFrames) simulated.Marginalize(states, keyframes);
    }
    const Frame& newest = window.frames.back();
    const StateVector error = Minus(simulated.TruthOf(newest.id), newest.state);
    const FrameCovariance covariance = window.CovarianceOf(newest);
    const auto part = [&](int begin, int size) {
      const Eigen::VectorXd e = error.segment(begin, size);
      return e.dot(covariance.state.block(begin, begin, size, size).ldlt().solve(e)) / kRuns;
    };
    const Frame& before = *std::prev(window.frames.end(), 2);
    const Eigen::VectorXd moved =
        Minus(MotionOf(simulated.TruthOf(before.id), simulated.TruthOf(newest.id)),
              MotionOf(before.state, newest.state))
            .head<kPoseParameters>();
    nees.motion += moved.dot(covariance.motion.ldlt().solve(moved)) / kRuns;
    nees.pose += part(kRotation, 6);
    nees.rotation += part(kRotation, 3);
    nees.position += part(kPosition, 3);
    nees.velocity += part(kVelocity, 3);
  }
  return nees;
}

void Report(const std::string& what, const Nees& nees) {
  std::printf(
      "%s: NEES of the pose %.2f (6), rotation %.2f (3), position %.2f (3), velocity %.2f (3), "
      "motion %.2f (6)\n",
      what.c_str(), nees.pose, nees.rotation, nees.position, nees.velocity, nees.motion);
  ::testing::Test::RecordProperty(what, std::to_string(nees.pose));
}

/// The mean of kRuns chi-square variables is in the middle 99 % of its distribution (by Wilson and
/// Hilferty's approximation).
void ExpectConsistent(double mean, int degrees) {
  const double n = kRuns * degrees;
  const auto quantile = [&](double z) {
    const double t = 1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n));
    return degrees * t * t * t;
  };
  EXPECT_GT(mean, quantile(-2.576));
  EXPECT_LT(mean, quantile(2.576));
}

TEST(Consistency, OfTheSlidingWindow) {
  // With the iterations that a robot has time for.
  const Nees nees = Measure(3, 4, {.window = {}});
  Report("sliding", nees);
  ExpectConsistent(nees.pose, 6);
  ExpectConsistent(nees.rotation, 3);
  ExpectConsistent(nees.position, 3);
  ExpectConsistent(nees.velocity, 3);
  ExpectConsistent(nees.motion, 6);
}

// What an odometry does that makes a landmark from its whole track, although what some of it said
// is in the prior: no more than measured.
TEST(Consistency, WithSightsThatCountTwice) {
  const Nees nees = Measure(3, 4, {.reuse_sights = true});
  Report("reused", nees);
  EXPECT_LT(nees.pose, 8);
}

}  // namespace
}  // namespace sgf::vio
