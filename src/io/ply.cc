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

}  // namespace sgf
