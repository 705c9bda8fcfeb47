/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/obs/CObservation.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <memory>

namespace mrpt::sgf
{
/** Direct alignment of two views that need not follow one another, as loop
 * closing does.
 * \ingroup mrpt_sgf_odometry_grp */
class CSgfPairAligner
{
 public:
	/** What is kept of an observation: its image and the depths of the pixels
	 * that are aligned. */
	struct TView;

	/** What an alignment came to. */
	struct TOutcome
	{
		/** Whether \a motion is to be believed */
		bool ok = false;
		/** Robot at the second view in coordinates of the robot at the first */
		mrpt::poses::CPose3DPDFGaussian motion;
		/** Share of the first view's points that the second sees, 0 to 1 */
		double overlap = 0;
		/** Share of those points that fit, 0 to 1 */
		double inlierShare = 0;
	};

	/** \exception std::exception for a bad value among the odometry's options
	 */
	explicit CSgfPairAligner(const CSgfOdometry::TParams& params);
	~CSgfPairAligner();

	/** Whether an observation is of a class that views are made of. */
	static bool isFrame(const mrpt::obs::CObservation& obs);

	/** Makes a view of a stereo observation or a range scan with image.
	 * \return nothing for another class and for an observation that cannot be
	 * used */
	std::shared_ptr<const TView> makeView(const mrpt::obs::CObservation& obs);

	/** Aligns views made by makeView() of this object.
	 * \param guess of the outcome's motion */
	TOutcome align(
		const TView& first, const TView& second,
		const mrpt::poses::CPose3D& guess) const;

 private:
	struct Impl;
	std::unique_ptr<Impl> m_impl;
};

}  // namespace mrpt::sgf
