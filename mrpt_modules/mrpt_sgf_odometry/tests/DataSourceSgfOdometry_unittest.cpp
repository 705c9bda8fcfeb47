/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/apps/RBPF_SLAM_App.h>
#include <mrpt/io/vector_loadsave.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/sgf/DataSourceSgfOdometry.h>

#include <fstream>
#include <map>

#include "support/temp_dir.h"
#include "syntheticRoom.h"

using namespace mrpt::sgf;
using mrpt::obs::CObservation;
using mrpt::sgf::testing::CRoom;

namespace
{
// A robot that drives through the room; one frame has one eye only.
class CDrive : public CObservationSource
{
 public:
	explicit CDrive(int frames, bool cutOff = false)
		: m_frames(frames), m_cutOff(cutOff)
	{
	}

	CObservation::Ptr next() override
	{
		if (m_next == m_frames && m_cutOff) throw std::runtime_error("cut off");
		if (m_next == m_frames) return {};
		auto obs = CRoom::stereo(CRoom::pose(m_next), CRoom::time(m_next));
		obs->hasImageRight = m_next != 3;
		++m_next;
		return obs;
	}

 private:
	int m_frames, m_next = 0;
	bool m_cutOff;
};

// A flight with an inertial sensor, whose measurements come late.
class CFlight : public CObservationSource
{
 public:
	explicit CFlight(int frames)
	{
		for (int i = 0; i < frames; ++i)
			add(CRoom::stereo(CRoom::flight(0.05 * i), CRoom::time(i)), 0);
		for (double s = 0.002; s < 0.05 * frames; s += 0.005)
			add(CRoom::imu(s), 0.07);
	}

	CObservation::Ptr next() override
	{
		if (m_queue.empty()) return {};
		auto obs = m_queue.begin()->second;
		m_queue.erase(m_queue.begin());
		return obs;
	}

 private:
	void add(const CObservation::Ptr& obs, double delay_s)
	{
		m_queue.emplace(
			mrpt::Clock::toDouble(obs->timestamp) + delay_s, obs);
	}

	std::multimap<double, CObservation::Ptr> m_queue;
};

class CApp : public mrpt::apps::RBPF_SLAM_App_Base, public DataSourceSgfOdometry
{
 public:
	using DataSourceSgfOdometry::impl_get_next_observations;

 protected:
	void impl_initialize(int, const char** argv) override
	{
		params.setContent(mrpt::io::file_get_contents(argv[1]));
		params.write("MappingApplication", "logOutput_dir", argv[2]);
	}
	std::string impl_get_usage() const override { return "app config folder"; }
};

std::vector<double> lastRow(const std::filesystem::path& file)
{
	std::ifstream in(file);
	std::string line;
	std::vector<double> row;
	while (std::getline(in, line))
	{
		std::istringstream fields(line);
		std::vector<double> numbers;
		for (double x; fields >> x;) numbers.push_back(x);
		if (numbers.size() >= 7) row = numbers;
	}
	return row;
}
}  // namespace

TEST(DataSourceSgfOdometry, GivesActionsWithFrames)
{
	CApp app;
	app.source = std::make_unique<CDrive>(6);
	app.odometry.setMinLoggingLevel(mrpt::system::LVL_ERROR);
	mrpt::obs::CActionCollection::Ptr action;
	mrpt::obs::CSensoryFrame::Ptr frame;
	CObservation::Ptr none;
	mrpt::poses::CPose3D sum;
	int steps = 0;
	while (app.impl_get_next_observations(action, frame, none))
	{
		const auto movement =
			action->getActionByClass<mrpt::obs::CActionRobotMovement3D>();
		ASSERT_TRUE(movement);
		EXPECT_EQ(
			movement->estimationMethod,
			mrpt::obs::CActionRobotMovement3D::emVisualOdometry);
		sum = sum + movement->poseChange.mean;
		EXPECT_TRUE(
			frame->getObservationByClass<mrpt::obs::CObservationRobotPose>());
		EXPECT_FALSE(none);
		++steps;
	}
	EXPECT_EQ(steps, 4);  // the first frame has no increment, one no right eye
	EXPECT_LT((sum - CRoom::pose(5)).norm(), 0.01);
}

// Frames that wait come with the measurements that they have waited for, the
// last ones at the end.
TEST(DataSourceSgfOdometry, GivesFramesThatHaveWaited)
{
	constexpr int kFrames = 6;
	CApp app;
	app.source = std::make_unique<CFlight>(kFrames);
	app.odometry.setMinLoggingLevel(mrpt::system::LVL_ERROR);
	app.odometry.params.estimator = TEstimator::STEREO_INERTIAL;
	mrpt::obs::CActionCollection::Ptr action;
	mrpt::obs::CSensoryFrame::Ptr frame;
	CObservation::Ptr none;
	int steps = 0;
	size_t measurements = 0;
	while (app.impl_get_next_observations(action, frame, none))
	{
		EXPECT_EQ(
			action->get(0)->timestamp,
			mrpt::Clock::fromDouble(CRoom::time(++steps)));
		for (const auto& obs : *frame)
		{
			measurements += IS_CLASS(*obs, mrpt::obs::CObservationIMU);
			EXPECT_FALSE(IS_CLASS(*obs, mrpt::obs::CObservationStereoImages));
		}
	}
	EXPECT_EQ(steps, kFrames - 1);
	EXPECT_GT(measurements, 50U);
}

TEST(DataSourceSgfOdometry, ASourceThatIsCutOffEnds)
{
	CApp app;
	app.source = std::make_unique<CDrive>(2, true);
	app.odometry.setMinLoggingLevel(mrpt::system::LVL_ERROR);
	app.odometry.logging_enable_console_output = false;
	app.odometry.logging_enable_keep_record = true;
	mrpt::obs::CActionCollection::Ptr action;
	mrpt::obs::CSensoryFrame::Ptr frame;
	CObservation::Ptr none;
	EXPECT_TRUE(app.impl_get_next_observations(action, frame, none));
	EXPECT_FALSE(app.impl_get_next_observations(action, frame, none));
	EXPECT_NE(
		app.odometry.getLogAsString().find("Ends early: cut off"),
		std::string::npos);
}

TEST(DataSourceSgfOdometry, NoSourceIsAnError)
{
	CApp app;
	mrpt::obs::CActionCollection::Ptr action;
	mrpt::obs::CSensoryFrame::Ptr frame;
	CObservation::Ptr none;
	EXPECT_ANY_THROW(app.impl_get_next_observations(action, frame, none));
}

// MRPT's particle filter, live on the odometry: its odometry path is ours.
TEST(DataSourceSgfOdometry, DrivesMrptsParticleFilter)
{
	const ::sgf::TempDir dir;
	const std::string out = dir.path() / "out";
	CApp app;
	app.setMinLoggingLevel(mrpt::system::LVL_ERROR);
	app.odometry.setMinLoggingLevel(mrpt::system::LVL_ERROR);
	app.quits_with_esc_key = false;
	app.source = std::make_unique<CDrive>(10);
	const char* argv[] = {"app", CONFIG_FOLDER "/rbpf-slam.ini", out.c_str()};
	app.initialize(3, argv);
	app.run();
	const auto row = lastRow(dir.path() / "out" / "log_odometry_path.txt");
	ASSERT_GE(row.size(), 4U);
	const auto& path = app.odometry.trajectory();
	const auto& end = path.rbegin()->second;
	EXPECT_NEAR(row[1], end.x, 1e-3);
	EXPECT_NEAR(row[2], end.y, 1e-3);
	EXPECT_NEAR(row[3], end.z, 1e-3);
}
