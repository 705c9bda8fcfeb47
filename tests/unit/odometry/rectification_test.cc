#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/odometry/rectification.h>
#include <sgf/synth/sequence.h>

#include "support/error_message.h"

namespace sgf::odometry {
namespace {

using ::testing::HasSubstr;

struct Rig {
  Camera left, right;
  SE3 T_left_right;

  StereoRectifier Rectifier() const { return {left, right, T_left_right}; }
};

// EuRoC's own calibration: distorted, with principal points 13 px apart in x and 7 px in y.
Rig EurocRig() {
  const auto cameras = synth::RigCameras(synth::RigModel::kEuroc);
  return {cameras[0].camera, cameras[1].camera,
          cameras[0].T_body_cam.Inverse() * cameras[1].T_body_cam};
}

Rig PinholeRig() {
  const Camera camera{64, 48, 50, 51, 31, 25};
  return {camera, camera, {Eigen::Quaterniond::Identity(), {0.25, 0, 0}}};
}

// Cameras a few degrees and centimetres off EuRoC's.
Rig RandomRig() {
  const auto some = [](double range) { return *rc::gen::inRange(-1000, 1001) * range / 1000; };
  Rig rig = EurocRig();
  rig.T_left_right.R = ExpSO3({some(0.1), some(0.1), some(0.1)}) * rig.T_left_right.R;
  rig.T_left_right.p += Eigen::Vector3d(some(0.03), some(0.03), some(0.03));
  rig.right.fx += some(40);
  rig.right.cy += some(20);
  rig.left.k1 += some(0.05);
  return rig;
}

RC_GTEST_PROP(StereoRectifierProperty, BringsAPointToTheSameRow, ()) {
  const Rig rig = RandomRig();
  const StereoRectifier rectifier = rig.Rectifier();
  const auto some = [] { return *rc::gen::inRange(-1000, 1001) / 1000.0; };
  const double depth = 3 + 2.5 * some();
  const Eigen::Vector3d in_left(depth * some() * 0.5, depth * some() * 0.3, depth);
  const Eigen::Vector3d in_right = rig.T_left_right.Inverse() * in_left;

  const Eigen::Vector3d left = rectifier.R_left_rect().transpose() * in_left;
  const Eigen::Vector2d left_px = rectifier.camera().Project(left);
  const Eigen::Vector2d right_px =
      rectifier.camera().Project(rectifier.R_right_rect().transpose() * in_right);
  RC_ASSERT(std::abs(left_px.y() - right_px.y()) < 1e-6);
  const double disparity = rectifier.camera().fx * rectifier.baseline_m() / left.z();
  RC_ASSERT(std::abs(left_px.x() - right_px.x() - disparity) < 1e-6);
}

// How far the positions in a raw image, of all rectified pixels, stay inside of it, px.
double SmallestMargin(const Camera& rectified, const Camera& raw, const Eigen::Matrix3d& R) {
  double margin = 1e9;
  for (int v = 0; v < rectified.height; ++v)
    for (int u = 0; u < rectified.width; ++u) {
      const Eigen::Vector2d at = raw.Project(R * rectified.Unproject({u, v}));
      margin = std::min({margin, at.x(), at.y(), raw.width - 1 - at.x(), raw.height - 1 - at.y()});
    }
  return margin;
}

TEST(StereoRectifier, HasTheWidestViewWithoutBlackBorder) {
  const Rig rig = EurocRig();
  const StereoRectifier rectifier = rig.Rectifier();
  const Camera& camera = rectifier.camera();
  const double margin = std::min(SmallestMargin(camera, rig.left, rectifier.R_left_rect()),
                                 SmallestMargin(camera, rig.right, rectifier.R_right_rect()));
  EXPECT_GT(margin, -1e-3) << "every pixel has a value";
  EXPECT_LT(margin, 1e-3) << "a smaller focal length would lose one";
  EXPECT_EQ(camera.width, 752);
  EXPECT_EQ(camera.fx, camera.fy);
  EXPECT_FALSE(camera.distorted());
}

TEST(StereoRectifier, HasARotationAndTheLengthOfTheBaseline) {
  const Rig rig = EurocRig();
  const StereoRectifier rectifier = rig.Rectifier();
  const Eigen::Matrix3d& R = rectifier.R_left_rect();
  EXPECT_NEAR((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
  EXPECT_NEAR(R.determinant(), 1, 1e-14);
  EXPECT_LT(std::acos((R.trace() - 1) / 2), 0.02) << "EuRoC's cameras are a degree off at most";
  EXPECT_EQ(rectifier.baseline_m(), rig.T_left_right.p.norm());
}

// Images whose grey level is the column (or row): rectified, they say where a pixel comes from.
TEST(StereoRectifier, TakesEachPixelFromWhereItIsSeen) {
  const Rig rig = EurocRig();
  const StereoRectifier rectifier = rig.Rectifier();
  cv::Mat1f columns(480, 752), rows(480, 752);
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 752; ++x) {
      columns(y, x) = static_cast<float>(x);
      rows(y, x) = static_cast<float>(y);
    }
  const auto [left_x, right_x] = rectifier.Rectify(columns, columns);
  const auto [left_y, right_y] = rectifier.Rectify(rows, rows);
  const auto check = [&](const cv::Mat& x, const cv::Mat& y, const Camera& raw,
                         const Eigen::Matrix3d& R) {
    constexpr double kStep = 1.0 / 32;  // OpenCV's table of positions
    for (int v = 0; v < 480; v += 37)
      for (int u = 0; u < 752; u += 37) {
        const Eigen::Vector2d at = raw.Project(R * rectifier.camera().Unproject({u, v}));
        EXPECT_NEAR(x.at<float>(v, u), at.x(), kStep);
        EXPECT_NEAR(y.at<float>(v, u), at.y(), kStep);
      }
  };
  check(left_x, left_y, rig.left, rectifier.R_left_rect());
  check(right_x, right_y, rig.right, rectifier.R_right_rect());
}

TEST(StereoRectifier, LeavesRectifiedPairsAsTheyAre) {
  const StereoRectifier rectifier = PinholeRig().Rectifier();
  EXPECT_EQ(rectifier.camera().fx, 50);
  EXPECT_EQ(rectifier.camera().fy, 51);
  EXPECT_EQ(rectifier.camera().cx, 31);
  EXPECT_EQ(rectifier.baseline_m(), 0.25);
  EXPECT_EQ(rectifier.R_left_rect(), Eigen::Matrix3d::Identity());
  const cv::Mat left(48, 64, CV_8UC1, cv::Scalar(1)), right(48, 64, CV_8UC1, cv::Scalar(2));
  const auto [a, b] = rectifier.Rectify(left, right);
  EXPECT_EQ(a.data, left.data);
  EXPECT_EQ(b.data, right.data);
}

TEST(StereoRectifier, TakesCamerasOfDifferentSizes) {
  Rig rig = PinholeRig();
  rig.right = {128, 96, 100, 102, 62.5, 50.5};
  const auto [left, right] =
      rig.Rectifier().Rectify(cv::Mat1b(48, 64, uchar{1}), cv::Mat1b(96, 128, uchar{2}));
  EXPECT_EQ(left.size(), cv::Size(64, 48));
  EXPECT_EQ(right.size(), cv::Size(64, 48));
}

TEST(StereoRectifier, ReportsWhatIsNoPair) {
  const auto message = [](const auto& change) {
    Rig rig = PinholeRig();
    change(rig);
    return ErrorMessage([&] { rig.Rectifier(); });
  };
  EXPECT_THAT(message([](Rig& rig) { rig.T_left_right.p.x() = -0.25; }),
              HasSubstr("the right camera is at (-0.25, 0, 0) m"));
  EXPECT_THAT(message([](Rig& rig) {
                rig.T_left_right.p = {0, 0.25, 0};
              }),
              HasSubstr("has to be on its right"));
  EXPECT_THAT(message([](Rig& rig) {
                rig.T_left_right.p = {0, 0, 0};
              }),
              HasSubstr("has to be on its right"));
  EXPECT_THAT(message([](Rig& rig) { rig.right.fx = 0; }), HasSubstr("focal lengths are 0, 51"));
  EXPECT_THAT(message([](Rig& rig) {
                rig.T_left_right.R = ExpSO3({1.2, 0, 0});
              }),
              HasSubstr("have no common view"));
  EXPECT_THAT(message([](Rig& rig) {
                rig.T_left_right.R = ExpSO3({0, 3, 0});
              }),
              HasSubstr("looks away from the common view"));
}

TEST(StereoRectifier, ReportsImagesOfAnotherSize) {
  const StereoRectifier rectifier = PinholeRig().Rectifier();
  const cv::Mat1b good(48, 64), bad(48, 63);
  EXPECT_EQ(ErrorMessage([&] { rectifier.Rectify(bad, good); }),
            "left image: image is 63x48, but the camera has 64x48 px");
  EXPECT_THAT(ErrorMessage([&] { rectifier.Rectify(good, bad); }), HasSubstr("right image"));
}

TEST(Undistorter, ShowsRaysWhereTheIdealCameraHasThem) {
  const Camera raw = EurocRig().left;
  const Undistorter undistorter(raw);
  const Camera& ideal = undistorter.camera();
  EXPECT_FALSE(ideal.distorted());
  EXPECT_EQ(ideal.fx, ideal.fy);
  // A raw image whose grey level is the ray's x.
  cv::Mat1f image(raw.height, raw.width);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image(y, x) = static_cast<float>(raw.Unproject({x, y}).x());
  const cv::Mat1f shown = undistorter.Undistort(image);
  ASSERT_EQ(shown.size(), image.size());
  for (int y = 0; y < shown.rows; y += 7)
    for (int x = 0; x < shown.cols; x += 7)
      EXPECT_NEAR(shown(y, x), ideal.Unproject({x, y}).x(), 2e-4) << x << ", " << y;
}

TEST(Undistorter, TakesAFisheyeLensThatSeesSideways) {
  // The wide lens of TUM's monocular benchmark: its corners are more than 90 degrees off the axis.
  const Camera raw{.width = 640,
                   .height = 512,
                   .fx = 0.349153 * 640,
                   .fy = 0.436593 * 512,
                   .cx = 0.493140 * 640 - 0.5,
                   .cy = 0.499021 * 512 - 0.5,
                   .omega = 0.933271};
  EXPECT_FALSE(raw.TryUnproject({0, 0}));
  const Undistorter undistorter(raw);
  const Camera& ideal = undistorter.camera();
  for (const auto& corner : {Eigen::Vector2d(0, 0), Eigen::Vector2d(639, 511)}) {
    const Eigen::Vector2d from = raw.Project(ideal.Unproject(corner));
    EXPECT_TRUE(from.x() > -0.5 && from.y() > -0.5 && from.x() < 639.5 && from.y() < 511.5);
  }
}

TEST(Undistorter, KeepsAnIdealCamera) {
  const Camera ideal = PinholeRig().left;
  const Undistorter undistorter(ideal);
  const cv::Mat1b image(ideal.height, ideal.width, uint8_t{7});
  EXPECT_EQ(undistorter.Undistort(image).data, image.data);
  EXPECT_EQ(undistorter.camera().fx, ideal.fx);
}

TEST(Undistorter, RefusesAnImageOfAnotherSize) {
  const Undistorter undistorter(PinholeRig().left);
  EXPECT_THAT(ErrorMessage([&] { undistorter.Undistort(cv::Mat1b(8, 9)); }), HasSubstr("9x8"));
}

}  // namespace
}  // namespace sgf::odometry
