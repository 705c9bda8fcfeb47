/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/core/Clock.h>
#include <mrpt/img/TCamera.h>
#include <mrpt/poses/CPose3D.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>

#include <cstdint>

#include <Eigen/Core>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

/** Between sgf's types and MRPT's. */
namespace mrpt::sgf::internal
{
using Matrix6d = Eigen::Matrix<double, 6, 6>;

::sgf::SE3 toSE3(const mrpt::poses::CPose3D& pose);
mrpt::poses::CPose3D toPose(const ::sgf::SE3& T);
bool isFinite(const mrpt::poses::CPose3D& pose);

/** A camera without distortion, or with that by k1, k2, p1, p2. */
mrpt::img::TCamera toTCamera(const ::sgf::Camera& camera);

/** Matrix that carries a tangent vector (translation before rotation) of frame
 * b to frame a: T Exp(v) T^-1 = Exp(Ad v). */
Matrix6d adjoint(const ::sgf::SE3& T_a_b);

/** A pose and its covariance in MRPT's (x y z yaw pitch roll).
 * \param cov of v in T Exp(v), translation (m) before rotation (rad) */
mrpt::poses::CPose3DPDFGaussian toPosePDF(
	const ::sgf::SE3& T, const Matrix6d& cov);

/** Nanoseconds since 1970, as sgf counts time; MRPT counts in steps of 100. */
std::int64_t toNanoseconds(mrpt::Clock::time_point t);
mrpt::Clock::time_point toTimePoint(std::int64_t time_ns);

/** Rotation from the camera's axes (z forward, y down) to those of a robot or
 * a depth sensor (x forward, z up). */
Eigen::Quaterniond forwardFromCamera();

}  // namespace mrpt::sgf::internal
