#include <gtest/gtest.h>

#include <sgf/vio/calibration.h>

namespace sgf::vio {
namespace {

using Eigen::Vector3d;

const SE3 kPose{ExpSO3({0.4, -1.1, 0.7}), {1, -2, 0.5}};
const BodyVelocity kBodyVelocity{{0.8, -0.3, 0.5}, {1.2, -0.4, 0.9}};
const Calibration kCalibration{{ExpSO3({0.05, 0.02, -0.04}), {0.03, -0.02, 0.05}}, 0.012};

/// Difference of poses: rotation on the right, position in the world.
Eigen::Matrix<double, 6, 1> Difference(const SE3& to, const SE3& from) {
  Eigen::Matrix<double, 6, 1> d;
  d << LogSO3(from.R.conjugate() * to.R), to.p - from.p;
  return d;
}

SE3 Moved(const SE3& pose, const Eigen::Matrix<double, 6, 1>& d) {
  return {pose.R * ExpSO3(d.head<3>()), pose.p + d.tail<3>()};
}

TEST(Calibration, IsIdentityWhereTheRigAndTheClockAreRight) {
  EXPECT_TRUE(Calibration().IsIdentity());
  EXPECT_EQ(Difference(AsSeen(kPose, kBodyVelocity, {}), kPose).norm(), 0);
  for (int k = 0; k < kCalibrationParameters; ++k)
    EXPECT_FALSE(Plus({}, 1e-3 * CalibrationVector::Unit(k)).IsIdentity()) << k;
}

TEST(Calibration, PlusAndMinusAreInverse) {
  const CalibrationVector d =
      (CalibrationVector() << 0.1, -0.2, 0.3, 0.4, 0.5, -0.6, 0.007).finished();
  EXPECT_LT((Minus(Plus(kCalibration, d), kCalibration) - d).norm(), 1e-12);
}

// A frame whose time stamp is too early shows the body where it is later.
TEST(Calibration, AFrameOfALateClockIsSeenFromFurtherOn) {
  const SE3 seen = AsSeen(kPose, kBodyVelocity, {SE3(), 0.01});
  EXPECT_LT((seen.p - kPose.p - 0.01 * kBodyVelocity.linear).norm(), 1e-12);
  EXPECT_LT((LogSO3(kPose.R.conjugate() * seen.R) - 0.01 * kBodyVelocity.angular).norm(), 1e-12);
}

TEST(Calibration, DerivativesAreCentralDifferences) {
  const AsSeenJacobian J = JacobianOfAsSeen(kPose, kBodyVelocity, kCalibration);
  constexpr double h = 1e-6;
  for (int k = 0; k < 6; ++k) {
    const Eigen::Matrix<double, 6, 1> d = h * Eigen::Matrix<double, 6, 1>::Unit(k);
    const Eigen::Matrix<double, 6, 1> slope =
        Difference(AsSeen(Moved(kPose, d), kBodyVelocity, kCalibration),
                   AsSeen(Moved(kPose, -d), kBodyVelocity, kCalibration)) /
        (2 * h);
    EXPECT_LT((slope - J.by_pose.col(k)).norm(), 1e-8) << k;
  }
  for (int k = 0; k < kCalibrationParameters; ++k) {
    const CalibrationVector d = h * CalibrationVector::Unit(k);
    const Eigen::Matrix<double, 6, 1> slope =
        Difference(AsSeen(kPose, kBodyVelocity, Plus(kCalibration, d)),
                   AsSeen(kPose, kBodyVelocity, Plus(kCalibration, -d))) /
        (2 * h);
    EXPECT_LT((slope - J.by_calibration.col(k)).norm(), 1e-8) << k;
  }
}

}  // namespace
}  // namespace sgf::vio
