/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include "parameters.h"

#include <mrpt/core/exceptions.h>

#include <algorithm>
#include <span>
#include <utility>

#include <sgf/core/options.h>

namespace mrpt::sgf
{
static std::span<const std::pair<const char*, TEstimator>> EnumNames(TEstimator)
{
	static constexpr std::pair<const char*, TEstimator> kNames[] = {
		{"stereo", TEstimator::STEREO},
		{"stereo_inertial", TEstimator::STEREO_INERTIAL}};
	return kNames;
}

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
		visit("estimator", p.estimator, "", "");
		visit("sensor_label", p.sensor_label, "", "");
		visit("imu_label", p.imu_label, "", "");
		visit("use_imu", p.use_imu, "", "");
		visit("max_waiting_frames", p.max_waiting_frames, "", "");
		visit("gyroscope_noise_density", p.gyroscope_noise_density, "", "");
		visit("gyroscope_random_walk", p.gyroscope_random_walk, "", "");
		visit(
			"accelerometer_noise_density", p.accelerometer_noise_density, "",
			"");
		visit(
			"accelerometer_random_walk", p.accelerometer_random_walk, "", "");
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

// Estimators check their options when they are made: so they are made, for any
// cameras.
void checkOptions(const CSgfOdometry::TParams& params, const std::string& where)
try
{
	const ::sgf::Camera camera{640, 480, 500, 500, 319.5, 239.5};
	const ::sgf::SE3 right{
		Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0, 0)};
	const ::sgf::odometry::Odometry odometry(
		{camera, 0.1}, internal::odometryOptions(params, where));
	const ::sgf::vio::StereoInertialOdometry vio(
		{camera, camera, right}, {}, internal::imuNoise(params),
		internal::vioOptions(params, where));
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

namespace
{
bool isVioOption(const std::string& name)
{
	static const auto kFields =
		::sgf::DescribeOptions(::sgf::vio::VioOptions());
	return std::any_of(
		kFields.begin(), kFields.end(),
		[&](const auto& field) { return field.name == name; });
}

// Names that nobody knows are left to the first estimator, which says so.
template <class OPTIONS>
OPTIONS optionsOf(
	const CSgfOdometry::TParams& params, const std::string& where, bool vio)
{
	YAML::Node node(YAML::NodeType::Map);
	for (const auto& [name, value] : params.odometry)
		if (isVioOption(name) == vio) ::sgf::SetOption(node, name, value);
	OPTIONS options;
	::sgf::ReadOptions(node, options, where);
	return options;
}
}  // namespace

::sgf::odometry::OdometryOptions internal::odometryOptions(
	const CSgfOdometry::TParams& params, const std::string& where)
{
	return optionsOf<::sgf::odometry::OdometryOptions>(params, where, false);
}

::sgf::vio::VioOptions internal::vioOptions(
	const CSgfOdometry::TParams& params, const std::string& where)
{
	auto options = optionsOf<::sgf::vio::VioOptions>(params, where, true);
	options.inertial = options.inertial && params.use_imu;
	return options;
}

::sgf::ImuNoise internal::imuNoise(const CSgfOdometry::TParams& params)
{
	return {
		params.gyroscope_noise_density, params.gyroscope_random_walk,
		params.accelerometer_noise_density, params.accelerometer_random_walk};
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
	checkOptions(*this, where);
	requirePositive("max_gap_s", max_gap_s, where);
	requirePositive("lost_std_xyz_m", lost_std_xyz_m, where);
	requirePositive("lost_std_angle_deg", lost_std_angle_deg, where);
	if (max_waiting_frames < 0)
		throw ::sgf::Error(
			where, mrpt::format(
					   "max_waiting_frames is %d, has to be at least 0",
					   max_waiting_frames));
}

void CSgfOdometry::TParams::saveToConfigFile(
	mrpt::config::CConfigFileBase& target, const std::string& section) const
{
	TParams copy = *this;
	auto docs = ::sgf::DescribeOptions(TOwnFields{copy});
	const auto add = [&docs](const auto& inner)
	{ docs.insert(docs.end(), inner.begin(), inner.end()); };
	add(::sgf::DescribeOptions(internal::odometryOptions(*this, section)));
	add(::sgf::DescribeOptions(internal::vioOptions(*this, section)));
	for (const auto& doc : docs)
		target.write(section, doc.name, doc.default_value);
}

}  // namespace mrpt::sgf
