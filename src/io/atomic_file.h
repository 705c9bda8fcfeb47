#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace sgf {

/// A file that appears under its name complete or not at all. Writing goes to a temporary name in
/// the same folder; Commit() renames it over the target. An interrupted or failed run leaves an
/// older target as it was.
///
///     AtomicFile file("results/table1.csv");
///     file.Write(text);
///     file.Commit();
class AtomicFile {
 public:
  /// Creates the temporary file.
  /// @throws Error naming the target when its folder is missing or not writable.
  explicit AtomicFile(std::filesystem::path target);

  /// Removes the temporary file unless committed.
  ~AtomicFile();

  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends bytes. @throws Error naming the target when they cannot be written (disk full).
  void Write(std::string_view bytes);

  /// Writes over bytes from `offset` on that were written before. @throws Error as Write().
  void Overwrite(std::int64_t offset, std::string_view bytes);

  /// Closes the file and gives it its name; to be called once, as the last call.
  /// @throws Error naming the target when that fails; the temporary file is then removed.
  void Commit();

 private:
  [[noreturn]] void Fail(const char* what, int error_number) const;
  void Close();

  std::filesystem::path target_;
  std::filesystem::path temporary_;
  int descriptor_ = -1;
  bool committed_ = false;
};

/// Writes a whole file, as AtomicFile does. @throws Error as there.
void WriteTextFile(const std::filesystem::path& path, std::string_view text);

/// Makes a folder, and those above it, unless it is there.
/// @throws Error naming it when that fails.
void MakeFolder(const std::filesystem::path& folder);

}  // namespace sgf
