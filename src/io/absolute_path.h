#pragma once

#include <filesystem>

namespace sgf::internal {

/// The absolute path of a file or folder, without dots and without a slash at its end: a suffix can
/// be added.
inline std::filesystem::path AbsolutePath(const std::filesystem::path& path) {
  const std::filesystem::path normal = std::filesystem::absolute(path).lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

}  // namespace sgf::internal
