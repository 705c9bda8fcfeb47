/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include "syntheticRoom.h"

using namespace mrpt::sgf;
using namespace mrpt::obs;
using mrpt::poses::CPose3D;
using mrpt::sgf::testing::CRoom;

namespace
{
double angleDeg(const CPose3D& p)
{
	return mrpt::RAD2DEG(
		p.getRotationMatrix().asEigen().trace() >= 3
			? 0.0
			: std::acos((p.getRotationMatrix().asEigen().trace() - 1) / 2));
}

CSgfOdometry quiet()
{
	CSgfOdometry odometry;
	odometry.setMinLoggingLevel(mrpt::system::LVL_ERROR);
	return odometry;
}

// An observation that was changed is skipped for a reason; the odometry goes
// on with the next one as if nothing had been.
template <class MAKE, class SPOIL>
void expectSkipped(MAKE make, SPOIL spoil, TSkipReason reason)
{
	CSgfOdometry odometry = quiet();
	EXPECT_EQ(
		odometry.process(*make(CRoom::pose(0), CRoom::time(0))).quality,
		TQuality::GOOD);
	auto bad = make(CRoom::pose(1), CRoom::time(1));
	spoil(*bad);
	const TResult result = odometry.process(*bad);
	EXPECT_EQ(result.quality, TQuality::NONE);
	ASSERT_TRUE(result.skipped);
	EXPECT_EQ(*result.skipped, reason) << describe(*result.skipped);
	EXPECT_FALSE(result.pose || result.increment);
	EXPECT_EQ(odometry.skippedCount(reason), 1U);
	EXPECT_NE(odometry.report().find(describe(reason)), std::string::npos);
	EXPECT_TRUE(odometry.process(*make(CRoom::pose(2), CRoom::time(2))).pose);
	EXPECT_EQ(odometry.trajectory().size(), 2U);
}

void expectSkippedStereo(
	const std::function<void(CObservationStereoImages&)>& spoil,
	TSkipReason reason)
{
	expectSkipped(CRoom::stereo, spoil, reason);
}

void expectSkippedDepth(
	const std::function<void(CObservation3DRangeScan&)>& spoil,
	TSkipReason reason)
{
	expectSkipped(CRoom::withDepth, spoil, reason);
}

template <class MAKE>
CPose3D drive(CSgfOdometry& odometry, MAKE make, int frames)
{
	CPose3D last;
	for (int i = 0; i < frames; ++i)
	{
		const TResult r =
			odometry.process(*make(CRoom::pose(i), CRoom::time(i)));
		EXPECT_EQ(r.quality, TQuality::GOOD) << i;
		if (r.pose) last = r.pose->mean;
	}
	return last;
}
}  // namespace

TEST(CSgfOdometry, StereoGivesTheRobotsPose)
{
	CSgfOdometry odometry = quiet();
	const CPose3D error = drive(odometry, CRoom::stereo, 12) - CRoom::pose(11);
	EXPECT_LT(error.norm(), 0.01);
	EXPECT_LT(angleDeg(error), 0.2);
	EXPECT_EQ(odometry.trajectory().size(), 12U);
}

TEST(CSgfOdometry, DepthGivesTheRobotsPose)
{
	CSgfOdometry odometry = quiet();
	const CPose3D error =
		drive(odometry, CRoom::withDepth, 12) - CRoom::pose(11);
	EXPECT_LT(error.norm(), 0.005);
	EXPECT_LT(angleDeg(error), 0.1);
}

TEST(CSgfOdometry, IncrementsAddUpToThePose)
{
	CSgfOdometry odometry = quiet();
	CPose3D sum;
	for (int i = 0; i < 6; ++i)
	{
		const auto r =
			odometry.process(*CRoom::stereo(CRoom::pose(i), CRoom::time(i)));
		ASSERT_EQ(r.increment.has_value(), i > 0);
		if (!r.increment) continue;
		sum = sum + r.asAction().poseChange.mean;
		EXPECT_LT((r.pose->mean - sum).norm(), 1e-9);
		const Eigen::MatrixXd cov = r.increment->cov.asEigen();
		EXPECT_GT(cov.llt().matrixL().toDenseMatrix().diagonal().minCoeff(), 0);
		EXPECT_LT(cov.diagonal().maxCoeff(), 1e-3);
	}
}

TEST(CSgfOdometry, UncertaintyGrowsWithTheKeyframes)
{
	CSgfOdometry odometry = quiet();
	double before = 0;
	size_t keyframes = 0;
	for (int i = 0; i < 16; ++i)
	{
		const auto r = odometry.process(
			*CRoom::stereo(CRoom::pose(2 * i), CRoom::time(i)));
		ASSERT_TRUE(r.pose) << i;
		if (!r.keyframePoints) continue;
		const double trace =
			r.pose->cov.asEigen().topLeftCorner<3, 3>().trace();
		EXPECT_TRUE(keyframes == 0 || trace > before);
		before = trace;
		++keyframes;
	}
	EXPECT_GT(keyframes, 1U);
	EXPECT_EQ(odometry.map().size(), keyframes);
}

// The points of the map lie on the room's walls.
TEST(CSgfOdometry, KeyframePointsLieOnTheWalls)
{
	CSgfOdometry odometry = quiet();
	const auto r = odometry.process(*CRoom::stereo({}, CRoom::time(0)));
	const auto& scan = *r.keyframePoints;
	ASSERT_GT(scan.points3D_x.size(), 100U);
	size_t onWall = 0;
	for (size_t i = 0; i < scan.points3D_x.size(); ++i)
	{
		const auto p = scan.sensorPose.composePoint(mrpt::math::TPoint3D(
			scan.points3D_x[i], scan.points3D_y[i], scan.points3D_z[i]));
		const double gap = std::min(
			{4 - std::abs(p.x), 3 - std::abs(p.y), 1.5 - std::abs(p.z)});
		onWall += std::abs(gap) < 0.25;
	}
	EXPECT_GT(onWall, 0.9 * scan.points3D_x.size());
}

// Raw images of a turned right camera come out as the rectified ones do.
TEST(CSgfOdometry, RawStereoIsRectified)
{
	const auto raw = [](const CPose3D& robot, double time)
	{
		auto obs = CRoom::stereo(robot, time);
		const CPose3D onLeft(
			CRoom::kBaseline, 0.003, 0, mrpt::DEG2RAD(0.5), mrpt::DEG2RAD(-1.0),
			mrpt::DEG2RAD(0.7));
		obs->rightCameraPose = mrpt::poses::CPose3DQuat(onLeft);
		obs->imageRight = CRoom::image(robot + CRoom::cameraPose() + onLeft);
		return obs;
	};
	CSgfOdometry odometry = quiet();
	const CPose3D error = drive(odometry, raw, 10) - CRoom::pose(9);
	EXPECT_LT(error.norm(), 0.01);
	EXPECT_LT(angleDeg(error), 0.2);
}

TEST(CSgfOdometry, OneEyeMissing)
{
	expectSkippedStereo(
		[](auto& o) { o.hasImageRight = false; }, TSkipReason::NO_RIGHT_IMAGE);
	expectSkippedStereo(
		[](auto& o) { o.imageRight = mrpt::img::CImage(); },
		TSkipReason::NO_IMAGE);
}

TEST(CSgfOdometry, ExternalImageMissing)
{
	expectSkippedStereo(
		[](auto& o)
		{ o.imageLeft.setExternalStorage("/nonexistent/left.png"); },
		TSkipReason::MISSING_FILE);
}

TEST(CSgfOdometry, SizeChanges)
{
	expectSkippedStereo(
		[](auto& o)
		{ o.imageLeft = o.imageLeft.scaleHalf(mrpt::img::IMG_INTERP_LINEAR); },
		TSkipReason::IMAGE_SIZE);
	expectSkippedDepth(
		[](auto& o)
		{
			o.rangeImage_setSize(10, 20);
			o.rangeImage.fill(1000);
		},
		TSkipReason::IMAGE_SIZE);
}

TEST(CSgfOdometry, NoCalibration)
{
	expectSkippedStereo(
		[](auto& o) { o.leftCamera.setIntrinsicParamsFromValues(0, 0, 0, 0); },
		TSkipReason::CALIBRATION_CHANGED);
	CSgfOdometry odometry = quiet();
	auto obs = CRoom::stereo({}, 1);
	obs->leftCamera.setIntrinsicParamsFromValues(0, 0, 0, 0);
	EXPECT_EQ(odometry.process(*obs).skipped, TSkipReason::NO_CALIBRATION);
	obs = CRoom::stereo({}, 1);
	obs->leftCamera = obs->rightCamera = {};  // of another size than the images
	EXPECT_EQ(odometry.process(*obs).skipped, TSkipReason::NO_CALIBRATION);
	obs = CRoom::stereo({}, 2);
	obs->cameraPose.x(NAN);
	EXPECT_EQ(odometry.process(*obs).skipped, TSkipReason::NO_CALIBRATION);
	obs = CRoom::stereo({}, 2);
	obs->rightCameraPose = {};
	EXPECT_EQ(odometry.process(*obs).skipped, TSkipReason::NO_CALIBRATION);
	obs = CRoom::stereo({}, 3);
	obs->leftCamera.setDistortionKannalaBrandt(0.1, 0, 0, 0);
	EXPECT_EQ(
		odometry.process(*obs).skipped, TSkipReason::UNSUPPORTED_CALIBRATION);
	EXPECT_TRUE(odometry.process(*CRoom::stereo({}, 4)).pose);
}

TEST(CSgfOdometry, PoseOfTheDepthSensorNotFinite)
{
	CSgfOdometry odometry = quiet();
	auto obs = CRoom::withDepth({}, 1);
	obs->sensorPose.x(NAN);
	EXPECT_EQ(odometry.process(*obs).skipped, TSkipReason::NO_CALIBRATION);
	EXPECT_TRUE(odometry.process(*CRoom::withDepth({}, 2)).pose);
}

TEST(CSgfOdometry, DepthNotToBeUsed)
{
	expectSkippedDepth(
		[](auto& o) { o.rangeImage.fill(0); }, TSkipReason::NO_DEPTH);
	expectSkippedDepth(
		[](auto& o) { o.rangeUnits = NAN; }, TSkipReason::NO_DEPTH);
	expectSkippedDepth(
		[](auto& o) { o.hasRangeImage = false; }, TSkipReason::NO_DEPTH);
	expectSkippedDepth(
		[](auto& o) { o.hasIntensityImage = false; }, TSkipReason::NO_IMAGE);
	expectSkippedDepth(
		[](auto& o)
		{ o.relativePoseIntensityWRTDepth = CPose3D(0.02, 0, 0, 0, 0, 0); },
		TSkipReason::UNSUPPORTED_CALIBRATION);
}

TEST(CSgfOdometry, TimesOutOfOrder)
{
	expectSkippedStereo(
		[](auto& o) { o.timestamp = mrpt::Clock::fromDouble(CRoom::time(0)); },
		TSkipReason::NOT_IN_ORDER);
	expectSkippedStereo(
		[](auto& o) { o.timestamp = mrpt::Clock::fromDouble(CRoom::time(-9)); },
		TSkipReason::NOT_IN_ORDER);
	expectSkippedStereo(
		[](auto& o) { o.timestamp = INVALID_TIMESTAMP; },
		TSkipReason::NO_TIMESTAMP);
}

TEST(CSgfOdometry, GapsAreReported)
{
	CSgfOdometry odometry = quiet();
	odometry.process(*CRoom::stereo(CRoom::pose(0), 1));
	odometry.process(*CRoom::stereo(CRoom::pose(1), 4));
	EXPECT_NE(odometry.report().find("gaps over 1 s: 1"), std::string::npos);
}

// A frame of which nothing is known gives no pose.
TEST(CSgfOdometry, BlackFramesGiveNoPose)
{
	CSgfOdometry odometry = quiet();
	drive(odometry, CRoom::stereo, 4);
	auto dark = CRoom::stereo(CRoom::pose(4), CRoom::time(4));
	for (auto* image : {&dark->imageLeft, &dark->imageRight})
		image->filledRectangle(
			0, 0, CRoom::kColumns - 1, CRoom::kRows - 1,
			mrpt::img::TColor::black());
	const auto r = odometry.process(*dark);
	EXPECT_EQ(r.quality, TQuality::LOST);
	EXPECT_FALSE(r.pose || r.increment);
	const auto found =
		odometry.process(*CRoom::stereo(CRoom::pose(5), CRoom::time(5)));
	ASSERT_TRUE(found.pose);
	EXPECT_LT((found.pose->mean - CRoom::pose(5)).norm(), 0.01);
	EXPECT_EQ(odometry.trajectory().size(), 5U);
}

// A robot that was carried to where nothing is known starts anew: from then on
// there are increments, the first of them wide, but no poses.
TEST(CSgfOdometry, AfterARestartThereAreIncrementsOnly)
{
	CSgfOdometry odometry = quiet();
	odometry.params.odometry["lost_frames"] = "1";
	drive(odometry, CRoom::stereo, 3);
	const auto elsewhere = [](int i)
	{
		const CPose3D around(0, 0, 0, mrpt::DEG2RAD(180.0), 0, 0);
		return CRoom::stereo(around + CRoom::pose(i), CRoom::time(i));
	};
	EXPECT_EQ(odometry.process(*elsewhere(3)).quality, TQuality::LOST);
	const auto bridge = odometry.process(*elsewhere(4));
	ASSERT_EQ(bridge.quality, TQuality::RELATIVE);
	EXPECT_FALSE(bridge.pose);
	ASSERT_TRUE(bridge.increment);
	// 1 m/s over the two periods without tracking
	EXPECT_NEAR(std::sqrt(bridge.increment->cov(0, 0)), 0.1, 1e-6);
	const auto next = odometry.process(*elsewhere(5));
	ASSERT_EQ(next.quality, TQuality::RELATIVE);
	EXPECT_FALSE(next.pose);
	ASSERT_TRUE(next.increment);
	EXPECT_LT(
		(next.increment->mean - (CRoom::pose(5) - CRoom::pose(4))).norm(),
		0.01);
	EXPECT_LT(std::sqrt(next.increment->cov(0, 0)), 0.02);
	EXPECT_EQ(odometry.trajectory().size(), 3U);
	EXPECT_NE(odometry.report().find("restarts: 1"), std::string::npos);
}

TEST(CSgfOdometry, OtherClassesAndLabelsAreLeftAlone)
{
	CSgfOdometry odometry = quiet();
	EXPECT_FALSE(odometry.processObservation(CObservationImage()));
	auto obs = CRoom::stereo({}, 1);
	EXPECT_TRUE(odometry.processObservation(*obs));
	obs = CRoom::stereo({}, 2);
	obs->sensorLabel = "REAR";
	EXPECT_FALSE(odometry.processObservation(*obs));
	EXPECT_EQ(odometry.trajectory().size(), 1U);
}

TEST(CSgfOdometry, ImuWithoutRatesIsCounted)
{
	CSgfOdometry odometry = quiet();
	CObservationIMU imu;
	imu.timestamp = mrpt::Clock::fromDouble(CRoom::time(0) + 0.01);
	odometry.processIMU(imu);  // before the first frame: of no use
	odometry.process(*CRoom::stereo({}, CRoom::time(0)));
	odometry.processIMU(imu);
	EXPECT_EQ(odometry.skippedCount(TSkipReason::NO_RATES), 1U);
	for (const auto axis : {IMU_WX, IMU_WY, IMU_WZ}) imu.set(axis, 0);
	odometry.processIMU(imu);
	odometry.processIMU(imu);
	EXPECT_EQ(odometry.skippedCount(TSkipReason::NOT_IN_ORDER), 1U);
}

// Between two frames the robot turns by more than images can follow; the
// gyroscope says so.
TEST(CSgfOdometry, GyroscopePredictsTurns)
{
	const CPose3D turned(0, 0, 0, mrpt::DEG2RAD(25.0), 0, 0);
	const auto errorDeg = [&](bool useImu)
	{
		CSgfOdometry odometry = quiet();
		odometry.params.use_imu = useImu;
		odometry.process(*CRoom::stereo({}, 1));
		for (int i = 1; i <= 20; ++i)
		{
			CObservationIMU imu;
			imu.timestamp = mrpt::Clock::fromDouble(1 + 0.05 * i / 20);
			imu.sensorPose = CPose3D(0, 0, 0, 0, M_PI / 2, 0);  // x down
			imu.set(IMU_WX, -mrpt::DEG2RAD(25.0) / 0.05);
			imu.set(IMU_WY, 0);
			imu.set(IMU_WZ, 0);
			odometry.processIMU(imu);
		}
		const auto r = odometry.process(*CRoom::stereo(turned, 1.05));
		return r.pose ? angleDeg(r.pose->mean - turned) : 180.0;
	};
	EXPECT_LT(errorDeg(true), 0.3);
	EXPECT_GT(errorDeg(false), 1.0);
}

TEST(CSgfOdometryParams, ComeBackFromAConfiguration)
{
	CSgfOdometry::TParams params;
	params.sensor_label = "FRONT";
	params.max_gap_s = 2.5;
	params.odometry["alignment.residual"] = "photo";
	mrpt::config::CConfigFileMemory config;
	params.saveToConfigFile(config, "O");
	EXPECT_EQ(config.read_string("O", "alignment.residual", ""), "photo");
	EXPECT_EQ(config.read_string("O", "use_imu", ""), "true");
	CSgfOdometry::TParams back;
	back.loadFromConfigFile(config, "O");
	EXPECT_EQ(back.sensor_label, "FRONT");
	EXPECT_EQ(back.max_gap_s, 2.5);
	EXPECT_EQ(back.odometry.at("alignment.residual"), "photo");
}

TEST(CSgfOdometryParams, WhatIsWrongIsNamed)
{
	const auto message = [](const std::string& text) -> std::string
	{
		try
		{
			mrpt::config::CConfigFileMemory config;
			config.setContent(text);
			CSgfOdometry::TParams().loadFromConfigFile(config, "O");
		}
		catch (const std::exception& e)
		{
			return e.what();
		}
		return "";
	};
	const auto names = [&](const std::string& text, const std::string& part)
	{ return message(text).find(part) != std::string::npos; };
	EXPECT_EQ(message("[O]\nuse_imu = false\nmax_depth_m = 20 // far\n"), "");
	EXPECT_TRUE(names("[O]\nuse_imo = false\n", "use_imo"));
	EXPECT_TRUE(names("[O]\nuse_imu = maybe\n", "maybe"));
	EXPECT_TRUE(names("[O]\nalignment.residul = sgf\n", "residul"));
	EXPECT_TRUE(names("[O]\nmax_gap_s = -1\n", "max_gap_s"));
	EXPECT_TRUE(
		names("[O]\nalignment.residual = sfg\n", "section O: residual"));
	EXPECT_TRUE(names("[O]\nmin_depth_m = 200\n", "section O: min_depth_m"));
	EXPECT_TRUE(names("[P]\n", "[O]"));
}
