/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/core/exceptions.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <vector>

#include <sgf/io/trajectory.h>

#include "conversions.h"

namespace mrpt::sgf
{
using namespace internal;

mrpt::obs::CActionRobotMovement3D TResult::asAction() const
{
	ASSERTMSG_(increment, "frame without increment");
	mrpt::obs::CActionRobotMovement3D action;
	action.timestamp = timestamp;
	action.poseChange = *increment;
	action.rawOdometryIncrementReading = increment->mean;
	action.estimationMethod =
		mrpt::obs::CActionRobotMovement3D::emVisualOdometry;
	return action;
}

mrpt::obs::CObservationRobotPose::Ptr TResult::asRobotPose(
	const std::string& sensorLabel) const
{
	ASSERTMSG_(pose, "frame without pose");
	auto obs = mrpt::obs::CObservationRobotPose::Create();
	obs->timestamp = timestamp;
	obs->sensorLabel = sensorLabel;
	obs->pose = *pose;
	return obs;
}

mrpt::obs::CObservationOdometry::Ptr TResult::asOdometry(
	const std::string& sensorLabel) const
{
	ASSERTMSG_(pose, "frame without pose");
	auto obs = mrpt::obs::CObservationOdometry::Create();
	obs->timestamp = timestamp;
	obs->sensorLabel = sensorLabel;
	obs->odometry = mrpt::poses::CPose2D(pose->mean);
	return obs;
}

mrpt::obs::CSensoryFrame::Ptr TResult::asSensoryFrame(
	const std::string& sensorLabel) const
{
	auto frame = mrpt::obs::CSensoryFrame::Create();
	if (pose) frame->insert(asRobotPose(sensorLabel));
	if (keyframePoints) frame->insert(keyframePoints);
	return frame;
}

void saveTrajectoryTUM(
	const mrpt::poses::CPose3DInterpolator& path, const std::string& file)
{
	std::vector<::sgf::TimedPose> poses;
	for (const auto& [time, pose] : path)
		poses.push_back(
			{toNanoseconds(time), toSE3(mrpt::poses::CPose3D(pose))});
	::sgf::WriteTrajectory(file, poses);
}

}  // namespace mrpt::sgf
