#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace sgf {

/// A textured image, the same on every run.
inline cv::Mat RandomImage(int rows, int cols, int type) {
  cv::Mat image(rows, cols, type);
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, image.depth() == CV_16U ? 65536 : 256);
  return image;
}

/// The bytes of an image file of the format that an extension (".png") names.
inline std::string Encode(const std::string& extension, const cv::Mat& image) {
  std::vector<uchar> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

/// CRC-32 of the PNG specification, bit by bit.
inline uint32_t BitwiseCrc32(const std::string& bytes) {
  uint32_t crc = 0xFFFFFFFFU;
  for (const char c : bytes)
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc >> 1) ^ (((crc ^ (static_cast<uint8_t>(c) >> bit)) & 1U) * 0xEDB88320U);
  return ~crc;
}

inline std::string BigEndianBytes(uint32_t value) {
  return {static_cast<char>(value >> 24), static_cast<char>(value >> 16),
          static_cast<char>(value >> 8), static_cast<char>(value)};
}

/// A chunk of a PNG file with its correct checksum.
inline std::string PngChunkBytes(const std::string& type, const std::string& data) {
  return BigEndianBytes(static_cast<uint32_t>(data.size())) + type + data +
         BigEndianBytes(BitwiseCrc32(type + data));
}

/// Replaces the IHDR chunk of a PNG file.
inline std::string WithPngHeader(std::string png, uint32_t width, uint32_t height, int bit_depth,
                                 int colour_type) {
  const std::string data = BigEndianBytes(width) + BigEndianBytes(height) +
                           static_cast<char>(bit_depth) + static_cast<char>(colour_type) +
                           std::string(3, '\0');
  return png.replace(8, 25, PngChunkBytes("IHDR", data));
}

/// Sets the checksums of all chunks right, as far as the chunk lengths can be followed.
inline std::string WithRightPngChecksums(std::string png) {
  for (size_t begin = 8; begin + 12 <= png.size();) {
    uint32_t length = 0;
    for (int i = 0; i < 4; ++i) length = length << 8 | static_cast<uint8_t>(png[begin + i]);
    if (length > png.size() - begin - 12) break;
    png.replace(begin + 8 + length, 4,
                BigEndianBytes(BitwiseCrc32(png.substr(begin + 4, length + 4))));
    begin += length + 12;
  }
  return png;
}

}  // namespace sgf
