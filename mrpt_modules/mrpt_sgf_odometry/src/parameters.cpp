/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "parameters.h"

#include <mrpt/core/exceptions.h>

#include <algorithm>

#include <sgf/core/options.h>

namespace mrpt::sgf
{
namespace
{
// The parameters proper, in the form that sgf's options have, so that one list
// of fields serves for reading and writing.
struct TOwnFields
{
	CSgfOdometry::TParams& p;

	template <class V>
	void VisitFields(V&& visit)
	{
		visit("sensor_label", p.sensor_label, "", "");
		visit("use_imu", p.use_imu, "", "");
		visit("max_gap_s", p.max_gap_s, "s", "");
		visit("lost_std_xyz_m", p.lost_std_xyz_m, "m", "");
		visit("lost_std_angle_deg", p.lost_std_angle_deg, "deg", "");
		visit("build_map", p.build_map, "", "");
	}
};

void requirePositive(const char* name, double value, const std::string& where)
{
	if (!(value > 0))
		throw ::sgf::Error(
			where, mrpt::format("%s is %g, has to be positive", name, value));
}

// The odometry checks its options when it is made: so one is made, for any
// camera.
void checkOdometryOptions(
	const ::sgf::odometry::OdometryOptions& options, const std::string& where)
try
{
	const ::sgf::Camera camera{640, 480, 500, 500, 319.5, 239.5};
	const ::sgf::odometry::Odometry odometry({camera, 0.1}, options);
}
catch (const ::sgf::Error& e)
{
	throw ::sgf::Error(where, e.what());
}

}  // namespace

void internal::requireSection(
	const mrpt::config::CConfigFileBase& source, const std::string& section)
{
	std::vector<std::string> sections;
	source.getAllSections(sections);
	if (std::find(sections.begin(), sections.end(), section) == sections.end())
		THROW_EXCEPTION_FMT(
			"there is no section [%s] in the configuration", section.c_str());
}

::sgf::odometry::OdometryOptions internal::odometryOptions(
	const CSgfOdometry::TParams& params, const std::string& where)
{
	YAML::Node node(YAML::NodeType::Map);
	for (const auto& [name, value] : params.odometry)
		::sgf::SetOption(node, name, value);
	::sgf::odometry::OdometryOptions options;
	::sgf::ReadOptions(node, options, where);
	return options;
}

void CSgfOdometry::TParams::loadFromConfigFile(
	const mrpt::config::CConfigFileBase& source, const std::string& section)
{
	loadFromSharedSection(source, section, {});
}

void CSgfOdometry::TParams::loadFromSharedSection(
	const mrpt::config::CConfigFileBase& source, const std::string& section,
	const std::set<std::string>& others)
{
	internal::requireSection(source, section);
	// Not in brackets, which MRPT takes for a place in the code.
	const std::string where = "section " + section;
	TOwnFields own{*this};
	const auto fields = ::sgf::DescribeOptions(own);
	std::vector<std::string> keys;
	source.getAllKeys(section, keys);
	YAML::Node ownValues(YAML::NodeType::Map);
	for (const auto& key : keys)
	{
		if (others.count(key)) continue;
		const std::string value = source.read_string(section, key, "");
		const bool isOwn = std::any_of(
			fields.begin(), fields.end(),
			[&](const auto& f) { return f.name == key; });
		if (isOwn)
			ownValues[key] = value;
		else
			odometry[key] = value;
	}
	::sgf::ReadOptions(ownValues, own, where);
	checkOdometryOptions(internal::odometryOptions(*this, where), where);
	requirePositive("max_gap_s", max_gap_s, where);
	requirePositive("lost_std_xyz_m", lost_std_xyz_m, where);
	requirePositive("lost_std_angle_deg", lost_std_angle_deg, where);
}

void CSgfOdometry::TParams::saveToConfigFile(
	mrpt::config::CConfigFileBase& target, const std::string& section) const
{
	TParams copy = *this;
	auto docs = ::sgf::DescribeOptions(TOwnFields{copy});
	const auto inner =
		::sgf::DescribeOptions(internal::odometryOptions(*this, section));
	docs.insert(docs.end(), inner.begin(), inner.end());
	for (const auto& doc : docs)
		target.write(section, doc.name, doc.default_value);
}

}  // namespace mrpt::sgf
