#pragma once

#include <numbers>

/// Small arithmetic that textures, solids and scenes share.
namespace sgf::synth {

inline constexpr float kPi = std::numbers::pi_v<float>;

inline float Radians(float degrees) { return degrees * kPi / 180; }

/// Largest whole number not above x. Faster than std::floor, a function call without SSE4.1.
inline int Floor(float x) {
  const int i = static_cast<int>(x);
  return i - (x < static_cast<float>(i));
}

}  // namespace sgf::synth
