/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/poses/CPosePDFGaussian.h>
#include <mrpt/sgf/CMetricMapBuilderSgfOdometry.h>

#include "support/temp_dir.h"
#include "syntheticRoom.h"

using namespace mrpt::sgf;
using mrpt::poses::CPose3D;
using mrpt::sgf::testing::CRoom;

// A program that knows nothing but MRPT's interface gets our pose at each
// frame.
TEST(CMetricMapBuilderSgfOdometry, GivesThePoseThroughMrptsInterface)
{
	CSgfOdometry odometry;
	std::unique_ptr<mrpt::slam::CMetricMapBuilder> builder =
		std::make_unique<CMetricMapBuilderSgfOdometry>();
	for (int i = 0; i < 8; ++i)
	{
		const auto obs = CRoom::stereo(CRoom::pose(i), CRoom::time(i));
		const auto expected = odometry.process(*obs);
		mrpt::obs::CActionCollection none;
		mrpt::obs::CSensoryFrame frame;
		frame.insert(obs);
		builder->processActionObservation(none, frame);
		const auto pose = builder->getCurrentPoseEstimation()->getMeanVal();
		ASSERT_TRUE(expected.pose);
		EXPECT_LT((pose - expected.pose->mean).norm(), 1e-9) << i;
	}
	EXPECT_GE(builder->getCurrentlyBuiltMapSize(), 1U);
	mrpt::maps::CSimpleMap map;
	builder->getCurrentlyBuiltMap(map);
	EXPECT_EQ(map.size(), builder->getCurrentlyBuiltMapSize());
	EXPECT_FALSE(builder->getCurrentlyBuiltMetricMap()->isEmpty());
}

TEST(CMetricMapBuilderSgfOdometry, StartsFromAPriorAndAMap)
{
	CMetricMapBuilderSgfOdometry builder;
	const auto feed = [&](int i)
	{
		mrpt::obs::CActionCollection none;
		mrpt::obs::CSensoryFrame frame;
		frame.insert(CRoom::stereo(CRoom::pose(i), CRoom::time(i)));
		builder.processActionObservation(none, frame);
	};
	feed(0);
	mrpt::maps::CSimpleMap map;
	builder.getCurrentlyBuiltMap(map);
	const mrpt::poses::CPosePDFGaussian prior(
		mrpt::poses::CPose2D(5, 1, mrpt::DEG2RAD(90.0)));
	builder.initialize(map, &prior);
	EXPECT_EQ(builder.getCurrentlyBuiltMapSize(), map.size());
	for (int i = 0; i < 5; ++i) feed(i);
	const CPose3D expected =
		CPose3D(5, 1, 0, mrpt::DEG2RAD(90.0), 0, 0) + CRoom::pose(4);
	EXPECT_LT(
		(builder.getCurrentPoseEstimation()->getMeanVal() - expected).norm(),
		0.01);
	EXPECT_GT(builder.getCurrentlyBuiltMapSize(), map.size());
}

TEST(CMetricMapBuilderSgfOdometry, ObservationsOfNoUseDoNotThrow)
{
	CMetricMapBuilderSgfOdometry builder;
	mrpt::obs::CActionCollection none;
	mrpt::obs::CSensoryFrame frame;
	auto bad = CRoom::stereo({}, 1);
	bad->hasImageRight = false;
	frame.insert(bad);
	EXPECT_NO_THROW(builder.processActionObservation(none, frame));
	EXPECT_EQ(builder.odometry().skippedCount(TSkipReason::NO_RIGHT_IMAGE), 1U);
	EXPECT_EQ(builder.getCurrentlyBuiltMapSize(), 0U);
}

TEST(CMetricMapBuilderSgfOdometry, WritesAPicture)
{
	const ::sgf::TempDir dir;
	CMetricMapBuilderSgfOdometry builder;
	mrpt::obs::CActionCollection none;
	for (int i = 0; i < 3; ++i)
	{
		mrpt::obs::CSensoryFrame frame;
		frame.insert(CRoom::stereo(CRoom::pose(i), CRoom::time(i)));
		builder.processActionObservation(none, frame);
	}
	builder.saveCurrentEstimationToImage(dir.path() / "map.png");
	mrpt::img::CImage picture;
	ASSERT_TRUE(picture.loadFromFile(dir.path() / "map.png"));
	EXPECT_EQ(std::max(picture.getWidth(), picture.getHeight()), 1001U);
	EXPECT_ANY_THROW(
		builder.saveCurrentEstimationToImage("/nonexistent/map.png"));
}
