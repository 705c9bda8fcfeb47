/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "estimator.h"

#include <algorithm>

namespace mrpt::sgf::internal
{
mrpt::obs::CObservation3DRangeScan::Ptr scanOf(
	const std::vector<TSeenPoint>& points, std::int64_t time_ns,
	const ::sgf::Camera& camera, const ::sgf::SE3& T_robot_cam)
{
	auto scan = mrpt::obs::CObservation3DRangeScan::Create();
	const Eigen::Quaterniond R_sensor_cam = forwardFromCamera();
	scan->timestamp = toTimePoint(time_ns);
	scan->sensorPose = toPose(
		T_robot_cam *
		::sgf::SE3{R_sensor_cam.conjugate(), Eigen::Vector3d::Zero()});
	scan->cameraParams = scan->cameraParamsIntensity = toTCamera(camera);
	scan->hasPoints3D = true;
	scan->resizePoints3DVectors(points.size());
	for (size_t i = 0; i < points.size(); ++i)
	{
		const auto& [pixel, point] = points[i];
		const Eigen::Vector3f p = (R_sensor_cam * point).cast<float>();
		scan->points3D_x[i] = p.x();
		scan->points3D_y[i] = p.y();
		scan->points3D_z[i] = p.z();
		scan->points3D_idxs_x[i] = static_cast<uint16_t>(pixel.x() + 0.5);
		scan->points3D_idxs_y[i] = static_cast<uint16_t>(pixel.y() + 0.5);
		scan->maxRange = std::max(scan->maxRange, p.x());
	}
	return scan;
}

}  // namespace mrpt::sgf::internal
