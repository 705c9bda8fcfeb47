#pragma once

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>

#include <stdlib.h>

namespace sgf {

/// A folder of its own for a test, removed with all that is in it at the end of the scope.
class TempDir {
 public:
  TempDir() {
    std::string name = (std::filesystem::temp_directory_path() / "sgf_test_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(), name);
    path_ = name;
  }
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;

  const std::filesystem::path& path() const { return path_; }

  /// Path of a file in the folder; folders on the way to it are made.
  std::filesystem::path File(const std::filesystem::path& relative) const {
    std::filesystem::create_directories((path_ / relative).parent_path());
    return path_ / relative;
  }

  /// Writes a file in the folder and returns its path.
  std::filesystem::path Write(const std::filesystem::path& relative, std::string_view bytes) const {
    const auto path = File(relative);
    std::filesystem::remove(path);  // rewriting a file in place is slow: ext4 then syncs at once
    std::ofstream file(path, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path;
  }

 private:
  std::filesystem::path path_;
};

}  // namespace sgf
