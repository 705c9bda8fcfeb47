/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/system/COutputLogger.h>

#include "messageOf.h"

namespace mrpt::sgf::internal
{
/** The next observation. What cannot be read any further counts as the end,
 * for loops of MRPT's that an exception would break off; the log says why. */
inline mrpt::obs::CObservation::Ptr nextOrEnd(
	CObservationSource& source, const mrpt::system::COutputLogger& log)
{
	try
	{
		return source.next();
	}
	catch (const std::exception& e)
	{
		log.logStr(mrpt::system::LVL_ERROR, "Ends early: " + messageOf(e));
		return {};
	}
}

}  // namespace mrpt::sgf::internal
