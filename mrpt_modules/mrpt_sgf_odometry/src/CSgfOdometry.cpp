/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/sgf/CSgfOdometry.h>

#include <mrpt/core/exceptions.h>

#include <sstream>
#include <vector>

#include <sgf/odometry/odometry.h>

#include "conversions.h"
#include "frameOf.h"
#include "messageOf.h"
#include "parameters.h"

namespace mrpt::sgf
{
using namespace internal;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationStereoImages;
using ::sgf::SE3;
using ::sgf::odometry::FrameResult;
using ::sgf::odometry::Keyframe;
using ::sgf::odometry::TrackingState;

namespace
{
constexpr std::array kReasons = {
	"stereo observation without right image",
	"range scan without depth",
	"observation without intensity image",
	"external image that cannot be loaded",
	"image of another size than calibrated",
	"observation without calibration",
	"calibration that is not supported",
	"calibration other than that of the first frame",
	"observation without time stamp",
	"time stamp not after the last one",
	"inertial observation without angular rates",
	"observation that the odometry refused"};
static_assert(kReasons.size() == static_cast<size_t>(TSkipReason::COUNT));

// Covariances are of v in T_map_robot Exp(v), translation (m) before rotation
// (rad), in the robot's coordinates.

struct TKeyframe
{
	SE3 T_map_robot;
	Matrix6d covariance;
};

struct TTracked
{
	std::int64_t time_ns = 0;
	SE3 T_map_robot;
	Matrix6d covariance = Matrix6d::Zero();  // since the first frame
	int keyframe = -1;                       // it was aligned with
	Matrix6d sinceKeyframe = Matrix6d::Zero();
	int asKeyframe = -1;  // index of the key-frame that it has become
};

// Covariance after a motion, by what it was before and that of the motion.
Matrix6d moved(
	const Matrix6d& before, const SE3& motion, const Matrix6d& ofMotion)
{
	const Matrix6d A = adjoint(motion.Inverse());
	return A * before * A.transpose() + ofMotion;
}

// Covariance of the motion from one frame to another. Errors since a common
// key-frame are taken as independent, which they are not quite: its depths are
// common to them.
Matrix6d ofMotion(const TTracked& from, const TTracked& to, const SE3& motion)
{
	if (from.asKeyframe >= 0 && from.asKeyframe == to.keyframe)
		return to.sinceKeyframe;
	if (from.keyframe == to.keyframe)
		return moved(from.sinceKeyframe, motion, to.sinceKeyframe);
	// Found again from an older key-frame: an upper bound.
	return moved(from.covariance, motion, to.covariance);
}

bool believable(const FrameResult& r)
{
	return r.state != TrackingState::kLost && r.T_world_cam.p.allFinite() &&
		   r.T_world_cam.R.coeffs().allFinite() && r.covariance.allFinite();
}

}  // namespace

const char* describe(TSkipReason reason)
{
	return kReasons.at(static_cast<size_t>(reason));
}

// ---------------------------------------------------------------------------
// State

struct CSgfOdometry::Impl
{
	CFrameMaker frames;
	std::optional<::sgf::odometry::Odometry> odometry;
	std::optional<std::string> label;
	std::int64_t lastFrame_ns = 0, lastRates_ns = 0;

	std::vector<TKeyframe> keyframes;
	std::optional<TTracked> last;  // frame that was tracked
	size_t frameCount = 0, lostCount = 0, restarts = 0, gaps = 0;
	std::array<size_t, static_cast<size_t>(TSkipReason::COUNT)> skipped{};

	mrpt::poses::CPose3DInterpolator trajectory;
	mrpt::maps::CSimpleMap map;
	mrpt::system::CTimeLogger timer{true, "CSgfOdometry"};

	// The logger would print when it goes.
	~Impl() { timer.clear(true); }

	void checkTime(mrpt::Clock::time_point stamp) const;
	FrameResult align(const TFrame& frame, const TParams& params);
	TTracked follow(
		const FrameResult& r, const SE3& T_map_robot, const TParams& params);
	TTracked restart(
		const FrameResult& r, const SE3& T_map_robot, const TParams& params);
	TResult take(const FrameResult& r, const TParams& params);
	void insertIntoMap(const TResult& result);
	void insertRates(const CObservationIMU& obs);
	void logTimes(const ::sgf::odometry::StageTimes& times);
	CObservation3DRangeScan::Ptr keyframePoints() const;
};

CSgfOdometry::CSgfOdometry()
	: mrpt::system::COutputLogger("CSgfOdometry"),
	  m_impl(std::make_unique<Impl>())
{
}
CSgfOdometry::~CSgfOdometry() = default;
CSgfOdometry::CSgfOdometry(CSgfOdometry&&) noexcept = default;
CSgfOdometry& CSgfOdometry::operator=(CSgfOdometry&&) noexcept = default;

void CSgfOdometry::reset()
{
	m_impl = std::make_unique<Impl>();
}

// ---------------------------------------------------------------------------
// Frames

void CSgfOdometry::Impl::checkTime(mrpt::Clock::time_point stamp) const
{
	if (stamp == INVALID_TIMESTAMP)
		throw Skipped(TSkipReason::NO_TIMESTAMP, "timestamp is invalid");
	if (frameCount > 0 && toNanoseconds(stamp) <= lastFrame_ns)
		throw Skipped(
			TSkipReason::NOT_IN_ORDER,
			mrpt::format(
				"%.4f s, the last frame was at %.4f s",
				mrpt::Clock::toDouble(stamp),
				mrpt::Clock::toDouble(toTimePoint(lastFrame_ns))));
}

FrameResult CSgfOdometry::Impl::align(
	const TFrame& frame, const TParams& params)
{
	if (!odometry)
		odometry.emplace(frames.rig(), odometryOptions(params, "parameters"));
	const FrameResult r =
		frame.depth.empty()
			? odometry->ProcessStereo(frame.time_ns, frame.grey, frame.right)
			: odometry->ProcessDepth(frame.time_ns, frame.grey, frame.depth);
	const double step_s = (frame.time_ns - lastFrame_ns) * 1e-9;
	if (frameCount > 0 && step_s > params.max_gap_s) ++gaps;
	lastFrame_ns = frame.time_ns;
	++frameCount;
	logTimes(r.times);
	return r;
}

void CSgfOdometry::Impl::logTimes(const ::sgf::odometry::StageTimes& times)
{
	timer.registerUserMeasure("frame", times.total_s);
	timer.registerUserMeasure("frame.pyramid", times.pyramid_s);
	timer.registerUserMeasure("frame.alignment", times.alignment_s);
	timer.registerUserMeasure("frame.depth", times.depth_s);
	timer.registerUserMeasure("frame.selection", times.selection_s);
}

TTracked CSgfOdometry::Impl::follow(
	const FrameResult& r, const SE3& T_map_robot, const TParams& params)
{
	if (r.state == TrackingState::kInitialised)
		return restart(r, T_map_robot, params);
	TTracked now{r.time_ns, T_map_robot};
	const TKeyframe& keyframe = keyframes.at(r.keyframe);
	const Matrix6d A = adjoint(frames.T_robot_cam());
	now.keyframe = r.keyframe;
	now.sinceKeyframe = A * r.covariance * A.transpose();
	now.covariance = moved(
		keyframe.covariance, keyframe.T_map_robot.Inverse() * T_map_robot,
		now.sinceKeyframe);
	return now;
}

TTracked CSgfOdometry::Impl::restart(
	const FrameResult& r, const SE3& T_map_robot, const TParams& params)
{
	TTracked now{r.time_ns, T_map_robot};
	if (!last) return now;
	++restarts;
	const double lost_s = (r.time_ns - last->time_ns) * 1e-9;
	const double xyz = params.lost_std_xyz_m * lost_s;
	const double angle = mrpt::DEG2RAD(params.lost_std_angle_deg) * lost_s;
	Eigen::Matrix<double, 6, 1> variances;
	variances << Eigen::Vector3d::Constant(xyz * xyz),
		Eigen::Vector3d::Constant(angle * angle);
	now.covariance = moved(
		last->covariance, last->T_map_robot.Inverse() * T_map_robot,
		variances.asDiagonal());
	return now;
}

TResult CSgfOdometry::Impl::take(const FrameResult& r, const TParams& params)
{
	TResult result;
	result.timestamp = toTimePoint(r.time_ns);
	result.inlierShare = r.inlier_share;
	result.quality = TQuality::LOST;
	if (!believable(r))
	{
		++lostCount;
		return result;
	}
	const SE3& T_robot_cam = frames.T_robot_cam();
	const SE3 T = T_robot_cam * r.T_world_cam * T_robot_cam.Inverse();
	TTracked now = follow(r, T, params);
	if (r.new_keyframe)
	{
		result.keyframePoints = keyframePoints();
		now.asKeyframe = static_cast<int>(keyframes.size());
		keyframes.push_back({T, now.covariance});
	}
	result.quality = restarts > 0 ? TQuality::RELATIVE : TQuality::GOOD;
	if (restarts == 0) result.pose = toPosePDF(T, now.covariance);
	if (last)
	{
		const SE3 motion = last->T_map_robot.Inverse() * T;
		result.increment = toPosePDF(motion, ofMotion(*last, now, motion));
	}
	last = now;
	return result;
}

CObservation3DRangeScan::Ptr CSgfOdometry::Impl::keyframePoints() const
{
	const Keyframe& keyframe = odometry->LastKeyframe();
	const auto& camera = frames.rig().camera;
	auto scan = CObservation3DRangeScan::Create();
	const Eigen::Quaterniond R_sensor_cam = forwardFromCamera();
	scan->timestamp = toTimePoint(keyframe.time_ns);
	scan->sensorLabel = label.value_or("");
	scan->sensorPose = toPose(
		frames.T_robot_cam() *
		SE3{R_sensor_cam.conjugate(), Eigen::Vector3d::Zero()});
	scan->cameraParams.ncols = camera.width;
	scan->cameraParams.nrows = camera.height;
	scan->cameraParams.setIntrinsicParamsFromValues(
		camera.fx, camera.fy, camera.cx, camera.cy);
	scan->cameraParamsIntensity = scan->cameraParams;
	scan->hasPoints3D = true;
	scan->resizePoints3DVectors(keyframe.points.size());
	for (size_t i = 0; i < keyframe.points.size(); ++i)
	{
		const auto& [pixel, inverse_depth, slope] = keyframe.points[i];
		const Eigen::Vector3f p =
			(R_sensor_cam * camera.Unproject(pixel.cast<double>()) /
			 inverse_depth)
				.cast<float>();
		scan->points3D_x[i] = p.x();
		scan->points3D_y[i] = p.y();
		scan->points3D_z[i] = p.z();
		scan->points3D_idxs_x[i] =
			static_cast<uint16_t>(pixel.x() + 0.5f);
		scan->points3D_idxs_y[i] =
			static_cast<uint16_t>(pixel.y() + 0.5f);
		scan->maxRange = std::max(scan->maxRange, p.x());
	}
	return scan;
}

void CSgfOdometry::Impl::insertIntoMap(const TResult& result)
{
	auto pose = mrpt::poses::CPose3DPDFGaussian::Create(*result.pose);
	auto frame = mrpt::obs::CSensoryFrame::Create();
	frame->insert(result.keyframePoints);
	map.insert(pose, frame);
}

// ---------------------------------------------------------------------------
// Observations

template <class OBS>
TResult CSgfOdometry::processFrame(const OBS& obs)
{
	try
	{
		m_impl->checkTime(obs.timestamp);
		const TFrame frame = m_impl->frames.make(obs);
		if (!m_impl->label) m_impl->label = obs.sensorLabel;
		TResult result = m_impl->take(m_impl->align(frame, params), params);
		if (result.pose)
		{
			m_impl->trajectory.insert(result.timestamp, result.pose->mean);
			if (result.keyframePoints && params.build_map)
				m_impl->insertIntoMap(result);
		}
		return result;
	}
	catch (const Skipped& e)
	{
		return skip(obs, e.reason, e.what());
	}
	catch (const std::exception& e)
	{
		return skip(obs, TSkipReason::REFUSED, messageOf(e));
	}
}

TResult CSgfOdometry::skip(
	const mrpt::obs::CObservation& obs, TSkipReason reason,
	const std::string& what)
{
	auto& count = m_impl->skipped[static_cast<size_t>(reason)];
	if (++count == 1)
		MRPT_LOG_WARN_FMT("Skipped: %s (%s)", describe(reason), what.c_str());
	else
		MRPT_LOG_DEBUG_FMT("Skipped: %s (%s)", describe(reason), what.c_str());
	TResult result;
	result.timestamp = obs.timestamp;
	result.skipped = reason;
	return result;
}

TResult CSgfOdometry::process(const CObservationStereoImages& obs)
{
	return processFrame(obs);
}

TResult CSgfOdometry::process(const CObservation3DRangeScan& obs)
{
	return processFrame(obs);
}

void CSgfOdometry::Impl::insertRates(const CObservationIMU& obs)
{
	using namespace mrpt::obs;
	if (obs.timestamp == INVALID_TIMESTAMP)
		throw Skipped(TSkipReason::NO_TIMESTAMP, "timestamp is invalid");
	if (!obs.has(IMU_WX) || !obs.has(IMU_WY) || !obs.has(IMU_WZ))
		throw Skipped(TSkipReason::NO_RATES, "IMU_WX, _WY or _WZ is not set");
	const Eigen::Vector3d rates(
		obs.get(IMU_WX), obs.get(IMU_WY), obs.get(IMU_WZ));
	if (!rates.allFinite())
		throw Skipped(TSkipReason::NO_RATES, "rates are not finite");
	const std::int64_t time_ns = toNanoseconds(obs.timestamp);
	if (lastRates_ns != 0 && time_ns <= lastRates_ns)
		throw Skipped(TSkipReason::NOT_IN_ORDER, "inertial observation");
	lastRates_ns = time_ns;
	const Eigen::Quaterniond R_cam_sensor =
		frames.T_robot_cam().R.conjugate() * toSE3(obs.sensorPose).R;
	odometry->ProcessGyro(time_ns, R_cam_sensor * rates);
}

void CSgfOdometry::processIMU(const CObservationIMU& obs)
{
	// Before the first frame there is nothing to predict from.
	if (!params.use_imu || !m_impl->odometry) return;
	try
	{
		m_impl->insertRates(obs);
	}
	catch (const Skipped& e)
	{
		skip(obs, e.reason, e.what());
	}
	catch (const std::exception& e)
	{
		skip(obs, TSkipReason::REFUSED, messageOf(e));
	}
}

std::optional<TResult> CSgfOdometry::processObservation(
	const mrpt::obs::CObservation& obs)
{
	if (const auto* imu = dynamic_cast<const CObservationIMU*>(&obs))
	{
		processIMU(*imu);
		return std::nullopt;
	}
	const std::string& wanted = params.sensor_label.empty()
									? m_impl->label.value_or(obs.sensorLabel)
									: params.sensor_label;
	if (obs.sensorLabel != wanted) return std::nullopt;
	return visitFrame(
		obs, [this](const auto& frame) { return process(frame); });
}

// ---------------------------------------------------------------------------
// What has come of it

const mrpt::poses::CPose3DInterpolator& CSgfOdometry::trajectory() const
{
	return m_impl->trajectory;
}

const mrpt::maps::CSimpleMap& CSgfOdometry::map() const
{
	return m_impl->map;
}

size_t CSgfOdometry::skippedCount(TSkipReason reason) const
{
	return m_impl->skipped.at(static_cast<size_t>(reason));
}

const mrpt::system::CTimeLogger& CSgfOdometry::timeLogger() const
{
	return m_impl->timer;
}

std::string CSgfOdometry::report() const
{
	std::ostringstream text;
	text << "frames: " << m_impl->frameCount
		 << ", with pose: " << m_impl->trajectory.size()
		 << ", lost: " << m_impl->lostCount
		 << ", restarts: " << m_impl->restarts
		 << ", key-frames: " << m_impl->keyframes.size() << "\n"
		 << "gaps over " << params.max_gap_s << " s: " << m_impl->gaps << "\n";
	for (size_t i = 0; i < m_impl->skipped.size(); ++i)
		if (m_impl->skipped[i] > 0)
			text << "skipped: " << m_impl->skipped[i] << " x " << kReasons[i]
				 << "\n";
	return text.str();
}

}  // namespace mrpt::sgf
