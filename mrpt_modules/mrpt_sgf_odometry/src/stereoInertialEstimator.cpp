/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/core/format.h>

#include <deque>

#include <sgf/vio/stereo_inertial_odometry.h>

#include "estimator.h"
#include "frameOf.h"
#include "imuOf.h"
#include "parameters.h"

namespace mrpt::sgf::internal
{
using mrpt::math::TVector3D;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationStereoImages;
using ::sgf::ImuSample;
using ::sgf::SE3;
using ::sgf::vio::InitialisationProblem;
using ::sgf::vio::StereoInertialOdometry;
using ::sgf::vio::VioFrameResult;
using ::sgf::vio::VioState;

namespace
{
// A covariance of a pose as sgf::vio has it, rotation before translation in the
// world's axes, for v in T Exp(v).
Matrix6d inTangent(const Matrix6d& cov, const Eigen::Quaterniond& R)
{
	Matrix6d J = Matrix6d::Zero();
	J.topRightCorner<3, 3>() = R.conjugate().toRotationMatrix();
	J.bottomLeftCorner<3, 3>().setIdentity();
	return J * cov * J.transpose();
}

// Covariance of the increment between the poses that were given out. How the
// last one has been corrected since is known, and counts as an error.
Matrix6d ofIncrement(const VioFrameResult& r, const SE3& increment)
{
	const SE3 correction = r.motion.Inverse() * increment;
	Eigen::Matrix<double, 6, 1> v;
	v << correction.p, ::sgf::LogSO3(correction.R);
	return inTangent(r.motion_covariance, r.motion.R) + v * v.transpose();
}

TVector3D toVector(const Eigen::Vector3d& v)
{
	return {v.x(), v.y(), v.z()};
}

// sgf::vio, whose body is the inertial sensor. Frames wait until there are
// measurements up to their time. While no sensor is known, the odometry runs
// on images alone, with the robot as its body; when one comes, it is begun anew
// where the robot is. Anchors are the frames at which the odometry has begun to
// count its uncertainty: when it begins, and when the sensor takes part.
class CStereoInertialEstimator : public CEstimator
{
 public:
	explicit CStereoInertialEstimator(const CSgfOdometry::TParams& params)
		: m_options(vioOptions(params, "parameters")),
		  m_noise(imuNoise(params)),
		  m_maxWaiting(static_cast<size_t>(params.max_waiting_frames))
	{
		if (!m_options.inertial) m_problem = "it is switched off";
	}

	std::optional<TEstimate> process(
		const CObservationStereoImages& obs) override
	{
		TFrame frame = m_frames.make(obs);
		// The images may be those of the observation, whose owner may change
		// them while the frame waits.
		frame.grey = frame.grey.clone();
		frame.right = frame.right.clone();
		m_waiting.push_back(std::move(frame));
		return next(false);
	}

	std::optional<TEstimate> process(const CObservation3DRangeScan&) override
	{
		throw Skipped(
			TSkipReason::UNSUPPORTED_SENSOR,
			"estimator stereo_inertial takes stereo images only");
	}

	std::optional<TEstimate> process(const CObservationIMU& obs) override
	{
		if (!m_options.inertial) return {};
		const auto& pose = obs.sensorPose;
		if (!isFinite(pose))
			throw Skipped(
				TSkipReason::NO_CALIBRATION,
				"pose of the inertial sensor is not finite");
		if (m_sensorPose && *m_sensorPose != pose)
			throw Skipped(
				TSkipReason::CALIBRATION_CHANGED,
				"pose of the inertial sensor differs from that of its first "
				"observation");
		m_samples.push_back(m_imu.read(obs));
		m_sensorPose = pose;
		const double longest_ns = 1e9 * m_options.imu.max_span_s;
		while (m_samples.back().time_ns - m_samples.front().time_ns >
			   longest_ns)
			m_samples.pop_front();
		return next(false);
	}

	std::optional<TEstimate> finish() override { return next(true); }

	std::string report() const override
	{
		std::string text = "inertial sensor: ";
		text += m_active ? "takes part" : "takes no part, " + m_problem;
		if (m_odometry)
		{
			const auto& health = m_odometry->imu_health();
			text += mrpt::format(
				"; measurements: %ld, saturated: %ld, gaps: %ld, frames "
				"without: %zu",
				long(health.taken), long(health.saturated), long(health.gaps),
				m_uncovered);
		}
		return text + "\n";
	}

 private:
	// --- Frames and measurements ---

	std::optional<TEstimate> next(bool atOnce)
	{
		if (m_waiting.empty()) return {};
		const bool covered = !m_options.inertial ||
							 m_imu.last_ns() >= m_waiting.front().time_ns;
		if (!covered && !atOnce && m_waiting.size() <= m_maxWaiting) return {};
		const TFrame frame = std::move(m_waiting.front());
		m_waiting.pop_front();
		return track(frame, covered);
	}

	void begin()
	{
		const SE3 T_robot_body =
			m_sensorPose ? toSE3(*m_sensorPose) : SE3();
		StereoInertialOdometry odometry(
			m_frames.stereoRig(),
			T_robot_body.Inverse() * m_frames.T_robot_cam(), m_noise,
			m_options);
		m_odometry = std::move(odometry);
		m_T_robot_body = T_robot_body;
		m_knowsSensor = m_sensorPose.has_value();
	}

	VioFrameResult run(const TFrame& frame)
	{
		if (m_knowsSensor)
			for (; !m_samples.empty(); m_samples.pop_front())
				m_odometry->AddImu(m_samples.front());
		return m_odometry->Process(frame.time_ns, frame.grey, frame.right);
	}

	TEstimate track(const TFrame& frame, bool covered)
	{
		if (!m_odometry) begin();
		const VioFrameResult r = run(frame);
		TEstimate e;
		e.time_ns = r.time_ns;
		e.times = {
			{"frame", r.times.total_s},
			{"frame.flow", r.times.flow_s},
			{"frame.refinement", r.times.refinement_s},
			{"frame.marginalization", r.times.marginalization_s}};
		warn(r, covered, e);
		m_odometry->TakeFinishedPoints();  // each was given out as it was made
		e.tracked =
			(r.state == VioState::kTracked || r.state == VioState::kPredicted) &&
			r.body.T_world_body.Matrix().allFinite() &&
			r.covariance.allFinite();
		if (!e.tracked) return e;
		setPose(r, e);
		e.inertial = inertialState(r);
		if (r.new_keyframe) e.keyframePoints = keyframePoints(r);
		if (m_sensorPose && !m_knowsSensor) beginWithSensor(frame, e);
		m_active = r.inertial;
		m_anchors += e.newAnchor;
		return e;
	}

	// The same frame is the last one of the old odometry and the first one of
	// the new.
	void beginWithSensor(const TFrame& frame, TEstimate& e)
	{
		begin();
		const VioFrameResult r = run(frame);
		m_T_map_world = e.T_map_robot * T_world_robot(r).Inverse();
		m_last = r.body.T_world_body;
		m_segment = r.segment;
		e.newAnchor = true;
	}

	// --- What comes of a frame ---

	SE3 T_world_robot(const VioFrameResult& r) const
	{
		return r.body.T_world_body * m_T_robot_body.Inverse();
	}

	void setPose(const VioFrameResult& r, TEstimate& e)
	{
		const SE3& T = r.body.T_world_body;
		const Matrix6d A = adjoint(m_T_robot_body);
		if (!m_T_map_world) m_T_map_world = T_world_robot(r).Inverse();
		e.T_map_robot = *m_T_map_world * T_world_robot(r);
		e.begins = !m_last || r.segment != m_segment;
		e.newAnchor = e.begins || (r.inertial && !m_active);
		if (!e.begins)
		{
			e.anchor = m_anchors - 1;
			e.sinceAnchor =
				A * inTangent(r.covariance.topLeftCorner<6, 6>(), T.R) *
				A.transpose();
			e.sinceLast =
				A * ofIncrement(r, m_last->Inverse() * T) * A.transpose();
		}
		const int judged = r.window.sights + r.window.outliers;
		if (judged > 0) e.inlierShare = double(r.window.sights) / judged;
		m_last = T;
		m_segment = r.segment;
	}

	TInertialState inertialState(const VioFrameResult& r) const
	{
		const Eigen::Quaterniond& R = m_T_map_world->R;
		TInertialState state;
		state.active = r.inertial;
		state.predicted = r.state == VioState::kPredicted;
		state.velocity = toVector(R * r.body.velocity);
		state.gyroBias = toVector(r.body.gyro_bias);
		state.accelBias = toVector(r.body.accel_bias);
		state.up = toVector(
			R * (r.R_gravity_world.conjugate() * Eigen::Vector3d::UnitZ()));
		if (!r.inertial) state.problem = m_problem;
		return state;
	}

	// Landmarks that were made in this frame.
	CObservation3DRangeScan::Ptr keyframePoints(const VioFrameResult& r) const
	{
		constexpr double kMostRelative = 0.1;  // deviation of the depth
		const auto& camera = m_frames.stereoRig().left;
		const SE3 T_cam_world =
			(T_world_robot(r) * m_frames.T_robot_cam()).Inverse();
		std::vector<TSeenPoint> points;
		for (const auto& p : m_odometry->ActivePoints())
		{
			const double limit = kMostRelative * p.inverse_depth;
			if (p.host_ns != r.time_ns ||
				p.inverse_depth_variance > limit * limit)
				continue;
			const Eigen::Vector3d point = T_cam_world * p.position;
			points.push_back({camera.Project(point), point});
		}
		return scanOf(points, r.time_ns, camera, m_frames.T_robot_cam());
	}

	void warn(const VioFrameResult& r, bool covered, TEstimate& e)
	{
		if (!covered && ++m_uncovered == 1 && m_sensorPose)
			e.warnings.push_back(
				"There are no inertial measurements up to a frame's time: "
				"images alone");
		if (!m_options.inertial) return;
		std::string problem = m_problem;
		if (!m_sensorPose)
			problem = "there are no inertial observations";
		else if (r.inertial)
			problem = Explain(InitialisationProblem::kTooLittleData);
		else if (r.problem != InitialisationProblem::kNone)
			problem = Explain(r.problem);
		if (problem == m_problem) return;
		m_problem = problem;
		if (r.problem != InitialisationProblem::kTooLittleData || !m_sensorPose)
			e.warnings.push_back(
				"The inertial sensor takes no part: " + problem);
	}

	::sgf::vio::VioOptions m_options;
	::sgf::ImuNoise m_noise;
	size_t m_maxWaiting;
	CFrameMaker m_frames{CFrameMaker::TImages::RAW};
	std::deque<TFrame> m_waiting;

	CImuReader m_imu;
	std::optional<mrpt::poses::CPose3D> m_sensorPose;
	std::deque<ImuSample> m_samples;  // not yet handed over
	size_t m_uncovered = 0;           // frames

	std::optional<StereoInertialOdometry> m_odometry;
	bool m_knowsSensor = false;  // the odometry does
	SE3 m_T_robot_body;
	std::optional<SE3> m_T_map_world;
	std::optional<SE3> m_last;  // T_world_body of the last frame with a pose
	int m_segment = 0, m_anchors = 0;
	bool m_active = false;
	std::string m_problem = Explain(InitialisationProblem::kTooLittleData);
};

}  // namespace

std::unique_ptr<CEstimator> makeStereoInertialEstimator(
	const CSgfOdometry::TParams& params)
{
	return std::make_unique<CStereoInertialEstimator>(params);
}

}  // namespace mrpt::sgf::internal
