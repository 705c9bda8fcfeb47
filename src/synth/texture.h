#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace sgf::synth {

/// A procedural texture's name and what it looks like.
struct TextureInfo {
  std::string_view name;
  std::string_view text;
  bool tiles;  ///< repeats without a seam; otherwise it is a picture for one patch
};

/// Every procedural texture.
std::span<const TextureInfo> AllTextures();

/// Linear albedo (RGB in [0, 1]) of a procedural texture, size_px x size_px.
/// @param seed other stones, other pictures: the same seed gives the same bits.
/// @throws Error listing the known names.
cv::Mat3f MakeTexture(std::string_view name, int size_px, uint32_t seed);

/// An albedo image for trilinear look-ups: repeats in both directions.
class Texture {
 public:
  /// @param albedo linear RGB; square, with a power of two as its side.
  /// @throws Error for another shape.
  explicit Texture(const cv::Mat3f& albedo);

  /// Filtered albedo (RGB and an unused fourth component) at (u, v), in units of whole images:
  /// (0, 0) is the lower left corner of the image, u grows to the right, v upwards.
  /// @param footprint side of the filtered square in units of whole images.
  Eigen::Array4f Sample(float u, float v, float footprint) const;

  /// Mean albedo.
  const Eigen::Array4f& mean() const { return mean_; }

 private:
  // RGB in steps of 1/65535 and an unused fourth component.
  using Texel = std::array<uint16_t, 4>;
  // A mip level, v upwards. Look-ups are bound by memory, so texels are half the size of floats and
  // lie in square blocks, in which neighbours along both axes are mostly in one cache line.
  struct Level {
    int size = 0;
    std::vector<Texel> texels;

    const Texel& At(int x, int y) const;
  };

  static Level Pack(const std::vector<Eigen::Array4f>& texels, int size);
  Eigen::Array4f Bilinear(const Level& level, float u, float v) const;

  int size_;
  Eigen::Array4f mean_;
  std::vector<Level> levels_;  // of side size_ >> index
};

}  // namespace sgf::synth
