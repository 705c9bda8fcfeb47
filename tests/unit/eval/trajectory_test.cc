#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/core/random.h>
#include <sgf/eval/trajectory.h>

namespace sgf {
namespace {

using Poses = std::vector<TimedPose>;

constexpr std::int64_t kPeriod_ns = 50'000'000;
constexpr double kRadPerDeg = std::numbers::pi / 180;

// A winding walk at 20 Hz.
Poses Walk(int poses) {
  Poses walk;
  for (int i = 0; i < poses; ++i) {
    const double t = 0.05 * i;
    walk.push_back({i * kPeriod_ns,
                    {ExpSO3({0.3 * std::sin(t), 0.5 * t, 0.2 * std::cos(2 * t)}),
                     {2 * std::cos(0.7 * t), t, std::sin(1.3 * t)}}});
  }
  return walk;
}

// Poses of another frame on the body, in another world, of another scale.
Poses Moved(Poses poses, const SE3& T_other_world, const SE3& T_body_est, double scale) {
  for (TimedPose& pose : poses) {
    pose.pose = T_other_world * pose.pose * T_body_est;
    pose.pose.p *= scale;
  }
  return poses;
}

std::vector<std::int64_t> Times(const Poses& poses) {
  std::vector<std::int64_t> times;
  for (const TimedPose& pose : poses) times.push_back(pose.time_ns);
  return times;
}

TrajectoryScores Score(const Poses& estimate, const Poses& truth,
                       TrajectoryAlignment align = TrajectoryAlignment::kSe3,
                       const SE3& T_body_est = {}) {
  return ScoreTrajectory(estimate, truth, T_body_est, Times(truth), {align, 0.06});
}

SE3 RandomMotion() {
  const auto some = [](double range) { return *rc::gen::inRange(-1000, 1001) * range / 1000; };
  return {ExpSO3({some(2), some(2), some(2)}).normalized(), {some(9), some(9), some(9)}};
}

// ---- Alignment

RC_GTEST_PROP(TrajectoryProperty, RecoversRigidMotionsThroughTheLeverArm, ()) {
  const Poses truth = Walk(60);
  const SE3 T_body_est = RandomMotion();
  const TrajectoryScores scores = Score(Moved(truth, RandomMotion(), T_body_est, 1), truth,
                                        TrajectoryAlignment::kSe3, T_body_est);
  RC_ASSERT(scores.ate_max_m < 1e-9);
  RC_ASSERT(scores.orientation_rmse_deg < 1e-5);
  RC_ASSERT(scores.rpe_one_second.translation_m < 1e-9);
  RC_ASSERT(scores.scale == 1);
}

// The scale is that of the camera's path: the lever arm between camera and body is not scaled.
RC_GTEST_PROP(TrajectoryProperty, RecoversTheScaleBeforeTheLeverArm, ()) {
  const Poses truth = Walk(60);
  const SE3 T_body_est = RandomMotion();
  const double scale = *rc::gen::inRange(100, 5000) / 1000.0;
  const TrajectoryScores scores = Score(Moved(truth, RandomMotion(), T_body_est, scale), truth,
                                        TrajectoryAlignment::kSim3, T_body_est);
  RC_ASSERT(std::abs(scores.scale * scale - 1) < 1e-9);
  RC_ASSERT(scores.ate_max_m < 1e-8);
  RC_ASSERT(scores.orientation_rmse_deg < 1e-5);
}

// What moves the poses moves a map that was estimated with them.
RC_GTEST_PROP(TrajectoryProperty, GivesTheMotionThatItAlignsWith, ()) {
  const Poses truth = Walk(60);
  const SE3 T_body_est = RandomMotion(), T_other_world = RandomMotion();
  const double scale = *rc::gen::inRange(100, 5000) / 1000.0;
  const Poses estimate = Moved(truth, T_other_world, T_body_est, scale);
  const auto found =
      AlignTrajectory(estimate, truth, T_body_est, {TrajectoryAlignment::kSim3, 0.06});
  RC_ASSERT(found.has_value());
  const Eigen::Vector3d place(3, -2, 5);
  RC_ASSERT((*found * (scale * (T_other_world * place)) - place).norm() < 1e-7);
  const SE3 body = *found * estimate[7].pose * T_body_est.Inverse();
  RC_ASSERT((body.p - truth[7].pose.p).norm() < 1e-7);
  RC_ASSERT(body.R.angularDistance(truth[7].pose.R) < 1e-6);
}

TEST(Trajectory, OfTwoPosesCannotBeAligned) {
  const Poses truth = Walk(2);
  EXPECT_FALSE(AlignTrajectory(truth, truth, {}, {}).has_value());
}

// No other motion of the estimate comes closer in the mean of squares.
RC_GTEST_PROP(TrajectoryProperty, AlignsBestInTheLeastSquaresSense, ()) {
  const Poses truth = Walk(30);
  Poses estimate = truth;
  const auto seed = *rc::gen::arbitrary<uint64_t>();
  for (size_t i = 0; i < estimate.size(); ++i)
    for (uint64_t k = 0; k < 3; ++k)
      estimate[i].pose.p[static_cast<Eigen::Index>(k)] += 0.1 * Gaussian(seed, 3 * i + k);
  const double best = Score(estimate, truth).ate_rmse_m;
  SE3 nudge = RandomMotion();
  nudge = {ExpSO3(0.01 * LogSO3(nudge.R)), 0.001 * nudge.p};
  RC_ASSERT(best < 0.25);
  RC_ASSERT(best <= Score(Moved(estimate, nudge, {}, 1), truth).ate_rmse_m + 1e-12);
  RC_ASSERT(best <= Score(estimate, truth, TrajectoryAlignment::kNone).ate_rmse_m);
}

TEST(Trajectory, IsNotMovedWithoutAlignment) {
  const Poses truth = Walk(30);
  const SE3 shift{Eigen::Quaterniond::Identity(), {0, 0, 2}};
  const TrajectoryScores scores =
      Score(Moved(truth, shift, {}, 1), truth, TrajectoryAlignment::kNone);
  EXPECT_NEAR(scores.ate_mean_m, 2, 1e-12);
  EXPECT_NEAR(scores.ate_max_m, 2, 1e-12);
  EXPECT_NEAR(scores.scale_error_max_m, 0, 1e-12);
}

TEST(Trajectory, OfNoMotionHasNoScale) {
  const Poses truth = Walk(30);
  Poses still = truth;
  for (TimedPose& pose : still) pose.pose.p = {1, 1, 1};
  const TrajectoryScores scores = Score(still, truth, TrajectoryAlignment::kSim3);
  EXPECT_EQ(scores.scale, 1);
  EXPECT_GT(scores.ate_rmse_m, 0.5);
}

// ---- Errors computed by hand

TEST(Trajectory, HasStatisticsOfPositionErrors) {
  const Poses truth = Walk(4);
  Poses estimate = truth;
  for (size_t i = 0; i < 4; ++i) estimate[i].pose.p.x() += std::array{0.0, 1.0, 2.0, 5.0}[i];
  const TrajectoryScores scores = Score(estimate, truth, TrajectoryAlignment::kNone);
  EXPECT_NEAR(scores.ate_mean_m, 2, 1e-12);
  EXPECT_NEAR(scores.ate_rmse_m, std::sqrt(7.5), 1e-12);
  EXPECT_NEAR(scores.ate_median_m, 1.5, 1e-12);
  EXPECT_NEAR(scores.ate_max_m, 5, 1e-12);
}

TEST(Trajectory, HasOrientationErrors) {
  const Poses truth = Walk(4);
  Poses estimate = truth;
  for (size_t i = 0; i < 2; ++i)
    estimate[i].pose.R = estimate[i].pose.R * ExpSO3({0, 10 * kRadPerDeg, 0});
  const TrajectoryScores scores = Score(estimate, truth);
  EXPECT_NEAR(scores.orientation_mean_deg, 5, 1e-5);
  EXPECT_NEAR(scores.orientation_rmse_deg, 10 * std::sqrt(0.5), 1e-5);
}

// Straight on at 1 m/s; `speed` and `turn_deg_s` of the estimate.
Poses StraightOn(int poses, double speed, double turn_deg_s) {
  Poses line;
  for (int i = 0; i < poses; ++i)
    line.push_back(
        {i * kPeriod_ns,
         {ExpSO3({0, 0, turn_deg_s * kRadPerDeg * 0.05 * i}), {0, 0, speed * 0.05 * i}}});
  return line;
}

TEST(Trajectory, HasErrorsOfRelativeMotion) {
  const TrajectoryScores scores = Score(StraightOn(41, 1.1, 2), StraightOn(41, 1, 0));
  EXPECT_NEAR(scores.path_m, 2, 1e-12);
  EXPECT_EQ(scores.rpe_half_second.stretches, 32) << "the last is 0.45 s, within 10 %";
  EXPECT_NEAR(scores.rpe_one_second.percent_of_path, 10, 1e-9);
  EXPECT_NEAR(scores.rpe_half_second.percent_of_path, 10, 1e-9);
  EXPECT_NEAR(scores.rpe_one_second.translation_m, 0.1, 0.005);
  EXPECT_NEAR(scores.rpe_one_second.rotation_deg, 2, 0.1);
  EXPECT_NEAR(scores.rpe_half_second.rotation_deg, 1, 0.05);
}

TEST(Trajectory, TakesTheNearestPoseForTheEndOfAStretch) {
  Poses truth = StraightOn(3, 1, 0);
  truth[1].time_ns = 490'000'000;
  truth[2].time_ns = 530'000'000;
  Poses estimate = truth;
  estimate[2].pose.p.z() += 1;
  const TrajectoryScores scores = Score(estimate, truth, TrajectoryAlignment::kNone);
  EXPECT_EQ(scores.rpe_half_second.stretches, 1);
  EXPECT_NEAR(scores.rpe_half_second.translation_m, 0, 1e-12);
}

TEST(Trajectory, HasNoStretchWithoutAPoseNearItsEnd) {
  const Poses truth = StraightOn(40, 1, 0);
  // 10 Hz with a pose lost: 0.5 s after it began, a stretch ends at 0.5 s or nowhere near.
  Poses estimate;
  for (size_t i = 0; i < truth.size(); i += 2)
    if (i != 10) estimate.push_back(truth[i]);
  const TrajectoryScores scores = Score(estimate, truth);
  // Of the 19 poses at 0, 0.1, ..., 1.8 s but 0.5 s, those up to 1.4 s have an end; that of 0 has
  // none.
  EXPECT_EQ(scores.rpe_half_second.stretches, 13);
  EXPECT_NEAR(scores.rpe_half_second.translation_m, 0, 1e-12);
}

TEST(Trajectory, HasNoRelativeErrorsWhenItIsTooShort) {
  const TrajectoryScores scores = Score(Walk(12), Walk(12));
  EXPECT_EQ(scores.rpe_half_second.stretches, 3);
  EXPECT_EQ(scores.rpe_one_second.stretches, 0);
  EXPECT_TRUE(std::isnan(scores.rpe_one_second.translation_m));
  EXPECT_TRUE(std::isnan(scores.rpe_one_second.percent_of_path));
}

TEST(Trajectory, SucceedsUpToTheLimits) {
  const Poses truth = StraightOn(60, 1, 0);
  const auto with = [&](double most, double one) {
    Poses estimate = truth;
    for (TimedPose& pose : estimate) pose.pose.p.x() += most;
    estimate[0].pose.p.x() -= most;
    estimate[30].pose.p.z() += one;
    return Score(estimate, truth, TrajectoryAlignment::kNone);
  };
  EXPECT_TRUE(with(0.09, 1.4).success_by_ate);
  EXPECT_FALSE(with(0.11, 0).success_by_ate) << "the median";
  EXPECT_FALSE(with(0, 1.6).success_by_ate) << "the maximum";
  EXPECT_TRUE(with(0.11, 1.4).success_by_scale) << "a shift to the side does not change distances";
  EXPECT_FALSE(with(0, 1.6).success_by_scale);
  EXPECT_NEAR(with(0, 1.6).scale_error_max_m, 1.6, 1e-12);
  EXPECT_NEAR(with(0, 1.6).scale_error_median_m, 0, 1e-12);
}

// One wild pose ruins the mean, not the median.
TEST(Trajectory, KeepsItsMedianWithAnOutlier) {
  const Poses truth = Walk(101);
  Poses estimate = truth;
  estimate[50].pose.p.x() += 10;
  const TrajectoryScores scores = Score(estimate, truth);
  EXPECT_LT(scores.ate_median_m, 0.3);
  EXPECT_GT(scores.ate_max_m, 9);
  EXPECT_GT(scores.ate_rmse_m, 0.9);
}

// ---- Association and coverage

TEST(InterpolatePose, IsLinearAndOfConstantRate) {
  const Poses poses{{0, {ExpSO3({0, 0, 0.2}), {1, 0, 0}}},
                    {20'000'000, {ExpSO3({0, 0, 1.0}), {3, 0, 4}}}};
  const auto pose = InterpolatePose(poses, 5'000'000, 0.02);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->p - Eigen::Vector3d(1.5, 0, 1)).norm(), 1e-12);
  EXPECT_NEAR(LogSO3(pose->R).z(), 0.4, 1e-12);
}

TEST(InterpolatePose, GoesTheShortWayRound) {
  Poses poses{{0, {ExpSO3({0, 0, 0.2}), {0, 0, 0}}},
              {10'000'000, {ExpSO3({0, 0, 0.4}), {0, 0, 0}}}};
  poses[1].pose.R.coeffs() *= -1;
  EXPECT_NEAR(LogSO3(InterpolatePose(poses, 5'000'000, 1)->R).z(), 0.3, 1e-9);
}

TEST(InterpolatePose, NeverCrossesAGapNorLeavesTheTrajectory) {
  const Poses poses{{100'000'000, {}}, {120'000'000, {}}, {140'000'001, {}}};
  const auto has = [&](std::int64_t time_ns) {
    return InterpolatePose(poses, time_ns, 0.02).has_value();
  };
  EXPECT_TRUE(has(110'000'000));
  EXPECT_FALSE(has(130'000'000));
  EXPECT_TRUE(has(140'000'001)) << "a pose of its own needs no neighbours";
  EXPECT_TRUE(has(139'999'500)) << "the same time to a microsecond";
  EXPECT_FALSE(has(99'990'000));
  EXPECT_FALSE(has(140'010'000));
  EXPECT_FALSE(InterpolatePose({}, 0, 1));
}

TEST(Trajectory, ComparesPosesWithTruthOnly) {
  Poses truth = Walk(100);
  const Poses estimate = truth;
  truth.erase(truth.begin() + 40, truth.begin() + 60);
  const TrajectoryScores scores =
      ScoreTrajectory(estimate, truth, {}, Times(estimate), {TrajectoryAlignment::kSe3, 0.06});
  EXPECT_EQ(scores.poses, 80);
  EXPECT_EQ(scores.frames, 80);
  EXPECT_EQ(scores.coverage_pct, 100);
}

TEST(Trajectory, CoversTheFramesThatHaveAPose) {
  const Poses truth = Walk(100);
  Poses estimate(truth.begin(), truth.begin() + 25);
  for (TimedPose& pose : estimate) pose.time_ns += 200;  // as from a file of doubles
  EXPECT_EQ(Score(estimate, truth).coverage_pct, 25);
  EXPECT_EQ(Score(estimate, truth).frames, 100);
  const TrajectoryScores unknown = ScoreTrajectory(estimate, truth, {}, {}, {});
  EXPECT_TRUE(std::isnan(unknown.coverage_pct));
  EXPECT_EQ(unknown.frames, 0);
  EXPECT_LT(unknown.ate_max_m, 1e-9);
}

TEST(Trajectory, IsCutToTheTimesOfAnother) {
  const Poses poses = Walk(10);
  Poses other{poses[1], poses[4], poses[9]};
  other[1].time_ns -= 900;
  other[2].time_ns += 2000;
  const Poses common = KeepCommonTimes(poses, other);
  EXPECT_EQ(Times(common), (std::vector<std::int64_t>{poses[1].time_ns, poses[4].time_ns}));
  EXPECT_EQ(common[1].pose.p, poses[4].pose.p);
}

// ---- Consistency

TEST(Consistency, IsThatOfTheDegreesOfFreedomWhereCovariancesAreTrue) {
  const Poses truth = Walk(600);
  Poses estimate = Moved(truth, {ExpSO3({0.2, -1, 0.4}), {3, 1, -2}}, {}, 1);
  Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Zero();
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column <= row; ++column) root(row, column) = row == column ? 0.02 : 0.01;
  std::vector<PoseCovariance> covariances;
  for (size_t k = 1; k < estimate.size(); ++k) {
    Eigen::Matrix<double, 6, 1> white;
    for (int i = 0; i < 6; ++i) white(i) = Gaussian(k, i);
    const Eigen::Matrix<double, 6, 1> e = root * white;
    SE3& pose = estimate[k].pose;
    pose = {pose.R * ExpSO3(e.head<3>()).conjugate(), pose.p - e.tail<3>()};
    covariances.push_back({estimate[k].time_ns, root * root.transpose()});
  }
  const Consistency nees = ScoreConsistency(estimate, covariances, truth, 0.06);
  EXPECT_NEAR(nees.pose, 6, 0.6);  // four standard deviations of the mean
  EXPECT_NEAR(nees.rotation, 3, 0.4);
  EXPECT_NEAR(nees.position, 3, 0.4);
  for (PoseCovariance& c : covariances) c.covariance *= 4;
  EXPECT_NEAR(ScoreConsistency(estimate, covariances, truth, 0.06).pose, nees.pose / 4, 1e-9);
}

TEST(Consistency, LeavesOutWhatIsNotKnown) {
  const Poses truth = Walk(4);
  const auto nees = [&](const std::vector<PoseCovariance>& covariances) {
    return ScoreConsistency(truth, covariances, truth, 0.06).pose;
  };
  EXPECT_TRUE(std::isnan(nees({})));
  EXPECT_TRUE(std::isnan(
      nees({{truth[1].time_ns, 0 * Eigen::Matrix<double, 6, 6>::Identity()}})));  // singular
  const Eigen::Matrix<double, 6, 6> one = Eigen::Matrix<double, 6, 6>::Identity();
  EXPECT_TRUE(std::isnan(nees({{truth[0].time_ns, one}})));  // where errors are measured from
  EXPECT_NEAR(nees({{truth[1].time_ns + 5, one}, {truth[2].time_ns, one}}), 0, 1e-20);
}

TEST(Trajectory, OfTwoPosesIsNoTrajectory) {
  const Poses truth = Walk(50);
  for (const int poses : {0, 2}) {
    const TrajectoryScores scores = Score(Walk(poses), truth);
    EXPECT_EQ(scores.poses, poses);
    EXPECT_EQ(scores.coverage_pct, 2 * poses);
    for (const double value : {scores.ate_rmse_m, scores.orientation_mean_deg, scores.path_m,
                               scores.scale, scores.rpe_half_second.rotation_deg})
      EXPECT_TRUE(std::isnan(value));
    EXPECT_FALSE(scores.success_by_ate);
    EXPECT_FALSE(scores.success_by_scale);
  }
}

}  // namespace
}  // namespace sgf
