/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/sgf/CObservationSource.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/core.h>

#include <sgf/core/options.h>
#include <sgf/io/odometry_dataset.h>

#include "conversions.h"

namespace mrpt::sgf
{
using namespace internal;
using mrpt::obs::CObservation;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationStereoImages;
using ::sgf::SE3;

namespace
{
// The file's option and its message are those of any option with names.
struct TLayoutOption
{
	::sgf::OdometryLayout layout = ::sgf::OdometryLayout::kEuroc;

	template <class V>
	void VisitFields(V&& visit)
	{
		visit("layout", layout, "", "");
	}
};

::sgf::OdometrySequence openSequence(
	const std::string& folder, const std::string& layout)
{
	if (layout.empty()) return ::sgf::OpenOdometrySequence(folder);
	YAML::Node node(YAML::NodeType::Map);
	::sgf::SetOption(node, "layout", layout);
	TLayoutOption option;
	::sgf::ReadOptions(node, option, "data set");
	return ::sgf::OpenOdometrySequence(folder, option.layout);
}

// An image that stays in its file until it is looked at.
mrpt::img::CImage externalImage(const std::filesystem::path& file)
{
	mrpt::img::CImage image;
	image.setExternalStorage(std::filesystem::absolute(file).string());
	return image;
}

class CDatasetSource : public CObservationSource
{
 public:
	CDatasetSource(const std::string& folder, const TDatasetOptions& options)
		: m_sequence(openSequence(folder, options.layout))
	{
		if (!m_sequence.stereo() && !m_sequence.has_depth())
			throw ::sgf::Error(folder, "has one camera and no depth");
		auto& frames = m_sequence.frames;
		if (options.max_frames > 0 && options.max_frames < frames.size())
			frames.resize(options.max_frames);
		if (!options.imu) m_sequence.imu.clear();
		const SE3& T_body_cam = m_sequence.cameras.front().T_body_cam;
		m_T_robot_body.R =
			(forwardFromCamera() * T_body_cam.R.conjugate()).normalized();
	}

	CObservation::Ptr next() override
	{
		constexpr auto kNever = std::numeric_limits<std::int64_t>::max();
		const auto& [frames, imu] = std::tie(m_sequence.frames, m_sequence.imu);
		if (m_frame == frames.size())
		{
			// One more, to interpolate at the last frame's time.
			const bool more = m_sample > 0 && m_sample < imu.size() &&
							  imu[m_sample - 1].time_ns < frames.back().time_ns;
			return more ? inertial(imu[m_sample++]) : nullptr;
		}
		const auto rates_ns =
			m_sample < imu.size() ? imu[m_sample].time_ns : kNever;
		if (rates_ns <= frames[m_frame].time_ns)
			return inertial(imu[m_sample++]);
		const auto& frame = frames[m_frame++];
		return m_sequence.stereo() ? stereo(frame) : withDepth(frame);
	}

	size_t incompleteFrames() const override
	{
		return m_sequence.skipped_frames;
	}

 private:
	CObservation::Ptr inertial(const ::sgf::ImuSample& sample) const
	{
		using namespace mrpt::obs;
		auto obs = CObservationIMU::Create();
		obs->timestamp = toTimePoint(sample.time_ns);
		obs->sensorLabel = "IMU";
		obs->sensorPose = toPose(m_T_robot_body);
		obs->set(IMU_WX, sample.gyro.x());
		obs->set(IMU_WY, sample.gyro.y());
		obs->set(IMU_WZ, sample.gyro.z());
		obs->set(IMU_X_ACC, sample.accel.x());
		obs->set(IMU_Y_ACC, sample.accel.y());
		obs->set(IMU_Z_ACC, sample.accel.z());
		return obs;
	}

	CObservation::Ptr stereo(const ::sgf::OdometryFrame& frame) const
	{
		const auto& left = m_sequence.cameras[0];
		const auto& right = m_sequence.cameras[1];
		const SE3 T_left_right = left.T_body_cam.Inverse() * right.T_body_cam;
		auto obs = CObservationStereoImages::Create();
		obs->timestamp = toTimePoint(frame.time_ns);
		obs->sensorLabel = "CAMERA";
		obs->leftCamera = toTCamera(left.camera);
		obs->rightCamera = toTCamera(right.camera);
		obs->cameraPose =
			mrpt::poses::CPose3DQuat(toPose(m_T_robot_body * left.T_body_cam));
		obs->rightCameraPose = mrpt::poses::CPose3DQuat(toPose(T_left_right));
		obs->imageLeft = externalImage(frame.left);
		obs->imageRight = externalImage(frame.right);
		obs->hasImageRight = true;
		return obs;
	}

	CObservation::Ptr withDepth(const ::sgf::OdometryFrame& frame) const
	{
		const auto& camera = m_sequence.cameras.front();
		auto obs = CObservation3DRangeScan::Create();
		obs->timestamp = toTimePoint(frame.time_ns);
		obs->sensorLabel = "CAMERA";
		obs->cameraParams = toTCamera(camera.camera);
		obs->cameraParamsIntensity = obs->cameraParams;
		// The pose of a depth sensor, which looks along its x.
		const SE3 T_cam_sensor{
			forwardFromCamera().conjugate(), Eigen::Vector3d::Zero()};
		obs->sensorPose =
			toPose(m_T_robot_body * camera.T_body_cam * T_cam_sensor);
		obs->intensityImage = externalImage(frame.left);
		obs->hasIntensityImage = true;
		setDepth(*obs, frame.depth);
		return obs;
	}

	void setDepth(
		CObservation3DRangeScan& obs, const std::filesystem::path& file) const
	{
		constexpr double kLargest = std::numeric_limits<uint16_t>::max();
		const double levels = m_sequence.depth_levels_per_m;
		const cv::Mat1f depth = ::sgf::ReadDepth(file, levels);
		obs.rangeUnits = static_cast<float>(1 / levels);
		obs.hasRangeImage = true;
		obs.rangeImage_setSize(depth.rows, depth.cols);
		for (int y = 0; y < depth.rows; ++y)
			for (int x = 0; x < depth.cols; ++x)
			{
				const double level = std::round(depth(y, x) * levels);
				const bool known = level > 0 && level <= kLargest;  // not NaN
				obs.rangeImage(y, x) = known ? static_cast<uint16_t>(level) : 0;
			}
		obs.maxRange = static_cast<float>(kLargest / levels);
	}

	::sgf::OdometrySequence m_sequence;
	SE3 m_T_robot_body;
	size_t m_frame = 0, m_sample = 0;
};

}  // namespace

std::unique_ptr<CObservationSource> openDataset(
	const std::string& folder, const TDatasetOptions& options)
{
	return std::make_unique<CDatasetSource>(folder, options);
}

std::unique_ptr<CObservationSource> openObservations(const std::string& path)
{
	if (std::filesystem::is_directory(path)) return openDataset(path, {});
	return openRawlog(path);
}

}  // namespace mrpt::sgf
