/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/sgf/CSgfPairAligner.h>

#include <optional>
#include <vector>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/odometry/odometry.h>

#include "conversions.h"
#include "frameOf.h"
#include "parameters.h"

namespace mrpt::sgf
{
using namespace internal;
using ::sgf::SE3;
using ::sgf::alignment::DirectAligner;
using ::sgf::alignment::ReferencePoint;
using ::sgf::odometry::Odometry;

struct CSgfPairAligner::TView
{
	cv::Mat grey;
	std::vector<ReferencePoint> points;
};

struct CSgfPairAligner::Impl
{
	::sgf::odometry::OdometryOptions options;
	CFrameMaker frames;
	std::optional<DirectAligner> aligner;
};

CSgfPairAligner::CSgfPairAligner(const CSgfOdometry::TParams& params)
	: m_impl(new Impl{odometryOptions(params, "parameters"), CFrameMaker(), {}})
{
}

CSgfPairAligner::~CSgfPairAligner() = default;

namespace
{
// Depths come as they do in odometry, which makes the first frame a key-frame.
std::vector<ReferencePoint> pointsOf(const TFrame& frame, Odometry odometry)
{
	if (frame.depth.empty())
		odometry.ProcessStereo(frame.time_ns, frame.grey, frame.right);
	else
		odometry.ProcessDepth(frame.time_ns, frame.grey, frame.depth);
	return odometry.LastKeyframe().points;
}
}  // namespace

bool CSgfPairAligner::isFrame(const mrpt::obs::CObservation& obs)
{
	return visitFrame(obs, [](const auto&) { return true; }).has_value();
}

std::shared_ptr<const CSgfPairAligner::TView> CSgfPairAligner::makeView(
	const mrpt::obs::CObservation& obs)
{
	try
	{
		const auto frame = visitFrame(
			obs, [this](const auto& o) { return m_impl->frames.make(o); });
		if (!frame) return {};
		const auto& rig = m_impl->frames.rig();
		if (!m_impl->aligner)
			m_impl->aligner.emplace(rig.camera, m_impl->options.alignment);
		return std::make_shared<const TView>(TView{
			frame->grey.clone(),
			pointsOf(*frame, Odometry(rig, m_impl->options))});
	}
	catch (const std::exception&)
	{
		return {};
	}
}

CSgfPairAligner::TOutcome CSgfPairAligner::align(
	const TView& first, const TView& second,
	const mrpt::poses::CPose3D& guess) const
{
	const DirectAligner& aligner = *m_impl->aligner;
	const SE3& T_robot_cam = m_impl->frames.T_robot_cam();
	const auto reference =
		aligner.MakeReference(aligner.MakePyramid(first.grey), first.points);
	const auto result = aligner.Align(
		*reference, aligner.MakePyramid(second.grey),
		T_robot_cam.Inverse() * toSE3(guess).Inverse() * T_robot_cam);
	const Matrix6d A = adjoint(T_robot_cam);
	TOutcome outcome;
	outcome.ok = result.ok();
	outcome.overlap = result.overlap;
	outcome.inlierShare = result.inlier_share;
	outcome.motion = toPosePDF(
		T_robot_cam * result.T_cur_ref.Inverse() * T_robot_cam.Inverse(),
		A * result.covariance * A.transpose());
	return outcome;
}

}  // namespace mrpt::sgf
