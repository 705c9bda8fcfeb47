#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include <sgf/core/error.h>
#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/io/pfm.h>

namespace sgf {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr double kPng16Scale = 256;

// By content, not by name. Anything else than "P" and one of "Ff" is left to the image reader, and
// so is the report of a missing file.
bool IsPfm(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 2> magic{};
  file.read(magic.data(), magic.size());
  return magic[0] == 'P' && (magic[1] == 'f' || magic[1] == 'F');
}

cv::Mat1f ReadDisparityPfm(const std::filesystem::path& path) {
  cv::Mat1f disparity = ReadPfm(path);
  for (float& d : disparity)
    if (!std::isfinite(d)) d = kNone;
  return disparity;
}

template <class T>
cv::Mat1f FromLevels(const cv::Mat_<T>& levels, double scale) {
  cv::Mat1f disparity(levels.size());
  std::transform(levels.begin(), levels.end(), disparity.begin(), [scale](T level) {
    return level == 0 ? kNone : static_cast<float>(level / scale);
  });
  return disparity;
}

uint16_t Png16Level(float disparity) {
  if (!std::isfinite(disparity)) return 0;
  return static_cast<uint16_t>(std::max(1L, std::lround(disparity * kPng16Scale)));
}

void RequirePng16Range(const std::filesystem::path& path, const cv::Mat1f& disparity) {
  for (int y = 0; y < disparity.rows; ++y)
    for (int x = 0; x < disparity.cols; ++x)
      if (const float d = disparity(y, x); std::isfinite(d) && (d < 0 || d > kMaxDisparityPng16))
        throw Error(path.string(), fmt::format("disparity {} at ({}, {}) is outside of [0, {:.3f}]",
                                               d, x, y, kMaxDisparityPng16));
}

}  // namespace

cv::Mat1f ReadDisparity(const std::filesystem::path& path, double scale) {
  if (!std::isfinite(scale) || scale <= 0)
    throw Error(path.string(), fmt::format("disparity scale is {}", scale));
  if (IsPfm(path)) return ReadDisparityPfm(path);
  const cv::Mat levels = ReadImage(path, cv::IMREAD_UNCHANGED);
  if (levels.type() == CV_8UC1) return FromLevels<uint8_t>(levels, scale);
  if (levels.type() == CV_16UC1) return FromLevels<uint16_t>(levels, kPng16Scale);
  throw Error(path.string(),
              fmt::format("a disparity map has one channel, this image has {}", levels.channels()));
}

void WriteDisparityPfm(const std::filesystem::path& path, const cv::Mat1f& disparity) {
  cv::Mat1f stored = disparity.clone();
  for (float& d : stored)
    if (!std::isfinite(d)) d = std::numeric_limits<float>::infinity();
  WritePfm(path, stored);
}

void WriteDisparityPng16(const std::filesystem::path& path, const cv::Mat1f& disparity) {
  RequirePng16Range(path, disparity);
  cv::Mat_<uint16_t> levels(disparity.size());
  std::transform(disparity.begin(), disparity.end(), levels.begin(), Png16Level);
  WritePng(path, levels);
}

}  // namespace sgf
