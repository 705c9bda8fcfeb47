/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/hwdrivers/CGenericSensor.h>
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <memory>
#include <string>
#include <vector>

namespace mrpt::sgf
{
/** Visual odometry as a sensor of rawlog-grabber: a plug-in, loaded by
 * `rawlog-grabber -p libmrpt-sgf-odometry-sensor.so config.ini` or by
 * mrpt::system::loadPluginModules().
 *
 * For each frame with a pose it emits a CObservationRobotPose (6-D, with
 * covariance) and a CObservationOdometry (x, y, yaw); when its source has
 * ended, a CObservationComment with the report of the odometry. These are
 * classes of MRPT, so that logs are read without this module.
 *
 * \code
 * [SGF]
 * driver           = CSgfOdometrySensor
 * process_rate     = 200         // Hz; at most one frame each time
 * sensorLabel      = SGF
 * path             = in.rawlog   // a rawlog, or the folder of a data set
 * //camera_config  = cam.ini   // in place of path: file with a section
 * //camera_section = CAMERA    // for a CCameraSensor
 * //imu_config     = imu.ini   // beside a camera: file with a section for a
 * //imu_section    = IMU       // sensor, which its driver key names
 * //emit_source    = false     // also emit the observations of the source
 * \endcode
 *
 * The section may also have all parameters of CSgfOdometry::TParams. (Each
 * section of its configuration is a sensor to rawlog-grabber: those of the
 * odometry cannot have one of their own there, nor can camera and IMU.)
 *
 * \ingroup mrpt_sgf_odometry_grp */
class CSgfOdometrySensor : public mrpt::hwdrivers::CGenericSensor
{
	DEFINE_GENERIC_SENSOR(CSgfOdometrySensor)

 public:
	/** Opens the source.
	 * \exception std::exception naming what cannot be opened */
	void initialize() override;

	/** Processes the observations up to the next frame. At the end of the
	 * source it does nothing. A source that cannot be read any further has
	 * come to its end, and the log says why. */
	void doProcess() override;

	/** Whether the source has come to its end; never so for a camera. */
	bool ended() const { return m_ended; }

 protected:
	/** \exception std::exception naming an unknown key, a missing one or a bad
	 * value */
	void loadConfig_sensorSpecific(
		const mrpt::config::CConfigFileBase& config,
		const std::string& section) override;

 private:
	void emit(const TResult& result);
	void emitReport();

	CSgfOdometry m_odometry;
	std::string m_path;  // if there is no camera
	bool m_emitSource = false, m_ended = false;
	std::vector<mrpt::hwdrivers::CGenericSensor::Ptr> m_sensors;
	std::unique_ptr<CObservationSource> m_source;
	mrpt::Clock::time_point m_lastTime;
};

}  // namespace mrpt::sgf
