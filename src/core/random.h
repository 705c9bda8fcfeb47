#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

/// Counter-based random numbers: the value is a function of a seed and an index alone, so it is the
/// same in whatever order, or by however many threads, the values are drawn. Streams that must not
/// depend on each other take seeds of their own: Hash64(seed, stream).
namespace sgf {

/// 64 random bits: value `index` of the SplitMix64 sequence (Steele, Lea and Flood, "Fast
/// splittable pseudorandom number generators", OOPSLA 2014) that starts at the hash of `seed`.
inline uint64_t Hash64(uint64_t seed, uint64_t index) {
  constexpr uint64_t kGamma = 0x9e3779b97f4a7c15;  // odd, 2^64 divided by the golden ratio
  const auto mix = [](uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  };
  return mix(mix(seed + kGamma) + (index + 1) * kGamma);
}

/// Uniform in the open interval (0, 1), in steps of 2^-52.
inline double Uniform01(uint64_t seed, uint64_t index) {
  return (static_cast<double>(Hash64(seed, index) >> 12) + 0.5) * 0x1p-52;
}

/// Standard normal, by the cosine half of the Box-Muller transform; at most 8.6 in magnitude.
inline double Gaussian(uint64_t seed, uint64_t index) {
  const double radius = std::sqrt(-2.0 * std::log(Uniform01(seed, 2 * index)));
  return radius * std::cos(2.0 * std::numbers::pi * Uniform01(seed, 2 * index + 1));
}

}  // namespace sgf
