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
 * Visual and visual-inertial odometry with scaled-gradient-field
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
/** What estimates the robot's motion.
 * \ingroup mrpt_sgf_odometry_grp */
enum class TEstimator : uint8_t
{
	/** Direct alignment of stereo images, or of images with depth */
	STEREO = 0,
	/** Points followed in stereo images, with an inertial sensor */
	STEREO_INERTIAL
};

/** How far what is known after a frame may be believed.
 * \ingroup mrpt_sgf_odometry_grp */
enum class TQuality : uint8_t
{
	/** The observation was not used: see TResult::skipped */
	NONE = 0,
	/** The frame waits for inertial measurements up to its time: its result
	 * comes with a later observation */
	WAITING,
	/** The camera is lost: there is no pose */
	LOST,
	/** Tracked, but the camera was lost at some time before and found none of
	 * its key-frames again: increments only. The one that bridges the time
	 * without tracking is a guess, and its covariance says so. */
	RELATIVE,
	/** Tracked without a gap since the first frame, or for a moment predicted:
	 * see TInertialState::predicted */
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
	NO_ACCELERATIONS,
	UNSUPPORTED_SENSOR,
	REFUSED,
	/** The number of reasons */
	COUNT
};

/** A reason in words, as in "stereo observation without right image".
 * \ingroup mrpt_sgf_odometry_grp */
const char* describe(TSkipReason reason);

/** What TEstimator::STEREO_INERTIAL knows beside the pose. The map frame is
 * that of the poses; it is not turned when gravity is found.
 * \ingroup mrpt_sgf_odometry_grp */
struct TInertialState
{
	/** Whether the inertial sensor takes part. If not, the velocity is that
	 * between the last two poses, and the biases and \a up are no estimates. */
	bool active = false;
	/** Why it does not, in words; else empty */
	std::string problem;
	/** Too little was seen: the inertial sensor alone has told the pose */
	bool predicted = false;
	/** Of the inertial sensor's place (of the robot's origin while no sensor is
	 * known), in the map frame, m/s */
	mrpt::math::TVector3D velocity;
	/** In the sensor's axes: rad/s and m/s^2 */
	mrpt::math::TVector3D gyroBias, accelBias;
	/** Unit vector against gravity, in the map frame */
	mrpt::math::TVector3D up;
};

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
	/** Set for tracked frames of TEstimator::STEREO_INERTIAL */
	std::optional<TInertialState> inertial;

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

namespace internal
{
struct TEstimate;
}

/** Visual odometry from stereo images, or from grey images with depth; or, by
 * TParams::estimator, from stereo images and an inertial sensor.
 *
 * Feed observations in the order of their times:
 * \code
 * mrpt::sgf::CSgfOdometry odometry;
 * odometry.params.loadFromConfigFileName("odometry.ini", "SgfOdometry");
 * const auto result = odometry.process(stereoObservation);
 * if (result.pose) std::cout << result.pose->mean << "\n";
 * \endcode
 *
 * TEstimator::STEREO rectifies raw stereo images by the calibration that the
 * observation carries. TEstimator::STEREO_INERTIAL takes them as they are, and
 * the pose of the inertial sensor on the robot from
 * CObservationIMU::sensorPose; poses are the robot's with both. Its frames wait
 * for inertial measurements up to their time: a result may belong to an earlier
 * frame than that of the call, which its time stamp tells. Each call gives at
 * most one; at the end finish() gives what is left. It begins with images alone
 * until gravity is found, and goes on with them where there are no
 * measurements; TInertialState and report() say so.
 *
 * Observations that cannot be used are skipped, counted by reason and
 * listed by report(); no input makes the processing methods throw.
 *
 * The covariance of the alignment (of the motion since the key-frame), or of
 * the state in the window of frames, is carried from the camera's tangent space
 * to the robot's by the adjoint, and to MRPT's (x y z yaw pitch roll) by the
 * inverse of the right Jacobian of yaw, pitch and roll. It grows without bound
 * at pitch +-90 degrees, where yaw and roll cannot be told apart.
 *
 * \ingroup mrpt_sgf_odometry_grp
 */
class CSgfOdometry : public mrpt::system::COutputLogger
{
 public:
	/** Parameters. Besides those below, a section of an ini file may have all
	 * options of both estimators, by their dotted names, such as
	 * `alignment.residual` of STEREO or `flow.residual` of STEREO_INERTIAL;
	 * each takes its own. `saveToConfigFile()` writes them all. */
	struct TParams : public mrpt::config::CLoadableOptions
	{
		/** "stereo" or "stereo_inertial" */
		TEstimator estimator = TEstimator::STEREO;
		/** Observations with another sensor label are ignored. If empty, the
		 * label of the first frame counts. */
		std::string sensor_label;
		/** The same for inertial observations */
		std::string imu_label;
		/** Use the inertial sensor, if there is one: STEREO predicts rotations
		 * from the gyroscope */
		bool use_imu = true;
		/** Frames of STEREO_INERTIAL that may wait for inertial measurements;
		 * with one more, the oldest does without */
		int max_waiting_frames = 5;
		/** Noise of the inertial sensor for STEREO_INERTIAL, by the densities
		 * of white noise (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)) and of that which
		 * drives the biases (rad/s^2/sqrt(Hz), m/s^3/sqrt(Hz)) */
		double gyroscope_noise_density = 1.6968e-4;
		double gyroscope_random_walk = 1.9393e-5;
		double accelerometer_noise_density = 2e-3;
		double accelerometer_random_walk = 3e-3;
		/** A longer time between frames is counted as a gap (s) */
		double max_gap_s = 1.0;
		/** Standard deviation of the motion while lost (m and degrees, after
		 * one second; grows with time) */
		double lost_std_xyz_m = 1.0, lost_std_angle_deg = 30.0;
		/** Collect the map of key-frames */
		bool build_map = true;
		/** Options of the estimators that differ from their defaults, by name
		 */
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

	/** To be set before the first observation. */
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
	/** Takes angular rates (rad/s) and, for STEREO_INERTIAL, accelerations
	 * with gravity (m/s^2), both in the sensor's axes. STEREO predicts the next
	 * frame's rotation from the rates.
	 * \return the result of a frame that has waited for it */
	std::optional<TResult> processIMU(const mrpt::obs::CObservationIMU& obs);

	/** The result of the next frame that waits, with the measurements that
	 * there are; to be called at the end of a recording until there is none. */
	std::optional<TResult> finish();

	/** Hands an observation to the method for its class.
	 * \return nothing for an IMU that no frame has waited for, for a class that
	 * odometry has no use for and for another sensor label */
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
	template <class F>
	std::optional<TResult> resultOf(
		mrpt::Clock::time_point stamp, F&& estimate);
	TResult take(const internal::TEstimate& estimate);
	TResult skip(
		mrpt::Clock::time_point stamp, TSkipReason reason,
		const std::string& what);

	struct Impl;
	std::unique_ptr<Impl> m_impl;
};

}  // namespace mrpt::sgf
