/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <algorithm>
#include <string>
#include <vector>

#include "syntheticRoom.h"

using namespace mrpt::sgf;
using namespace mrpt::obs;
using mrpt::poses::CPose3D;
using mrpt::sgf::testing::CRoom;

namespace
{
constexpr int kFrames = 40;
constexpr double kFramePeriod_s = 0.05, kImuPeriod_s = 0.005;
// The sensor has a clock of its own: no measurement is at a frame's time.
constexpr double kImuOffset_s = 0.002;

using TObservations = std::vector<CObservation::Ptr>;

TObservations imageSequence(double k1)
{
	TObservations all;
	for (int i = 0; i < kFrames; ++i)
		all.push_back(CRoom::bentStereo(
			CRoom::flight(i * kFramePeriod_s), CRoom::time(i), k1));
	return all;
}

const TObservations& images()
{
	static const TObservations kImages = imageSequence(0);
	return kImages;
}

TObservations measurements(double from_s = -0.5)
{
	TObservations all;
	for (double s = from_s + kImuOffset_s; s < kFrames * kFramePeriod_s;
		 s += kImuPeriod_s)
		all.push_back(CRoom::imu(s));
	return all;
}

// Both in the order of their times.
// \param delay_s of the measurements
TObservations merged(
	const TObservations& frames, const TObservations& imu, double delay_s = 0)
{
	TObservations all = frames;
	all.insert(all.end(), imu.begin(), imu.end());
	const auto comes = [&](const CObservation::Ptr& obs)
	{
		return mrpt::Clock::toDouble(obs->timestamp) +
			   (IS_CLASS(*obs, CObservationIMU) ? delay_s : 0);
	};
	std::stable_sort(
		all.begin(), all.end(),
		[&](const auto& a, const auto& b) { return comes(a) < comes(b); });
	return all;
}

CSgfOdometry odometryWith(const std::string& lines)
{
	mrpt::config::CConfigFileMemory config;
	config.setContent("[O]\n" + lines);
	CSgfOdometry odometry;
	odometry.logging_enable_console_output = false;
	odometry.logging_enable_keep_record = true;
	odometry.params.loadFromConfigFile(config, "O");
	return odometry;
}

CSgfOdometry stereoInertial(const std::string& lines = "")
{
	// The images are small: more points than the default's.
	return odometryWith(
		"estimator = stereo_inertial\nflow.cell_px = 28\n" + lines);
}

// Results of all frames.
std::vector<TResult> run(
	CSgfOdometry& odometry, const TObservations& observations)
{
	std::vector<TResult> results;
	for (const auto& obs : observations)
		if (const auto r = odometry.processObservation(*obs);
			r && r->quality != TQuality::WAITING)
			results.push_back(*r);
	while (const auto r = odometry.finish()) results.push_back(*r);
	return results;
}

CPose3D truthAt(mrpt::Clock::time_point time)
{
	return CRoom::flight(mrpt::Clock::toDouble(time) - CRoom::time(0));
}

// All frames have a pose, and it is that of the flight.
void expectOnTheFlight(const std::vector<TResult>& results, double limit_m)
{
	ASSERT_EQ(results.size(), size_t(kFrames));
	for (const auto& r : results)
	{
		ASSERT_EQ(r.quality, TQuality::GOOD);
		ASSERT_TRUE(r.pose);
		const CPose3D error = r.pose->mean - truthAt(r.timestamp);
		const double cosine = (error.getRotationMatrix().trace() - 1) / 2;
		EXPECT_LT(error.norm(), limit_m);
		EXPECT_LT(
			mrpt::RAD2DEG(std::acos(std::clamp(cosine, -1.0, 1.0))), 0.3);
	}
}

// The uncertainty of the position starts from 0, and never again.
// \param share of it that is left at least where it falls from frame to frame
void expectNothingForgotten(
	const std::vector<TResult>& results, double share)
{
	double before = 0;
	for (const auto& r : results)
	{
		const auto cov = r.pose->cov.asEigen();
		const double trace = cov.topLeftCorner<3, 3>().trace();
		EXPECT_GE(trace, share * before);
		before = trace;
	}
	EXPECT_GT(before, 0);
}

bool says(const CSgfOdometry& odometry, const std::string& text)
{
	return odometry.getLogAsString().find(text) != std::string::npos;
}

bool reports(const CSgfOdometry& odometry, const std::string& text)
{
	return odometry.report().find(text) != std::string::npos;
}

// What is wrong with the sensor is in the result, the log and the report.
void expectNamed(
	const CSgfOdometry& odometry, const TResult& last, const std::string& said)
{
	ASSERT_TRUE(last.inertial);
	EXPECT_FALSE(last.inertial->active);
	EXPECT_NE(last.inertial->problem.find(said), std::string::npos)
		<< last.inertial->problem;
	EXPECT_TRUE(says(odometry, said)) << odometry.getLogAsString();
	EXPECT_TRUE(reports(odometry, said)) << odometry.report();
}

TObservations changed(
	TObservations observations,
	const std::function<void(CObservationIMU&)>& change)
{
	for (auto& obs : observations)
	{
		auto imu = std::make_shared<CObservationIMU>(
			dynamic_cast<const CObservationIMU&>(*obs));
		change(*imu);
		obs = imu;
	}
	return observations;
}
}  // namespace

TEST(StereoInertial, IsChosenByTheConfiguration)
{
	for (const auto& [name, inertial] :
		 {std::pair("stereo", false), std::pair("stereo_inertial", true)})
	{
		CSgfOdometry odometry =
			odometryWith(std::string("estimator = ") + name);
		const auto results = run(odometry, {images()[0], images()[1]});
		ASSERT_EQ(results.size(), 2U);
		EXPECT_EQ(results[1].inertial.has_value(), inertial);
		mrpt::config::CConfigFileMemory config;
		odometry.params.saveToConfigFile(config, "O");
		EXPECT_EQ(config.read_string("O", "estimator", ""), name);
	}
}

TEST(StereoInertial, TracksAFlight)
{
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, merged(images(), measurements()));
	expectOnTheFlight(results, 0.01);
	EXPECT_EQ(odometry.trajectory().size(), size_t(kFrames));
	const auto& last = *results.back().inertial;
	EXPECT_TRUE(last.active) << last.problem;
	EXPECT_TRUE(last.problem.empty());
	EXPECT_FALSE(last.predicted);
	EXPECT_TRUE(reports(odometry, "inertial sensor: takes part"));
	// Velocity of the sensor's place.
	const double end_s = (kFrames - 1) * kFramePeriod_s;
	const auto place = [](double s)
	{ return (CRoom::flight(s) + CRoom::sensorPose()).translation(); };
	const auto velocity = (place(end_s + 1e-4) - place(end_s - 1e-4)) / 2e-4;
	EXPECT_LT((last.velocity - velocity).norm(), 0.05);
	EXPECT_GT(last.up.z, std::cos(mrpt::DEG2RAD(1.0)));
	EXPECT_LT(last.gyroBias.norm(), 0.01);
	EXPECT_LT(last.accelBias.norm(), 0.1);
}

// Also where the odometry corrects what it took for true before.
TEST(StereoInertial, IncrementsAddUpAndTheirCovarianceIsSound)
{
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, merged(images(), measurements()));
	CPose3D sum;
	double sumOfSquares = 0;
	for (size_t i = 1; i < results.size(); ++i)
	{
		ASSERT_TRUE(results[i].increment);
		const auto& increment = *results[i].increment;
		sum = sum + increment.mean;
		EXPECT_LT((results[i].pose->mean - sum).norm(), 1e-9);
		const CPose3D truth =
			truthAt(results[i].timestamp) - truthAt(results[i - 1].timestamp);
		Eigen::Matrix<double, 6, 1> d;
		for (int k = 0; k < 6; ++k) d[k] = increment.mean[k] - truth[k];
		const Eigen::MatrixXd cov = increment.cov.asEigen();
		Eigen::LLT<Eigen::MatrixXd> factor(cov);
		ASSERT_EQ(factor.info(), Eigen::Success);
		// In deviations; six are expected of their sum in the mean, and these
		// images are better than the odometry takes images to be.
		const double squares = d.dot(factor.solve(d));
		EXPECT_LT(squares, 22.5) << i;  // 99.9 % are below
		sumOfSquares += squares;
	}
	EXPECT_GT(sumOfSquares, 0.05 * kFrames);
	EXPECT_LT(sumOfSquares, 6 * kFrames);
	expectNothingForgotten(results, 0.8);
}

TEST(StereoInertial, KeyframePointsLieOnTheWalls)
{
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, merged(images(), measurements()));
	size_t onWall = 0, all = 0, keyframes = 0;
	for (const auto& r : results)
	{
		if (!r.keyframePoints) continue;
		++keyframes;
		const auto& scan = *r.keyframePoints;
		const CPose3D sensor = r.pose->mean + scan.sensorPose;
		for (size_t i = 0; i < scan.points3D_x.size(); ++i)
		{
			const auto p = sensor.composePoint(mrpt::math::TPoint3D(
				scan.points3D_x[i], scan.points3D_y[i], scan.points3D_z[i]));
			const double gap = std::min(
				{4 - std::abs(p.x), 3 - std::abs(p.y), 1.5 - std::abs(p.z)});
			onWall += std::abs(gap) < 0.25;
			++all;
		}
	}
	EXPECT_EQ(odometry.map().size(), keyframes);
	EXPECT_GT(all, 50U);
	EXPECT_GT(onWall, 0.9 * all);
}

TEST(StereoInertial, TakesRawImages)
{
	CSgfOdometry odometry = stereoInertial();
	expectOnTheFlight(
		run(odometry, merged(imageSequence(-0.1), measurements())), 0.01);
}

// Measurements that come late change nothing but when results come.
TEST(StereoInertial, FramesWaitForMeasurements)
{
	CSgfOdometry inTime = stereoInertial(), late = stereoInertial();
	const auto expected = run(inTime, merged(images(), measurements()));
	const auto results = run(late, merged(images(), measurements(), 0.18));
	ASSERT_EQ(results.size(), expected.size());
	for (size_t i = 0; i < results.size(); ++i)
	{
		EXPECT_EQ(results[i].timestamp, expected[i].timestamp);
		EXPECT_EQ(results[i].pose->mean, expected[i].pose->mean) << i;
	}
	CSgfOdometry fresh = stereoInertial();
	fresh.processObservation(*measurements().front());
	const auto waits = fresh.processObservation(*images()[0]);
	ASSERT_TRUE(waits);
	EXPECT_EQ(waits->quality, TQuality::WAITING);
	EXPECT_FALSE(waits->pose || waits->skipped);
}

TEST(StereoInertial, NoMoreFramesWaitThanAllowed)
{
	CSgfOdometry odometry = stereoInertial("max_waiting_frames = 2");
	for (int i = 0; i < 5; ++i)
	{
		const auto r = odometry.processObservation(*images()[i]);
		ASSERT_TRUE(r);
		EXPECT_EQ(r->quality, i < 2 ? TQuality::WAITING : TQuality::GOOD);
		if (i < 2) continue;
		EXPECT_EQ(r->timestamp, images()[i - 2]->timestamp);
	}
	EXPECT_TRUE(odometry.finish());
	EXPECT_TRUE(odometry.finish());
	EXPECT_FALSE(odometry.finish());
}

TEST(StereoInertial, MeasurementsOutOfOrderAreCounted)
{
	TObservations imu = measurements();
	for (size_t i = 20; i + 1 < imu.size(); i += 50)
		std::swap(imu[i], imu[i + 1]);
	const size_t swapped = (imu.size() - 2 - 20) / 50 + 1;
	TObservations all;
	size_t next = 0;
	for (const auto& frame : images())
	{
		while (next < imu.size() && imu[next]->timestamp < frame->timestamp)
			all.push_back(imu[next++]);
		all.push_back(frame);
	}
	all.insert(all.end(), imu.begin() + next, imu.end());
	CSgfOdometry odometry = stereoInertial();
	expectOnTheFlight(run(odometry, all), 0.01);
	EXPECT_EQ(odometry.skippedCount(TSkipReason::NOT_IN_ORDER), swapped);
}

TEST(StereoInertial, AccelerationInGIsNamed)
{
	const auto imu = changed(
		measurements(),
		[](auto& obs)
		{
			for (const auto axis : {IMU_X_ACC, IMU_Y_ACC, IMU_Z_ACC})
				obs.set(axis, obs.get(axis) / 9.81);
		});
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, merged(images(), imu));
	expectOnTheFlight(results, 0.02);  // by images alone
	expectNamed(odometry, results.back(), "acceleration in g?");
}

// The rates lead the flow astray: the first frames are lost, and there are
// increments from then on.
TEST(StereoInertial, RatesInDegreesAreNamed)
{
	const auto imu = changed(
		measurements(),
		[](auto& obs)
		{
			for (const auto axis : {IMU_WX, IMU_WY, IMU_WZ})
				obs.set(axis, mrpt::RAD2DEG(obs.get(axis)));
		});
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, merged(images(), imu));
	EXPECT_EQ(results.back().quality, TQuality::RELATIVE);
	EXPECT_FALSE(results.back().pose);
	EXPECT_LT(
		(results.back().increment->mean -
		 (truthAt(results[kFrames - 1].timestamp) -
		  truthAt(results[kFrames - 2].timestamp)))
			.norm(),
		0.01);
	expectNamed(odometry, results.back(), "the gyroscope's rotations");
}

TEST(StereoInertial, WithoutSensorImagesAlone)
{
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, images());
	expectOnTheFlight(results, 0.02);
	expectNamed(
		odometry, results.back(), "there are no inertial observations");
}

TEST(StereoInertial, SwitchedOffTheSensorIsNotWaitedFor)
{
	CSgfOdometry odometry = stereoInertial("use_imu = false");
	odometry.processObservation(*measurements().front());
	const auto r = odometry.processObservation(*images()[0]);
	ASSERT_TRUE(r && r->pose);
	EXPECT_FALSE(r->inertial->active);
	EXPECT_TRUE(reports(odometry, "it is switched off"));
}

// A driver that starts later than the camera's.
TEST(StereoInertial, ASensorThatComesLaterTakesPart)
{
	CSgfOdometry odometry = stereoInertial("start_s = 0.5");
	const auto results = run(odometry, merged(images(), measurements(0.9)));
	expectOnTheFlight(results, 0.02);
	const auto active = std::find_if(
		results.begin(), results.end(),
		[](const auto& r) { return r.inertial->active; });
	expectNothingForgotten({results.begin(), active}, 0.95);
	EXPECT_TRUE(results.back().inertial->active)
		<< results.back().inertial->problem;
}

// Measurements that end are missed, and it is said.
TEST(StereoInertial, ASensorThatFallsSilentIsReported)
{
	TObservations imu = measurements();
	imu.resize(imu.size() * 3 / 4);
	CSgfOdometry odometry = stereoInertial();
	expectOnTheFlight(run(odometry, merged(images(), imu)), 0.03);
	EXPECT_TRUE(says(odometry, "no inertial measurements up to"));
	EXPECT_FALSE(reports(odometry, "frames without: 0"));
}

// Nothing is seen for a moment: the sensor tells the pose.
TEST(StereoInertial, BlackFramesArePredicted)
{
	TObservations frames = images();
	for (const int i : {34, 35})
	{
		auto dark = std::make_shared<CObservationStereoImages>(
			dynamic_cast<const CObservationStereoImages&>(*frames[i]));
		for (auto* image : {&dark->imageLeft, &dark->imageRight})
		{
			*image = mrpt::img::CImage(
				CRoom::kColumns, CRoom::kRows, mrpt::img::CH_GRAY);
			image->filledRectangle(
				0, 0, CRoom::kColumns - 1, CRoom::kRows - 1,
				mrpt::img::TColor::black());
		}
		frames[i] = dark;
	}
	CSgfOdometry odometry = stereoInertial();
	const auto results = run(odometry, merged(frames, measurements()));
	expectOnTheFlight(results, 0.03);
	EXPECT_TRUE(results[34].inertial->predicted);
	EXPECT_FALSE(results[39].inertial->predicted);
}

TEST(StereoInertial, WhatCannotBeUsedIsCounted)
{
	CSgfOdometry odometry = stereoInertial();
	const auto skips = [&](const CObservation& obs, TSkipReason reason)
	{
		const size_t before = odometry.skippedCount(reason);
		odometry.processObservation(obs);
		return odometry.skippedCount(reason) == before + 1;
	};
	EXPECT_TRUE(skips(
		*CRoom::withDepth({}, 1), TSkipReason::UNSUPPORTED_SENSOR));
	auto fisheye = *CRoom::stereo({}, 1);
	fisheye.leftCamera.setDistortionKannalaBrandt(0.1, 0, 0, 0);
	EXPECT_TRUE(skips(fisheye, TSkipReason::UNSUPPORTED_CALIBRATION));
	auto imu = *CRoom::imu(0);
	imu.dataIsPresent[IMU_Y_ACC] = false;
	EXPECT_TRUE(skips(imu, TSkipReason::NO_ACCELERATIONS));
	imu = *CRoom::imu(0);
	imu.sensorPose.x(NAN);
	EXPECT_TRUE(skips(imu, TSkipReason::NO_CALIBRATION));
	odometry.processObservation(*CRoom::imu(0));
	imu = *CRoom::imu(0.01);
	imu.sensorPose = CPose3D();
	EXPECT_TRUE(skips(imu, TSkipReason::CALIBRATION_CHANGED));
	imu = *CRoom::imu(0.02);
	imu.sensorLabel = "OTHER";  // left alone
	imu.sensorPose = CPose3D();
	EXPECT_FALSE(skips(imu, TSkipReason::CALIBRATION_CHANGED));
	EXPECT_TRUE(odometry.processObservation(*CRoom::stereo({}, CRoom::time(0))));
}

TEST(StereoInertialParams, WhatIsWrongIsNamed)
{
	const auto message = [](const std::string& lines) -> std::string
	{
		try
		{
			odometryWith(lines);
		}
		catch (const std::exception& e)
		{
			return e.what();
		}
		return "";
	};
	const auto names = [&](const std::string& lines, const std::string& part)
	{ return message(lines).find(part) != std::string::npos; };
	EXPECT_TRUE(
		names("estimator = mono", "estimator is 'mono'; known: stereo, "));
	EXPECT_TRUE(names("flow.residal = sgf", "'flow'") ||
				names("flow.residal = sgf", "residal"));
	EXPECT_TRUE(names("flow.residual = sfg", "section O: residual"));
	EXPECT_TRUE(names("max_waiting_frames = -1", "max_waiting_frames"));
	EXPECT_TRUE(names("gyroscope_noise_density = 0", "section O"));
	// Options of both stand in one section.
	EXPECT_EQ(
		message("flow.residual = sgf3\nalignment.residual = photo\n"), "");
}
