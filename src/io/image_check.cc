#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/io/image_check.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1a\n";

struct ImageSize {
  int64_t width = 0;
  int64_t height = 0;
};

uint32_t BigEndian(std::string_view bytes) {
  uint32_t value = 0;
  for (const char c : bytes) value = value << 8 | static_cast<uint8_t>(c);
  return value;
}

void RequireSize(const ImageSize& size, const std::string& where) {
  if (size.width < 1 || size.height < 1)
    throw Error(where, fmt::format("image size is {}x{}", size.width, size.height));
}

// Deflate reaches 1032:1, Huffman-coded JPEG (2 bits for a block of 64 samples) 256:1. More than
// that is a damaged header, which must not decide how much memory is allocated.
void RequirePlausibleSize(const ImageSize& size, int64_t bits_per_pixel, size_t data_bytes,
                          const std::string& where) {
  constexpr int64_t kBestRatio = 1032;
  RequireSize(size, where);
  const int64_t data_bits = static_cast<int64_t>(data_bytes) * 8;
  // A division, because the product on the other side may overflow.
  if (size.width > data_bits * kBestRatio / bits_per_pixel / size.height)
    throw Error(where, fmt::format("{} bytes cannot hold an image of {}x{}", data_bytes, size.width,
                                   size.height));
}

// --- PNG ---

constexpr std::array<uint32_t, 256> MakeCrcTable() {
  std::array<uint32_t, 256> table{};
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t c = i;
    for (int bit = 0; bit < 8; ++bit) c = (c & 1) != 0 ? 0xEDB88320U ^ (c >> 1) : c >> 1;
    table[i] = c;
  }
  return table;
}

uint32_t Crc32(std::string_view bytes) {
  static constexpr auto kTable = MakeCrcTable();
  uint32_t crc = 0xFFFFFFFFU;
  for (const char c : bytes) crc = kTable[(crc ^ static_cast<uint8_t>(c)) & 0xFF] ^ (crc >> 8);
  return ~crc;
}

struct PngChunk {
  std::string_view type;
  std::string_view data;
};

// Takes the next chunk (length, type, data, CRC) off the front of `rest`.
PngChunk TakeChunk(std::string_view& rest, const std::string& where) {
  if (rest.size() < 12) throw Error(where, "truncated PNG: ends before its IEND chunk");
  const size_t length = BigEndian(rest.substr(0, 4));
  const PngChunk chunk{rest.substr(4, 4), rest.substr(8, length)};
  if (rest.size() - 12 < length)
    throw Error(where, fmt::format("truncated PNG: chunk {} has {} bytes, {} are left",
                                   Printable(chunk.type), length, rest.size() - 12));
  if (Crc32(rest.substr(4, length + 4)) != BigEndian(rest.substr(length + 8, 4)))
    throw Error(where,
                fmt::format("corrupt PNG: wrong checksum of chunk {}", Printable(chunk.type)));
  rest.remove_prefix(length + 12);
  return chunk;
}

int64_t PngBitsPerPixel(std::string_view header, const std::string& where) {
  constexpr std::array<int, 7> kChannels = {1, 0, 3, 1, 2, 0, 4};  // of a colour type
  const uint32_t bit_depth = BigEndian(header.substr(8, 1));
  const uint32_t colour_type = BigEndian(header.substr(9, 1));
  if (colour_type >= kChannels.size() || kChannels[colour_type] == 0 || bit_depth < 1 ||
      bit_depth > 16)
    throw Error(where,
                fmt::format("corrupt PNG: colour type {} with {} bits", colour_type, bit_depth));
  return static_cast<int64_t>(kChannels[colour_type]) * bit_depth;
}

void RequireCompletePng(std::string_view bytes, const std::string& where) {
  std::string_view rest = bytes.substr(kPngSignature.size());
  const PngChunk header = TakeChunk(rest, where);
  if (header.type != "IHDR" || header.data.size() != 13)
    throw Error(where, "corrupt PNG: does not begin with its IHDR chunk");
  const ImageSize size{BigEndian(header.data.substr(0, 4)), BigEndian(header.data.substr(4, 4))};
  size_t data_bytes = 0;
  for (PngChunk chunk = header; chunk.type != "IEND"; chunk = TakeChunk(rest, where))
    if (chunk.type == "IDAT") data_bytes += chunk.data.size();
  RequirePlausibleSize(size, PngBitsPerPixel(header.data, where), data_bytes, where);
}

// --- JPEG ---

constexpr uint8_t kStartOfScan = 0xDA;
constexpr uint8_t kEndOfImage = 0xD9;

bool IsRestart(uint8_t marker) { return marker >= 0xD0 && marker <= 0xD7; }

// SOF0 to SOF15; C4, C8 and CC in their midst are other segments.
bool IsStartOfFrame(uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

// Position of the marker that ends the scan data at `begin`: 0xFF and a byte that is neither a
// stuffed zero nor a restart nor more fill.
size_t ScanEnd(std::string_view bytes, size_t begin) {
  for (size_t i = begin; i + 1 < bytes.size(); ++i) {
    const auto next = static_cast<uint8_t>(bytes[i + 1]);
    if (bytes[i] == '\xFF' && next != 0 && next != 0xFF && !IsRestart(next)) return i;
  }
  return bytes.size();
}

// Walks the segments of a JPEG. Stands on a marker between the calls.
class JpegWalker {
 public:
  JpegWalker(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {}

  // Steps to the next marker and returns its code.
  uint8_t Marker() {
    while (position_ + 1 < bytes_.size() && bytes_.substr(position_, 2) == "\xFF\xFF") ++position_;
    if (position_ + 1 >= bytes_.size()) throw Error(where_, "truncated JPEG: has no end marker");
    if (bytes_[position_] != '\xFF')
      throw Error(where_, fmt::format("corrupt JPEG: no marker at byte {}", position_));
    return static_cast<uint8_t>(bytes_[position_ + 1]);
  }

  // Content of the segment at the marker stood on; leaves that segment.
  std::string_view TakeSegment() {
    const std::string_view rest = bytes_.substr(position_ + 2);
    const size_t length = rest.size() < 2 ? 2 : BigEndian(rest.substr(0, 2));
    if (rest.size() < length || length < 2)
      throw Error(where_,
                  fmt::format("truncated JPEG: segment of {} bytes at byte {}", length, position_));
    position_ += 2 + length;
    return rest.substr(2, length - 2);
  }

  void SkipScan() { position_ = ScanEnd(bytes_, position_); }

 private:
  std::string_view bytes_;
  const std::string& where_;
  size_t position_ = 2;  // after the SOI marker
};

void RequireCompleteJpeg(std::string_view bytes, const std::string& where) {
  JpegWalker walker(bytes, where);
  std::optional<ImageSize> size;
  bool has_scan = false;
  for (uint8_t marker = walker.Marker(); marker != kEndOfImage; marker = walker.Marker()) {
    const std::string_view segment = walker.TakeSegment();
    if (IsStartOfFrame(marker) && segment.size() >= 5)
      size = ImageSize{BigEndian(segment.substr(3, 2)), BigEndian(segment.substr(1, 2))};
    if (marker != kStartOfScan) continue;
    has_scan = true;
    walker.SkipScan();
  }
  if (!size || !has_scan) throw Error(where, "corrupt JPEG: holds no image");
  RequirePlausibleSize(*size, 8, bytes.size(), where);
}

// --- PGM and PPM ---

bool IsSpace(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

// Takes blanks, comments to the end of their line and then a number off the front of `rest`.
int64_t TakeNumber(std::string_view& rest, const std::string& where) {
  while (!rest.empty() && (IsSpace(rest[0]) || rest[0] == '#'))
    rest.remove_prefix(rest[0] == '#' ? std::min(rest.find('\n'), rest.size() - 1) + 1 : 1);
  constexpr int64_t kTooLarge = 1 << 30;
  int64_t value = -1;
  for (; !rest.empty() && rest[0] >= '0' && rest[0] <= '9' && value < kTooLarge;
       rest.remove_prefix(1))
    value = std::max<int64_t>(value, 0) * 10 + (rest[0] - '0');
  if (value < 0 || value >= kTooLarge)
    throw Error(where, fmt::format("corrupt PGM or PPM: header ends in {}", Printable(rest)));
  return value;
}

void RequireCompletePnm(std::string_view bytes, const std::string& where) {
  std::string_view rest = bytes.substr(2);
  ImageSize size;
  size.width = TakeNumber(rest, where);
  size.height = TakeNumber(rest, where);
  const int64_t max_value = TakeNumber(rest, where);
  RequireSize(size, where);
  if (max_value < 1 || max_value > 65535)
    throw Error(where, fmt::format("corrupt PGM or PPM: largest value is {}", max_value));
  const int64_t bytes_per_pixel = int64_t{bytes[1] == '6' ? 3 : 1} * (max_value > 255 ? 2 : 1);
  const int64_t available = static_cast<int64_t>(rest.size()) - 1;  // one blank ends the header
  if (size.width > available / bytes_per_pixel / size.height)
    throw Error(where, fmt::format("truncated PGM or PPM: {} bytes for {}x{} pixels of {} bytes",
                                   available, size.width, size.height, bytes_per_pixel));
}

}  // namespace

void RequireCompleteImage(std::string_view bytes, const std::string& where) {
  if (bytes.empty()) throw Error(where, "file is empty");
  if (bytes.substr(0, kPngSignature.size()) == kPngSignature)
    return RequireCompletePng(bytes, where);
  if (bytes.substr(0, 3) == "\xFF\xD8\xFF") return RequireCompleteJpeg(bytes, where);
  const auto magic = bytes.substr(0, 2);
  if (magic == "P5" || magic == "P6") return RequireCompletePnm(bytes, where);
  throw Error(where, fmt::format("begins with {}: not a PNG, JPEG or binary PGM or PPM image",
                                 Printable(bytes.substr(0, 8))));
}

}  // namespace sgf
