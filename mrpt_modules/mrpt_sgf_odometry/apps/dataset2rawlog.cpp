/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
// Makes a rawlog of a data set.

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/sgf/CObservationSource.h>
#include <mrpt/sgf/CSgfPairAligner.h>

#include <filesystem>

#include "CRawlogWriter.h"
#include "runTool.h"

namespace mrpt::sgf::apps
{
namespace
{
namespace fs = std::filesystem;
using mrpt::img::CImage;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationStereoImages;

// What a rawlog's images are called, and where they go.
class CImageStore
{
 public:
	// The folder in which MRPT looks for the images of a rawlog. If embed, the
	// images become part of the rawlog instead.
	CImageStore(const fs::path& rawlog, bool embed) : m_embed(embed)
	{
		m_folder = rawlog.parent_path() / (rawlog.stem().string() + "_Images");
		if (!embed) fs::create_directory(m_folder);
	}

	void take(CImage& image, const std::string& name) const
	{
		const fs::path from = image.getExternalStorageFileAbsolutePath();
		if (!fs::exists(from))
			THROW_EXCEPTION_FMT("%s: is missing", from.c_str());
		if (m_embed)
		{
			CImage loaded;
			if (!loaded.loadFromFile(from.string()))
				THROW_EXCEPTION_FMT("%s: is no image", from.c_str());
			// MRPT would store colour as JPEG, which loses detail.
			image = loaded.isColor() ? loaded.grayscale() : loaded;
			return;
		}
		const std::string file = name + from.extension().string();
		fs::copy_file(
			from, m_folder / file, fs::copy_options::overwrite_existing);
		image.setExternalStorage(file);
	}

	void take(CObservation3DRangeScan& obs, const std::string& name) const
	{
		take(obs.intensityImage, name + "_left");
		if (!m_embed)
			obs.rangeImage_convertToExternalStorage(
				name + "_range.bin", m_folder.string() + "/");
	}

 private:
	fs::path m_folder;
	bool m_embed;
};

void storeImages(
	mrpt::obs::CObservation& obs, const CImageStore& store, size_t frame)
{
	const std::string name = mrpt::format("%06zu", frame);
	if (auto* stereo = dynamic_cast<CObservationStereoImages*>(&obs))
	{
		store.take(stereo->imageLeft, name + "_left");
		store.take(stereo->imageRight, name + "_right");
	}
	else if (auto* scan = dynamic_cast<CObservation3DRangeScan*>(&obs))
		store.take(*scan, name);
}

void convert(
	const std::string& folder, const std::string& rawlog,
	const TDatasetOptions& options, bool embed)
{
	const auto source = openDataset(folder, options);
	CRawlogWriter writer(rawlog);
	const CImageStore store(rawlog, embed);
	size_t frames = 0, samples = 0;
	while (const auto obs = source->next())
	{
		storeImages(*obs, store, frames);
		writer.write(*obs);
		++(CSgfPairAligner::isFrame(*obs) ? frames : samples);
	}
	writer.commit();
	std::printf(
		"%s: %zu frames, %zu inertial samples\n", rawlog.c_str(), frames,
		samples);
	reportIncomplete(*source);
}

}  // namespace
}  // namespace mrpt::sgf::apps

int main(int argc, char** argv)
{
	CLI::App app(
		"Makes a rawlog of a data set in the layout of EuRoC, KITTI odometry, "
		"TUM RGB-D or ICL-NUIM",
		"dataset2rawlog");
	std::string folder, rawlog;
	mrpt::sgf::TDatasetOptions options;
	bool embed = false, noImu = false;
	app.add_option("-i,--input", folder, "folder of the data set")->required();
	app.add_option("-o,--output", rawlog, "rawlog to write")->required();
	app.add_option(
		"-l,--layout", options.layout,
		"euroc, kitti_odometry, tum_rgbd or icl_nuim (default: found by "
		"looking)");
	app.add_option(
		"-n,--frames", options.max_frames,
		"frames to take, from the first (default: all)");
	app.add_flag(
		"-e,--embed", embed,
		"store images within the rawlog, in grey, in place of external files");
	app.add_flag("--no-imu", noImu, "leave out inertial samples");
	return mrpt::sgf::apps::runTool(
		app, argc, argv,
		[&]
		{
			options.imu = !noImu;
			mrpt::sgf::apps::convert(folder, rawlog, options, embed);
		});
}
