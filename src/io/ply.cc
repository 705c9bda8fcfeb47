#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/fields.h>
#include <sgf/io/ply.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

constexpr std::string_view kFormat = "ply\nformat binary_little_endian 1.0\n";
constexpr std::string_view kPoint =
    "property float x\nproperty float y\nproperty float z\nproperty float variance\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty int support\n"
    "end_header\n";
constexpr size_t kPointBytes = 4 * 4 + 3 + 4;

/// The header's line with the number of points, which is known in the end. Always as long: blanks
/// end the comment before it.
std::string CountLine(std::int64_t count) {
  return fmt::format("{:>40}", fmt::format("\nelement vertex {}\n", count));
}

void AppendLittleEndian(std::string& bytes, uint32_t word) {
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift & 0xFF);
}

/// Takes the text up to and with `mark` off the front of `text`. @throws Error where it has none.
std::string_view TakeUntil(std::string_view mark, std::string_view& text,
                           const std::filesystem::path& path) {
  const size_t end = text.find(mark);
  if (end == std::string_view::npos)
    throw Error(path.string(), fmt::format("has no {} in its header", Printable(mark)));
  const std::string_view front = text.substr(0, end);
  text.remove_prefix(end + mark.size());
  return front;
}

uint32_t TakeLittleEndian(std::string_view& bytes) {
  uint32_t word = 0;
  for (int k = 0; k < 4; ++k) word |= uint32_t{static_cast<uint8_t>(bytes[k])} << 8 * k;
  bytes.remove_prefix(4);
  return word;
}

float TakeFloat(std::string_view& bytes) { return std::bit_cast<float>(TakeLittleEndian(bytes)); }

}  // namespace

void WriteMeshPly(const std::filesystem::path& path, std::span<const cv::Point3f> vertices,
                  std::span<const std::array<int, 3>> triangles, const std::string& comment) {
  std::string bytes = fmt::format(
      "{}comment {}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      kFormat, comment, vertices.size(), triangles.size());
  for (const cv::Point3f& v : vertices)
    for (const float coordinate : {v.x, v.y, v.z})
      AppendLittleEndian(bytes, std::bit_cast<uint32_t>(coordinate));
  for (const std::array<int, 3>& triangle : triangles) {
    bytes += static_cast<char>(triangle.size());
    for (const int index : triangle) AppendLittleEndian(bytes, static_cast<uint32_t>(index));
  }
  WriteTextFile(path, bytes);
}

PointsPlyWriter::PointsPlyWriter(const std::filesystem::path& path, const std::string& comment)
    : file_(path) {
  const std::string begin = fmt::format("{}comment {}", kFormat, comment);
  count_at_ = static_cast<std::int64_t>(begin.size());
  file_.Write(begin + CountLine(0) + std::string(kPoint));
}

void PointsPlyWriter::Add(const PlyPoint& p) {
  for (const float value : {p.position.x, p.position.y, p.position.z, p.variance})
    AppendLittleEndian(bytes_, std::bit_cast<uint32_t>(value));
  const auto grey = static_cast<uint8_t>(std::clamp(p.grey, 0.f, 255.f));
  bytes_.append(3, static_cast<char>(grey));
  AppendLittleEndian(bytes_, static_cast<uint32_t>(p.support));
  ++count_;
  constexpr size_t kBuffer = size_t{1} << 16;
  if (bytes_.size() > kBuffer) Flush();
}

void PointsPlyWriter::Flush() {
  file_.Write(bytes_);
  bytes_.clear();
}

void PointsPlyWriter::Commit() {
  Flush();
  file_.Overwrite(count_at_, CountLine(count_));
  file_.Commit();
}

void WritePointsPly(const std::filesystem::path& path, std::span<const PlyPoint> points,
                    const std::string& comment) {
  PointsPlyWriter writer(path, comment);
  for (const PlyPoint& point : points) writer.Add(point);
  writer.Commit();
}

std::vector<PlyPoint> ReadPointsPly(const std::filesystem::path& path) {
  const std::string data = ReadFile(path);
  std::string_view rest = data;
  const std::string_view begin = TakeUntil("element vertex ", rest, path);
  const auto count = ParseNumber<int>(TakeUntil("\n", rest, path));
  if (!begin.starts_with(kFormat) || !rest.starts_with(kPoint) || !count || *count < 0)
    throw Error(path.string(), "is no binary PLY file with x, y, z, variance, colour and support");
  rest.remove_prefix(kPoint.size());
  if (rest.size() != kPointBytes * static_cast<size_t>(*count))
    throw Error(path.string(), fmt::format("{} bytes do not hold {} points", rest.size(), *count));
  std::vector<PlyPoint> points(*count);
  for (PlyPoint& p : points) {
    p.position = {TakeFloat(rest), TakeFloat(rest), TakeFloat(rest)};
    p.variance = TakeFloat(rest);
    p.grey = static_cast<uint8_t>(rest.front());
    rest.remove_prefix(3);
    p.support = static_cast<int>(TakeLittleEndian(rest));
  }
  return points;
}

}  // namespace sgf
