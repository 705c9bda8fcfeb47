#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string>

#include <opencv2/core.hpp>

namespace sgf {

/// Writes a triangle mesh as a binary PLY file: vertices x, y, z as float, faces as lists of three
/// indices.
/// @param comment goes into the header: what the coordinates mean; one line.
/// @throws Error for a file that cannot be written.
void WriteMeshPly(const std::filesystem::path& path, std::span<const cv::Point3f> vertices,
                  std::span<const std::array<int, 3>> triangles, const std::string& comment);

}  // namespace sgf
