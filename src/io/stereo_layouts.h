#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sgf/io/stereo_dataset.h>

namespace sgf {

/// A stereo dataset that experiments know: where it may lie, and how.
struct StereoDatasetEntry {
  std::string name;  ///< key of the entry, as experiments and tables call the dataset
  std::string title;
  StereoLayout layout = StereoLayout::kMiddleburyEval3;
  std::vector<std::string> folders;  ///< relative to a data root, in order of preference
  int scenes = 0;                    ///< in the complete dataset
  bool generated = false;  ///< made by the project from installed packages, not downloaded

  /// Fields of an entry in the file (see core/options.h); the name is its key there.
  template <class V>
  void VisitFields(V&& visit) {
    visit("title", title, "", "name for tables and figures");
    visit("layout", layout, "", "how the files lie in the folder");
    visit("folders", folders, "", "folders under the data root, in order of preference");
    visit("scenes", scenes, "", "number of scenes in the complete dataset");
    visit("generated", generated, "", "made from installed packages");
  }
};

/// Reads a file as datasets/stereo_layouts.yaml: a YAML map from names to entries, in the order of
/// the file.
/// @throws Error naming file and line when it is no valid YAML, for an unknown or repeated key, an
///   unreadable value, an entry without title, layout or folders, and a folder that is not
///   relative.
std::vector<StereoDatasetEntry> ReadStereoLayouts(const std::filesystem::path& path);

/// The first of the entry's folders that exists under a data root.
std::optional<std::filesystem::path> FindDataset(const StereoDatasetEntry& entry,
                                                 const std::filesystem::path& root);

}  // namespace sgf
