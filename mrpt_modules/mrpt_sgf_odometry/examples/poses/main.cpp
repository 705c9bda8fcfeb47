// Prints the robot's pose at each frame of a rawlog or a data set. Usage:
// sgf_poses INPUT [CONFIG], with a configuration such as sgf-odometry.ini
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <iostream>
#include <optional>

int main(int argc, char** argv)
{
	if (argc != 2 && argc != 3)
	{
		std::cerr << "usage: sgf_poses INPUT [CONFIG]\n";
		return 2;
	}
	mrpt::sgf::CSgfOdometry odometry;
	if (argc == 3)
		odometry.params.loadFromConfigFileName(argv[2], "SgfOdometry");
	const auto print = [](const std::optional<mrpt::sgf::TResult>& result)
	{
		if (result && result->pose) std::cout << result->pose->mean << "\n";
	};
	const auto source = mrpt::sgf::openObservations(argv[1]);
	while (const auto obs = source->next())
		print(odometry.processObservation(*obs));
	// Frames that have waited for inertial measurements.
	while (const auto result = odometry.finish()) print(result);
	std::cout << odometry.report();
}
