/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/apps/BaseAppDataSource.h>
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <memory>

namespace mrpt::sgf
{
/** Live odometry for the applications of mrpt-apps that take actions and
 * sensory frames, such as RBPF_SLAM_App_Base:
 * \code
 * class MyApp : public mrpt::apps::RBPF_SLAM_App_Base,
 *               public mrpt::sgf::DataSourceSgfOdometry { ... };
 * MyApp app;
 * app.source = mrpt::sgf::openRawlog("stereo.rawlog");
 * \endcode
 * Each tracked frame is an action with the increment, and a sensory frame with
 * the pose, the key-frame's points and the observations of other classes that
 * came since the last one. Frames that are not tracked are passed over: the
 * next increment spans them.
 *
 * \ingroup mrpt_sgf_odometry_grp */
class DataSourceSgfOdometry : virtual public mrpt::apps::BaseAppDataSource
{
 public:
	/** Where the images come from; to be set before the application runs. */
	std::unique_ptr<CObservationSource> source;

	/** Its parameters may be set before the application runs. */
	CSgfOdometry odometry;

 protected:
	/** \return false at the source's end. A source that cannot be read any
	 * further has come to its end, and the log says why.
	 * \exception std::exception if there is no source */
	bool impl_get_next_observations(
		mrpt::obs::CActionCollection::Ptr& action,
		mrpt::obs::CSensoryFrame::Ptr& observations,
		mrpt::obs::CObservation::Ptr& observation) override;
};

}  // namespace mrpt::sgf
