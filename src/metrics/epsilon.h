#pragma once

#include <span>
#include <utility>

#include <opencv2/core.hpp>

#include <sgf/core/gradient.h>

namespace sgf::metrics {

/// Over what the mean squared gradient magnitude is taken.
enum class EpsilonScope {
  kImage,   ///< the whole image: the paper's eq. 6
  kTile,    ///< tiles, interpolated bilinearly between their centres
  kWindow,  ///< a square window around every pixel
};

/// Names of the scopes in options files.
std::span<const std::pair<const char*, EpsilonScope>> EnumNames(EpsilonScope);

/// How the regulariser epsilon of the normalised gradient (eq. 7) is found. One number per image
/// (the paper) makes the dissimilarities invariant to a gain of the whole image; tiles and windows
/// make them nearly so to a gain that varies over the image.
struct EpsilonOptions {
  EpsilonScope scope = EpsilonScope::kImage;
  int tile_px = 64;
  int window_px = 31;
  double noise_floor = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("scope", scope, "", "where the mean squared gradient is taken: image, tile or window");
    visit("tile_px", tile_px, "px", "side of the tiles, adjusted to divide the image evenly");
    visit("window_px", window_px, "px", "side of the square window, odd");
    visit("noise_floor", noise_floor, "(grey levels/px)^2", "added: c times the noise variance");
  }
};

/// @throws Error for options that make no sense.
void CheckOptions(const EpsilonOptions& options);

/// Epsilon of every pixel, (grey levels/px)^2, of the size of the gradient and never negative. It
/// is 0 only where the scope is entirely flat and there is no noise floor.
///
/// image: one value. tile: the image is divided into round(size / tile_px) equal tiles per axis, at
/// least one; pixels beyond the outermost centres take the outermost values. window: the border is
/// replicated, so windows may exceed the image.
/// @throws Error for an empty gradient, planes of different sizes, or options that make no sense.
cv::Mat1f ComputeEpsilon(const GradientImage& gradient, const EpsilonOptions& options);

}  // namespace sgf::metrics
