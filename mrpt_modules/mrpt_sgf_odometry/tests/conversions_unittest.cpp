/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "../src/conversions.h"

#include <gtest/gtest.h>

#include <sgf/core/random.h>

using namespace mrpt::sgf::internal;
using mrpt::poses::CPose3D;
using ::sgf::SE3;

namespace
{
using Vector6d = Eigen::Matrix<double, 6, 1>;

Vector6d normals(uint64_t seed, uint64_t index)
{
	Vector6d v;
	for (int i = 0; i < 6; ++i) v[i] = ::sgf::Gaussian(seed, 6 * index + i);
	return v;
}

// Motion by a small tangent vector, translation before rotation.
SE3 small(const Vector6d& v)
{
	return {::sgf::ExpSO3(v.tail<3>()), v.head<3>()};
}

Vector6d asVector(const CPose3D& p)
{
	Vector6d v;
	v << p.x(), p.y(), p.z(), p.yaw(), p.pitch(), p.roll();
	return v;
}

const SE3 kSome{
	Eigen::Quaterniond(0.8, 0.3, -0.4, 0.2).normalized(),
	Eigen::Vector3d(1, -2, 3)};
}  // namespace

TEST(Conversions, PosesComeBack)
{
	const CPose3D pose(1, 2, 3, 0.4, -0.5, 0.6);
	const CPose3D back = toPose(toSE3(pose));
	EXPECT_LT((asVector(back) - asVector(pose)).norm(), 1e-12);
	const Eigen::Vector3d x(0.3, -0.7, 2);
	const auto byMrpt =
		pose.composePoint(mrpt::math::TPoint3D(x.x(), x.y(), x.z()));
	EXPECT_LT(
		(toSE3(pose) * x - Eigen::Vector3d(byMrpt.x, byMrpt.y, byMrpt.z))
			.norm(),
		1e-12);
}

TEST(Conversions, TimesComeBackInMrptsSteps)
{
	const std::int64_t euroc_ns = 1403636579763555584;
	EXPECT_EQ(toNanoseconds(toTimePoint(euroc_ns)), euroc_ns / 100 * 100);
	EXPECT_NEAR(mrpt::Clock::toDouble(toTimePoint(1'500'000'000)), 1.5, 1e-6);
	EXPECT_EQ(toNanoseconds(mrpt::Clock::fromDouble(2.25)), 2'250'000'000);
}

TEST(Conversions, AdjointCarriesSmallMotions)
{
	const Vector6d v = 1e-6 * normals(1, 0);
	const SE3 carried = kSome * small(v) * kSome.Inverse();
	const Vector6d expected = adjoint(kSome) * v;
	EXPECT_LT((carried.p - expected.head<3>()).norm(), 1e-10);
	EXPECT_LT((::sgf::LogSO3(carried.R) - expected.tail<3>()).norm(), 1e-10);
}

// The covariance of many poses drawn in the tangent space is that which is
// computed for x y z yaw pitch roll.
TEST(Conversions, CovarianceIsThatOfDrawnPoses)
{
	Matrix6d L = Matrix6d::Zero();
	for (int i = 0; i < 6; ++i)
		for (int j = 0; j <= i; ++j)
			L(i, j) = 0.01 * (i == j ? 1 + 0.3 * i
									 : ::sgf::Gaussian(7, 6 * i + j) / 2);
	const auto pdf = toPosePDF(kSome, L * L.transpose());
	const Vector6d mean = asVector(pdf.mean);
	constexpr int kDraws = 40000;
	Matrix6d sum = Matrix6d::Zero();
	for (int i = 0; i < kDraws; ++i)
	{
		const Vector6d d =
			asVector(toPose(kSome * small(L * normals(3, i)))) - mean;
		sum += d * d.transpose();
	}
	const Matrix6d drawn = sum / kDraws;
	const Matrix6d computed = pdf.cov.asEigen();
	for (int i = 0; i < 6; ++i)
		for (int j = 0; j < 6; ++j)
			EXPECT_NEAR(
				computed(i, j), drawn(i, j),
				0.03 * std::sqrt(drawn(i, i) * drawn(j, j)))
				<< i << " " << j;
}

TEST(Conversions, CovarianceStaysFiniteLookingStraightUp)
{
	const SE3 up = toSE3(CPose3D(0, 0, 0, 0.3, -M_PI / 2, 0));
	const auto pdf = toPosePDF(up, Matrix6d::Identity() * 1e-4);
	EXPECT_TRUE(pdf.cov.asEigen().allFinite());
	EXPECT_GT(pdf.cov(3, 3), 1.0);  // yaw is not known any more
}
