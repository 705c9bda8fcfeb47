#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/io/atomic_file.h>

namespace sgf {

/// Writes a triangle mesh as a binary PLY file: vertices x, y, z as float, faces as lists of three
/// indices.
/// @param comment goes into the header: what the coordinates mean; one line.
/// @throws Error for a file that cannot be written.
void WriteMeshPly(const std::filesystem::path& path, std::span<const cv::Point3f> vertices,
                  std::span<const std::array<int, 3>> triangles, const std::string& comment);

/// A point of a map.
struct PlyPoint {
  cv::Point3f position;
  float grey = 0;      ///< grey levels; stored as red, green and blue, cut to 0 to 255
  float variance = 0;  ///< of whatever the header's comment says
  int support = 0;     ///< how many images it was seen in
};

/// Writes points as they come as a binary PLY file: x, y, z and variance as float, red, green and
/// blue as bytes, support as int. Memory does not grow with their number.
class PointsPlyWriter {
 public:
  /// @param comment as for WriteMeshPly().
  /// @throws Error for a file that cannot be written.
  PointsPlyWriter(const std::filesystem::path& path, const std::string& comment);

  /// @throws Error for bytes that cannot be written.
  void Add(const PlyPoint& point);

  /// Gives the file its name; the last call. @throws Error as Add().
  void Commit();

  std::int64_t count() const { return count_; }

 private:
  void Flush();

  AtomicFile file_;
  std::int64_t count_at_;  ///< bytes before the number of points
  std::int64_t count_ = 0;
  std::string bytes_;
};

/// Writes points in one go, as PointsPlyWriter does.
/// @throws Error for a file that cannot be written.
void WritePointsPly(const std::filesystem::path& path, std::span<const PlyPoint> points,
                    const std::string& comment);

/// Reads points as WritePointsPly() writes them; the comment may be any.
/// @throws Error naming the file for another header or another number of bytes; as ReadFile().
std::vector<PlyPoint> ReadPointsPly(const std::filesystem::path& path);

}  // namespace sgf
