#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

/// Generated folders that are whole or not at all. A manifest lists all files of a folder with
/// their sizes and hashes and is written last, so that a folder with a manifest in agreement with
/// its files was written to its end.
namespace sgf {

/// Name of the manifest in its folder.
inline constexpr const char* kManifestName = "manifest.yaml";

/// A file in a folder.
struct ManifestFile {
  std::string path;  ///< relative to the folder, with '/'
  std::uint64_t size = 0;
  std::string sha256;
};

/// What a generated folder holds and what it was made from.
struct Manifest {
  std::string recipe_hash;                     ///< of all that decides the content
  std::map<std::string, std::int64_t> counts;  ///< what the maker counts, such as frames
  std::vector<ManifestFile> files;             ///< in the order of their paths; not the manifest
};

/// Makes everything in a folder durable (fsync) and then writes its manifest, last.
/// @throws Error naming the file or folder that cannot be read, synced or written, or that is
///   neither a regular file nor a folder.
void WriteManifest(const std::filesystem::path& folder, const std::string& recipe_hash,
                   const std::map<std::string, std::int64_t>& counts);

/// Reads a folder's manifest.
/// @throws Error naming the manifest when it is missing, damaged or truncated.
Manifest ReadManifest(const std::filesystem::path& folder);

/// Whether a folder is a whole one made from a recipe: its manifest can be read and has this recipe
/// hash, and all files are there with the right sizes. Contents are not read.
bool IsComplete(const std::filesystem::path& folder, const std::string& recipe_hash);

/// Compares a folder with its manifest: the files in it, their sizes and their content.
/// @throws Error as ReadManifest; naming the first file that is missing, is not listed or differs.
void CheckManifest(const std::filesystem::path& folder);

/// Keeps other processes off a folder while it lives. The lock stays with the folder when that is
/// renamed and ends with the process.
class FolderLock {
 public:
  /// Makes the folder, and those above it, where it is missing, and locks it.
  /// @throws Error naming the folder when that fails or another process has it locked.
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  void Close();

  int descriptor_ = -1;
};

/// A folder that appears under its name whole or not at all. Work goes to `target.partial`;
/// Commit() gives it its name. An interrupted or failed run leaves an older target as it was, or,
/// where it ends while Commit() puts the new one in its place, none.
///
///     StagedFolder staged("datasets/generated/room");
///     WritePng(staged.path() / "left.png", image);
///     staged.Commit(recipe_hash, {{"frames", 1}});
class StagedFolder {
 public:
  /// Makes an empty `target.partial`, and the folders above it; what an interrupted run left there
  /// is removed.
  /// @throws Error naming the folder when that fails or another process works on it.
  explicit StagedFolder(const std::filesystem::path& target);

  /// Removes the working folder unless committed.
  ~StagedFolder();

  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  /// Where to write.
  const std::filesystem::path& path() const { return partial_; }

  /// Writes the manifest, makes all durable and replaces the target; to be called once, as the last
  /// call. @throws Error as WriteManifest; when the folder cannot be given its name.
  void Commit(const std::string& recipe_hash, const std::map<std::string, std::int64_t>& counts);

 private:
  std::filesystem::path target_;
  std::filesystem::path partial_;
  FolderLock lock_;
  bool committed_ = false;
};

}  // namespace sgf
