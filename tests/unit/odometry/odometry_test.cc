#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/odometry/odometry.h>

namespace sgf::odometry {
namespace {

const Rig kRig{{.width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 160, .cy = 120}, 0.12};
constexpr std::int64_t kPeriod = 50'000'000;  // ns

OdometryOptions Options() {
  OdometryOptions options;
  options.matcher.num_disparities = 32;
  options.selection.cell_px = 10;
  return options;
}

/// Where the camera is at frame k, T_world_cam: the first frame is the world.
SE3 PoseAt(int k) {
  const double t = 0.04 * k;
  return {ExpSO3({0.03 * t, 0.2 * t, -0.1 * t}), {0.4 * t, -0.1 * t, 0.3 * t}};
}

/// A camera that is carried through the world.
struct Rehearsal {
  test::CornerWorld world{kRig.camera};
  Odometry odometry{kRig, Options()};

  FrameResult Stereo(int k, double gain = 1) {
    const SE3 left = PoseAt(k);
    const SE3 right = left * SE3{Eigen::Quaterniond::Identity(), {kRig.baseline_m, 0, 0}};
    return odometry.ProcessStereo(k * kPeriod, world.Render(left, gain).grey,
                                  world.Render(right, gain).grey);
  }
  FrameResult Depth(int k) {
    const auto view = world.Render(PoseAt(k));
    return odometry.ProcessDepth(k * kPeriod, view.grey, view.depth_m);
  }
  FrameResult Black(int k) {
    const cv::Mat1b black(kRig.camera.height, kRig.camera.width, uint8_t{0});
    return odometry.ProcessStereo(k * kPeriod, black, black);
  }
};

void ExpectPose(const FrameResult& result, int k, double tolerance_m) {
  EXPECT_EQ(result.state, k == 0 ? TrackingState::kInitialised : TrackingState::kTracked);
  EXPECT_LT((result.T_world_cam.p - PoseAt(k).p).norm(), tolerance_m) << "frame " << k;
  EXPECT_LT(LogSO3(result.T_world_cam.R.conjugate() * PoseAt(k).R).norm(), tolerance_m / 3);
}

TEST(Odometry, FollowsAStereoCamera) {
  Rehearsal rehearsal;
  for (int k = 0; k < 15; ++k) ExpectPose(rehearsal.Stereo(k), k, 0.02);
}

TEST(Odometry, FollowsACameraWithDepth) {
  Rehearsal rehearsal;
  for (int k = 0; k < 15; ++k) ExpectPose(rehearsal.Depth(k), k, 0.01);
}

TEST(Odometry, FollowsThroughJumpsOfTheExposure) {
  Rehearsal rehearsal;
  for (int k = 0; k < 12; ++k) ExpectPose(rehearsal.Stereo(k, k % 4 < 2 ? 1.0 : 0.5), k, 0.03);
}

TEST(Odometry, MakesKeyframesAndTellsOfThem) {
  Rehearsal rehearsal;
  EXPECT_THAT(ErrorMessage([&] { rehearsal.odometry.LastKeyframe(); }),
              testing::HasSubstr("no key-frame"));
  const FrameResult first = rehearsal.Depth(0);
  EXPECT_TRUE(first.new_keyframe);
  const Keyframe keyframe = rehearsal.odometry.LastKeyframe();
  ASSERT_GT(keyframe.points.size(), 200u);
  const cv::Mat1f depth_m = rehearsal.world.Render({}).depth_m;
  for (const alignment::ReferencePoint& point : keyframe.points)
    EXPECT_FLOAT_EQ(1 / point.inverse_depth,
                    depth_m(cv::Point(cv::Point2f(point.pixel.x(), point.pixel.y()))));
}

TEST(Odometry, SaysWhenItIsLostAndFindsItsWayBack) {
  Rehearsal rehearsal;
  for (int k = 0; k < 5; ++k) rehearsal.Stereo(k);
  for (int k = 5; k < 8; ++k) {
    EXPECT_EQ(rehearsal.Black(k).state, TrackingState::kLost);
  }
  for (int k = 8; k < 11; ++k) ExpectPose(rehearsal.Stereo(k), k, 0.03);
}

TEST(Odometry, StartsAnewAfterBeingLostForLong) {
  Rehearsal rehearsal;
  for (int k = 0; k < 3; ++k) rehearsal.Stereo(k);
  const int lost = Options().lost_frames;
  for (int k = 3; k < 3 + lost; ++k) EXPECT_EQ(rehearsal.Black(k).state, TrackingState::kLost);
  // Nothing to see: no start either.
  EXPECT_EQ(rehearsal.Black(3 + lost).state, TrackingState::kLost);
  Odometry& odometry = rehearsal.odometry;
  const SE3 elsewhere{ExpSO3({0, 0.1, 0.6}), {1.5, 1.2, -1}};
  const auto view = rehearsal.world.Render(elsewhere);
  const FrameResult anew = odometry.ProcessDepth((4 + lost) * kPeriod, view.grey, view.depth_m);
  EXPECT_EQ(anew.state, TrackingState::kInitialised);
  EXPECT_TRUE(anew.new_keyframe);
  // Not again at once, though there would be points to start from.
  cv::Mat1b noise(kRig.camera.height, kRig.camera.width);
  cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_EQ(odometry.ProcessDepth((5 + lost) * kPeriod, noise, view.depth_m).state,
            TrackingState::kLost);
}

TEST(Odometry, FindsAFirstMotionThatNothingPredicts) {
  // With two levels no guess but a good one leads to it, and what is off is not believed.
  OdometryOptions options = Options();
  options.alignment.levels = 2;
  options.alignment.min_inlier_share = 0.8;
  Rehearsal rehearsal;
  rehearsal.odometry = Odometry(kRig, options);
  rehearsal.Depth(0);
  const SE3 moved{ExpSO3({0, 0.04, 0}), {0, 0, 0.4}};
  const auto view = rehearsal.world.Render(moved);
  const FrameResult result = rehearsal.odometry.ProcessDepth(kPeriod, view.grey, view.depth_m);
  EXPECT_EQ(result.state, TrackingState::kTracked);
  EXPECT_LT((result.T_world_cam.p - moved.p).norm(), 0.02);
}

TEST(Odometry, TakesRotationsFromTheGyroscope) {
  // One iteration refines a prediction but does not find a turn of 14 degrees.
  const SE3 turned{ExpSO3({0, 0.25, 0}), {0, 0, 0}};
  const auto rotation_error = [&](bool with_gyro) {
    Rehearsal rehearsal;
    OdometryOptions options = Options();
    options.alignment.levels = 1;
    options.alignment.solver.max_iterations = 1;
    rehearsal.odometry = Odometry(kRig, options);
    rehearsal.Depth(0);
    for (std::int64_t t = 0; with_gyro && t <= kPeriod; t += kPeriod / 10)
      rehearsal.odometry.ProcessGyro(t, {0, 0.25 / 0.05, 0});
    const auto view = rehearsal.world.Render(turned);
    const FrameResult result = rehearsal.odometry.ProcessDepth(kPeriod, view.grey, view.depth_m);
    return LogSO3(result.T_world_cam.R.conjugate() * turned.R).norm();
  };
  EXPECT_LT(rotation_error(true), 0.005);
  EXPECT_GT(rotation_error(false), 0.05);
}

TEST(Odometry, RefusesBadInputAndGoesOn) {
  Rehearsal rehearsal;
  rehearsal.Stereo(0);
  Odometry& odometry = rehearsal.odometry;
  const cv::Mat1b good(240, 320, uint8_t{9});
  EXPECT_THAT(ErrorMessage([&] { odometry.ProcessStereo(0, good, good); }),
              testing::HasSubstr("is not after the last one's"));
  EXPECT_THAT(ErrorMessage([&] { odometry.ProcessStereo(kPeriod, good, cv::Mat1b(5, 5)); }),
              testing::HasSubstr("is 5x5 px; the camera has 320x240"));
  EXPECT_THAT(ErrorMessage([&] { odometry.ProcessStereo(kPeriod, cv::Mat3b(240, 320), good); }),
              testing::HasSubstr("CV_8UC3"));
  EXPECT_THAT(ErrorMessage([&] { odometry.ProcessDepth(kPeriod, good, cv::Mat1f(2, 2)); }),
              testing::HasSubstr("is 2x2 px"));
  ExpectPose(rehearsal.Stereo(1), 1, 0.01);
}

TEST(Odometry, IgnoresDepthThatIsNone) {
  Rehearsal rehearsal;
  auto view = rehearsal.world.Render({});
  const float none[] = {NAN, INFINITY, -1.f, 0.f};
  for (int y = 0; y < view.depth_m.rows; ++y)
    for (int x = 0; x < view.depth_m.cols; x += 2) view.depth_m(y, x) = none[(x / 2 + y) % 4];
  rehearsal.odometry.ProcessDepth(0, view.grey, view.depth_m);
  for (const alignment::ReferencePoint& point : rehearsal.odometry.LastKeyframe().points)
    EXPECT_TRUE(1 / point.inverse_depth > 1 && 1 / point.inverse_depth < 8);
  ExpectPose(rehearsal.Depth(1), 1, 0.01);
}

TEST(Odometry, RefusesOptionsOutOfRange) {
  const auto expect_refused = [](const char* message, const auto& change) {
    OdometryOptions options;
    change(options);
    EXPECT_THAT(ErrorMessage([&] { Odometry(kRig, options); }), testing::HasSubstr(message));
  };
  expect_refused("min_depth_m", [](auto& o) { o.min_depth_m = 2 * o.max_depth_m; });
  expect_refused("min_depth_m", [](auto& o) { o.max_depth_m = INFINITY; });
  expect_refused("tracking_levels", [](auto& o) { o.tracking_levels = 0; });
  expect_refused("lost_frames", [](auto& o) { o.lost_frames = -1; });
  expect_refused("keyframe_overlap", [](auto& o) { o.keyframe_overlap = NAN; });
  expect_refused("cannot refine depths", [](auto& o) { o.refinement.residual = "photo_affine"; });
  expect_refused("max_change_px", [](auto& o) { o.refinement.max_change_px = 0; });
  EXPECT_THAT(ErrorMessage([&] {
                Odometry({kRig.camera, 0}, {}).ProcessStereo(0, {}, {});
              }),
              testing::HasSubstr("has no baseline"));
}

}  // namespace
}  // namespace sgf::odometry
