/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

#include "conversions.h"

namespace mrpt::sgf::internal
{
/** What is known of a frame. Covariances are of v in T Exp(v), translation (m)
 * before rotation (rad), in the robot's coordinates. */
struct TEstimate
{
	std::int64_t time_ns = 0;
	/** Whether there is a pose; if not, nothing below but times is set */
	bool tracked = false;
	/** Nothing ties the pose to those before: the first frame, or a guess
	 * after a loss */
	bool begins = false;
	::sgf::SE3 T_map_robot;

	/** Frame that the covariance counts from: the number of earlier frames
	 * with \a newAnchor. Not set if it begins. */
	int anchor = -1;
	Matrix6d sinceAnchor = Matrix6d::Zero();
	/** Of the motion since the last frame that was tracked, where it is known
	 * better than by the two frames' anchors */
	std::optional<Matrix6d> sinceLast;
	bool newAnchor = false;

	/** Set if the frame has become a key-frame */
	mrpt::obs::CObservation3DRangeScan::Ptr keyframePoints;
	double inlierShare = 0;
	std::optional<TInertialState> inertial;

	/** Stages and their times, s */
	std::vector<std::pair<std::string, double>> times;
	/** What the user has to know, each said once */
	std::vector<std::string> warnings;
};

/** An estimator behind CSgfOdometry. All processing methods return the estimate
 * of at most one frame, the oldest that has none. Frames may have to wait for
 * the inertial sensor; that of the call need not be the one that is returned.
 * \exception Skipped for an observation that cannot be used; the state is as
 * before
 * \exception std::exception for a frame that was refused */
class CEstimator
{
 public:
	virtual ~CEstimator() = default;

	virtual std::optional<TEstimate> process(
		const mrpt::obs::CObservationStereoImages& obs) = 0;
	virtual std::optional<TEstimate> process(
		const mrpt::obs::CObservation3DRangeScan& obs) = 0;
	virtual std::optional<TEstimate> process(
		const mrpt::obs::CObservationIMU& obs) = 0;

	/** The next frame that waits, with what there is. */
	virtual std::optional<TEstimate> finish() { return {}; }

	/** Lines of text for the user. */
	virtual std::string report() const { return ""; }
};

/** \exception ::sgf::Error for a bad option
 * @{ */
std::unique_ptr<CEstimator> makeStereoEstimator(
	const CSgfOdometry::TParams& params);
std::unique_ptr<CEstimator> makeStereoInertialEstimator(
	const CSgfOdometry::TParams& params);
/** @} */

/** A point that a key-frame sees. */
struct TSeenPoint
{
	Eigen::Vector2d pixel;  //!< px
	Eigen::Vector3d point;  //!< in the camera's coordinates, m
};

/** The points as a range scan without images.
 * \param camera that has seen them, with its pose on the robot */
mrpt::obs::CObservation3DRangeScan::Ptr scanOf(
	const std::vector<TSeenPoint>& points, std::int64_t time_ns,
	const ::sgf::Camera& camera, const ::sgf::SE3& T_robot_cam);

}  // namespace mrpt::sgf::internal
