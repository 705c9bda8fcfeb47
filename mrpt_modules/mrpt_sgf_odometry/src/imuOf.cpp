/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "imuOf.h"

#include <mrpt/core/format.h>

#include <array>

#include "conversions.h"
#include "frameOf.h"

namespace mrpt::sgf::internal
{
using namespace mrpt::obs;

namespace
{
using TAxes = std::array<TIMUDataIndex, 3>;

Eigen::Vector3d vectorOf(
	const CObservationIMU& obs, const TAxes& axes, TSkipReason ifNone)
{
	Eigen::Vector3d v;
	for (int i = 0; i < 3; ++i)
	{
		if (!obs.has(axes[i]))
			throw Skipped(ifNone, mrpt::format("axis %d is not set", i));
		v[i] = obs.get(axes[i]);
	}
	if (!v.allFinite()) throw Skipped(ifNone, "they are not finite");
	return v;
}

Eigen::Vector3d ratesOf(const CObservationIMU& obs)
{
	return vectorOf(obs, {IMU_WX, IMU_WY, IMU_WZ}, TSkipReason::NO_RATES);
}

}  // namespace

::sgf::ImuSample CImuReader::inOrder(
	const CObservationIMU& obs, const Eigen::Vector3d& gyro,
	const Eigen::Vector3d& accel)
{
	if (obs.timestamp == INVALID_TIMESTAMP)
		throw Skipped(TSkipReason::NO_TIMESTAMP, "timestamp is invalid");
	const std::int64_t time_ns = toNanoseconds(obs.timestamp);
	if (m_last_ns != 0 && time_ns <= m_last_ns)
		throw Skipped(TSkipReason::NOT_IN_ORDER, "inertial observation");
	m_last_ns = time_ns;
	return {time_ns, gyro, accel};
}

::sgf::ImuSample CImuReader::readRates(const CObservationIMU& obs)
{
	return inOrder(obs, ratesOf(obs), Eigen::Vector3d::Zero());
}

::sgf::ImuSample CImuReader::read(const CObservationIMU& obs)
{
	const Eigen::Vector3d gyro = ratesOf(obs);
	return inOrder(
		obs, gyro,
		vectorOf(
			obs, {IMU_X_ACC, IMU_Y_ACC, IMU_Z_ACC},
			TSkipReason::NO_ACCELERATIONS));
}

}  // namespace mrpt::sgf::internal
