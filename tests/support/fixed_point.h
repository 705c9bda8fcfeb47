#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <sgf/metrics/normalized_metrics.h>
#include <sgf/metrics/sample.h>

/// sgf in 16-bit fixed point: the scalar definition that the SIMD kernels (src/stereo/sgf_rows-inl.h)
/// reproduce bit for bit, and how far it is from the exact one.
namespace sgf::metrics {

/// 16-bit number with 15 fractional bits, with the arithmetic of the SIMD instruction sets.
struct Q15 {
  int16_t v;
};

/// Product rounded to nearest, halves up: (2ab + 2^15) >> 16 as x86's pmulhrsw computes it.
inline Q15 operator*(Q15 a, Q15 b) {
  return {static_cast<int16_t>((int32_t{a.v} * b.v + (1 << 14)) >> 15)};
}

/// Saturating sum.
inline Q15 operator+(Q15 a, Q15 b) {
  return {static_cast<int16_t>(std::clamp(int32_t{a.v} + b.v, -32768, 32767))};
}

inline bool operator<(Q15 a, Q15 b) { return a.v < b.v; }

/// What sgf needs of a pixel, quantised by QuantizeSample.
struct FixedSample {
  Q15 ax, ay;  ///< normalised gradient, 1 = 32767
  Q15 r;       ///< scale / max(||a||^2, tau), an integer of at most 32767
};

/// Quantises a sample: a to round(32767 a), r to round(min(32767, scale * r)); computed in float,
/// rounded to nearest even, saturated to 16 bits.
/// @param scale cost of two perpendicular gradients, in 1..127.
inline FixedSample QuantizeSample(const Sample<float>& sample, int scale) {
  constexpr float kOne = 32767.0F;
  const auto quantize = [](float x) {
    return Q15{static_cast<int16_t>(std::clamp(std::lrint(x), -32768L, 32767L))};
  };
  return {quantize(kOne * sample.ax), quantize(kOne * sample.ay),
          quantize(std::min(kOne, static_cast<float>(scale) * sample.r))};
}

/// scale * sgf (eq. 10) as an integer in [0, 2 * scale + 1], with tau raised to
/// tau_s = max(tau, scale / 32767) because r is at most 32767.
///
/// Differs from scale * sgf in double with tau_s by less than 1.5 + 2 sqrt(scale / 32767), so by
/// less than 1.63 for every scale in 1..127. Derivation, with d = a.b, m = min(r_i, r_j),
/// q = max(||a||, ||b||) <= 1 and quantised D = 32768 d + E, M = scale * m + F:
/// - |F| <= 1/2, since rounding commutes with min, and min(32767, scale * r) is exact at tau_s.
/// - Rounding a component errs by 1/2 (and by some 0.01 in float), which a product carries to at
///   most (||a||_1 + ||b||_1) / 2 <= sqrt(2) q; the two products round by 1/2 each; 1 standing for
///   32767 / 32768 costs 2 |d|. So |E| <= 1 + sqrt(2) q + 2 q^2.
/// - The result D M / 32768 rounds by 1/2 and differs from scale * d * m by d F + E M / 32768,
/// where
///   |d| <= q^2 and M <= min(32767, scale / q^2 + 1/2).
/// The sum 1/2 + q^2 / 2 + (1 + sqrt(2) q + 2 q^2) M / 32768 is largest where M just reaches 32767,
/// at q^2 = scale / 32767: 1.5 + sqrt(2) q + 2.5 q^2.
inline int FixedSgfCost(const FixedSample& i, const FixedSample& j, int scale) {
  return std::max(0, scale - SgfSimilarity(i, j).v);
}

}  // namespace sgf::metrics
