#include <fmt/core.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/error.h>
#include <sgf/core/options.h>
#include <sgf/io/read_file.h>
#include <sgf/io/stereo_layouts.h>

namespace sgf {
namespace {

std::string At(const std::filesystem::path& path, const YAML::Mark& mark) {
  return mark.is_null() ? path.string() : fmt::format("{}:{}", path.string(), mark.line + 1);
}

void RequireKeys(const YAML::Node& map, const std::string& name, const std::string& where) {
  for (const char* key : {"title", "layout", "folders"})
    if (!map.IsMap() || !map[key])
      throw Error(where, fmt::format("dataset {} has no {}", name, key));
}

void RequireRelativeFolders(const StereoDatasetEntry& entry, const std::string& where) {
  if (entry.folders.empty()) throw Error(where, "expected at least one folder");
  for (const std::string& folder : entry.folders)
    if (folder.empty() || std::filesystem::path(folder).is_absolute())
      throw Error(where, fmt::format("folder '{}' is not relative to a data root", folder));
}

StereoDatasetEntry ReadEntry(const YAML::Node& key, const YAML::Node& value,
                             const std::filesystem::path& path) {
  StereoDatasetEntry entry;
  entry.name = key.as<std::string>();
  ReadOptions(value, entry, path.string());
  RequireKeys(value, entry.name, At(path, key.Mark()));
  RequireRelativeFolders(entry, At(path, value["folders"].Mark()));
  return entry;
}

std::vector<StereoDatasetEntry> ReadEntries(const YAML::Node& root,
                                            const std::filesystem::path& path) {
  if (!root.IsMap()) throw Error(At(path, root.Mark()), "expected a map of datasets");
  std::vector<StereoDatasetEntry> entries;
  for (const auto& item : root) {
    StereoDatasetEntry entry = ReadEntry(item.first, item.second, path);
    for (const StereoDatasetEntry& other : entries)
      if (other.name == entry.name)
        throw Error(At(path, item.first.Mark()),
                    fmt::format("dataset {} is there twice", entry.name));
    entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace

std::vector<StereoDatasetEntry> ReadStereoLayouts(const std::filesystem::path& path) {
  const std::string text = ReadFile(path);
  try {
    return ReadEntries(YAML::Load(text), path);
  } catch (const YAML::Exception& error) {
    throw Error(At(path, error.mark), error.msg);
  }
}

std::optional<std::filesystem::path> FindDataset(const StereoDatasetEntry& entry,
                                                 const std::filesystem::path& root) {
  std::error_code ignored;
  for (const std::string& folder : entry.folders)
    if (std::filesystem::is_directory(root / folder, ignored)) return root / folder;
  return std::nullopt;
}

}  // namespace sgf
