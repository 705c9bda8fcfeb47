#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include <sgf/io/euroc.h>

// Reads a EuRoC sequence under SGF_DATA. Expected numbers were taken from the files by eye and with
// wc.

namespace sgf {
namespace {

TEST(EurocData, MachineHall01) {
  const std::filesystem::path root = std::getenv("SGF_DATA");
  const EurocSequence sequence = ReadEuroc(root / "euroc/MH_01_easy");

  ASSERT_EQ(sequence.images.size(), 2U);
  EXPECT_EQ(sequence.images[0].size(), sequence.images[1].size());
  EXPECT_EQ(sequence.sensors.imu_rate_hz, 200);
  EXPECT_EQ(sequence.sensors.imu_noise.gyroscope_noise_density, 1.6968e-04);
  EXPECT_EQ(sequence.sensors.imu_noise.accelerometer_random_walk, 3.0000e-3);
  EXPECT_GT(sequence.imu.size(), sequence.images[0].size());
  EXPECT_GT(sequence.truth.size(), sequence.images[0].size());

  const EurocCamera& left = sequence.sensors.cameras[0];
  const EurocCamera& right = sequence.sensors.cameras[1];
  EXPECT_EQ(left.camera.width, 752);
  EXPECT_EQ(left.camera.fx, 458.654);
  EXPECT_EQ(left.camera.k1, -0.28340811);
  EXPECT_EQ(right.camera.p2, -3.55590700e-05);
  EXPECT_EQ(left.T_body_cam.p.y(), -0.064676986768);
  const SE3 T_left_right = left.T_body_cam.Inverse() * right.T_body_cam;
  EXPECT_NEAR(T_left_right.p.norm(), 0.11, 0.001) << "the baseline";

  // At rest on average, the accelerometers feel gravity, which points down in the world.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ImuSample& sample : sequence.imu) mean += sample.accel;
  EXPECT_NEAR(mean.norm() / static_cast<double>(sequence.imu.size()), 9.81, 0.5);
}

}  // namespace
}  // namespace sgf
