// Prints the robot's pose at each frame of a rawlog or a data set.
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <iostream>

int main(int argc, char** argv)
{
	if (argc != 2) return 2;  // expected: a rawlog, or a folder
	mrpt::sgf::CSgfOdometry odometry;
	const auto source = mrpt::sgf::openObservations(argv[1]);
	while (const auto obs = source->next())
		if (const auto result = odometry.processObservation(*obs);
			result && result->pose)
			std::cout << result->pose->mean << "\n";
	std::cout << odometry.report();
}
