#include <algorithm>
#include <cerrno>
#include <iterator>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/error.h>
#include <sgf/io/absolute_path.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/hash.h>
#include <sgf/io/manifest.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const fs::path& path, const char* what, int error_number) {
  throw Error(path.string(),
              fmt::format("{}: {}", what, std::generic_category().message(error_number)));
}

// Makes a file's content or a folder's entries durable.
void Sync(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) Fail(path, "cannot be opened", errno);
  const int error = fsync(descriptor) == 0 ? 0 : errno;
  close(descriptor);
  // Some file systems cannot sync folders and say so with EINVAL.
  if (error != 0 && error != EINVAL) Fail(path, "cannot be written to disk", error);
}

/// What is in a folder.
struct Tree {
  std::vector<fs::path> folders;   ///< the folder itself first
  std::vector<std::string> files;  ///< relative, in order, without the manifest
};

Tree ListTree(const fs::path& folder) try {
  Tree tree{{folder}, {}};
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string path = entry.path().lexically_relative(folder).generic_string();
    if (entry.is_symlink() || !(entry.is_directory() || entry.is_regular_file()))
      throw Error(entry.path().string(), "is neither a regular file nor a folder");
    if (entry.is_directory())
      tree.folders.push_back(entry.path());
    else if (path != kManifestName)
      tree.files.push_back(path);
  }
  std::sort(tree.files.begin(), tree.files.end());
  return tree;
} catch (const fs::filesystem_error& error) {
  throw Error(folder.string(), error.code().message());
}

std::uint64_t FileSize(const fs::path& path) {
  std::error_code error;
  const std::uint64_t size = fs::file_size(path, error);
  if (error) throw Error(path.string(), "is missing or no regular file");
  return size;
}

// ---- The manifest's text

std::uint64_t TotalBytes(const Manifest& manifest) {
  std::uint64_t bytes = 0;
  for (const ManifestFile& file : manifest.files) bytes += file.size;
  return bytes;
}

// The totals, which stand first, show a list that was cut.
std::string Text(const Manifest& manifest) {
  YAML::Emitter out;
  out << YAML::Comment("All files of this folder. Written last.");
  out << YAML::BeginMap << YAML::Key << "recipe" << YAML::Value << manifest.recipe_hash;
  out << YAML::Key << "counts" << YAML::Value << YAML::Flow << manifest.counts;
  out << YAML::Key << "total_files" << YAML::Value << manifest.files.size();
  out << YAML::Key << "total_bytes" << YAML::Value << TotalBytes(manifest);
  out << YAML::Key << "files" << YAML::Value << YAML::BeginSeq;
  for (const auto& [path, size, sha256] : manifest.files)
    out << YAML::Flow << YAML::BeginSeq << sha256 << size << path << YAML::EndSeq;
  out << YAML::EndSeq << YAML::EndMap;
  return out.c_str() + std::string("\n");
}

bool StaysInside(const fs::path& path) {
  return path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
}

ManifestFile ParseFile(const YAML::Node& node, const std::string& where) {
  if (!node.IsSequence() || node.size() != 3)
    throw Error(where, "damaged: a file has no hash, size and path");
  ManifestFile file{node[2].as<std::string>(), node[1].as<std::uint64_t>(),
                    node[0].as<std::string>()};
  if (!StaysInside(file.path))
    throw Error(where, fmt::format("damaged: file {} is not in the folder", Printable(file.path)));
  return file;
}

Manifest Parse(const YAML::Node& root, const std::string& where) {
  for (const char* key : {"recipe", "counts", "total_files", "total_bytes", "files"})
    if (!root.IsMap() || !root[key]) throw Error(where, fmt::format("damaged: no key {}", key));
  Manifest manifest;
  manifest.recipe_hash = root["recipe"].as<std::string>();
  manifest.counts = root["counts"].as<std::map<std::string, std::int64_t>>();
  for (const YAML::Node& node : root["files"]) manifest.files.push_back(ParseFile(node, where));
  if (manifest.files.size() != root["total_files"].as<size_t>() ||
      TotalBytes(manifest) != root["total_bytes"].as<std::uint64_t>())
    throw Error(where, "damaged: the list of files does not have its totals");
  return manifest;
}

// ---- Comparing

void CheckSize(const fs::path& folder, const ManifestFile& file) {
  const fs::path path = folder / file.path;
  if (const std::uint64_t size = FileSize(path); size != file.size)
    throw Error(path.string(), fmt::format("has {} bytes, its manifest says {}", size, file.size));
}

void CheckContent(const fs::path& folder, const ManifestFile& file) {
  const std::string path = (folder / file.path).string();
  if (Sha256OfFile(path) != file.sha256)
    throw Error(path, "has another content than its manifest says (SHA-256)");
}

// ---- The working folder

void RemoveAll(const fs::path& path) {
  std::error_code error;
  fs::remove_all(path, error);
  if (error) throw Error(path.string(), "cannot be removed: " + error.message());
}

void Rename(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw Error(to.string(), "cannot be put in place: " + error.message());
}

fs::path WithSuffix(fs::path path, const char* suffix) { return path += suffix; }

void RemoveContent(const fs::path& folder) try {
  for (const auto& entry : fs::directory_iterator(folder)) RemoveAll(entry.path());
} catch (const fs::filesystem_error& error) {
  throw Error(folder.string(), error.code().message());
}

bool IsSameFile(int descriptor, const fs::path& path) {
  struct stat opened {
  }, named{};
  return fstat(descriptor, &opened) == 0 && stat(path.c_str(), &named) == 0 &&
         opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
}

}  // namespace

void WriteManifest(const fs::path& folder, const std::string& recipe_hash,
                   const std::map<std::string, std::int64_t>& counts) {
  const Tree tree = ListTree(folder);
  Manifest manifest{recipe_hash, counts, {}};
  for (const std::string& name : tree.files) {
    const fs::path path = folder / name;
    Sync(path);
    manifest.files.push_back({name, FileSize(path), Sha256OfFile(path)});
  }
  for (const fs::path& path : tree.folders) Sync(path);
  AtomicFile file(folder / kManifestName);
  file.Write(Text(manifest));
  file.Commit();
  Sync(folder / kManifestName);
  Sync(folder);
}

Manifest ReadManifest(const fs::path& folder) {
  const fs::path path = folder / kManifestName;
  const std::string text = ReadFile(path);
  try {
    return Parse(YAML::Load(text), path.string());
  } catch (const YAML::Exception& error) {
    throw Error(path.string(), "damaged: " + error.msg);
  }
}

bool IsComplete(const fs::path& folder, const std::string& recipe_hash) {
  try {
    const Manifest manifest = ReadManifest(folder);
    for (const ManifestFile& file : manifest.files) CheckSize(folder, file);
    return manifest.recipe_hash == recipe_hash;
  } catch (const Error&) {
    return false;
  }
}

void CheckManifest(const fs::path& folder) {
  const Manifest manifest = ReadManifest(folder);
  std::set<std::string> listed;
  for (const ManifestFile& file : manifest.files) {
    CheckSize(folder, file);
    CheckContent(folder, file);
    listed.insert(file.path);
  }
  for (const std::string& name : ListTree(folder).files)
    if (!listed.contains(name)) throw Error((folder / name).string(), "is not in the manifest");
}

FolderLock::FolderLock(const fs::path& folder) {
  // A folder that another process has given another name meanwhile is not ours: try again.
  for (bool locked = false; !locked; locked = IsSameFile(descriptor_, folder)) {
    Close();
    MakeFolder(folder);
    descriptor_ = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor_ < 0 && errno != ENOENT) Fail(folder, "cannot be opened", errno);
    // Other failures than this one: a file system without locks.
    if (descriptor_ >= 0 && flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      Close();
      throw Error(folder.string(), "is being written by another process");
    }
  }
}

FolderLock::~FolderLock() { Close(); }

void FolderLock::Close() {
  if (descriptor_ >= 0) close(descriptor_);
  descriptor_ = -1;
}

StagedFolder::StagedFolder(const fs::path& target)
    : target_(internal::AbsolutePath(target)),
      partial_(WithSuffix(target_, ".partial")),
      lock_(partial_) {
  RemoveContent(partial_);
}

StagedFolder::~StagedFolder() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(partial_, ignored);
}

void StagedFolder::Commit(const std::string& recipe_hash,
                          const std::map<std::string, std::int64_t>& counts) {
  WriteManifest(partial_, recipe_hash, counts);
  const fs::path old = WithSuffix(target_, ".old");
  RemoveAll(old);
  std::error_code ignored;
  if (fs::exists(target_, ignored)) Rename(target_, old);
  Rename(partial_, target_);
  committed_ = true;
  Sync(target_.parent_path());
  RemoveAll(old);
}

}  // namespace sgf
