/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/obs/CObservationIMU.h>

#include <cstdint>

#include <sgf/core/inertial.h>

namespace mrpt::sgf::internal
{
/** Reads what an inertial sensor says, in its own axes, in the order of time.
 */
class CImuReader
{
 public:
	/** \exception Skipped for what cannot be used
	 * @{ */
	/** Angular rates alone */
	::sgf::ImuSample readRates(const mrpt::obs::CObservationIMU& obs);
	/** Angular rates and accelerations */
	::sgf::ImuSample read(const mrpt::obs::CObservationIMU& obs);
	/** @} */

	/** Time of the last one that was read; 0 before the first. */
	std::int64_t last_ns() const { return m_last_ns; }

 private:
	::sgf::ImuSample inOrder(
		const mrpt::obs::CObservationIMU& obs, const Eigen::Vector3d& gyro,
		const Eigen::Vector3d& accel);

	std::int64_t m_last_ns = 0;
};

}  // namespace mrpt::sgf::internal
