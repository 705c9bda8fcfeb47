// Costs as bytes, compiled once per instruction set by Highway.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/stereo/byte_scale.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <bit>

#include <hwy/highway.h>

#include <sgf/stereo/byte_scale.h>
#include <sgf/stereo/vector_tag-inl.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {

using DU16 = VectorTag<uint16_t>;

// Turns costs into bytes: cost * scale, rounded.
class ByteScaler {
 public:
  // scale = 2^shift * factor, with a factor of 16 bits.
  explicit ByteScaler(uint32_t scale_q16)
      : shift_(std::max(0, static_cast<int>(std::bit_width(scale_q16)) - 16)),
        factor_(static_cast<uint16_t>(scale_q16 >> shift_)),
        limit_(static_cast<uint16_t>(
            std::min(65535U >> shift_, (256U << 16) / std::max(1U, scale_q16)))) {}

  void operator()(const uint16_t* costs, size_t count, uint8_t* out) const {
    const size_t lanes = hn::Lanes(DU16());
    if (count < lanes) {
      for (size_t i = 0; i < count; ++i) out[i] = One(costs[i]);
      return;
    }
    for (size_t i = 0; i + lanes <= count; i += lanes) Vector(costs + i, out + i);
    Vector(costs + count - lanes, out + count - lanes);
  }

 private:
  HWY_INLINE void Vector(const uint16_t* costs, uint8_t* out) const {
    const DU16 d;
    const hn::RebindToSigned<DU16> di;
    const hn::Rebind<uint8_t, DU16> d8;
    const auto scale = hn::Set(d, factor_);
    const auto cost = hn::ShiftLeftSame(hn::Min(hn::LoadU(d, costs), hn::Set(d, limit_)), shift_);
    const auto rounding = hn::ShiftRight<15>(hn::Mul(cost, scale));
    const auto rounded = hn::Add(hn::MulHigh(cost, scale), rounding);
    hn::StoreU(hn::DemoteTo(d8, hn::BitCast(di, rounded)), d8, out);
  }

  uint8_t One(uint16_t cost) const {
    const uint32_t shifted = static_cast<uint32_t>(std::min(cost, limit_)) << shift_;
    return static_cast<uint8_t>(std::min((shifted * factor_ + (1U << 15)) >> 16, 255U));
  }

  int shift_;
  uint16_t factor_;
  uint16_t limit_;  // costs from here on become 255; shifted, it fits 16 bits
};

void ScaleRow(const uint16_t* costs, int width, int count, uint32_t scale_q16, int stride,
              uint8_t* out) {
  const ByteScaler scale(scale_q16);
  if (stride == count) {
    scale(costs, static_cast<size_t>(width) * count, out);
    return;
  }
  for (int x = 0; x < width; ++x, costs += count, out += stride) scale(costs, count, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sgf::stereo::internal {

HWY_EXPORT(ScaleRow);

void ScaleToBytes(const uint16_t* costs, int width, int count, uint32_t scale_q16, int stride,
                  uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(ScaleRow)(costs, width, count, scale_q16, stride, out);
}

}  // namespace sgf::stereo::internal
#endif  // HWY_ONCE
