#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/direct/pixel_selection.h>
#include <sgf/direct/tracing.h>

namespace sgf::direct {
namespace {

using test::kCamera;

/// A key-frame at the world's origin and views from a camera that moves to the right and ahead.
struct Scene {
  test::CornerWorld world{kCamera};
  Keyframe host;
  cv::Mat1f depth_m;

  Scene() {
    const auto view = world.Render({});
    depth_m = view.depth_m;
    host.pyramid.samples.push_back(alignment::MakeSampleChannels(view.grey, {}));
    PixelSelector select({.points = 300});
    for (const cv::Point& p : select(host.image()))
      host.immature.push_back(
          MakeImmaturePoint(host.image(), Eigen::Vector2f(float(p.x), float(p.y))));
  }

  static SE3 PoseAt(int k) {
    return {ExpSO3({0, 0.01 * k, 0.005 * k}), {0.04 * k, 0.01 * k, 0.02 * k}};
  }

  alignment::SampleChannels Image(int k, double gain = 1, double offset = 0) const {
    return alignment::MakeSampleChannels(world.Render(PoseAt(k), gain, offset).grey, {});
  }

  double TrueInverseDepth(const ImmaturePoint& point) const {
    return 1 / depth_m(static_cast<int>(point.pixel.y()), static_cast<int>(point.pixel.x()));
  }
};

struct Outcome {
  double found = 0;         ///< share of points
  double median_error = 0;  ///< of their inverse depths, relative
  double inside = 0;        ///< share of the found whose interval has the truth, or nearly
};

Outcome TraceThrough(const std::string& residual, double gain, double offset,
                     const RelativeBrightness& relative) {
  Scene scene;
  const auto estimator = MakeDepthEstimator(kCamera, {.residual = residual});
  for (int k = 1; k <= 6; ++k) {
    const auto image = scene.Image(k, gain, offset);
    for (ImmaturePoint& point : scene.host.immature)
      estimator->Trace(scene.host, image, Scene::PoseAt(k).Inverse(), relative, point);
  }
  std::vector<double> errors;
  int inside = 0;
  for (const ImmaturePoint& point : scene.host.immature) {
    if (point.found == 0) continue;
    const double truth = scene.TrueInverseDepth(point);
    errors.push_back(std::abs(point.InverseDepth() / truth - 1));
    const double half = 0.5 * (point.inverse_depth_max - point.inverse_depth_min);
    inside += std::abs(point.InverseDepth() - truth) < 2 * half;
  }
  if (errors.empty()) return {};
  std::sort(errors.begin(), errors.end());
  return {double(errors.size()) / double(scene.host.immature.size()), errors[errors.size() / 2],
          double(inside) / double(errors.size())};
}

TEST(Tracing, FindsDepthByEveryKindOfDissimilarity) {
  for (const char* residual : {"photo", "sgf", "ngv", "sgf3_vec"}) {
    SCOPED_TRACE(residual);
    const Outcome outcome = TraceThrough(residual, 1, 0, {});
    EXPECT_GT(outcome.found, 0.8);
    EXPECT_LT(outcome.median_error, 0.01);
    EXPECT_GT(outcome.inside, 0.9);
  }
}

TEST(Tracing, UnknownBrightnessHurtsThePhotometricOneOnly) {
  const Outcome photo = TraceThrough("photo", 0.6, 0, {});
  const Outcome sgf = TraceThrough("sgf", 0.6, 0, {});
  EXPECT_GT(sgf.found, 0.8);
  EXPECT_LT(sgf.median_error, 0.01);
  EXPECT_TRUE(photo.found < 0.6 || photo.median_error > 0.02);
}

TEST(Tracing, KnownBrightnessIsTakenOut) {
  // I_ref = exp(alpha) I_cur + beta
  const Outcome photo = TraceThrough("photo", 0.6, 10, {-std::log(0.6), -10 / 0.6});
  EXPECT_GT(photo.found, 0.8);
  EXPECT_LT(photo.median_error, 0.01);
}

TEST(Tracing, AStandingCameraSaysNothing) {
  Scene scene;
  const auto estimator = MakeDepthEstimator(kCamera, {});
  const auto image = scene.Image(0);
  for (ImmaturePoint& point : scene.host.immature) {
    estimator->Trace(scene.host, image, {}, {}, point);
    EXPECT_EQ(point.found, 0);
  }
}

TEST(Tracing, RefinesOverSeveralViews) {
  Scene scene;
  const auto estimator = MakeDepthEstimator(kCamera, {.residual = "sgf"});
  std::vector<Keyframe> targets(3);
  std::vector<View> views;
  for (int k = 0; k < 3; ++k) {
    targets[k].pyramid.samples.push_back(scene.Image(2 * k + 2));
    views.push_back({&targets[k], Scene::PoseAt(2 * k + 2).Inverse()});
  }
  std::vector<double> errors;
  for (const ImmaturePoint& point : scene.host.immature) {
    const double truth = scene.TrueInverseDepth(point);
    const RefinedDepth refined = estimator->Refine(scene.host, point.pixel, 1.02 * truth, views);
    if (refined.seen_by.empty()) continue;
    errors.push_back(std::abs(refined.inverse_depth / truth - 1));
    EXPECT_GT(refined.information, 0);
  }
  ASSERT_GT(errors.size(), 0.8 * scene.host.immature.size());
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.005);
}

TEST(Tracing, RefusesWhatCannotEstimateDepth) {
  for (const char* residual : {"photo_affine", "bit_planes", "lssd"})
    EXPECT_THAT(ErrorMessage([&] { MakeDepthEstimator(kCamera, {.residual = residual}); }),
                testing::HasSubstr("cannot estimate depth"));
  EXPECT_THAT(ErrorMessage([] { MakeDepthEstimator(kCamera, {.max_length = 0}); }),
              testing::HasSubstr("max_length"));
}

}  // namespace
}  // namespace sgf::direct
