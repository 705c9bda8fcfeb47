#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <support/error_message.h>

#include <sgf/core/camera.h>

namespace sgf {
namespace {

using ::testing::HasSubstr;

Camera EurocCam0() {
  return {.width = 752,
          .height = 480,
          .fx = 458.654,
          .fy = 457.296,
          .cx = 367.215,
          .cy = 248.375,
          .k1 = -0.28340811,
          .k2 = 0.07395907,
          .p1 = 0.00019359,
          .p2 = 1.76187114e-05};
}

cv::Matx33d Matrix(const Camera& c) { return {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1}; }

cv::Vec4d Distortion(const Camera& c) { return {c.k1, c.k2, c.p1, c.p2}; }

std::vector<cv::Point2d> AllPixels(const Camera& c) {
  std::vector<cv::Point2d> pixels;
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) pixels.emplace_back(x, y);
  return pixels;
}

TEST(Camera, ProjectInvertsUnprojectOverTheWholeImage) {
  const Camera camera = EurocCam0();
  double worst_px = 0;
  for (const auto& p : AllPixels(camera)) {
    const Eigen::Vector2d pixel(p.x, p.y);
    const Eigen::Vector3d ray = camera.Unproject(pixel);
    ASSERT_EQ(ray.z(), 1);
    worst_px = std::max(worst_px, (camera.Project(3.7 * ray) - pixel).norm());
  }
  RecordProperty("worst_px", std::to_string(worst_px * 1e12) + "e-12");
  EXPECT_LT(worst_px, 1e-6);
}

TEST(Camera, UnprojectInvertsProject) {
  const Camera camera = EurocCam0();
  for (double x = -0.9; x < 0.9; x += 0.1)
    for (double y = -0.6; y < 0.6; y += 0.1) {
      const Eigen::Vector3d ray(x, y, 1);
      EXPECT_LT((camera.Unproject(camera.Project(2 * ray)) - ray).norm(), 1e-11);
    }
}

TEST(Camera, ProjectsAsOpenCv) {
  const Camera camera = EurocCam0();
  std::vector<cv::Point3d> points;
  for (double x = -2; x <= 2; x += 0.25)
    for (double y = -1.25; y <= 1.25; y += 0.25) points.emplace_back(x, y, 1.5 + 0.3 * x);
  std::vector<cv::Point2d> expected;
  cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), Matrix(camera), Distortion(camera), expected);
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d pixel = camera.Project({points[i].x, points[i].y, points[i].z});
    EXPECT_NEAR(pixel.x(), expected[i].x, 1e-10);
    EXPECT_NEAR(pixel.y(), expected[i].y, 1e-10);
  }
}

TEST(Camera, UnprojectsAsOpenCv) {
  const Camera camera = EurocCam0();
  const std::vector<cv::Point2d> pixels = AllPixels(camera);
  std::vector<cv::Point2d> expected;
  cv::undistortPoints(pixels, expected, Matrix(camera), Distortion(camera), cv::noArray(),
                      cv::noArray(), {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-13});
  double worst = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector3d ray = camera.Unproject({pixels[i].x, pixels[i].y});
    worst = std::max(worst, std::hypot(ray.x() - expected[i].x, ray.y() - expected[i].y));
  }
  EXPECT_LT(worst, 1e-9);
}

TEST(Camera, WithoutDistortionIsAPinhole) {
  Camera camera = EurocCam0();
  camera.k1 = camera.k2 = camera.p1 = camera.p2 = 0;
  const Eigen::Vector3d ray = camera.Unproject({100, 200});
  EXPECT_DOUBLE_EQ(ray.x(), (100 - camera.cx) / camera.fx);
  EXPECT_DOUBLE_EQ(ray.y(), (200 - camera.cy) / camera.fy);
  EXPECT_LT((camera.Project(5 * ray) - Eigen::Vector2d(100, 200)).norm(), 1e-12);
}

// r (1 - 0.28 r^2 + 0.02 r^4) rises to 0.7659 at r = 1.198, falls, and rises again from r = 2.64
// on.
TEST(Camera, FindsNoRayWhereTheDistortionFoldsBack) {
  Camera camera = EurocCam0();
  camera.k1 = -0.28;
  camera.k2 = 0.02;
  camera.p1 = camera.p2 = 0;
  const auto at_radius = [&](double r) {
    return Eigen::Vector2d(camera.cx + r * camera.fx, camera.cy);
  };
  EXPECT_LT(camera.Unproject(at_radius(0.765)).x(), 1.198);
  for (double r = 0.77; r < 3; r += 0.001)
    EXPECT_THAT(ErrorMessage([&] { camera.Unproject(at_radius(r)); }),
                HasSubstr("the distortion folds back"))
        << "radius " << r;
}

TEST(Camera, FisheyeRadiusGrowsWithTheAngle) {
  const Camera camera{
      .width = 640, .height = 480, .fx = 220, .fy = 230, .cx = 315, .cy = 250, .omega = 0.93};
  for (const double angle : {0.0, 0.3, 0.8, 1.2}) {  // rad
    const double tangent = std::tan(angle);
    const double radius = std::atan(2 * tangent * std::tan(camera.omega / 2)) / camera.omega;
    const Eigen::Vector2d pixel = camera.Project({2 * tangent * 0.6, 2 * tangent * 0.8, 2});
    EXPECT_NEAR(pixel.x(), camera.cx + camera.fx * 0.6 * radius, 1e-9);
    EXPECT_NEAR(pixel.y(), camera.cy + camera.fy * 0.8 * radius, 1e-9);
  }
  int with_ray = 0;
  const std::vector<cv::Point2d> pixels = AllPixels(camera);
  for (const auto& p : pixels) {
    const Eigen::Vector2d pixel(p.x, p.y);
    const auto ray = camera.TryUnproject(pixel);
    if (!ray) continue;
    ++with_ray;
    ASSERT_LT((camera.Project(*ray) - pixel).norm(), 1e-8) << pixel.transpose();
  }
  EXPECT_GT(with_ray, 0.9 * pixels.size());
  EXPECT_FALSE(camera.TryUnproject({0, 0})) << "more than 90 degrees off the axis";
  EXPECT_THAT(ErrorMessage([&] { camera.Unproject({0, 0}); }), HasSubstr("no ray"));
}

TEST(Camera, NamesWhatIsWrongWithItsParameters) {
  Camera camera = EurocCam0();
  EXPECT_EQ(ErrorMessage([&] { camera.Check(); }), "no error");
  camera.width = 0;
  EXPECT_THAT(ErrorMessage([&] { camera.Check(); }), HasSubstr("size is 0x480 px"));
  camera = EurocCam0();
  camera.fy = -1;
  EXPECT_THAT(ErrorMessage([&] { camera.Check(); }), HasSubstr("458.654, -1 px"));
  camera = EurocCam0();
  camera.k2 = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ErrorMessage([&] { camera.Check(); }), HasSubstr("a parameter is nan"));
}

}  // namespace
}  // namespace sgf
