/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "conversions.h"

#include <algorithm>
#include <cmath>

namespace mrpt::sgf::internal
{
namespace
{
Eigen::Matrix3d cross(const Eigen::Vector3d& v)
{
	Eigen::Matrix3d m;
	m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
	return m;
}

// The inverse of the right Jacobian of yaw, pitch and roll: how they change by
// a small rotation vector in the turned frame. Near pitch +-90 degrees yaw and
// roll are all but the same rotation; their variance is bounded there, to stay
// a number.
Eigen::Matrix3d inverseRightJacobian(const mrpt::poses::CPose3D& pose)
{
	constexpr double kSmallestCosine = 1e-3;
	const double sp = std::sin(pose.pitch());
	const double cp = std::max(std::cos(pose.pitch()), kSmallestCosine);
	const double sr = std::sin(pose.roll()), cr = std::cos(pose.roll());
	Eigen::Matrix3d J;
	J << 0, sr / cp, cr / cp, 0, cr, -sr, 1, sr * sp / cp, cr * sp / cp;
	return J;
}

// Blocks for translation and rotation, which do not mix.
Matrix6d blocks(const Eigen::Matrix3d& upper, const Eigen::Matrix3d& lower)
{
	Matrix6d m = Matrix6d::Zero();
	m.topLeftCorner<3, 3>() = upper;
	m.bottomRightCorner<3, 3>() = lower;
	return m;
}

// Step of MRPT's clock, and what it counts from: 1 January 1601.
constexpr std::int64_t kTick_ns = 100;
constexpr std::int64_t kEpochTicks = 11644473600LL * 10'000'000LL;

}  // namespace

::sgf::SE3 toSE3(const mrpt::poses::CPose3D& pose)
{
	const Eigen::Matrix3d R = pose.getRotationMatrix().asEigen();
	return {
		Eigen::Quaterniond(R).normalized(),
		Eigen::Vector3d(pose.x(), pose.y(), pose.z())};
}

mrpt::poses::CPose3D toPose(const ::sgf::SE3& T)
{
	mrpt::math::CMatrixDouble44 m;
	m.asEigen() = T.Matrix();
	return mrpt::poses::CPose3D(m);
}

bool isFinite(const mrpt::poses::CPose3D& pose)
{
	return pose.getHomogeneousMatrixVal<mrpt::math::CMatrixDouble44>()
		.asEigen()
		.allFinite();
}

mrpt::img::TCamera toTCamera(const ::sgf::Camera& in)
{
	mrpt::img::TCamera out;
	out.ncols = in.width;
	out.nrows = in.height;
	out.setIntrinsicParamsFromValues(in.fx, in.fy, in.cx, in.cy);
	if (in.distorted()) out.setDistortionPlumbBob(in.k1, in.k2, in.p1, in.p2);
	return out;
}

Matrix6d adjoint(const ::sgf::SE3& T_a_b)
{
	const Eigen::Matrix3d R = T_a_b.R.toRotationMatrix();
	Matrix6d m = blocks(R, R);
	m.topRightCorner<3, 3>() = cross(T_a_b.p) * R;
	return m;
}

mrpt::poses::CPose3DPDFGaussian toPosePDF(
	const ::sgf::SE3& T, const Matrix6d& cov)
{
	mrpt::poses::CPose3DPDFGaussian pdf(toPose(T));
	const Matrix6d J =
		blocks(T.R.toRotationMatrix(), inverseRightJacobian(pdf.mean));
	const Matrix6d m = J * cov * J.transpose();
	pdf.cov.asEigen() = (m + m.transpose()) / 2;
	return pdf;
}

std::int64_t toNanoseconds(mrpt::Clock::time_point t)
{
	return (t.time_since_epoch().count() - kEpochTicks) * kTick_ns;
}

mrpt::Clock::time_point toTimePoint(std::int64_t time_ns)
{
	return mrpt::Clock::time_point(
		mrpt::Clock::duration(time_ns / kTick_ns + kEpochTicks));
}

Eigen::Quaterniond forwardFromCamera()
{
	Eigen::Matrix3d R;
	R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
	return Eigen::Quaterniond(R);
}

}  // namespace mrpt::sgf::internal
