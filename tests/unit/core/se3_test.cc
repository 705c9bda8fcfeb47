#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <sgf/core/random.h>
#include <sgf/core/se3.h>

namespace sgf {
namespace {

constexpr double kPi = std::numbers::pi;

std::vector<Eigen::Vector3d> Axes() {
  std::vector<Eigen::Vector3d> axes = {Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitY(),
                                       Eigen::Vector3d::UnitZ()};
  for (int i = 0; i < 20; ++i)
    axes.push_back(
        Eigen::Vector3d(Gaussian(1, 3 * i), Gaussian(1, 3 * i + 1), Gaussian(1, 3 * i + 2))
            .normalized());
  return axes;
}

// On both sides of the angles at which the functions change to a series, and up to half a turn.
const std::vector<double> kAngles = {0,       1e-300, 1e-12,      1e-7,       9.99e-7,    1.01e-6,
                                     2.1e-6,  9.9e-5, 1.01e-4,    0.1,        1,          3,
                                     kPi / 2, 3.14,   kPi - 1e-6, kPi - 1e-9, kPi - 1e-14};

SE3 SomeMotion(int i) {
  return {ExpSO3(Eigen::Vector3d(Gaussian(i, 0), Gaussian(i, 1), Gaussian(i, 2))),
          Eigen::Vector3d(Gaussian(i, 3), Gaussian(i, 4), Gaussian(i, 5))};
}

TEST(SE3, ExpIsTheAxisAngleQuaternion) {
  for (const auto& axis : Axes())
    for (const double angle : kAngles) {
      const Eigen::Quaterniond q = ExpSO3(angle * axis);
      EXPECT_NEAR(q.w(), std::cos(angle / 2), 1e-15);
      EXPECT_LE((q.vec() - std::sin(angle / 2) * axis).norm(), 4e-16 * std::sin(angle / 2));
    }
}

TEST(SE3, LogInvertsExpToRoundingFromZeroToHalfATurn) {
  for (const auto& axis : Axes())
    for (const double angle : kAngles) {
      const Eigen::Vector3d w = angle * axis;
      EXPECT_LE((LogSO3(ExpSO3(w)) - w).norm(), 1e-15 * angle) << "angle " << angle;
    }
}

TEST(SE3, LogOfExactlyHalfATurnHasNormPi) {
  for (const double w : {0.0, -0.0})
    EXPECT_DOUBLE_EQ(LogSO3(Eigen::Quaterniond(w, 0.6, 0, -0.8)).norm(), kPi);
}

TEST(SE3, LogDoesNotDependOnTheQuaternionsSign) {
  for (int i = 0; i < 50; ++i) {
    const Eigen::Quaterniond q = SomeMotion(i).R;
    EXPECT_EQ(LogSO3(q), LogSO3(Eigen::Quaterniond(-q.coeffs())));
    EXPECT_LE(LogSO3(q).norm(), kPi);
  }
}

TEST(SE3, LogOfMoreThanHalfATurnGoesTheShortWay) {
  const Eigen::Vector3d axis(0, 0.6, 0.8);
  EXPECT_NEAR((LogSO3(ExpSO3(1.5 * kPi * axis)) + 0.5 * kPi * axis).norm(), 0, 1e-15);
}

TEST(SE3, HatIsTheCrossProduct) {
  const Eigen::Vector3d w(1, -2, 3), x(0.3, 0.5, -0.7);
  EXPECT_EQ(HatSO3(w) * x, w.cross(x));
}

TEST(SE3, RightJacobianIsTheDerivativeOfExp) {
  for (const auto& axis : Axes())
    for (const double angle : {0.0, 1e-7, 0.0199, 0.0201, 0.1, 1.0, 3.0}) {
      const Eigen::Vector3d w = angle * axis;
      Eigen::Matrix3d numeric;
      constexpr double kStep = 1e-5;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(k);
        numeric.col(k) = LogSO3(ExpSO3(w - d).conjugate() * ExpSO3(w + d)) / (2 * kStep);
      }
      EXPECT_LT((RightJacobianSO3(w) - numeric).norm(), 1e-9) << "angle " << angle;
      EXPECT_LT(
          (RightJacobianSO3(w) * InverseRightJacobianSO3(w) - Eigen::Matrix3d::Identity()).norm(),
          3e-14)
          << "angle " << angle;
    }
}

TEST(SE3, ProductAndInverseAreThoseOfTheMatrices) {
  for (int i = 0; i < 20; ++i) {
    const SE3 a = SomeMotion(2 * i), b = SomeMotion(2 * i + 1);
    EXPECT_TRUE((a * b).Matrix().isApprox(a.Matrix() * b.Matrix(), 1e-15));
    EXPECT_TRUE((a.Inverse().Matrix() * a.Matrix()).isIdentity(1e-14));
    const Eigen::Vector3d x(1, -2, 3);
    EXPECT_LE((a * x - (a.Matrix() * x.homogeneous()).head<3>()).norm(), 1e-14);
  }
}

TEST(SE3, RotationStaysAUnitQuaternionOverManyProducts) {
  SE3 motion;
  for (int i = 0; i < 10000; ++i) motion = motion * SomeMotion(i % 7);
  EXPECT_NEAR(motion.R.norm(), 1, 1e-15);
}

}  // namespace
}  // namespace sgf
