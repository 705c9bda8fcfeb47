#include <algorithm>
#include <bit>
#include <cstring>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/synth/arithmetic.h>
#include <sgf/synth/texture.h>

namespace sgf::synth {
namespace {

using Eigen::Array4f;
using Plane = std::vector<Array4f>;

constexpr int kBlock = 4;
constexpr float kSteps = 65535;

// Level 0, bottom row first because v grows upwards.
Plane FirstLevel(const cv::Mat3f& albedo) {
  Plane level;
  level.reserve(albedo.total());
  for (int y = albedo.rows - 1; y >= 0; --y)
    for (int x = 0; x < albedo.cols; ++x) {
      const cv::Vec3f& texel = albedo(y, x);
      level.emplace_back(texel[0], texel[1], texel[2], 0.0f);
    }
  return level;
}

// The level of half the side: means of 2 x 2 texels.
Plane HalfLevel(const Plane& fine, int fine_size) {
  Plane level;
  level.reserve(fine.size() / 4);
  for (int y = 0; y < fine_size; y += 2)
    for (int x = 0; x < fine_size; x += 2) {
      const Array4f* texel = &fine[static_cast<size_t>(y) * fine_size + x];
      level.push_back(0.25f * ((texel[0] + texel[1]) + (texel[fine_size] + texel[fine_size + 1])));
    }
  return level;
}

// Four 16-bit numbers as floats, which GCC and Clang turn into two SSE2 instructions in this form.
Array4f ToFloat(const std::array<uint16_t, 4>& texel) {
  using Words = uint16_t __attribute__((vector_size(8)));
  using Floats = float __attribute__((vector_size(16)));
  const auto floats = __builtin_convertvector(std::bit_cast<Words>(texel), Floats);
  Array4f result;
  std::memcpy(result.data(), &floats, sizeof(floats));
  return result;
}

// log2 by the exponent and a straight line over each octave; off by 0.09 at most. x is positive.
float CoarseLog2(float x) {
  constexpr float kMantissaSteps = 1 << 23;
  return static_cast<float>(std::bit_cast<int32_t>(x)) / kMantissaSteps - 127.0f;
}

}  // namespace

Texture::Texture(const cv::Mat3f& albedo) : size_(albedo.cols) {
  if (albedo.rows != albedo.cols || !std::has_single_bit(static_cast<unsigned>(albedo.cols)))
    throw Error("texture", fmt::format("must be square with a power of two as its side, is {}x{}",
                                       albedo.cols, albedo.rows));
  Plane plane = FirstLevel(albedo);
  levels_.push_back(Pack(plane, size_));
  for (int size = size_; size > 1; size /= 2) {
    plane = HalfLevel(plane, size);
    levels_.push_back(Pack(plane, size / 2));
  }
  mean_ = plane.front();
}

// Inline in the two look-ups that need it: (x / 4, y / 4) names the block, the rest the texel in
// it.
inline const Texture::Texel& Texture::Level::At(int x, int y) const {
  if (size < kBlock) return texels[y * size + x];
  const int block = (y / kBlock) * (size / kBlock) + x / kBlock;
  return texels[(block * kBlock + y % kBlock) * kBlock + x % kBlock];
}

Texture::Level Texture::Pack(const Plane& plane, int size) {
  Level level{size, std::vector<Texel>(plane.size())};
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      const Array4f scaled = plane[static_cast<size_t>(y) * size + x].min(1).max(0) * kSteps + 0.5f;
      for (int k = 0; k < 4; ++k)
        const_cast<Texel&>(level.At(x, y))[k] = static_cast<uint16_t>(scaled[k]);
    }
  return level;
}

Eigen::Array4f Texture::Sample(float u, float v, float footprint) const {
  const float texels = footprint * static_cast<float>(size_);
  if (!(texels > 1)) return Bilinear(levels_[0], u, v);
  const float depth = std::min(CoarseLog2(texels), static_cast<float>(levels_.size() - 1));
  const int fine = static_cast<int>(depth);
  const float blend = depth - static_cast<float>(fine);
  const int coarse = std::min(fine + 1, static_cast<int>(levels_.size()) - 1);
  const Array4f near = Bilinear(levels_[fine], u, v);
  return near + blend * (Bilinear(levels_[coarse], u, v) - near);
}

Eigen::Array4f Texture::Bilinear(const Level& level, float u, float v) const {
  const auto size = static_cast<float>(level.size);
  const float x = u * size - 0.5f, y = v * size - 0.5f;
  const int floor_x = Floor(x), floor_y = Floor(y);
  const float fx = x - static_cast<float>(floor_x), fy = y - static_cast<float>(floor_y);
  // The side is a power of two, so that its last bits alone say where in the repeating image we
  // are.
  const int mask = level.size - 1;
  const int x0 = floor_x & mask, x1 = (floor_x + 1) & mask;
  const int y0 = floor_y & mask, y1 = (floor_y + 1) & mask;
  const Array4f a = ToFloat(level.At(x0, y0)), b = ToFloat(level.At(x1, y0));
  const Array4f c = ToFloat(level.At(x0, y1)), d = ToFloat(level.At(x1, y1));
  const Array4f below = a + fx * (b - a);
  const Array4f above = c + fx * (d - c);
  return (below + fy * (above - below)) * (1 / kSteps);
}

}  // namespace sgf::synth
