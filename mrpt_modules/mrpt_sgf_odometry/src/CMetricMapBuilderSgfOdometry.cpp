/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/core/exceptions.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/sgf/CMetricMapBuilderSgfOdometry.h>
#include <mrpt/sgf/topView.h>

namespace mrpt::sgf
{
using mrpt::maps::CSimpleMap;
using mrpt::maps::CSimplePointsMap;

CMetricMapBuilderSgfOdometry::CMetricMapBuilderSgfOdometry(
	const CSgfOdometry::TParams& params)
{
	m_odometry.params = params;
	m_odometry.params.build_map = false;  // this class has its own
	initialize();
}

void CMetricMapBuilderSgfOdometry::initialize(
	const CSimpleMap& initialMap, const mrpt::poses::CPosePDF* x0)
{
	m_odometry.reset();
	m_pose = {};
	if (x0) m_pose.copyFrom(*x0);
	m_path.clear();
	m_map = initialMap;
	auto points = CSimplePointsMap::Create();
	insertPoints(m_map, *points);
	m_metricMap.maps.clear();
	m_metricMap.maps.push_back(points);
}

mrpt::poses::CPose3DPDF::Ptr
CMetricMapBuilderSgfOdometry::getCurrentPoseEstimation() const
{
	return mrpt::poses::CPose3DPDFGaussian::Create(m_pose);
}

void CMetricMapBuilderSgfOdometry::processActionObservation(
	[[maybe_unused]] mrpt::obs::CActionCollection& action,
	mrpt::obs::CSensoryFrame& observations)
{
	for (const auto& obs : observations)
		if (const auto result = m_odometry.processObservation(*obs))
			take(*result);
}

void CMetricMapBuilderSgfOdometry::take(const TResult& result)
{
	if (result.quality < TQuality::RELATIVE) return;
	if (result.increment) m_pose += *result.increment;
	m_path.push_back(m_pose.mean.asTPose());
	if (!result.keyframePoints || !options.enableMapUpdating) return;
	auto frame = mrpt::obs::CSensoryFrame::Create();
	frame->insert(result.keyframePoints);
	m_map.insert(mrpt::poses::CPose3DPDFGaussian::Create(m_pose), frame);
	frame->insertObservationsInto(m_metricMap, m_pose.mean);
}

void CMetricMapBuilderSgfOdometry::getCurrentlyBuiltMap(
	CSimpleMap& out_map) const
{
	out_map = m_map;
}

unsigned int CMetricMapBuilderSgfOdometry::getCurrentlyBuiltMapSize()
{
	return static_cast<unsigned int>(m_map.size());
}

const mrpt::maps::CMultiMetricMap*
CMetricMapBuilderSgfOdometry::getCurrentlyBuiltMetricMap() const
{
	return &m_metricMap;
}

void CMetricMapBuilderSgfOdometry::saveCurrentEstimationToImage(
	const std::string& file, [[maybe_unused]] bool formatEMF_BMP)
{
	const auto points = m_metricMap.mapByClass<CSimplePointsMap>();
	if (!topView(*points, m_path).saveToFile(file))
		THROW_EXCEPTION_FMT("%s: cannot be written", file.c_str());
}

}  // namespace mrpt::sgf
