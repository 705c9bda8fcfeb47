#include <cmath>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/direct/pixel_selection.h>
#include <sgf/direct/window.h>

namespace sgf::direct {
namespace {

using test::kCamera;

SE3 TruthAt(int k) {
  return {ExpSO3({0.01 * k, 0.02 * k, 0.01 * k}), {0.1 * k, 0.02 * k, 0.05 * k}};
}

/// Turns about all axes, which tell a camera's focal length and centre.
SE3 WideTruthAt(int k) {
  const double s = k % 2 ? 1 : -1;
  return {ExpSO3({0.05 * s * (k % 3), -0.06 * s * k, 0.15 * k}),
          {0.06 * s * k, 0.1 * (k % 3), 0.03 * k}};
}

/// Key-frames whose first has points that all the others see; poses and depths somewhat off.
Window Disturbed(const std::vector<double>& gains, double error, SE3 (*truth_at)(int) = TruthAt) {
  const test::CornerWorld world(kCamera);
  Window window;
  for (size_t k = 0; k < gains.size(); ++k) {
    auto frame = std::make_unique<Keyframe>();
    frame->id = 10 + static_cast<int>(k);
    const SE3 truth = truth_at(static_cast<int>(k));
    const auto view = world.Render(truth, gains[k]);
    frame->pyramid.samples.push_back(alignment::MakeSampleChannels(view.grey, {}));
    frame->T_cam_world = truth.Inverse();
    if (k > 0)
      frame->T_cam_world =
          SE3{ExpSO3({error, -error, error}), {error, error, -error}} * frame->T_cam_world;
    if (k == 0) {
      PixelSelector select({.points = 300});
      for (const cv::Point& p : select(frame->image()))
        frame->points.push_back({.pixel = Eigen::Vector2f(float(p.x), float(p.y)),
                                 .inverse_depth = (1 + error) / view.depth_m(p)});
    }
    window.push_back(std::move(frame));
  }
  for (ActivePoint& point : window[0]->points)
    for (size_t k = 1; k < window.size(); ++k) point.observations.push_back({window[k]->id});
  return window;
}

/// Of the direction and the turn from the first to another key-frame; the scale is free.
double PoseError(const Window& window, int k) {
  const SE3 found = window[k]->T_cam_world * window[0]->T_cam_world.Inverse();
  const SE3 truth = TruthAt(k).Inverse();
  const double turn = LogSO3(found.R * truth.R.conjugate()).norm();
  return turn + (found.p.normalized() - truth.p.normalized()).norm();
}

TEST(Window, FindsPosesAndDepths) {
  for (const char* residual : {"photo_affine", "ngv", "sgf3_vec"}) {
    SCOPED_TRACE(residual);
    Window window = Disturbed({1, 1, 1}, 0.01);
    WindowOptimizer optimizer(kCamera, {.residual = residual, .max_iterations = 20}, 1);
    optimizer.Anchor(*window[0]);
    const double before = PoseError(window, 2);
    WindowSummary summary;
    for (int round = 0; round < 3; ++round) summary = optimizer.Refine(window, false);
    EXPECT_TRUE(summary.usable);
    EXPECT_GT(summary.observations, 400);
    EXPECT_LT(PoseError(window, 2), 0.15 * before);
    EXPECT_LT(window[0]->T_cam_world.p.norm(), 1e-4) << "the first key-frame is held";
    for (const ActivePoint& point : window[0]->points) EXPECT_GT(point.variance, 0);
  }
}

TEST(Window, EstimatesBrightness) {
  Window window = Disturbed({1, 0.7}, 0.002);
  WindowOptimizer optimizer(kCamera, {.max_iterations = 20}, 1);
  optimizer.Anchor(*window[0]);
  for (int round = 0; round < 3; ++round) optimizer.Refine(window, false);
  const RelativeBrightness relative = Between(window[0]->brightness, window[1]->brightness);
  EXPECT_NEAR(relative.alpha, -std::log(0.7), 0.05);
  EXPECT_NEAR(100 * std::exp(relative.alpha) * 0.7 + relative.beta, 100, 2);
}

TEST(Window, RefinesTheCamera) {
  Camera wrong = kCamera;
  wrong.fx *= 1.03;
  wrong.fy *= 1.03;
  wrong.cx += 4;
  std::vector<double> errors;
  for (const double sigma_px : {0.0, 20.0}) {
    Window window = Disturbed({1, 1, 1, 1, 1, 1}, 0.002, WideTruthAt);
    WindowOptimizer optimizer(wrong, {.max_iterations = 20, .sigma_intrinsics = sigma_px}, 1);
    optimizer.Anchor(*window[0]);
    for (int round = 0; round < 3; ++round) optimizer.Refine(window, false);
    const Camera& found = optimizer.camera();
    errors.push_back(std::abs(found.fx - kCamera.fx) + std::abs(found.fy - kCamera.fy) +
                     std::abs(found.cx - kCamera.cx) + std::abs(found.cy - kCamera.cy));
    // It stays refined when points leave.
    std::vector<std::pair<int, const ActivePoint*>> leaving;
    for (const ActivePoint& point : window[0]->points) leaving.emplace_back(0, &point);
    optimizer.Marginalize(window, leaving);
    EXPECT_EQ(optimizer.prior().frames().size(), sigma_px > 0 ? 7u : 6u);
    EXPECT_TRUE(optimizer.prior().H().allFinite());
  }
  EXPECT_NEAR(errors[0], 4 + 0.06 * 260, 1e-9) << "held";
  EXPECT_LT(errors[1], 0.5);  // px
}

TEST(Window, IsTheSameForAnyNumberOfThreads) {
  std::vector<Window> windows;
  for (const int threads : {1, 2}) {
    windows.push_back(Disturbed({1, 0.9, 1.1}, 0.01));
    WindowOptimizer optimizer(kCamera, {}, threads);
    optimizer.Anchor(*windows.back()[0]);
    optimizer.Refine(windows.back(), false);
  }
  for (size_t k = 0; k < windows[0].size(); ++k)
    EXPECT_EQ(windows[0][k]->T_cam_world.Matrix(), windows[1][k]->T_cam_world.Matrix());
}

TEST(Window, TakesOutObservationsThatDoNotFit) {
  Window window = Disturbed({1, 1, 1}, 0);
  auto& points = window[0]->points;
  for (size_t k = 0; k < points.size(); k += 10) points[k].inverse_depth *= 2;
  WindowOptimizer optimizer(kCamera, {}, 1);
  optimizer.Anchor(*window[0]);
  EXPECT_GT(optimizer.Refine(window, false).outliers, static_cast<int>(points.size() / 20));
}

TEST(Window, KeepsWhatMarginalisedPointsSaid) {
  Window window = Disturbed({1, 1, 1}, 0.005);
  WindowOptimizer optimizer(kCamera, {.max_iterations = 20}, 1);
  optimizer.Anchor(*window[0]);
  for (int round = 0; round < 3; ++round) optimizer.Refine(window, false);
  const double information = optimizer.prior().H().trace();
  std::vector<std::pair<int, const ActivePoint*>> leaving;
  for (size_t k = 0; k < window[0]->points.size(); k += 2)
    leaving.emplace_back(0, &window[0]->points[k]);
  optimizer.Marginalize(window, leaving);
  ASSERT_EQ(optimizer.prior().frames().size(), 3u);
  EXPECT_GT(optimizer.prior().H().trace(), information);
  // The minimum has not moved: the slope of the prior vanishes there, but for what other points
  // pull the other way.
  const Eigen::MatrixXd& H = optimizer.prior().H();
  const Eigen::VectorXd step =
      -(H + 1e-6 * H.trace() * Eigen::MatrixXd::Identity(H.rows(), H.cols()))
           .ldlt()
           .solve(optimizer.prior().b());
  EXPECT_LT(step.segment<3>(8).norm(), 0.02);
}

TEST(Window, RefusesWhatItCannotRefine) {
  for (const char* residual : {"lssd", "bit_planes"})
    EXPECT_THAT(ErrorMessage([&] { WindowOptimizer(kCamera, {.residual = residual}, 1); }),
                testing::HasSubstr("cannot refine a window"));
  EXPECT_THAT(
      ErrorMessage([] { WindowOptimizer(kCamera, {.residual = "ngv", .sigma_intrinsics = 1}, 1); }),
      testing::HasSubstr("only 'photo_affine' refines the camera"));
  EXPECT_THAT(ErrorMessage([] { WindowOptimizer(kCamera, {.max_cost = 0}, 1); }),
              testing::HasSubstr("max_cost"));
}

}  // namespace
}  // namespace sgf::direct
