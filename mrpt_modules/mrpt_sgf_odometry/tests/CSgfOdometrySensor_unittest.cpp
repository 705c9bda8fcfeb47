/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/hwdrivers/CGenericSensor.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/serialization/CArchive.h>
#include <mrpt/sgf/CSgfOdometry.h>
#include <mrpt/system/os.h>

#include "support/temp_dir.h"
#include "syntheticRoom.h"

using namespace mrpt::sgf;
using namespace mrpt::obs;
using mrpt::hwdrivers::CGenericSensor;
using mrpt::sgf::testing::CRoom;

namespace
{
constexpr int kFrames = 5;

// The plug-in's sensor, made as rawlog-grabber makes it.
CGenericSensor::Ptr makeSensor(const std::string& lines)
{
	mrpt::system::loadPluginModules(SENSOR_PLUGIN);
	auto sensor = CGenericSensor::createSensorPtr("CSgfOdometrySensor");
	EXPECT_TRUE(sensor);
	mrpt::config::CConfigFileMemory config;
	config.setContent(
		"[S]\ndriver = CSgfOdometrySensor\nprocess_rate = 100\n"
		"sensorLabel = SGF\n" +
		lines);
	sensor->loadConfig(config, "S");
	return sensor;
}

std::string errorOf(const std::string& lines)
{
	try
	{
		makeSensor(lines)->initialize();
	}
	catch (const std::exception& e)
	{
		return e.what();
	}
	return "";
}

std::string write(
	const std::filesystem::path& file,
	const std::vector<CObservation::Ptr>& observations)
{
	mrpt::io::CFileGZOutputStream stream(file);
	auto archive = mrpt::serialization::archiveFrom(stream);
	for (const auto& obs : observations) archive.WriteObject(obs.get());
	return file;
}

std::string writeDrive(const std::filesystem::path& folder)
{
	std::vector<CObservation::Ptr> frames;
	for (int i = 0; i < kFrames; ++i)
		frames.push_back(CRoom::stereo(CRoom::pose(i), CRoom::time(i)));
	return write(folder / "drive.rawlog", frames);
}
}  // namespace

TEST(CSgfOdometrySensor, EmitsStockObservations)
{
	const ::sgf::TempDir dir;
	const auto sensor = makeSensor("path = " + writeDrive(dir.path()));
	sensor->initialize();
	CGenericSensor::TListObservations all;
	for (int i = 0; i <= kFrames; ++i)
	{
		sensor->doProcess();
		all.merge(sensor->getObservations());
	}
	int poses = 0, odometries = 0, comments = 0;
	mrpt::poses::CPose3D last;
	for (const auto& [time, object] : all)
	{
		if (const auto pose =
				std::dynamic_pointer_cast<CObservationRobotPose>(object))
		{
			++poses;
			EXPECT_EQ(pose->sensorLabel, "SGF");
			last = pose->pose.mean;
		}
		odometries += IS_CLASS(*object, CObservationOdometry);
		comments += IS_CLASS(*object, CObservationComment);
	}
	EXPECT_EQ(poses, kFrames);
	EXPECT_EQ(odometries, kFrames);
	EXPECT_EQ(comments, 2);
	EXPECT_LT((last - CRoom::pose(kFrames - 1)).norm(), 0.01);
	EXPECT_TRUE(IS_CLASS(*all.rbegin()->second, CObservationComment));
	EXPECT_NO_THROW(sensor->doProcess());  // nothing is left
	EXPECT_TRUE(sensor->getObservations().empty());
}

TEST(CSgfOdometrySensor, ARawlogThatIsCutOffGivesItsPosesAndTheReport)
{
	const ::sgf::TempDir dir;
	const auto file = writeDrive(dir.path());
	std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
	const auto sensor = makeSensor("path = " + file);
	sensor->initialize();
	CGenericSensor::TListObservations all;
	for (int i = 0; i <= kFrames; ++i)
	{
		EXPECT_NO_THROW(sensor->doProcess());
		all.merge(sensor->getObservations());
	}
	size_t poses = 0;
	for (const auto& [time, object] : all)
		poses += IS_CLASS(*object, CObservationRobotPose);
	EXPECT_GE(poses, 1U);
	EXPECT_LT(poses, size_t(kFrames));
	EXPECT_TRUE(IS_CLASS(*all.rbegin()->second, CObservationComment));
}

TEST(CSgfOdometrySensor, TakesImagesFromACameraSensor)
{
	const ::sgf::TempDir dir;
	const auto camera = dir.Write(
		"camera.ini",
		"[CAMERA]\nprocess_rate = 100\nsensorLabel = CAMERA\n"
		"grabber_type = rawlog\nrawlog_file = " +
			writeDrive(dir.path()) + "\n");
	const auto sensor = makeSensor("camera_config = " + camera.string());
	sensor->initialize();
	size_t poses = 0;
	for (int i = 0; i < kFrames; ++i)
	{
		sensor->doProcess();
		for (const auto& [time, object] : sensor->getObservations())
			poses += IS_CLASS(*object, CObservationRobotPose);
	}
	EXPECT_EQ(poses, size_t(kFrames));
}

// The inertial sensor is a sensor of its own: here, one that emits a rawlog.
TEST(CSgfOdometrySensor, TakesMeasurementsFromAnInertialSensor)
{
	const ::sgf::TempDir dir;
	std::vector<CObservation::Ptr> measurements;
	for (double s = 0.002; s < kFrames * 0.05; s += 0.005)
		measurements.push_back(CRoom::imu(s));
	const auto camera = dir.Write(
		"camera.ini",
		"[CAMERA]\nprocess_rate = 100\nsensorLabel = CAMERA\n"
		"grabber_type = rawlog\nrawlog_file = " +
			writeDrive(dir.path()) + "\n");
	const auto imu = dir.Write(
		"imu.ini",
		"[IMU]\ndriver = CSgfOdometrySensor\nprocess_rate = 100\n"
		"emit_source = true\npath = " +
			write(dir.path() / "imu.rawlog", measurements) + "\n");
	const auto sensor = makeSensor(
		"estimator = stereo_inertial\ncamera_config = " + camera.string() +
		"\nimu_config = " + imu.string() + "\nemit_source = true\n");
	sensor->initialize();
	size_t poses = 0, samples = 0;
	for (int i = 0; i < kFrames; ++i)
	{
		sensor->doProcess();
		for (const auto& [time, object] : sensor->getObservations())
		{
			poses += IS_CLASS(*object, CObservationRobotPose);
			samples += IS_CLASS(*object, CObservationIMU);
		}
	}
	EXPECT_EQ(poses, size_t(kFrames));
	EXPECT_EQ(samples, measurements.size());
}

TEST(CSgfOdometrySensor, ParametersAreInItsSection)
{
	EXPECT_EQ(
		errorOf("camera_config = c.ini\nalignment.residual = photo\n")
			.find("residual"),
		std::string::npos);
	EXPECT_NE(
		errorOf("path = x.rawlog\nalignment.levels = four\n").find("four"),
		std::string::npos);
}

TEST(CSgfOdometrySensor, BadSectionsAreNamed)
{
	EXPECT_NE(
		errorOf("path = x.rawlog\npaht = y")
			.find("section S: unknown key 'paht'"),
		std::string::npos);
	EXPECT_NE(errorOf("").find("camera_config"), std::string::npos);
	EXPECT_NE(
		errorOf("path = x.rawlog\nimu_config = i.ini")
			.find("imu_config has to go with camera_config"),
		std::string::npos);
	const ::sgf::TempDir dir;
	const auto imu = dir.Write("imu.ini", "[IMU]\ndriver = CNone\n");
	EXPECT_NE(
		errorOf("camera_config = c.ini\nimu_config = " + imu.string())
			.find("CNone"),
		std::string::npos);
	EXPECT_NE(
		errorOf("path = /nonexistent/x.rawlog").find("x.rawlog"),
		std::string::npos);
}
