/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/config/CConfigFile.h>
#include <mrpt/core/exceptions.h>
#include <mrpt/core/initializer.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/sgf/CSgfOdometrySensor.h>

#include <map>
#include <set>
#include <vector>

#include "../src/nextOrEnd.h"

namespace mrpt::sgf
{
IMPLEMENTS_GENERIC_SENSOR(CSgfOdometrySensor, mrpt::sgf)

/** Makes the plug-in's sensor known by its name. */
void registerAllClasses_mrpt_sgf_odometry()
{
	CSgfOdometrySensor::doRegister();
}

MRPT_INITIALIZER(registerAllClasses_mrpt_sgf_odometry_on_load)
{
	registerAllClasses_mrpt_sgf_odometry();
}

namespace
{
// Keys of all sensors, which rawlog-grabber and CGenericSensor read, and those
// of this one. The others are parameters of the odometry.
const std::set<std::string> kKeys = {
	"driver",          "process_rate",   "max_queue_len",
	"grab_decimation", "sensorLabel",    "path",
	"camera_config",   "camera_section", "imu_config",
	"imu_section",     "emit_source"};

// Observations of other sensors, in the order of their times.
class CSensorsSource : public CObservationSource
{
 public:
	explicit CSensorsSource(
		const std::vector<mrpt::hwdrivers::CGenericSensor::Ptr>& sensors)
		: m_sensors(sensors)
	{
		for (const auto& sensor : m_sensors) sensor->initialize();
	}

	mrpt::obs::CObservation::Ptr next() override
	{
		if (m_queue.empty()) askAll();
		if (m_queue.empty()) return {};
		auto obs = m_queue.begin()->second;
		m_queue.erase(m_queue.begin());
		return obs;
	}

 private:
	void askAll()
	{
		for (const auto& sensor : m_sensors)
		{
			sensor->doProcess();
			for (const auto& [time, object] : sensor->getObservations())
				if (auto obs =
						std::dynamic_pointer_cast<mrpt::obs::CObservation>(
							object))
					m_queue.emplace(obs->timestamp, obs);
		}
	}

	std::vector<mrpt::hwdrivers::CGenericSensor::Ptr> m_sensors;
	std::multimap<mrpt::Clock::time_point, mrpt::obs::CObservation::Ptr>
		m_queue;
};

// A sensor of any driver, by a file with its section.
mrpt::hwdrivers::CGenericSensor::Ptr sensorOf(
	const std::string& driver, const mrpt::config::CConfigFile& file,
	const std::string& section)
{
	auto sensor =
		mrpt::hwdrivers::CGenericSensor::createSensorPtr(driver);
	if (!sensor)
		THROW_EXCEPTION_FMT(
			"[%s]: driver '%s' is not known", section.c_str(), driver.c_str());
	sensor->loadConfig(file, section);
	return sensor;
}

}  // namespace

void CSgfOdometrySensor::loadConfig_sensorSpecific(
	const mrpt::config::CConfigFileBase& config, const std::string& section)
{
	m_odometry.params.loadFromSharedSection(config, section, kKeys);
	m_emitSource = config.read_bool(section, "emit_source", m_emitSource);
	m_path = config.read_string(section, "path", "");
	const auto cameraFile = config.read_string(section, "camera_config", "");
	if (m_path.empty() == cameraFile.empty())
		THROW_EXCEPTION_FMT(
			"[%s]: has to have either path or camera_config", section.c_str());
	const auto imuFile = config.read_string(section, "imu_config", "");
	if (cameraFile.empty() && !imuFile.empty())
		THROW_EXCEPTION_FMT(
			"[%s]: imu_config has to go with camera_config", section.c_str());
	if (!cameraFile.empty())
		m_sensors.push_back(sensorOf(
			"CCameraSensor", mrpt::config::CConfigFile(cameraFile),
			config.read_string(section, "camera_section", "CAMERA")));
	if (imuFile.empty()) return;
	const mrpt::config::CConfigFile file(imuFile);
	const auto imuSection = config.read_string(section, "imu_section", "IMU");
	m_sensors.push_back(sensorOf(
		file.read_string(imuSection, "driver", ""), file, imuSection));
}

void CSgfOdometrySensor::initialize()
{
	if (m_sensors.empty())
		m_source = openObservations(m_path);
	else
		m_source = std::make_unique<CSensorsSource>(m_sensors);
	m_state = ssWorking;
}

void CSgfOdometrySensor::doProcess()
{
	ASSERTMSG_(m_source, "initialize() has not been called");
	if (m_ended) return;
	while (const auto obs = internal::nextOrEnd(*m_source, m_odometry))
	{
		if (m_emitSource) appendObservation(obs);
		m_lastTime = std::max(m_lastTime, obs->timestamp);
		const auto result = m_odometry.processObservation(*obs);
		if (result && result->quality != TQuality::WAITING)
			return emit(*result);
	}
	// A camera has no end: there was no image in this period.
	if (!m_sensors.empty()) return;
	if (const auto result = m_odometry.finish()) return emit(*result);
	emitReport();
}

void CSgfOdometrySensor::emit(const TResult& result)
{
	if (!result.pose) return;
	appendObservations(
		{result.asRobotPose(m_sensorLabel),
		 result.asOdometry(m_sensorLabel + "_2D")});
}

void CSgfOdometrySensor::emitReport()
{
	// rawlog-grabber never writes the very last object it is given: this one.
	for (const int step : {1, 2})
	{
		auto comment = mrpt::obs::CObservationComment::Create();
		comment->timestamp = m_lastTime + mrpt::Clock::duration(step);
		comment->sensorLabel = m_sensorLabel;
		comment->text = m_odometry.report();
		appendObservation(comment);
	}
	m_ended = true;
}

}  // namespace mrpt::sgf
