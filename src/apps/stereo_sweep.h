#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <sgf/io/stereo_layouts.h>

namespace sgf::apps {

/// What `sgf_eval stereo` is asked for.
struct StereoSweepRequest {
  std::string experiment;      ///< YAML file of the sweep
  std::string dataset;         ///< as in datasets/stereo_layouts.yaml
  std::string column;          ///< name in the sweep
  std::string output;          ///< CSV file of scores
  std::string options_output;  ///< YAML file for every parameter; may be empty
  std::string changes;         ///< YAML file with a map `changes`; may be empty
  std::string change;          ///< name in it of what is done to right images; may be empty
  int window = 0;              ///< px; the only one of the grid's that is run, 0: all
  int threads = 1;
};

/// Runs one column of a sweep over all scenes of a dataset, for every window and uniqueness of its
/// grid, and writes a CSV line per scene, region, window and uniqueness.
/// @throws Error for a file, name or option that is not as it should be.
void RunStereoSweep(const StereoSweepRequest& request, const StereoDatasetEntry& entry,
                    const std::filesystem::path& folder);

}  // namespace sgf::apps
