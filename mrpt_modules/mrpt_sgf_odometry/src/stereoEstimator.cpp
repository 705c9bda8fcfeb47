/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <sgf/odometry/odometry.h>

#include "estimator.h"
#include "frameOf.h"
#include "imuOf.h"
#include "parameters.h"

namespace mrpt::sgf::internal
{
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationStereoImages;
using ::sgf::SE3;
using ::sgf::odometry::FrameResult;
using ::sgf::odometry::TrackingState;

namespace
{
bool believable(const FrameResult& r)
{
	return r.state != TrackingState::kLost && r.T_world_cam.p.allFinite() &&
		   r.T_world_cam.R.coeffs().allFinite() && r.covariance.allFinite();
}

// Direct alignment with key-frames, from stereo images or images with depth.
// Anchors are the key-frames.
class CStereoEstimator : public CEstimator
{
 public:
	explicit CStereoEstimator(const CSgfOdometry::TParams& params)
		: m_options(odometryOptions(params, "parameters")),
		  m_useImu(params.use_imu)
	{
	}

	std::optional<TEstimate> process(
		const CObservationStereoImages& obs) override
	{
		return track(m_frames.make(obs));
	}

	std::optional<TEstimate> process(
		const CObservation3DRangeScan& obs) override
	{
		return track(m_frames.make(obs));
	}

	std::optional<TEstimate> process(const CObservationIMU& obs) override
	{
		// Before the first frame there is nothing to predict from.
		if (!m_useImu || !m_odometry) return {};
		const ::sgf::ImuSample sample = m_imu.readRates(obs);
		const Eigen::Quaterniond R_cam_sensor =
			m_frames.T_robot_cam().R.conjugate() * toSE3(obs.sensorPose).R;
		m_odometry->ProcessGyro(sample.time_ns, R_cam_sensor * sample.gyro);
		return {};
	}

 private:
	TEstimate track(const TFrame& frame)
	{
		if (!m_odometry) m_odometry.emplace(m_frames.rig(), m_options);
		const FrameResult r = frame.depth.empty()
								  ? m_odometry->ProcessStereo(
										frame.time_ns, frame.grey, frame.right)
								  : m_odometry->ProcessDepth(
										frame.time_ns, frame.grey, frame.depth);
		TEstimate e;
		e.time_ns = r.time_ns;
		e.times = {
			{"frame", r.times.total_s},
			{"frame.pyramid", r.times.pyramid_s},
			{"frame.alignment", r.times.alignment_s},
			{"frame.depth", r.times.depth_s},
			{"frame.selection", r.times.selection_s}};
		e.inlierShare = r.inlier_share;
		e.tracked = believable(r);
		if (!e.tracked) return e;
		const SE3& T_robot_cam = m_frames.T_robot_cam();
		const Matrix6d A = adjoint(T_robot_cam);
		e.T_map_robot = T_robot_cam * r.T_world_cam * T_robot_cam.Inverse();
		e.begins = r.state == TrackingState::kInitialised;
		e.anchor = r.keyframe;
		e.sinceAnchor = A * r.covariance * A.transpose();
		e.newAnchor = r.new_keyframe;
		if (r.new_keyframe) e.keyframePoints = keyframePoints();
		return e;
	}

	CObservation3DRangeScan::Ptr keyframePoints() const
	{
		const auto& keyframe = m_odometry->LastKeyframe();
		const auto& camera = m_frames.rig().camera;
		std::vector<TSeenPoint> points;
		for (const auto& [pixel, inverse_depth, slope] : keyframe.points)
		{
			const Eigen::Vector2d at = pixel.cast<double>();
			points.push_back({at, camera.Unproject(at) / inverse_depth});
		}
		return scanOf(
			points, keyframe.time_ns, camera, m_frames.T_robot_cam());
	}

	::sgf::odometry::OdometryOptions m_options;
	bool m_useImu;
	CFrameMaker m_frames;
	CImuReader m_imu;
	std::optional<::sgf::odometry::Odometry> m_odometry;
};

}  // namespace

std::unique_ptr<CEstimator> makeStereoEstimator(
	const CSgfOdometry::TParams& params)
{
	return std::make_unique<CStereoEstimator>(params);
}

}  // namespace mrpt::sgf::internal
