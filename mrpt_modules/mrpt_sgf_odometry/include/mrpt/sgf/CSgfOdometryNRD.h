/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/config/CConfigFile.h>
#include <mrpt/graphslam/interfaces/CNodeRegistrationDecider.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mrpt::sgf
{
/** Calls f with each observation that a graph-SLAM decider is handed, in either
 * format of rawlogs.
 * \ingroup mrpt_sgf_odometry_grp */
template <class F>
void forEachObservation(
	const mrpt::obs::CSensoryFrame::Ptr& observations,
	const mrpt::obs::CObservation::Ptr& observation, F&& f)
{
	if (observation) f(observation);
	if (observations)
		for (const auto& obs : *observations) f(obs);
}

/** Node registration decider that knows the robot's motion from SGF odometry:
 * for 3-D graphs, from stereo images or RGB-D range scans. A node is registered
 * when the robot has moved or turned far enough since the last one. Its edge
 * has the odometry's covariance.
 *
 * ### .ini parameters, section NodeRegistrationDeciderParameters
 * - registration_max_distance: m, default 0.5
 * - registration_max_angle: degrees, default 15
 *
 * Section SgfOdometry, if there is one: see CSgfOdometry::TParams.
 *
 * \ingroup mrpt_sgf_odometry_grp */
template <class GRAPH_T>
class CSgfOdometryNRD
	: public virtual mrpt::graphslam::deciders::CNodeRegistrationDecider<
		  GRAPH_T>
{
 public:
	using parent_t =
		mrpt::graphslam::deciders::CNodeRegistrationDecider<GRAPH_T>;
	using constraint_t = typename GRAPH_T::constraint_t;
	using global_pose_t = typename GRAPH_T::global_pose_t;
	static_assert(
		constraint_t::state_length == 6, "SGF odometry is for 3-D graphs");

	CSgfOdometryNRD() { this->initializeLoggers("CSgfOdometryNRD"); }

	/** \exception std::exception as CSgfOdometry::TParams does */
	void loadParams(const std::string& source_fname) override
	{
		parent_t::loadParams(source_fname);
		const mrpt::config::CConfigFile source(source_fname);
		const std::string own = "NodeRegistrationDeciderParameters";
		m_maxDistance =
			source.read_double(own, "registration_max_distance", m_maxDistance);
		m_maxAngle = mrpt::DEG2RAD(source.read_double(
			own, "registration_max_angle", mrpt::RAD2DEG(m_maxAngle)));
		this->setMinLoggingLevel(mrpt::system::VerbosityLevel(
			source.read_int(own, "class_verbosity", 1)));
		if (source.sectionExists("SgfOdometry"))
			m_odometry.params.loadFromConfigFile(source, "SgfOdometry");
	}

	/** \return whether a node was registered */
	bool updateState(
		[[maybe_unused]] mrpt::obs::CActionCollection::Ptr action,
		mrpt::obs::CSensoryFrame::Ptr observations,
		mrpt::obs::CObservation::Ptr observation) override
	{
		bool registered = false;
		forEachObservation(
			observations, observation,
			[&](const auto& obs)
			{
				if (const auto result = m_odometry.processObservation(*obs))
					registered = take(*result) || registered;
			});
		return registered;
	}

	global_pose_t getCurrentRobotPosEstimation() const override
	{
		global_pose_t pose;
		if (this->m_prev_registered_nodeID != mrpt::graphs::INVALID_NODEID)
			pose = this->m_graph->nodes.at(this->m_prev_registered_nodeID);
		pose += m_sinceNode.mean;
		return pose;
	}

	/** Time stamps of the nodes */
	const std::map<mrpt::graphs::TNodeID, mrpt::Clock::time_point>& nodeTimes()
		const
	{
		return m_nodeTimes;
	}

	/** The odometry, for its report and counters */
	const CSgfOdometry& odometry() const { return m_odometry; }

 protected:
	/** Registers a node if the robot has moved far enough. */
	bool checkRegistrationCondition() override
	{
		const auto& moved = m_sinceNode.mean;
		const double trace = moved.getRotationMatrix().trace();
		const double angle = std::acos(std::clamp((trace - 1) / 2, -1.0, 1.0));
		if (moved.norm() <= m_maxDistance && angle <= m_maxAngle) return false;
		if (this->m_prev_registered_nodeID == mrpt::graphs::INVALID_NODEID)
			registerRoot();
		constraint_t edge;
		edge.copyFrom(m_sinceNode);
		this->registerNewNodeAtEnd(edge);  // at the current estimate
		m_sinceNode = {};
		return true;
	}

 private:
	// The root is the first frame. (The base class would put it where the robot
	// is by now.)
	void registerRoot()
	{
		global_pose_t origin;
		this->addNodeAnnotsToPose(&origin);
		this->m_graph->nodes[this->m_graph->root] = origin;
		this->m_prev_registered_nodeID = this->m_graph->root;
	}

	bool take(const TResult& result)
	{
		if (result.quality < TQuality::RELATIVE) return false;
		if (!result.increment)
		{
			m_nodeTimes[0] = result.timestamp;
			return false;
		}
		m_sinceNode += *result.increment;
		if (!checkRegistrationCondition()) return false;
		m_nodeTimes[this->m_prev_registered_nodeID] = result.timestamp;
		return true;
	}

	CSgfOdometry m_odometry;
	mrpt::poses::CPose3DPDFGaussian m_sinceNode;
	std::map<mrpt::graphs::TNodeID, mrpt::Clock::time_point> m_nodeTimes;
	double m_maxDistance = 0.5;               // m
	double m_maxAngle = mrpt::DEG2RAD(15.0);  // rad
};

}  // namespace mrpt::sgf
