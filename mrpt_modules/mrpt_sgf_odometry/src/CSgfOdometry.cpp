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

#include "conversions.h"
#include "estimator.h"
#include "frameOf.h"
#include "messageOf.h"

namespace mrpt::sgf
{
using namespace internal;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationStereoImages;
using ::sgf::SE3;

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
	"inertial observation without accelerations",
	"observation of a class that the estimator does not take",
	"observation that the odometry refused"};
static_assert(kReasons.size() == static_cast<size_t>(TSkipReason::COUNT));

// Covariances are of v in T_map_robot Exp(v), translation (m) before rotation
// (rad), in the robot's coordinates.

// What later frames' covariances count from.
struct TAnchor
{
	SE3 T_map_robot;
	Matrix6d covariance;
};

struct TTracked
{
	std::int64_t time_ns = 0;
	SE3 T_map_robot;
	Matrix6d covariance = Matrix6d::Zero();  // since the first frame
	int anchor = -1;                         // it counts from
	Matrix6d sinceAnchor = Matrix6d::Zero();
	int asAnchor = -1;  // index of the anchor that it has become
};

// Covariance after a motion, by what it was before and that of the motion.
Matrix6d moved(
	const Matrix6d& before, const SE3& motion, const Matrix6d& ofMotion)
{
	const Matrix6d A = adjoint(motion.Inverse());
	return A * before * A.transpose() + ofMotion;
}

// Covariance of the motion from one frame to another. Errors since a common
// anchor are taken as independent, which they are not quite: a key-frame's
// depths are common to them.
Matrix6d ofMotion(const TTracked& from, const TTracked& to, const SE3& motion)
{
	if (from.asAnchor >= 0 && from.asAnchor == to.anchor) return to.sinceAnchor;
	if (from.anchor == to.anchor)
		return moved(from.sinceAnchor, motion, to.sinceAnchor);
	// Found again from an older key-frame: an upper bound.
	return moved(from.covariance, motion, to.covariance);
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
	std::unique_ptr<CEstimator> estimator;
	std::optional<std::string> label, imuLabel;
	std::int64_t lastFrame_ns = 0;

	std::vector<TAnchor> anchors;
	std::optional<TTracked> last;  // frame that was tracked
	size_t frameCount = 0, lostCount = 0, restarts = 0, gaps = 0;
	size_t keyframeCount = 0;
	std::array<size_t, static_cast<size_t>(TSkipReason::COUNT)> skipped{};

	mrpt::poses::CPose3DInterpolator trajectory;
	mrpt::maps::CSimpleMap map;
	mrpt::system::CTimeLogger timer{true, "CSgfOdometry"};

	// The logger would print when it goes.
	~Impl() { timer.clear(true); }

	CEstimator& estimatorOf(const TParams& params);
	void checkTime(mrpt::Clock::time_point stamp) const;
	void accept(const mrpt::obs::CObservation& obs, const TParams& params);
	TTracked follow(const TEstimate& e, const TParams& params);
	TTracked restart(const TEstimate& e, const TParams& params);
	TResult take(const TEstimate& e, const TParams& params);
	void insertIntoMap(const TResult& result);
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

CEstimator& CSgfOdometry::Impl::estimatorOf(const TParams& params)
{
	if (!estimator)
		estimator = params.estimator == TEstimator::STEREO
						? makeStereoEstimator(params)
						: makeStereoInertialEstimator(params);
	return *estimator;
}

// A frame has become one of the sequence, if only to wait.
void CSgfOdometry::Impl::accept(
	const mrpt::obs::CObservation& obs, const TParams& params)
{
	if (!label) label = obs.sensorLabel;
	const std::int64_t time_ns = toNanoseconds(obs.timestamp);
	const double step_s = (time_ns - lastFrame_ns) * 1e-9;
	if (frameCount > 0 && step_s > params.max_gap_s) ++gaps;
	lastFrame_ns = time_ns;
	++frameCount;
}

TTracked CSgfOdometry::Impl::follow(const TEstimate& e, const TParams& params)
{
	if (e.begins) return restart(e, params);
	TTracked now{e.time_ns, e.T_map_robot};
	const TAnchor& anchor = anchors.at(e.anchor);
	now.anchor = e.anchor;
	now.sinceAnchor = e.sinceAnchor;
	now.covariance = moved(
		anchor.covariance, anchor.T_map_robot.Inverse() * e.T_map_robot,
		e.sinceAnchor);
	return now;
}

TTracked CSgfOdometry::Impl::restart(const TEstimate& e, const TParams& params)
{
	TTracked now{e.time_ns, e.T_map_robot};
	if (!last) return now;
	++restarts;
	const double lost_s = (e.time_ns - last->time_ns) * 1e-9;
	const double xyz = params.lost_std_xyz_m * lost_s;
	const double angle = mrpt::DEG2RAD(params.lost_std_angle_deg) * lost_s;
	Eigen::Matrix<double, 6, 1> variances;
	variances << Eigen::Vector3d::Constant(xyz * xyz),
		Eigen::Vector3d::Constant(angle * angle);
	now.covariance = moved(
		last->covariance, last->T_map_robot.Inverse() * e.T_map_robot,
		variances.asDiagonal());
	return now;
}

TResult CSgfOdometry::Impl::take(const TEstimate& e, const TParams& params)
{
	for (const auto& [stage, time_s] : e.times)
		timer.registerUserMeasure(stage, time_s);
	TResult result;
	result.timestamp = toTimePoint(e.time_ns);
	result.inlierShare = e.inlierShare;
	result.inertial = e.inertial;
	result.quality = TQuality::LOST;
	if (!e.tracked)
	{
		++lostCount;
		return result;
	}
	TTracked now = follow(e, params);
	if (e.newAnchor)
	{
		now.asAnchor = static_cast<int>(anchors.size());
		anchors.push_back({e.T_map_robot, now.covariance});
	}
	if (e.keyframePoints)
	{
		++keyframeCount;
		result.keyframePoints = e.keyframePoints;
		result.keyframePoints->sensorLabel = label.value_or("");
	}
	result.quality = restarts > 0 ? TQuality::RELATIVE : TQuality::GOOD;
	if (restarts == 0) result.pose = toPosePDF(e.T_map_robot, now.covariance);
	if (last)
	{
		const SE3 motion = last->T_map_robot.Inverse() * e.T_map_robot;
		result.increment = toPosePDF(
			motion, e.sinceLast ? *e.sinceLast : ofMotion(*last, now, motion));
	}
	last = now;
	return result;
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

TResult CSgfOdometry::take(const TEstimate& e)
{
	for (const auto& warning : e.warnings) MRPT_LOG_WARN(warning);
	TResult result = m_impl->take(e, params);
	if (!result.pose) return result;
	m_impl->trajectory.insert(result.timestamp, result.pose->mean);
	if (result.keyframePoints && params.build_map)
		m_impl->insertIntoMap(result);
	return result;
}

template <class F>
std::optional<TResult> CSgfOdometry::resultOf(
	mrpt::Clock::time_point stamp, F&& estimate)
{
	try
	{
		const std::optional<TEstimate> e = estimate();
		if (!e) return std::nullopt;
		return take(*e);
	}
	catch (const Skipped& e)
	{
		return skip(stamp, e.reason, e.what());
	}
	catch (const std::exception& e)
	{
		return skip(stamp, TSkipReason::REFUSED, messageOf(e));
	}
}

template <class OBS>
TResult CSgfOdometry::processFrame(const OBS& obs)
{
	const auto result = resultOf(
		obs.timestamp,
		[&]
		{
			m_impl->checkTime(obs.timestamp);
			auto estimate = m_impl->estimatorOf(params).process(obs);
			m_impl->accept(obs, params);
			return estimate;
		});
	if (result) return *result;
	TResult waits;
	waits.timestamp = obs.timestamp;
	waits.quality = TQuality::WAITING;
	return waits;
}

TResult CSgfOdometry::skip(
	mrpt::Clock::time_point stamp, TSkipReason reason, const std::string& what)
{
	auto& count = m_impl->skipped[static_cast<size_t>(reason)];
	if (++count == 1)
		MRPT_LOG_WARN_FMT("Skipped: %s (%s)", describe(reason), what.c_str());
	else
		MRPT_LOG_DEBUG_FMT("Skipped: %s (%s)", describe(reason), what.c_str());
	TResult result;
	result.timestamp = stamp;
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

std::optional<TResult> CSgfOdometry::processIMU(const CObservationIMU& obs)
{
	auto& label = m_impl->imuLabel;
	const std::string wanted =
		params.imu_label.empty() ? label.value_or(obs.sensorLabel)
								 : params.imu_label;
	if (obs.sensorLabel != wanted) return std::nullopt;
	label = wanted;
	auto result = resultOf(
		obs.timestamp, [&] { return m_impl->estimatorOf(params).process(obs); });
	if (result && result->skipped) return std::nullopt;
	return result;
}

std::optional<TResult> CSgfOdometry::finish()
{
	if (!m_impl->estimator) return std::nullopt;
	return resultOf(
		toTimePoint(m_impl->lastFrame_ns),
		[&] { return m_impl->estimator->finish(); });
}

std::optional<TResult> CSgfOdometry::processObservation(
	const mrpt::obs::CObservation& obs)
{
	if (const auto* imu = dynamic_cast<const CObservationIMU*>(&obs))
		return processIMU(*imu);
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
		 << ", key-frames: " << m_impl->keyframeCount << "\n"
		 << "gaps over " << params.max_gap_s << " s: " << m_impl->gaps << "\n";
	for (size_t i = 0; i < m_impl->skipped.size(); ++i)
		if (m_impl->skipped[i] > 0)
			text << "skipped: " << m_impl->skipped[i] << " x " << kReasons[i]
				 << "\n";
	if (m_impl->estimator) text << m_impl->estimator->report();
	return text.str();
}

}  // namespace mrpt::sgf
