/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/maps/CMultiMetricMap.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/sgf/CSgfOdometry.h>
#include <mrpt/slam/CMetricMapBuilder.h>

#include <vector>

namespace mrpt::sgf
{
/** SGF odometry behind MRPT's interface for SLAM: drop-in where a program
 * takes a CMetricMapBuilder. Actions are ignored, since the images say how the
 * robot has moved. The metric map has one points map, of the key-frames'
 * points.
 *
 * After a loss of tracking the estimate goes on from a guess of the motion
 * meanwhile, with a covariance that says so.
 *
 * \ingroup mrpt_sgf_odometry_grp */
class CMetricMapBuilderSgfOdometry : public mrpt::slam::CMetricMapBuilder
{
 public:
	explicit CMetricMapBuilderSgfOdometry(
		const CSgfOdometry::TParams& params = {});

	/** Starts anew.
	 * \param initialMap key-frames to begin with; they are kept, not tracked
	 * \param x0 the robot's pose at the first frame; MRPT's interface has it
	 * in 2-D. If null, the origin. */
	void initialize(
		const mrpt::maps::CSimpleMap& initialMap = {},
		const mrpt::poses::CPosePDF* x0 = nullptr) override;

	/** The robot's pose after the last frame that was tracked; a
	 * CPose3DPDFGaussian. */
	mrpt::poses::CPose3DPDF::Ptr getCurrentPoseEstimation() const override;

	/** Processes the frames among the observations; never throws for what they
	 * hold. */
	void processActionObservation(
		mrpt::obs::CActionCollection& action,
		mrpt::obs::CSensoryFrame& observations) override;

	void getCurrentlyBuiltMap(mrpt::maps::CSimpleMap& out_map) const override;
	unsigned int getCurrentlyBuiltMapSize() override;
	const mrpt::maps::CMultiMetricMap* getCurrentlyBuiltMetricMap()
		const override;

	/** Writes the view of map and path from above.
	 * \param file its extension chooses the format, whatever \a formatEMF_BMP
	 * says: an image cannot be an EMF
	 * \exception std::exception if it cannot be written */
	void saveCurrentEstimationToImage(
		const std::string& file, bool formatEMF_BMP = false) override;

	/** The odometry, for its report and counters. */
	const CSgfOdometry& odometry() const { return m_odometry; }

 private:
	void take(const TResult& result);

	CSgfOdometry m_odometry;
	mrpt::poses::CPose3DPDFGaussian m_pose;
	std::vector<mrpt::math::TPose3D> m_path;
	mrpt::maps::CSimpleMap m_map;
	mrpt::maps::CMultiMetricMap m_metricMap;
};

}  // namespace mrpt::sgf
