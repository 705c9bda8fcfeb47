/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <optional>
#include <stdexcept>
#include <string>

#include <opencv2/core.hpp>

#include <sgf/core/se3.h>
#include <sgf/flow/stereo_flow.h>
#include <sgf/odometry/odometry.h>
#include <sgf/odometry/rectification.h>

namespace mrpt::sgf::internal
{
/** An observation that cannot be used. */
struct Skipped : public std::runtime_error
{
	Skipped(TSkipReason r, const std::string& what)
		: std::runtime_error(what), reason(r)
	{
	}
	TSkipReason reason;
};

/** A frame as sgf's odometry takes it. */
struct TFrame
{
	std::int64_t time_ns = 0;
	cv::Mat grey;     //!< the left or only image, 8-bit
	cv::Mat right;    //!< 8-bit; empty with depth
	cv::Mat1f depth;  //!< m; empty with stereo
};

/** Turns observations of one camera (pair) into frames. The first observation
 * fixes the calibration. */
class CFrameMaker
{
 public:
	/** Images are rectified, or free of distortion; stereo images may also
	 * stay as they are. */
	enum class TImages
	{
		IDEAL,
		RAW
	};
	explicit CFrameMaker(TImages images = TImages::IDEAL) : m_images(images) {}

	/** \exception Skipped for what cannot be used
	 * @{ */
	TFrame make(const mrpt::obs::CObservationStereoImages& obs);
	TFrame make(const mrpt::obs::CObservation3DRangeScan& obs);
	/** @} */

	/** Camera of ideal frames; set after the first. */
	const ::sgf::odometry::Rig& rig() const { return m_rig; }
	/** Cameras of raw frames; set after the first. */
	const ::sgf::flow::StereoRig& stereoRig() const { return m_stereoRig; }
	/** Pose of the left or only camera on the robot; set after the first frame. */
	const ::sgf::SE3& T_robot_cam() const { return m_T_robot_cam; }

 private:
	/** What has to stay as it is from frame to frame */
	struct TCalibration
	{
		mrpt::img::TCamera first, second;
		mrpt::poses::CPose3D onRobot, secondOnFirst;

		bool operator==(const TCalibration& o) const;
		void check() const;  // throws Skipped
	};
	bool isNew(const TCalibration& calibration) const;
	void setUp(const mrpt::obs::CObservationStereoImages& obs);
	void rectify();
	void setUp(const mrpt::obs::CObservation3DRangeScan& obs);

	TImages m_images;
	std::optional<TCalibration> m_calibration;
	std::optional<::sgf::odometry::StereoRectifier> m_rectifier;
	cv::Mat m_undistortX, m_undistortY;  // empty without distortion
	::sgf::odometry::Rig m_rig;
	::sgf::flow::StereoRig m_stereoRig;
	::sgf::SE3 m_T_robot_cam;
};

/** Hands an observation to f as what it is, if it is one of the two classes
 * that frames come from.
 * \return what f returns, or nothing for another class */
template <class F>
auto visitFrame(const mrpt::obs::CObservation& obs, F&& f) -> std::optional<
	decltype(f(std::declval<const mrpt::obs::CObservationStereoImages&>()))>
{
	using namespace mrpt::obs;
	if (const auto* s = dynamic_cast<const CObservationStereoImages*>(&obs))
		return f(*s);
	if (const auto* d = dynamic_cast<const CObservation3DRangeScan*>(&obs))
		return f(*d);
	return std::nullopt;
}

}  // namespace mrpt::sgf::internal
