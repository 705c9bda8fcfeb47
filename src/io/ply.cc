#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>

#include <fmt/core.h>

#include <sgf/io/atomic_file.h>
#include <sgf/io/ply.h>

namespace sgf {
namespace {

void AppendLittleEndian(std::string& bytes, uint32_t word) {
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift & 0xFF);
}

}  // namespace

void WriteMeshPly(const std::filesystem::path& path, std::span<const cv::Point3f> vertices,
                  std::span<const std::array<int, 3>> triangles, const std::string& comment) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment {}\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      comment, vertices.size(), triangles.size());
  for (const cv::Point3f& v : vertices)
    for (const float coordinate : {v.x, v.y, v.z})
      AppendLittleEndian(bytes, std::bit_cast<uint32_t>(coordinate));
  for (const std::array<int, 3>& triangle : triangles) {
    bytes += static_cast<char>(triangle.size());
    for (const int index : triangle) AppendLittleEndian(bytes, static_cast<uint32_t>(index));
  }
  WriteTextFile(path, bytes);
}

void WritePointsPly(const std::filesystem::path& path, std::span<const PlyPoint> points,
                    const std::string& comment) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment {}\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\nproperty float variance\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty int support\n"
      "end_header\n",
      comment, points.size());
  for (const PlyPoint& p : points) {
    for (const float value : {p.position.x, p.position.y, p.position.z, p.variance})
      AppendLittleEndian(bytes, std::bit_cast<uint32_t>(value));
    const auto grey = static_cast<uint8_t>(std::clamp(p.grey, 0.f, 255.f));
    bytes.append(3, static_cast<char>(grey));
    AppendLittleEndian(bytes, static_cast<uint32_t>(p.support));
  }
  WriteTextFile(path, bytes);
}

}  // namespace sgf
