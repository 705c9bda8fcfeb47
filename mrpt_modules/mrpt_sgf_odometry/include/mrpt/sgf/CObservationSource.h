/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/obs/CObservation.h>

#include <memory>
#include <string>

namespace mrpt::sgf
{
/** A stream of observations in the order in which they were stored.
 * \ingroup mrpt_sgf_odometry_grp */
class CObservationSource
{
 public:
	virtual ~CObservationSource() = default;

	/** The next observation, or an empty pointer at the end.
	 * \exception std::exception if the rest cannot be read */
	virtual mrpt::obs::CObservation::Ptr next() = 0;

	/** Frames that are left out since one of their files is missing */
	virtual size_t incompleteFrames() const { return 0; }
};

/** Observations of a rawlog of either format. Its external images are looked
 * for where CRawlog::detectImagesDirectory() is documented to look.
 * \exception std::exception naming the file if it cannot be read or holds
 * nothing of a rawlog. next() throws when the file ends within an object or
 * with an object of a class that is not known.
 * \ingroup mrpt_sgf_odometry_grp */
std::unique_ptr<CObservationSource> openRawlog(const std::string& file);

/** How a data set is turned into observations.
 * \ingroup mrpt_sgf_odometry_grp */
struct TDatasetOptions
{
	/** "euroc", "kitti_odometry", "tum_rgbd", "icl_nuim", or empty to tell by
	 * the folder's content */
	std::string layout;
	/** Read the inertial sensor, if the data set has one */
	bool imu = true;
	/** Frames to read, from the first; 0 for all */
	size_t max_frames = 0;
};

/** Observations of a sequence in the layout of EuRoC (also those that
 * sgf_render makes), KITTI odometry, or TUM RGB-D and ICL-NUIM, in the order of
 * their times: CObservationStereoImages, CObservation3DRangeScan,
 * CObservationIMU. Images are external, by their absolute path.
 *
 * The robot's frame has the origin of the data set's body frame and is turned
 * so that the left (or only) camera looks along x, its image's up being z.
 * \exception std::exception naming what is wrong with the data set
 * \ingroup mrpt_sgf_odometry_grp */
std::unique_ptr<CObservationSource> openDataset(
	const std::string& folder, const TDatasetOptions& options);

/** openDataset() of a folder, openRawlog() of anything else.
 * \ingroup mrpt_sgf_odometry_grp */
std::unique_ptr<CObservationSource> openObservations(const std::string& path);

}  // namespace mrpt::sgf
