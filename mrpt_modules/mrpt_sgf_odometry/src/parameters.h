/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/config/CConfigFileBase.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <sgf/core/inertial.h>
#include <sgf/odometry/odometry.h>
#include <sgf/vio/stereo_inertial_odometry.h>

namespace mrpt::sgf::internal
{
/** An estimator's options with those that the parameters name.
 * \param where what errors call the parameters
 * \exception ::sgf::Error for a bad value, or a name that no estimator knows
 * @{ */
::sgf::odometry::OdometryOptions odometryOptions(
	const CSgfOdometry::TParams& params, const std::string& where);
::sgf::vio::VioOptions vioOptions(
	const CSgfOdometry::TParams& params, const std::string& where);
/** @} */

::sgf::ImuNoise imuNoise(const CSgfOdometry::TParams& params);

/** \exception std::exception naming file and section if it is not there */
void requireSection(
	const mrpt::config::CConfigFileBase& source, const std::string& section);

}  // namespace mrpt::sgf::internal
