#pragma once

#include <span>
#include <utility>

#include <Eigen/Core>

namespace sgf::alignment {

/// Which pixels around a point make its patch.
enum class Pattern {
  kPoint,     ///< the pixel itself
  kDso8,      ///< 8 pixels, spread over 5 x 5 (DSO)
  kCross17,   ///< 17 pixels: a cross of 5 x 5 and a ring
  kSquare25,  ///< 5 x 5
  kBasalt52,  ///< 52 pixels of a disc, every second one, 16 px across (Basalt)
};
std::span<const std::pair<const char*, Pattern>> EnumNames(Pattern);

inline constexpr int kMaxPatternPixels = 64;

/// Offsets from the point, px.
std::span<const Eigen::Vector2f> Offsets(Pattern pattern);

}  // namespace sgf::alignment
