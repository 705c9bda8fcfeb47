/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
// Runs the odometry on a rawlog or a data set, and writes what MRPT's
// applications read.

#include <mrpt/config/CConfigFile.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/opengl/COpenGLScene.h>
#include <mrpt/opengl/CPointCloud.h>
#include <mrpt/opengl/CSetOfLines.h>
#include <mrpt/opengl/stock_objects.h>
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfOdometry.h>
#include <mrpt/sgf/topView.h>

#include <iostream>
#include <vector>

#include "CRawlogWriter.h"
#include "runTool.h"

namespace mrpt::sgf::apps
{
namespace
{
const std::string kLabel = "SGF_ODOMETRY";

void require(bool written, const std::string& file)
{
	if (!written) THROW_EXCEPTION_FMT("%s: cannot be written", file.c_str());
}

// The two rawlogs, written as frames come.
class CLogs
{
 public:
	explicit CLogs(const std::string& prefix)
		: m_observations(prefix + "_obs.rawlog"),
		  m_actions(prefix + "_actsf.rawlog")
	{
	}

	void take(const TResult& result)
	{
		m_last = result.timestamp;
		if (result.pose)
		{
			m_observations.write(*result.asRobotPose(kLabel));
			m_observations.write(*result.asOdometry(kLabel + "_2D"));
		}
		if (!result.increment) return;
		mrpt::obs::CActionCollection actions;
		auto action = result.asAction();
		actions.insert(action);
		m_actions.write(actions);
		m_actions.write(*result.asSensoryFrame(kLabel));
	}

	void commit(const std::string& report)
	{
		mrpt::obs::CObservationComment comment;
		comment.timestamp = m_last;
		comment.text = report;
		m_observations.write(comment);
		m_observations.commit();
		m_actions.commit();
	}

 private:
	CRawlogWriter m_observations, m_actions;
	mrpt::Clock::time_point m_last;
};

void writeScene(
	const CSgfOdometry& odometry, const mrpt::maps::CSimplePointsMap& points,
	const std::string& file)
{
	mrpt::opengl::COpenGLScene scene;
	auto cloud = mrpt::opengl::CPointCloud::Create();
	cloud->loadFromPointsMap(&points);
	cloud->setName("points");
	scene.insert(cloud);
	auto path = mrpt::opengl::CSetOfLines::Create();
	path->setName("trajectory");
	path->setColor(0.1f, 0.2f, 0.9f);
	path->setLineWidth(2);
	const mrpt::math::TPose3D* before = nullptr;
	for (const auto& [time, pose] : odometry.trajectory())
	{
		if (before)
			path->appendLine(
				before->x, before->y, before->z, pose.x, pose.y, pose.z);
		before = &pose;
	}
	scene.insert(path);
	for (size_t i = 0; i < odometry.map().size(); ++i)
	{
		auto corner = mrpt::opengl::stock_objects::CornerXYZSimple(0.1f);
		corner->setPose(std::get<0>(odometry.map().get(i))->getMeanVal());
		scene.insert(corner);
	}
	require(scene.saveToFile(file), file);
}

void writeMaps(const CSgfOdometry& odometry, const std::string& prefix)
{
	mrpt::maps::CSimplePointsMap points;
	insertPoints(odometry.map(), points);
	std::vector<mrpt::math::TPose3D> path;
	for (const auto& [time, pose] : odometry.trajectory()) path.push_back(pose);
	require(
		odometry.map().saveToFile(prefix + ".simplemap"),
		prefix + ".simplemap");
	writeScene(odometry, points, prefix + ".3Dscene");
	require(points.saveToPlyFile(prefix + ".ply", true), prefix + ".ply");
	require(topView(points, path).saveToFile(prefix + ".png"), prefix + ".png");
	saveTrajectoryTUM(odometry.trajectory(), prefix + ".tum");
}

struct TArguments
{
	std::string input, prefix, config, section = "SgfOdometry";
};

std::string ofSensor(const CSgfOdometry::TParams& params)
{
	if (params.sensor_label.empty()) return "";
	return " of sensor " + params.sensor_label;
}

void run(const TArguments& arguments)
{
	CSgfOdometry odometry;
	odometry.setMinLoggingLevel(mrpt::system::LVL_WARN);
	if (!arguments.config.empty())
		odometry.params.loadFromConfigFileName(
			arguments.config, arguments.section);
	const auto source = openObservations(arguments.input);
	CLogs logs(arguments.prefix);
	size_t frames = 0;
	while (const auto obs = source->next())
		if (const auto result = odometry.processObservation(*obs))
		{
			++frames;
			logs.take(*result);
		}
	while (const auto result = odometry.finish()) logs.take(*result);
	std::cout << odometry.report();
	reportIncomplete(*source);
	if (frames == 0)
		THROW_EXCEPTION_FMT(
			"%s: has no stereo images and no range scans%s",
			arguments.input.c_str(), ofSensor(odometry.params).c_str());
	if (odometry.trajectory().empty())
		THROW_EXCEPTION_FMT(
			"%s: no frame could be used", arguments.input.c_str());
	logs.commit(odometry.report());
	writeMaps(odometry, arguments.prefix);
	std::cout << odometry.timeLogger().getStatsAsText();
}

}  // namespace
}  // namespace mrpt::sgf::apps

int main(int argc, char** argv)
{
	CLI::App app(
		"Visual odometry on a rawlog or a data set. Writes PREFIX_obs.rawlog, "
		"PREFIX_actsf.rawlog, PREFIX.simplemap, PREFIX.3Dscene, PREFIX.ply, "
		"PREFIX.png and PREFIX.tum",
		"sgf-odometry-cli");
	mrpt::sgf::apps::TArguments a;
	app.add_option("-i,--input", a.input, "rawlog, or folder of a data set")
		->required();
	app.add_option("-o,--output", a.prefix, "prefix of the files to write")
		->required();
	app.add_option("-c,--config", a.config, "configuration (default: none)")
		->check(CLI::ExistingFile);
	app.add_option(
		"-s,--section", a.section,
		"section of the configuration (default: SgfOdometry)");
	return mrpt::sgf::apps::runTool(
		app, argc, argv, [&] { mrpt::sgf::apps::run(a); });
}
