/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/poses/CPose3D.h>
#include <mrpt/serialization/CArchive.h>
#include <mrpt/sgf/CObservationSource.h>

#include <fstream>

#include "support/temp_dir.h"
#include "syntheticRoom.h"

using namespace mrpt::sgf;
using namespace mrpt::obs;
using mrpt::sgf::testing::CRoom;

namespace
{
CObservationIMU::Ptr imuAt(double time_s)
{
	auto imu = CObservationIMU::Create();
	imu->timestamp = mrpt::Clock::fromDouble(time_s);
	return imu;
}

std::vector<double> timesOf(const std::string& file)
{
	std::vector<double> times;
	const auto source = openRawlog(file);
	while (const auto obs = source->next())
		times.push_back(mrpt::Clock::toDouble(obs->timestamp));
	return times;
}

template <class... OBJECTS>
void write(const std::string& file, const OBJECTS&... objects)
{
	mrpt::io::CFileGZOutputStream stream(file);
	auto archive = mrpt::serialization::archiveFrom(stream);
	(archive.WriteObject(&objects), ...);
}

std::string messageOf(const std::function<void()>& f)
{
	try
	{
		f();
	}
	catch (const std::exception& e)
	{
		return e.what();
	}
	return "";
}

const std::vector<double> kOneTwoThree{1, 2, 3};
}  // namespace

TEST(Rawlog, ObservationsOfBothFormatsAndOfAWholeRawlog)
{
	const ::sgf::TempDir dir;
	const std::string file = dir.path() / "in.rawlog";
	write(file, *imuAt(1), *imuAt(2), *imuAt(3));
	EXPECT_EQ(timesOf(file), kOneTwoThree);

	CSensoryFrame first, second;
	first.insert(imuAt(1));
	first.insert(imuAt(2));
	second.insert(imuAt(3));
	write(file, CActionCollection(), first, CActionCollection(), second);
	EXPECT_EQ(timesOf(file), kOneTwoThree);

	CRawlog whole;
	for (const double t : kOneTwoThree) whole.insert(imuAt(t));
	write(file, whole);
	EXPECT_EQ(timesOf(file), kOneTwoThree);
}

TEST(Rawlog, WhatCannotBeReadIsNamed)
{
	const ::sgf::TempDir dir;
	const std::string file = dir.path() / "in.rawlog";
	EXPECT_NE(
		messageOf([&] { openRawlog(file); }).find(file), std::string::npos);
	std::ofstream(file) << "this is no rawlog";
	EXPECT_NE(
		messageOf([&] { openRawlog(file); }).find(file), std::string::npos);
	std::ofstream(file, std::ios::trunc);
	EXPECT_NE(
		messageOf([&] { openRawlog(file); }).find(file), std::string::npos);
	write(file, *imuAt(1), mrpt::poses::CPose3D());
	EXPECT_NE(
		messageOf([&] { timesOf(file); }).find("CPose3D"), std::string::npos);
}

// A file that was cut off within an object is not taken for a whole one.
TEST(Rawlog, CutOffIsAnError)
{
	const ::sgf::TempDir dir;
	const std::string file = dir.path() / "in.rawlog";
	{
		// Not compressed, so that the cut can be put into the second object.
		mrpt::io::CFileGZOutputStream stream;
		ASSERT_TRUE(stream.open(file, 0));
		auto archive = mrpt::serialization::archiveFrom(stream);
		archive.WriteObject(imuAt(1).get());
		archive.WriteObject(imuAt(2).get());
	}
	const auto size = std::filesystem::file_size(file);
	std::filesystem::resize_file(file, size - size / 4);
	EXPECT_NE(
		messageOf([&] { timesOf(file); }).find("object 1"), std::string::npos);
}

TEST(Rawlog, ExternalImagesAreFoundBesideIt)
{
	const ::sgf::TempDir dir;
	const std::string file = dir.path() / "in.rawlog";
	std::filesystem::create_directory(dir.path() / "in_Images");
	auto obs = CRoom::stereo({}, 1);
	ASSERT_TRUE(obs->imageLeft.saveToFile(dir.path() / "in_Images" / "l.png"));
	const auto level = obs->imageLeft.at<uint8_t>(7, 5);
	obs->imageLeft.setExternalStorage("l.png");
	write(file, *obs);
	const auto read = std::dynamic_pointer_cast<CObservationStereoImages>(
		openRawlog(file)->next());
	ASSERT_TRUE(read);
	EXPECT_EQ(read->imageLeft.at<uint8_t>(7, 5), level);
}

TEST(Dataset, WhatIsWrongIsNamed)
{
	const ::sgf::TempDir dir;
	EXPECT_NE(
		messageOf([&] { openDataset(dir.path(), {}); })
			.find(dir.path().string()),
		std::string::npos);
	EXPECT_NE(
		messageOf([&] { openDataset(dir.path(), {"kiti"}); }).find("kiti"),
		std::string::npos);
}
