#pragma once

// Internal to sgf::stereo.

#include <cstdint>

namespace sgf::stereo::internal {

/// Turns the costs of `width` pixels, `count` each, into bytes, `stride` a pixel:
/// min(255, (cost * scale + 2^15) >> 16), where scale is scale_q16 cut to 16 significant bits.
void ScaleToBytes(const uint16_t* costs, int width, int count, uint32_t scale_q16, int stride,
                  uint8_t* out);

}  // namespace sgf::stereo::internal
