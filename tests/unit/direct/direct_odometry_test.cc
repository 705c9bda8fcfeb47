#include <cmath>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/direct/direct_odometry.h>
#include <sgf/eval/trajectory.h>

namespace sgf::direct {
namespace {

using testing::HasSubstr;

using test::kCamera;
constexpr std::int64_t kPeriod = 50'000'000;  // ns

SE3 PoseAt(int k) {
  const double t = 0.05 * k;
  return {ExpSO3({0.05 * std::sin(t), 0.1 * std::sin(0.7 * t), 0.05 * t}),
          {0.7 * t, 0.3 * std::sin(1.5 * t), -0.3 * t}};
}

DirectOptions Options() {
  DirectOptions options;
  options.selection.points = 400;
  options.active_points = 400;
  return options;
}

/// A camera that is carried along PoseAt().
struct Flight {
  explicit Flight(const DirectOptions& options = Options(), const Camera& believed = kCamera)
      : odometry(believed, options) {}

  test::CornerWorld world{kCamera};
  DirectOdometry odometry;
  std::vector<TimedPose> truth = {};

  DirectFrameResult Fly(int k, double gain = 1, std::optional<double> exposure_ms = std::nullopt) {
    return FlyTo(PoseAt(k), k, gain, exposure_ms);
  }
  DirectFrameResult FlyTo(const SE3& pose, int k, double gain = 1,
                          std::optional<double> exposure_ms = std::nullopt) {
    truth.push_back({k * kPeriod, pose});
    return odometry.Process(k * kPeriod, world.Render(pose, gain).grey, exposure_ms);
  }
  DirectFrameResult Show(int k, const cv::Mat& image) {
    return odometry.Process(k * kPeriod, image);
  }
  TrajectoryScores Scores() const {
    std::vector<TimedPose> estimate;
    for (const DirectPose& pose : odometry.Trajectory())
      estimate.push_back({pose.time_ns, pose.T_world_cam});
    return ScoreTrajectory(estimate, truth, {}, {}, {.align = TrajectoryAlignment::kSim3});
  }
};

cv::Mat1b Black() { return cv::Mat1b(240, 320, uint8_t{0}); }

class FlightWith : public testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(FlightWith, IsFollowed) {
  DirectOptions options = Options();
  options.depth.residual = GetParam().first;
  options.tracking.residual = options.window.residual = GetParam().second;
  Flight flight(options);
  for (int k = 0; k < 50; ++k) flight.Fly(k);
  const TrajectoryScores scores = flight.Scores();
  EXPECT_GE(scores.poses, 49);
  EXPECT_LT(scores.ate_rmse_m, 0.01 * scores.path_m);
}

INSTANTIATE_TEST_SUITE_P(Dissimilarities, FlightWith,
                         testing::Values(std::pair("photo", "photo_affine"),
                                         std::pair("sgf", "photo_affine"),
                                         std::pair("ngv", "ngv")));

TEST(DirectOdometry, FollowsThroughJumpsOfTheExposure) {
  DirectOptions options = Options();
  options.depth.residual = "sgf";
  Flight flight(options);
  for (int k = 0; k < 50; ++k) flight.Fly(k, k / 10 % 2 ? 0.7 : 1);
  const TrajectoryScores scores = flight.Scores();
  EXPECT_GE(scores.poses, 47);
  EXPECT_LT(scores.ate_rmse_m, 0.015 * scores.path_m);
}

TEST(DirectOdometry, TakesExposuresThatAreKnown) {
  DirectOptions options = Options();
  options.window.sigma_a_known = 1e-3;
  Flight flight(options);
  int checked = 0;
  for (int k = 0; k < 50; ++k) {
    const double gain = k / 8 % 2 ? 0.7 : 1;
    const DirectFrameResult result = flight.Fly(k, gain, 4 * gain);
    if (!result.new_keyframe || result.new_map) continue;
    EXPECT_NEAR(result.brightness.a, std::log(gain), 0.05) << k;
    ++checked;
  }
  EXPECT_GT(checked, 2);
  EXPECT_LT(flight.Scores().ate_rmse_m, 0.015 * flight.Scores().path_m);
}

TEST(DirectOdometry, GoesOnAfterTurningOnTheSpot) {
  Flight flight;
  int k = 0;
  for (; k < 30; ++k) flight.Fly(k);
  for (; k < 50; ++k) {
    const double turn = 0.1 * std::sin(0.3 * (k - 29));
    flight.FlyTo(PoseAt(29) * SE3{ExpSO3({0, turn, 0}), {0, 0, 0}}, k);
  }
  for (; k < 75; ++k) flight.FlyTo(PoseAt(k - 20), k);
  const TrajectoryScores scores = flight.Scores();
  EXPECT_GE(scores.poses, 74);
  EXPECT_LT(scores.ate_rmse_m, 0.015 * scores.path_m);
}

TEST(DirectOdometry, PointsLieOnTheWalls) {
  Flight flight;
  for (int k = 0; k < 40; ++k) flight.Fly(k);
  const TrajectoryScores scores = flight.Scores();
  std::vector<MapPoint> points = flight.odometry.ActivePoints();
  ASSERT_GT(points.size(), 150u);
  std::vector<double> errors;
  for (const MapPoint& point : points) {
    const Eigen::Vector3d p = scores.scale * point.position;
    errors.push_back(std::abs(p.z() - 4 + 0.5 * std::abs(p.x())));
  }
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.08) << "the first frame is the world";
}

TEST(DirectOdometry, IsTheSameForAnyNumberOfThreads) {
  std::vector<std::vector<DirectPose>> runs;
  for (const int threads : {1, 2}) {
    DirectOptions options = Options();
    options.threads = threads;
    Flight flight(options);
    for (int k = 0; k < 25; ++k) flight.Fly(k);
    runs.push_back(flight.odometry.Trajectory());
  }
  ASSERT_GT(runs[0].size(), 20u);
  ASSERT_EQ(runs[0].size(), runs[1].size());
  for (size_t k = 0; k < runs[0].size(); ++k)
    EXPECT_EQ(runs[0][k].T_world_cam.Matrix(), runs[1][k].T_world_cam.Matrix());
}

TEST(DirectOdometry, SaysWhenItIsLostAndBeginsANewMap) {
  Flight flight;
  for (int k = 0; k < 25; ++k) flight.Fly(k);
  const int lost = Options().lost_frames;
  for (int k = 25; k < 25 + lost; ++k) EXPECT_EQ(flight.Show(k, Black()).state, DirectState::kLost);
  EXPECT_EQ(flight.Fly(25 + lost).state, DirectState::kTracked) << "not far from where it was";
  int k = 26 + lost;
  for (; k < 30 + 2 * lost; ++k) flight.Show(k, Black());
  DirectFrameResult result;
  for (; k < 80 + lost && result.state != DirectState::kTracked; ++k) result = flight.Fly(k);
  EXPECT_EQ(result.state, DirectState::kTracked);
  EXPECT_EQ(result.segment, 1);
  EXPECT_TRUE(result.new_map);
  std::set<int> segments;
  for (const DirectPose& pose : flight.odometry.Trajectory()) {
    EXPECT_TRUE(pose.T_world_cam.Matrix().allFinite());
    segments.insert(pose.segment);
    if (pose.time_ns < 25 * kPeriod) {
      EXPECT_EQ(pose.segment, 0);
    }
  }
  EXPECT_EQ(segments, (std::set{0, 1}));
  for (const MapPoint& point : flight.odometry.TakeFinishedPoints()) EXPECT_EQ(point.segment, 0);
  for (const MapPoint& point : flight.odometry.ActivePoints()) EXPECT_EQ(point.segment, 1);
}

TEST(DirectOdometry, MakesNoMapOfNothing) {
  const test::CornerWorld world(kCamera);
  const auto never_tracked = [](const auto& image) {
    Flight flight;
    for (int k = 0; k < 25; ++k)
      EXPECT_EQ(flight.Show(k, image(k)).state, DirectState::kInitialising) << k;
    EXPECT_TRUE(flight.odometry.Trajectory().empty());
  };
  never_tracked([](int) { return Black(); });
  never_tracked([](int) { return cv::Mat1b(240, 320, uint8_t{250}); });
  never_tracked([&](int) { return world.Render({}).grey; });
  never_tracked([&](int k) { return world.Render({ExpSO3({0, 0.01 * k, 0}), {0, 0, 0}}).grey; });
}

TEST(DirectOdometry, SurvivesDroppedFramesAndAJumpCut) {
  Flight flight;
  for (int k = 0; k < 25; ++k) flight.Fly(k);
  EXPECT_EQ(flight.Fly(28).state, DirectState::kTracked);
  const SE3 elsewhere{ExpSO3({0.5, -0.4, 2}), {2, -2, 1}};
  for (int k = 29; k < 31; ++k)
    EXPECT_EQ(flight.Show(k, flight.world.Render(elsewhere).grey).state, DirectState::kLost);
  EXPECT_EQ(flight.Fly(31).state, DirectState::kTracked);
}

TEST(DirectOdometry, BearsWrongIntrinsics) {
  Camera wrong = kCamera;
  wrong.fx *= 1.3;
  wrong.fy *= 0.8;
  Flight flight(Options(), wrong);
  for (int k = 0; k < 50; ++k) EXPECT_TRUE(flight.Fly(k).T_world_cam.Matrix().allFinite()) << k;
  for (const DirectPose& pose : flight.odometry.Trajectory())
    EXPECT_TRUE(pose.T_world_cam.Matrix().allFinite());
  for (const MapPoint& point : flight.odometry.ActivePoints())
    EXPECT_TRUE(point.position.allFinite());
}

TEST(DirectOdometry, RefinesIntrinsics) {
  Camera wrong = kCamera;
  wrong.fx *= 1.03;
  wrong.fy *= 1.03;
  DirectOptions options = Options();
  options.window.sigma_intrinsics = 20;
  Flight flight(options, wrong);
  for (int k = 0; k < 80; ++k) {  // turns tell the focal length
    const double t = 0.05 * k;
    SE3 pose = PoseAt(k);
    pose.R = ExpSO3({0.25 * std::sin(2 * t), 0.3 * std::sin(1.7 * t), 0.6 * std::sin(t)});
    flight.Show(k, flight.world.Render(pose).grey);
  }
  EXPECT_LT(std::abs(flight.odometry.camera().fx - kCamera.fx), 0.3 * (wrong.fx - kCamera.fx));
  EXPECT_LT(std::abs(flight.odometry.camera().fy - kCamera.fy), 0.3 * (wrong.fy - kCamera.fy));
}

TEST(DirectOdometry, RefusesBadInputAndGoesOn) {
  Flight flight;
  flight.Fly(0);
  const auto refusal = [&](std::int64_t time_ns, const cv::Mat& image,
                           std::optional<double> exposure_ms = std::nullopt) {
    return ErrorMessage([&] { flight.odometry.Process(time_ns, image, exposure_ms); });
  };
  EXPECT_THAT(refusal(0, Black()), HasSubstr("not after the last one"));
  EXPECT_THAT(refusal(kPeriod, cv::Mat1b(240, 321)), HasSubstr("321x240"));
  EXPECT_THAT(refusal(kPeriod, cv::Mat1d(240, 320)), HasSubstr("8-bit or float grey"));
  EXPECT_THAT(refusal(kPeriod, {}), HasSubstr("image"));
  EXPECT_THAT(refusal(kPeriod, cv::Mat1f(240, 320, std::nanf(""))), HasSubstr("not finite"));
  EXPECT_THAT(refusal(kPeriod, Black(), 3.), HasSubstr("some frames only"));
  EXPECT_THAT(refusal(kPeriod, Black(), -3.), HasSubstr("positive"));
  EXPECT_EQ(flight.Fly(1).state, DirectState::kInitialising);
}

TEST(DirectOdometry, RefusesOptionsOutOfRange) {
  const auto refusal = [](const auto& change) {
    DirectOptions options = Options();
    change(options);
    return ErrorMessage([&] { DirectOdometry(kCamera, options); });
  };
  EXPECT_THAT(refusal([](auto& o) { o.active_points = 1; }), HasSubstr("active_points"));
  EXPECT_THAT(refusal([](auto& o) { o.keyframes = 2; }), HasSubstr("keyframes"));
  for (const double share : {-0.1, 1.1, std::nan("")})
    EXPECT_THAT(refusal([&](auto& o) { o.keyframe_inliers = share; }),
                HasSubstr("keyframe_inliers"));
  EXPECT_THAT(refusal([](auto& o) { o.lost_frames = 0; }), HasSubstr("lost_frames"));
  EXPECT_THAT(refusal([](auto& o) { o.depth.residual = "lssd"; }), HasSubstr("estimate depth"));
  Camera distorted = kCamera;
  distorted.k1 = -0.2;
  EXPECT_THAT(ErrorMessage([&] { DirectOdometry(distorted, Options()); }), HasSubstr("distortion"));
}

}  // namespace
}  // namespace sgf::direct
