/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/config/CConfigFileBase.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <sgf/odometry/odometry.h>

namespace mrpt::sgf::internal
{
/** The odometry's options with those that the parameters name.
 * \param where what errors call the parameters
 * \exception ::sgf::Error for an unknown name or a bad value */
::sgf::odometry::OdometryOptions odometryOptions(
	const CSgfOdometry::TParams& params, const std::string& where);

/** \exception std::exception naming file and section if it is not there */
void requireSection(
	const mrpt::config::CConfigFileBase& source, const std::string& section);

}  // namespace mrpt::sgf::internal
