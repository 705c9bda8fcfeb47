/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/config/CConfigFile.h>
#include <mrpt/core/exceptions.h>
#include <mrpt/graphslam/interfaces/CEdgeRegistrationDecider.h>
#include <mrpt/sgf/CSgfOdometryNRD.h>
#include <mrpt/sgf/CSgfPairAligner.h>

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace mrpt::sgf
{
/** Edge registration decider that closes loops in 3-D: where the graph says
 * that a new node sees what an old one saw, their images are aligned directly.
 * An edge is registered if the alignment holds and if that of the new node to
 * the old one agrees with that of the old one to the new.
 *
 * ### .ini parameters, section EdgeRegistrationDeciderParameters
 * - lc_min_nodes_apart: nodes in between, default 10
 * - lc_max_distance: of the two nodes by the graph, m, default 2
 * - lc_max_angle: between the two by the graph, degrees, default 40
 * - lc_candidates: nodes to try, the nearest first, default 3
 * - lc_min_inliers: share of the points that have to fit, default 0.6
 * - lc_max_disagreement_m: of the two directions, default 0.05
 * - lc_max_disagreement_deg: of the two directions, default 1
 *
 * Section SgfOdometry, if there is one: see CSgfOdometry::TParams.
 *
 * \ingroup mrpt_sgf_odometry_grp */
template <class GRAPH_T>
class CSgfLoopClosureERD
	: public virtual mrpt::graphslam::deciders::CEdgeRegistrationDecider<
		  GRAPH_T>
{
 public:
	using parent_t =
		mrpt::graphslam::deciders::CEdgeRegistrationDecider<GRAPH_T>;
	using constraint_t = typename GRAPH_T::constraint_t;
	using TNodeID = mrpt::graphs::TNodeID;
	static_assert(
		constraint_t::state_length == 6, "SGF loop closing is for 3-D graphs");

	CSgfLoopClosureERD() { this->initializeLoggers("CSgfLoopClosureERD"); }

	/** \exception std::exception as CSgfOdometry::TParams does, and for a key
	 * "lc_..." that is not known */
	void loadParams(const std::string& source_fname) override
	{
		parent_t::loadParams(source_fname);
		const mrpt::config::CConfigFile source(source_fname);
		params.load(source, "EdgeRegistrationDeciderParameters");
		this->setMinLoggingLevel(mrpt::system::VerbosityLevel(source.read_int(
			"EdgeRegistrationDeciderParameters", "class_verbosity", 1)));
		CSgfOdometry::TParams odometry;
		if (source.sectionExists("SgfOdometry"))
			odometry.loadFromConfigFile(source, "SgfOdometry");
		m_aligner = std::make_unique<CSgfPairAligner>(odometry);
		m_framesKept = static_cast<size_t>(odometry.max_waiting_frames) + 1;
	}

	/** By what time a node has, its frame is found where nodes come later than
	 * their frames, as with TEstimator::STEREO_INERTIAL. Without it the frame
	 * at hand is taken for that of a new node.
	 * \param times such as CSgfOdometryNRD::nodeTimes(); they have to live as
	 * long as this object is used */
	void setNodeTimes(
		const std::map<mrpt::graphs::TNodeID, mrpt::Clock::time_point>& times)
	{
		m_nodeTimes = &times;
	}

	/** Looks for loops if there is a new node; to be called with the same
	 * observations as the node decider, and after it.
	 * \return true */
	bool updateState(
		[[maybe_unused]] mrpt::obs::CActionCollection::Ptr action,
		mrpt::obs::CSensoryFrame::Ptr observations,
		mrpt::obs::CObservation::Ptr observation) override
	{
		this->m_just_inserted_lc = false;
		forEachObservation(
			observations, observation, [this](const auto& obs) { take(obs); });
		return true;
	}

	/** Loop closures, by the name that the engine knows them by */
	void getEdgesStats(
		std::map<std::string, int>* edge_type_to_num) const override
	{
		(*edge_type_to_num)["lc"] = m_closures;
	}

	/** Loop closures registered so far */
	int closures() const { return m_closures; }

	struct TParams
	{
		size_t minNodesApart = 10;
		double maxDistance = 2;                 //!< m
		double maxAngle = mrpt::DEG2RAD(40.0);  //!< rad
		size_t candidates = 3;
		double minInliers = 0.6;
		double maxDisagreement = 0.05;                     //!< m
		double maxDisagreementAngle = mrpt::DEG2RAD(1.0);  //!< rad

		void load(const mrpt::config::CConfigFileBase& c, const std::string& s)
		{
			requireKnown(c, s);
			const auto angle = [&](const char* key, double now) {
				return mrpt::DEG2RAD(c.read_double(s, key, mrpt::RAD2DEG(now)));
			};
			minNodesApart =
				c.read_uint64_t(s, "lc_min_nodes_apart", minNodesApart);
			maxDistance = c.read_double(s, "lc_max_distance", maxDistance);
			maxAngle = angle("lc_max_angle", maxAngle);
			candidates = c.read_uint64_t(s, "lc_candidates", candidates);
			minInliers = c.read_double(s, "lc_min_inliers", minInliers);
			maxDisagreement =
				c.read_double(s, "lc_max_disagreement_m", maxDisagreement);
			maxDisagreementAngle =
				angle("lc_max_disagreement_deg", maxDisagreementAngle);
		}

	 private:
		// MRPT's own keys in the section have other names.
		static void requireKnown(
			const mrpt::config::CConfigFileBase& c, const std::string& s)
		{
			static const std::set<std::string> kKnown = {
				"lc_min_nodes_apart",     "lc_max_distance",
				"lc_max_angle",           "lc_candidates",
				"lc_min_inliers",         "lc_max_disagreement_m",
				"lc_max_disagreement_deg"};
			std::vector<std::string> keys;
			c.getAllKeys(s, keys);
			for (const auto& key : keys)
				if (key.rfind("lc_", 0) == 0 && !kKnown.count(key))
					THROW_EXCEPTION_FMT(
						"section %s: unknown key '%s'", s.c_str(), key.c_str());
		}
	};
	TParams params;

 protected:
	/** Adds the edge to the graph. */
	void registerNewEdge(
		const TNodeID& from, const TNodeID& to,
		const constraint_t& rel_edge) override
	{
		parent_t::registerNewEdge(from, to, rel_edge);
		this->m_graph->insertEdge(from, to, rel_edge);
		this->m_just_inserted_lc = true;
		++m_closures;
	}

 private:
	using View = std::shared_ptr<const CSgfPairAligner::TView>;

	static double angleOf(const mrpt::poses::CPose3D& p)
	{
		const double trace = p.getRotationMatrix().trace();
		return std::acos(std::clamp((trace - 1) / 2, -1.0, 1.0));
	}

	// The frame that the node decider has made a node of; empty if it is not
	// known.
	mrpt::obs::CObservation::Ptr frameOf(TNodeID node) const
	{
		if (!m_nodeTimes) return m_frames.back();
		const auto time = m_nodeTimes->find(node);
		if (time == m_nodeTimes->end()) return {};
		for (const auto& frame : m_frames)
			if (frame->timestamp == time->second) return frame;
		return {};
	}

	// Looks at the newest node. The root is registered with the first node
	// after it, but stands for the first frame.
	void take(const mrpt::obs::CObservation::Ptr& obs)
	{
		const bool isFrame = CSgfPairAligner::isFrame(*obs);
		if (isFrame) m_frames.push_back(obs);
		if (m_frames.size() > m_framesKept) m_frames.pop_front();
		const size_t count = this->m_graph->nodeCount();
		const TNodeID node = count == 0 ? 0 : count - 1;
		if (m_views.count(node) || !(isFrame || m_nodeTimes)) return;
		const auto frame = frameOf(node);
		if (!frame) return;
		const View view = m_aligner->makeView(*frame);
		if (view || count > 0) m_views[node] = view;
		if (!view) return;
		for (const TNodeID old : candidates(node)) tryToClose(old, node);
	}

	mrpt::poses::CPose3D relative(TNodeID from, TNodeID to) const
	{
		const mrpt::poses::CPose3D a(this->m_graph->nodes.at(from));
		const mrpt::poses::CPose3D b(this->m_graph->nodes.at(to));
		return b - a;
	}

	// Old nodes near a new one, the nearest first.
	std::vector<TNodeID> candidates(TNodeID node) const
	{
		std::vector<std::pair<double, TNodeID>> near;
		for (const auto& [old, view] : m_views)
		{
			if (old + params.minNodesApart >= node) break;
			if (!view) continue;
			const auto motion = relative(old, node);
			if (motion.norm() <= params.maxDistance &&
				angleOf(motion) <= params.maxAngle)
				near.emplace_back(motion.norm(), old);
		}
		std::sort(near.begin(), near.end());
		if (near.size() > params.candidates) near.resize(params.candidates);
		std::vector<TNodeID> nodes;
		for (const auto& [distance, old] : near) nodes.push_back(old);
		return nodes;
	}

	// The better of two guesses: what the graph says, and the same place.
	std::optional<CSgfPairAligner::TOutcome> best(
		const View& a, const View& b, const mrpt::poses::CPose3D& byGraph) const
	{
		std::optional<CSgfPairAligner::TOutcome> found;
		for (const auto& guess : {byGraph, mrpt::poses::CPose3D()})
		{
			const auto outcome = m_aligner->align(*a, *b, guess);
			const bool good =
				outcome.ok && outcome.inlierShare >= params.minInliers;
			MRPT_LOG_DEBUG_FMT(
				"Alignment %s: overlap %.2f, inliers %.2f",
				outcome.ok ? "holds" : "has failed", outcome.overlap,
				outcome.inlierShare);
			if (good && (!found || outcome.inlierShare > found->inlierShare))
				found = outcome;
		}
		return found;
	}

	void tryToClose(TNodeID old, TNodeID node)
	{
		const View &a = m_views.at(old), &b = m_views.at(node);
		const auto there = best(a, b, relative(old, node));
		if (!there) return;
		const auto back = m_aligner->align(*b, *a, -there->motion.mean);
		const auto roundTrip = there->motion.mean + back.motion.mean;
		MRPT_LOG_DEBUG_FMT(
			"Nodes %zu and %zu: there and back is off by %.3f m and %.2f deg",
			size_t(old), size_t(node), roundTrip.norm(),
			mrpt::RAD2DEG(angleOf(roundTrip)));
		if (!back.ok || roundTrip.norm() > params.maxDisagreement ||
			angleOf(roundTrip) > params.maxDisagreementAngle)
			return;
		constraint_t edge;
		edge.copyFrom(there->motion);
		registerNewEdge(old, node, edge);
	}

	std::unique_ptr<CSgfPairAligner> m_aligner;
	std::deque<mrpt::obs::CObservation::Ptr> m_frames;  // the newest ones
	size_t m_framesKept = 1;
	const std::map<TNodeID, mrpt::Clock::time_point>* m_nodeTimes = nullptr;
	std::map<TNodeID, View> m_views;  // empty where there was none to be had
	int m_closures = 0;
};

}  // namespace mrpt::sgf
