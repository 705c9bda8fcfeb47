/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/config/CLoadableOptions.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CActionRobotMovement3D.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DInterpolator.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/system/COutputLogger.h>
#include <mrpt/system/CTimeLogger.h>

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

/** \defgroup mrpt_sgf_odometry_grp [mrpt-sgf-odometry]
 * Visual odometry by direct alignment of images with scaled-gradient-field
 * dissimilarities, which hold under changing light (Quenzel et al., "Beyond
 * Photometric Consistency", ICRA 2020).
 *
 * Frames: the robot has x forward, y left, z up; a camera looks along its z,
 * with x right and y down, so that a forward camera has the pose (x, y, z,
 * -90, 0, -90) degrees on the robot. The map frame is the robot's pose at the
 * first frame.
 */
namespace mrpt::sgf
{
/** How far what is known after a frame may be believed.
 * \ingroup mrpt_sgf_odometry_grp */
enum class TQuality : uint8_t
{
	/** The observation was not used: see TResult::skipped */
	NONE = 0,
	/** The camera is lost: there is no pose */
	LOST,
	/** Tracked, but the camera was lost at some time before and found none of
	 * its key-frames again: increments only. The one that bridges the time
	 * without tracking is a guess, and its covariance says so. */
	RELATIVE,
	/** Tracked without a gap since the first frame */
	GOOD
};

/** Why an observation was not used.
 * \ingroup mrpt_sgf_odometry_grp */
enum class TSkipReason : uint8_t
{
	NO_RIGHT_IMAGE = 0,
	NO_DEPTH,
	NO_IMAGE,
	MISSING_FILE,
	IMAGE_SIZE,
	NO_CALIBRATION,
	UNSUPPORTED_CALIBRATION,
	CALIBRATION_CHANGED,
	NO_TIMESTAMP,
	NOT_IN_ORDER,
	NO_RATES,
	REFUSED,
	/** The number of reasons */
	COUNT
};

/** A reason in words, as in "stereo observation without right image".
 * \ingroup mrpt_sgf_odometry_grp */
const char* describe(TSkipReason reason);

/** What is known after an observation.
 * \ingroup mrpt_sgf_odometry_grp */
struct TResult
{
	mrpt::Clock::time_point timestamp;
	TQuality quality = TQuality::NONE;
	/** Set if and only if the quality is TQuality::NONE */
	std::optional<TSkipReason> skipped;

	/** Robot in the map frame at frame time, m and rad. Its covariance is that
	 * of (x y z yaw pitch roll), accumulated since the first frame. Set if and
	 * only if the quality is TQuality::GOOD. */
	std::optional<mrpt::poses::CPose3DPDFGaussian> pose;
	/** Motion since the last frame that was tracked, in the robot's
	 * coordinates of then. Set for all tracked frames but the first. */
	std::optional<mrpt::poses::CPose3DPDFGaussian> increment;

	/** The points that were selected for tracking, if this frame has become a
	 * key-frame, in a range scan with points only */
	mrpt::obs::CObservation3DRangeScan::Ptr keyframePoints;
	/** Share of the residuals that are inliers, 0 to 1 */
	double inlierShare = 0;

	/** The increment as MRPT's filters take it.
	 * \exception std::exception if there is none */
	mrpt::obs::CActionRobotMovement3D asAction() const;
	/** The pose as an observation in 6-D.
	 * \exception std::exception if there is none */
	mrpt::obs::CObservationRobotPose::Ptr asRobotPose(
		const std::string& sensorLabel) const;
	/** The pose's x, y and yaw.
	 * \exception std::exception if there is none */
	mrpt::obs::CObservationOdometry::Ptr asOdometry(
		const std::string& sensorLabel) const;
	/** What goes with the action in a rawlog of actions and sensory frames:
	 * the pose, if there is one, and the points of a key-frame. */
	mrpt::obs::CSensoryFrame::Ptr asSensoryFrame(
		const std::string& sensorLabel) const;
};

/** Writes poses as the TUM RGB-D benchmark has them: `time x y z qx qy qz qw`,
 * in s and m.
 * \exception std::exception naming the file if it cannot be written
 * \ingroup mrpt_sgf_odometry_grp */
void saveTrajectoryTUM(
	const mrpt::poses::CPose3DInterpolator& path, const std::string& file);

/** Visual odometry from stereo images, or from grey images with depth.
 *
 * Feed observations in the order of their times:
 * \code
 * mrpt::sgf::CSgfOdometry odometry;
 * odometry.params.loadFromConfigFileName("odometry.ini", "SgfOdometry");
 * const auto result = odometry.process(stereoObservation);
 * if (result.pose) std::cout << result.pose->mean << "\n";
 * \endcode
 *
 * Raw stereo images are rectified by the calibration that the observation
 * carries. Observations that cannot be used are skipped, counted by reason and
 * listed by report(); no input makes the processing methods throw.
 *
 * The covariance of the alignment (of the motion since the key-frame) is
 * carried from the camera's tangent space to the robot's by the adjoint, and to
 * MRPT's (x y z yaw pitch roll) by the inverse of the right Jacobian of yaw,
 * pitch and roll. It grows without bound at pitch +-90 degrees, where yaw and
 * roll cannot be told apart.
 *
 * \ingroup mrpt_sgf_odometry_grp
 */
class CSgfOdometry : public mrpt::system::COutputLogger
{
 public:
	/** Parameters. Besides those below, a section of an ini file may have all
	 * options of the odometry itself, by their dotted names, such as
	 * `alignment.metric`. `saveToConfigFile()` writes them all. */
	struct TParams : public mrpt::config::CLoadableOptions
	{
		/** Observations with another sensor label are ignored. If empty, the
		 * label of the first frame counts. */
		std::string sensor_label;
		/** Predict rotations from the gyroscope, if there is one */
		bool use_imu = true;
		/** A longer time between frames is counted as a gap (s) */
		double max_gap_s = 1.0;
		/** Standard deviation of the motion while lost (m and degrees, after
		 * one second; grows with time) */
		double lost_std_xyz_m = 1.0, lost_std_angle_deg = 30.0;
		/** Collect the map of key-frames */
		bool build_map = true;
		/** Options of the odometry that differ from their defaults, by name */
		std::map<std::string, std::string> odometry;

		/** \exception std::exception naming section and key for an unknown
		 * key or a bad value, or the section if it is not there */
		void loadFromConfigFile(
			const mrpt::config::CConfigFileBase& source,
			const std::string& section) override;
		/** As loadFromConfigFile(), for a section that has other keys too.
		 * \param others keys to leave alone */
		void loadFromSharedSection(
			const mrpt::config::CConfigFileBase& source,
			const std::string& section, const std::set<std::string>& others);
		/** Writes all parameters as they are in effect.
		 * \exception std::exception for a bad value in \a odometry */
		void saveToConfigFile(
			mrpt::config::CConfigFileBase& target,
			const std::string& section) const override;
	};

	/** To be set before the first frame. */
	TParams params;

	CSgfOdometry();
	~CSgfOdometry() override;
	CSgfOdometry(CSgfOdometry&&) noexcept;
	CSgfOdometry& operator=(CSgfOdometry&&) noexcept;

	/** Back to the state before the first frame, with the parameters of now. */
	void reset();

	/** @name Processing. None of these throws.
	 * @{ */
	TResult process(const mrpt::obs::CObservationStereoImages& obs);
	/** Depth and grey (or colour) image have to be registered: see
	 * CObservation3DRangeScan::doDepthAndIntensityCamerasCoincide(). */
	TResult process(const mrpt::obs::CObservation3DRangeScan& obs);
	/** Takes the angular rates for the prediction of the next frame. */
	void processIMU(const mrpt::obs::CObservationIMU& obs);

	/** Hands an observation to the method for its class.
	 * \return nothing for an IMU, for a class that odometry has no use for and
	 * for another sensor label */
	std::optional<TResult> processObservation(
		const mrpt::obs::CObservation& obs);
	/** @} */

	/** @name What has come of it
	 * @{ */
	/** All believed poses, at frame time and never changed later */
	const mrpt::poses::CPose3DInterpolator& trajectory() const;

	/** Poses of the believed key-frames, each with a CObservation3DRangeScan
	 * of the points that were tracked. */
	const mrpt::maps::CSimpleMap& map() const;

	/** Observations not used so far, for a reason */
	size_t skippedCount(TSkipReason reason) const;

	/** A few lines of text: frames, how many of them have a pose, gaps,
	 * observations skipped by reason. */
	std::string report() const;

	/** Time spent in each stage */
	const mrpt::system::CTimeLogger& timeLogger() const;
	/** @} */

 private:
	template <class OBS>
	TResult processFrame(const OBS& obs);
	TResult skip(
		const mrpt::obs::CObservation& obs, TSkipReason reason,
		const std::string& what);

	struct Impl;
	std::unique_ptr<Impl> m_impl;
};

}  // namespace mrpt::sgf
