/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "frameOf.h"

#include <mrpt/core/format.h>

#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <sgf/io/image.h>

#include "conversions.h"
#include "messageOf.h"

namespace mrpt::sgf::internal
{
using mrpt::img::TCamera;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationStereoImages;

namespace
{
::sgf::Camera toCamera(const TCamera& in)
{
	const bool bent = in.distortion != mrpt::img::DistortionModel::none;
	::sgf::Camera camera{
		static_cast<int>(in.ncols),
		static_cast<int>(in.nrows),
		in.fx(),
		in.fy(),
		in.cx(),
		in.cy()};
	if (bent)
	{
		camera.k1 = in.k1();
		camera.k2 = in.k2();
		camera.p1 = in.p1();
		camera.p2 = in.p2();
	}
	return camera;
}

// A camera that can be worked with, or Skipped.
::sgf::Camera checkedCamera(const TCamera& in)
{
	using mrpt::img::DistortionModel;
	const double numbers = in.fx() * in.fy() + in.cx() + in.cy();
	if (!(in.fx() > 0 && in.fy() > 0) || !std::isfinite(numbers))
		throw Skipped(
			TSkipReason::NO_CALIBRATION,
			mrpt::format("focal lengths %g and %g px", in.fx(), in.fy()));
	const bool higherOrder =
		in.k3() != 0 || in.k4() != 0 || in.k5() != 0 || in.k6() != 0;
	if (in.distortion == DistortionModel::kannala_brandt ||
		(in.distortion == DistortionModel::plumb_bob && higherOrder))
		throw Skipped(
			TSkipReason::UNSUPPORTED_CALIBRATION,
			"only distortion by k1, k2, p1, p2 is known");
	return toCamera(in);
}

// The image as 8-bit grey levels, loaded if it is external.
cv::Mat greyOf(const mrpt::img::CImage& image, const TCamera& camera)
{
	cv::Mat pixels;
	if (image.isEmpty()) throw Skipped(TSkipReason::NO_IMAGE, "image is empty");
	try
	{
		image.asCvMat(pixels, mrpt::img::SHALLOW_COPY);
	}
	catch (const mrpt::img::CExceptionExternalImageNotFound& e)
	{
		throw Skipped(TSkipReason::MISSING_FILE, messageOf(e));
	}
	const cv::Size expected(camera.ncols, camera.nrows);
	if (pixels.size() != expected)
		throw Skipped(
			TSkipReason::IMAGE_SIZE,
			mrpt::format(
				"image of %dx%d px, calibration for %dx%d px", pixels.cols,
				pixels.rows, expected.width, expected.height));
	return ::sgf::ToGrey(pixels);
}

// Depth along the optical axis, m, from what the observation has.
cv::Mat1f depthOf(const CObservation3DRangeScan& obs)
{
	const auto& ranges = obs.rangeImage;
	const TCamera& c = obs.cameraParams;
	cv::Mat1f depth(ranges.rows(), ranges.cols());
	for (int y = 0; y < depth.rows; ++y)
		for (int x = 0; x < depth.cols; ++x)
		{
			const double ray =
				obs.range_is_depth
					? 1.0
					: std::hypot(
						  1.0, (x - c.cx()) / c.fx(), (y - c.cy()) / c.fy());
			depth(y, x) =
				static_cast<float>(ranges(y, x) * obs.rangeUnits / ray);
		}
	return depth;
}

void requireDepth(const CObservation3DRangeScan& obs)
{
	const bool sound = std::isfinite(obs.rangeUnits) && obs.rangeUnits > 0;
	const bool any = obs.hasRangeImage && sound &&
					 (obs.rangeImage.asEigen().array() != 0).any();
	if (!any) throw Skipped(TSkipReason::NO_DEPTH, "no pixel has a depth");
	if (obs.rangeImage.rows() != int(obs.cameraParams.nrows) ||
		obs.rangeImage.cols() != int(obs.cameraParams.ncols))
		throw Skipped(
			TSkipReason::IMAGE_SIZE,
			mrpt::format(
				"depth image of %dx%d px, calibration for %ux%u px",
				int(obs.rangeImage.cols()), int(obs.rangeImage.rows()),
				obs.cameraParams.ncols, obs.cameraParams.nrows));
}

void requireRegistered(const CObservation3DRangeScan& obs)
{
	const TCamera &d = obs.cameraParams, &i = obs.cameraParamsIntensity;
	const bool same = obs.doDepthAndIntensityCamerasCoincide() &&
					  d.ncols == i.ncols && d.nrows == i.nrows &&
					  d.intrinsicParams == i.intrinsicParams &&
					  d.dist == i.dist;
	if (!same)
		throw Skipped(
			TSkipReason::UNSUPPORTED_CALIBRATION,
			"depth is not registered to the intensity image");
}

}  // namespace

bool CFrameMaker::TCalibration::operator==(const TCalibration& o) const
{
	return first == o.first && second == o.second && onRobot == o.onRobot &&
		   secondOnFirst == o.secondOnFirst;
}

void CFrameMaker::TCalibration::check() const
{
	checkedCamera(first);
	checkedCamera(second);
	for (const auto& pose : {onRobot, secondOnFirst})
		if (!isFinite(pose))
			throw Skipped(
				TSkipReason::NO_CALIBRATION, "pose of a camera is not finite");
}

bool CFrameMaker::isNew(const TCalibration& calibration) const
{
	if (!m_calibration) calibration.check();
	if (m_calibration && !(*m_calibration == calibration))
		throw Skipped(
			TSkipReason::CALIBRATION_CHANGED,
			"camera or its pose differs from that of the first frame");
	return !m_calibration;
}

void CFrameMaker::setUp(const CObservationStereoImages& obs)
{
	m_stereoRig = {
		checkedCamera(obs.leftCamera), checkedCamera(obs.rightCamera),
		toSE3(mrpt::poses::CPose3D(obs.rightCameraPose))};
	if (!(m_stereoRig.T_left_right.p.norm() > 0))
		throw Skipped(TSkipReason::NO_CALIBRATION, "stereo baseline is 0");
	m_T_robot_cam = toSE3(mrpt::poses::CPose3D(obs.cameraPose));
	if (m_images == TImages::IDEAL) rectify();
}

void CFrameMaker::rectify()
{
	const auto& [left, right, T_left_right] = m_stereoRig;
	try
	{
		m_rectifier.emplace(left, right, T_left_right);
	}
	catch (const std::exception& e)
	{
		throw Skipped(TSkipReason::UNSUPPORTED_CALIBRATION, e.what());
	}
	m_rig = {m_rectifier->camera(), m_rectifier->baseline_m()};
	const ::sgf::SE3 T_left_rect{
		Eigen::Quaterniond(m_rectifier->R_left_rect()).normalized(),
		Eigen::Vector3d::Zero()};
	m_T_robot_cam = m_T_robot_cam * T_left_rect;
}

TFrame CFrameMaker::make(const CObservationStereoImages& obs)
{
	if (!obs.hasImageRight)
		throw Skipped(TSkipReason::NO_RIGHT_IMAGE, "hasImageRight is false");
	const TCalibration calibration{
		obs.leftCamera, obs.rightCamera, mrpt::poses::CPose3D(obs.cameraPose),
		mrpt::poses::CPose3D(obs.rightCameraPose)};
	const bool first = isNew(calibration);
	TFrame frame;
	frame.time_ns = toNanoseconds(obs.timestamp);
	frame.grey = greyOf(obs.imageLeft, obs.leftCamera);
	frame.right = greyOf(obs.imageRight, obs.rightCamera);
	if (first) setUp(obs);
	m_calibration = calibration;
	if (m_rectifier)
		std::tie(frame.grey, frame.right) =
			m_rectifier->Rectify(frame.grey, frame.right);
	return frame;
}

void CFrameMaker::setUp(const CObservation3DRangeScan& obs)
{
	::sgf::Camera camera = checkedCamera(obs.cameraParamsIntensity);
	if (camera.distorted())
	{
		const cv::Matx33d K(
			camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
		const cv::Vec4d bend(camera.k1, camera.k2, camera.p1, camera.p2);
		cv::initUndistortRectifyMap(
			K, bend, cv::noArray(), K, {camera.width, camera.height}, CV_32FC1,
			m_undistortX, m_undistortY);
		camera.k1 = camera.k2 = camera.p1 = camera.p2 = 0;
	}
	m_rig = {camera, 0};
	m_T_robot_cam = toSE3(obs.sensorPose + obs.relativePoseIntensityWRTDepth);
}

TFrame CFrameMaker::make(const CObservation3DRangeScan& obs)
{
	if (!obs.hasIntensityImage)
		throw Skipped(TSkipReason::NO_IMAGE, "hasIntensityImage is false");
	obs.load();
	requireDepth(obs);
	requireRegistered(obs);
	const TCalibration calibration{
		obs.cameraParams, obs.cameraParamsIntensity, obs.sensorPose,
		obs.relativePoseIntensityWRTDepth};
	const bool first = isNew(calibration);
	TFrame frame;
	frame.time_ns = toNanoseconds(obs.timestamp);
	frame.grey = greyOf(obs.intensityImage, obs.cameraParamsIntensity);
	frame.depth = depthOf(obs);
	if (first) setUp(obs);
	m_calibration = calibration;
	if (m_undistortX.empty()) return frame;
	// Depths are never mixed: those of neighbours may lie on different things.
	const auto undistort = [this](const cv::Mat& in, int interpolation)
	{
		cv::Mat out;
		cv::remap(in, out, m_undistortX, m_undistortY, interpolation);
		return out;
	};
	frame.grey = undistort(frame.grey, cv::INTER_LINEAR);
	frame.depth = undistort(frame.depth, cv::INTER_NEAREST);
	return frame;
}

}  // namespace mrpt::sgf::internal
