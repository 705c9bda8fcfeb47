/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
// Graph SLAM with MRPT's engine, on a rawlog or a data set: nodes from SGF
// odometry, loops closed by SGF alignment.

// MRPT 2.5.8: CLevMarqGSO.h uses these without including them.
#include <mrpt/core/lock_helper.h>
#include <mrpt/opengl/CDisk.h>
#include <mrpt/opengl/CSphere.h>
//
#include <mrpt/graphslam/CGraphSlamEngine.h>
#include <mrpt/graphslam/ERD/CEmptyERD.h>
#include <mrpt/graphslam/GSO/CLevMarqGSO.h>
#include <mrpt/graphslam/levmarq.h>
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfLoopClosureERD.h>
#include <mrpt/sgf/CSgfOdometryNRD.h>

#include <iostream>

#include "../src/parameters.h"
#include "runTool.h"

namespace mrpt::sgf::apps
{
namespace
{
using TGraph = mrpt::graphs::CNetworkOfPoses3DInf;

struct TArguments
{
	std::string input, prefix, config;
	bool closeLoops = true;
};

// The nodes' poses as a trajectory. The engine leaves them where the shortest
// path through the edges puts them: all edges are brought together here.
mrpt::poses::CPose3DInterpolator optimized(
	TGraph& graph, const CSgfOdometryNRD<TGraph>& nodes)
{
	mrpt::graphslam::TResultInfoSpaLevMarq info;
	mrpt::containers::yaml options;
	options["max_iterations"] = 200;
	if (graph.nodeCount() > 1)
		mrpt::graphslam::optimize_graph_spa_levmarq(
			graph, info, nullptr, options);
	mrpt::poses::CPose3DInterpolator path;
	for (const auto& [id, pose] : graph.nodes)
		path.insert(nodes.nodeTimes().at(id), mrpt::poses::CPose3D(pose));
	return path;
}

void run(const TArguments& arguments)
{
	for (const auto section :
		 {"NodeRegistrationDeciderParameters",
		  "EdgeRegistrationDeciderParameters"})
		internal::requireSection(
			mrpt::config::CConfigFile(arguments.config), section);
	const auto source = openObservations(arguments.input);
	CSgfOdometryNRD<TGraph> nodes;
	CSgfLoopClosureERD<TGraph> loops;
	loops.setNodeTimes(nodes.nodeTimes());
	mrpt::graphslam::deciders::CEmptyERD<TGraph> noLoops;
	mrpt::graphslam::optimizers::CLevMarqGSO<TGraph> optimizer;
	mrpt::graphslam::deciders::CEdgeRegistrationDecider<TGraph>* edges =
		&noLoops;
	if (arguments.closeLoops) edges = &loops;
	mrpt::graphslam::CGraphSlamEngine<TGraph> engine(
		arguments.config, arguments.input, "", nullptr, &nodes, edges,
		&optimizer);
	size_t entry = 0;
	while (auto obs = source->next())
	{
		engine.execGraphSlamStep(obs, entry);
		++entry;
	}
	TGraph graph = engine.getGraph();
	std::cout << nodes.odometry().report();
	reportIncomplete(*source);
	if (nodes.nodeTimes().empty())
		THROW_EXCEPTION_FMT(
			"%s: no frame could be used", arguments.input.c_str());
	if (graph.nodeCount() == 0)
		THROW_EXCEPTION_FMT(
			"%s: the robot has not moved far enough for a node",
			arguments.input.c_str());
	const auto path = optimized(graph, nodes);
	graph.saveToTextFile(arguments.prefix + ".graph");
	saveTrajectoryTUM(path, arguments.prefix + ".tum");
	std::printf(
		"graph: %zu nodes, %zu edges, %d loop closures\n", graph.nodeCount(),
		graph.edgeCount(), loops.closures());
}

}  // namespace
}  // namespace mrpt::sgf::apps

int main(int argc, char** argv)
{
	CLI::App app(
		"Graph SLAM with SGF odometry and loop closing. Writes PREFIX.graph "
		"and "
		"PREFIX.tum (poses of the nodes)",
		"sgf-graphslam");
	mrpt::sgf::apps::TArguments a;
	app.add_option("-i,--input", a.input, "rawlog, or folder of a data set")
		->required();
	app.add_option("-o,--output", a.prefix, "prefix of the files to write")
		->required();
	app.add_option("-c,--config", a.config, "configuration")
		->required()
		->check(CLI::ExistingFile);
	app.add_flag("!--no-loop-closing", a.closeLoops, "leave loops open");
	return mrpt::sgf::apps::runTool(
		app, argc, argv, [&] { mrpt::sgf::apps::run(a); });
}
