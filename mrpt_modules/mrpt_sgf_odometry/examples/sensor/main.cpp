// Runs the plug-in as rawlog-grabber does: prints what the sensor emits. Usage:
// sgf_sensor CONFIG
#include <mrpt/config/CConfigFile.h>
#include <mrpt/hwdrivers/CGenericSensor.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/system/os.h>

#include <iostream>

int main(int argc, char** argv)
{
	if (argc != 2)
	{
		std::cerr << "usage: sgf_sensor CONFIG\n";
		return 2;
	}
	mrpt::system::loadPluginModules(PLUGIN);
	const auto sensor =
		mrpt::hwdrivers::CGenericSensor::createSensorPtr("CSgfOdometrySensor");
	sensor->loadConfig(mrpt::config::CConfigFile(argv[1]), "SGF");
	sensor->initialize();
	for (bool ended = false; !ended;)
	{
		sensor->doProcess();
		for (const auto& [time, object] : sensor->getObservations())
		{
			std::cout << mrpt::Clock::toDouble(time) << " "
					  << object->GetRuntimeClass()->className << "\n";
			ended = ended || IS_CLASS(*object, mrpt::obs::CObservationComment);
		}
	}
}
