/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/poses/CPose3D.h>

#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include <sgf/core/camera.h>
#include <sgf/core/random.h>
#include <sgf/core/se3.h>

/** What a camera on a robot sees in a room with textured walls, for tests. */
namespace mrpt::sgf::testing
{
/** Grey level of the wall at a point: smooth noise of two sizes. */
inline double greyAt(const Eigen::Vector3d& p)
{
	const auto lattice = [](const Eigen::Vector3i& c, uint64_t seed)
	{
		const auto index = uint64_t(c.x() + 4096) << 40 ^
						   uint64_t(c.y() + 4096) << 20 ^
						   uint64_t(c.z() + 4096);
		return ::sgf::Uniform01(seed, index);
	};
	const auto noise = [&](const Eigen::Vector3d& q, uint64_t seed)
	{
		const Eigen::Vector3i base = q.array().floor().cast<int>();
		const Eigen::Vector3d f = q - base.cast<double>();
		double value = 0;
		for (int corner = 0; corner < 8; ++corner)
		{
			const Eigen::Vector3i o(corner & 1, corner >> 1 & 1, corner >> 2);
			double weight = 1;
			for (int i = 0; i < 3; ++i) weight *= o[i] ? f[i] : 1 - f[i];
			value += weight * lattice(base + o, seed);
		}
		return value;
	};
	return 20 + 140 * noise(p / 0.25, 1) + 70 * noise(p / 0.08, 2);
}

struct THit
{
	double depth;  //!< along the optical axis, m
	double grey;
};

/** A room of 8 x 6 x 3 m around the origin, seen by a pinhole camera. */
class CRoom
{
 public:
	static constexpr int kColumns = 320, kRows = 240;
	static constexpr double kFocal = 200;      // px
	static constexpr double kBaseline = 0.12;  // m

	/** The camera on the robot: forward, half a metre up. */
	static mrpt::poses::CPose3D cameraPose()
	{
		return mrpt::poses::CPose3D(
			0.1, 0, 0.5, mrpt::DEG2RAD(-90.0), 0, mrpt::DEG2RAD(-90.0));
	}

	static mrpt::img::TCamera camera()
	{
		mrpt::img::TCamera c;
		c.ncols = kColumns;
		c.nrows = kRows;
		c.setIntrinsicParamsFromValues(
			kFocal, kFocal, (kColumns - 1) / 2.0, (kRows - 1) / 2.0);
		return c;
	}

	static THit look(const mrpt::poses::CPose3D& camera, double x, double y)
	{
		const auto c = CRoom::camera();
		const Eigen::Matrix3d R = camera.getRotationMatrix().asEigen();
		const Eigen::Vector3d origin(camera.x(), camera.y(), camera.z());
		const Eigen::Vector3d ray =
			R *
			Eigen::Vector3d((x - c.cx()) / kFocal, (y - c.cy()) / kFocal, 1);
		const Eigen::Vector3d half(4, 3, 1.5);
		double depth = std::numeric_limits<double>::max();
		for (int i = 0; i < 3; ++i)
			if (ray[i] != 0)
				depth = std::min(
					depth,
					(std::copysign(half[i], ray[i]) - origin[i]) / ray[i]);
		return {depth, greyAt(origin + depth * ray)};
	}

	static mrpt::img::CImage image(
		const mrpt::poses::CPose3D& camera, double k1 = 0)
	{
		const auto ideal = CRoom::camera();
		const ::sgf::Camera bent{kColumns,   kRows,      kFocal, kFocal,
						   ideal.cx(), ideal.cy(), k1};
		mrpt::img::CImage out(kColumns, kRows, mrpt::img::CH_GRAY);
		for (int y = 0; y < kRows; ++y)
			for (int x = 0; x < kColumns; ++x)
			{
				const Eigen::Vector3d ray = bent.Unproject({x, y});
				const THit hit = look(
					camera, kFocal * ray.x() + ideal.cx(),
					kFocal * ray.y() + ideal.cy());
				*out.ptr<uint8_t>(x, y) =
					static_cast<uint8_t>(std::lround(hit.grey));
			}
		return out;
	}

	/** Stereo images of a robot at a pose, rectified. */
	static mrpt::obs::CObservationStereoImages::Ptr stereo(
		const mrpt::poses::CPose3D& robot, double time_s)
	{
		return bentStereo(robot, time_s, 0);
	}

	/** The same by cameras with distortion. */
	static mrpt::obs::CObservationStereoImages::Ptr bentStereo(
		const mrpt::poses::CPose3D& robot, double time_s, double k1)
	{
		auto obs = mrpt::obs::CObservationStereoImages::Create();
		obs->timestamp = mrpt::Clock::fromDouble(time_s);
		obs->sensorLabel = "STEREO";
		obs->leftCamera = obs->rightCamera = camera();
		obs->cameraPose = mrpt::poses::CPose3DQuat(cameraPose());
		const mrpt::poses::CPose3D onLeft(kBaseline, 0, 0, 0, 0, 0);
		obs->rightCameraPose = mrpt::poses::CPose3DQuat(onLeft);
		if (k1 != 0)
			for (auto* c : {&obs->leftCamera, &obs->rightCamera})
				c->setDistortionPlumbBob(k1, 0, 0, 0);
		obs->imageLeft = image(robot + cameraPose(), k1);
		obs->imageRight = image(robot + cameraPose() + onLeft, k1);
		obs->hasImageRight = true;
		return obs;
	}

	/** Image and depth of a robot at a pose. */
	static mrpt::obs::CObservation3DRangeScan::Ptr withDepth(
		const mrpt::poses::CPose3D& robot, double time_s)
	{
		auto obs = mrpt::obs::CObservation3DRangeScan::Create();
		obs->timestamp = mrpt::Clock::fromDouble(time_s);
		obs->sensorLabel = "RGBD";
		obs->cameraParams = obs->cameraParamsIntensity = camera();
		const mrpt::poses::CPose3D seen = robot + cameraPose();
		// The depth sensor's own frame looks along x.
		obs->sensorPose = cameraPose() + (-obs->relativePoseIntensityWRTDepth);
		obs->intensityImage = image(seen);
		obs->hasIntensityImage = obs->hasRangeImage = true;
		obs->rangeImage_setSize(kRows, kColumns);
		for (int y = 0; y < kRows; ++y)
			for (int x = 0; x < kColumns; ++x)
				obs->rangeImage(y, x) = static_cast<uint16_t>(
					std::lround(look(seen, x, y).depth / obs->rangeUnits));
		return obs;
	}

	/** Pose of the robot in frame i of a gentle curve, from the origin on. */
	static mrpt::poses::CPose3D pose(int i)
	{
		return mrpt::poses::CPose3D(
			0.03 * i, 0.01 * i * i * 0.1, 0, mrpt::DEG2RAD(0.6 * i), 0, 0);
	}
	static double time(int i) { return 1000 + 0.05 * i; }

	/** Pose of a robot in lively flight, from the origin on.
	 * \param s seconds since time(0) */
	static mrpt::poses::CPose3D flight(double s)
	{
		return mrpt::poses::CPose3D(
			0.3 * std::sin(1.5 * s), 0.2 * (1 - std::cos(2 * s)),
			0.15 * std::sin(2.2 * s), 0.2 * std::sin(1.1 * s),
			0.1 * std::sin(1.7 * s), 0.12 * std::sin(1.3 * s));
	}

	/** The inertial sensor on the robot: beside and turned. */
	static mrpt::poses::CPose3D sensorPose()
	{
		return mrpt::poses::CPose3D(
			-0.1, 0.05, 0.2, mrpt::DEG2RAD(30.0), mrpt::DEG2RAD(80.0), 0);
	}

	/** What an ideal inertial sensor says in flight, gravity being along -z. */
	static mrpt::obs::CObservationIMU::Ptr imu(double s)
	{
		using namespace mrpt::obs;
		constexpr double kStep_s = 1e-3;
		const auto at = [](double t) { return flight(t) + sensorPose(); };
		const auto rotation = [&](double t) {
			return Eigen::Matrix3d(at(t).getRotationMatrix().asEigen());
		};
		const auto place = [&](double t)
		{ return Eigen::Vector3d(at(t).x(), at(t).y(), at(t).z()); };
		const Eigen::Matrix3d turn =
			rotation(s - kStep_s).transpose() * rotation(s + kStep_s);
		const Eigen::Vector3d rates =
			::sgf::LogSO3(Eigen::Quaterniond(turn)) / (2 * kStep_s);
		const Eigen::Vector3d moved =
			place(s - kStep_s) - 2 * place(s) + place(s + kStep_s);
		const Eigen::Vector3d accel =
			rotation(s).transpose() * (moved / (kStep_s * kStep_s) +
									   9.81 * Eigen::Vector3d::UnitZ());
		auto obs = CObservationIMU::Create();
		obs->timestamp = mrpt::Clock::fromDouble(time(0) + s);
		obs->sensorLabel = "IMU";
		obs->sensorPose = sensorPose();
		for (int i = 0; i < 3; ++i)
		{
			obs->set(std::array{IMU_WX, IMU_WY, IMU_WZ}[i], rates[i]);
			obs->set(
				std::array{IMU_X_ACC, IMU_Y_ACC, IMU_Z_ACC}[i], accel[i]);
		}
		return obs;
	}
};

}  // namespace mrpt::sgf::testing
