/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/core/exceptions.h>
#include <mrpt/sgf/DataSourceSgfOdometry.h>

#include "nextOrEnd.h"

namespace mrpt::sgf
{
bool DataSourceSgfOdometry::impl_get_next_observations(
	mrpt::obs::CActionCollection::Ptr& action,
	mrpt::obs::CSensoryFrame::Ptr& observations,
	mrpt::obs::CObservation::Ptr& observation)
{
	ASSERTMSG_(source, "DataSourceSgfOdometry::source is not set");
	observation.reset();
	auto others = mrpt::obs::CSensoryFrame::Create();
	while (true)
	{
		const auto obs = internal::nextOrEnd(*source, odometry);
		const auto result =
			obs ? odometry.processObservation(*obs) : odometry.finish();
		if (!obs && !result) return false;
		// An inertial observation may come with a result, of a frame before.
		if (obs && (!result || IS_CLASS(*obs, mrpt::obs::CObservationIMU)))
			others->insert(obs);
		if (!result || !result->increment) continue;
		auto movement = result->asAction();
		action = mrpt::obs::CActionCollection::Create();
		action->insert(movement);
		observations = result->asSensoryFrame("SGF_ODOMETRY");
		for (const auto& other : *others) observations->insert(other);
		return true;
	}
}

}  // namespace mrpt::sgf
