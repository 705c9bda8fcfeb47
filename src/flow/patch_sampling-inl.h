// Sampling of whole patches, per instruction set (Highway's -inl.h convention).

#if defined(SGF_FLOW_PATCH_SAMPLING_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SGF_FLOW_PATCH_SAMPLING_INL_H_
#undef SGF_FLOW_PATCH_SAMPLING_INL_H_
#else
#define SGF_FLOW_PATCH_SAMPLING_INL_H_
#endif

#include <array>
#include <cmath>

#include <hwy/highway.h>

#include <sgf/flow/patch_template.h>

// All of what is called is compiled into the function, for its instruction set: the definitions of
// residuals and warps stand in ordinary headers, and loops over pixels that call them become SIMD
// code of this instruction set.
#undef SGF_FLATTEN
#define SGF_FLATTEN [[gnu::flatten]]

HWY_BEFORE_NAMESPACE();
namespace sgf::flow::internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The pixels of the images between which the pixels of a patch lie, and where.
struct Places {
  std::array<int32_t, alignment::kMaxPatternPixels> index;  // of the upper left one
  PixelRow fx, fy;
};

// Places beyond the border are moved to it: a pixel inside, so that they have neighbours.
SGF_FLATTEN inline void Place(const PaddedPattern& pattern, const PatchWarp& warp,
                              const LevelView& image, Places& places) {
  const Eigen::Matrix2f linear = warp.Linear();
  const float most_x = std::nextafter(float(image.cols - 2), 0.f);
  const float most_y = std::nextafter(float(image.rows - 2), 0.f);
  const int stride = static_cast<int>(image.stride), channels = image.channels;
#pragma GCC ivdep
  for (int k = 0; k < pattern.padded; ++k) {
    PatchWarp::Point point;
    warp.Place({pattern.x[k], pattern.y[k]}, linear, point);
    const float x = metrics::Min(metrics::Max(point.pixel.x(), 1.f), most_x);
    const float y = metrics::Min(metrics::Max(point.pixel.y(), 1.f), most_y);
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    places.fx[k] = x - static_cast<float>(ix);
    places.fy[k] = y - static_cast<float>(iy);
    places.index[size_t(k)] = iy * stride + ix * channels;
  }
}

// Bilinear interpolation, in the order of operations of ChannelImage.
template <class V>
HWY_INLINE V Interpolate(V a, V b, V c, V d, V fx, V fy) {
  const V top = hn::Add(a, hn::Mul(fx, hn::Sub(b, a)));
  const V bottom = hn::Add(c, hn::Mul(fx, hn::Sub(d, c)));
  return hn::Add(top, hn::Mul(fy, hn::Sub(bottom, top)));
}

using Four = hn::CappedTag<float, 4>;

// Neighbours p[index] and p[index + 1] of a vector of pixels. Loads of both at once and shuffles
// take a quarter of the time of gathers.
HWY_INLINE void LoadPairs(const float* p, const int32_t* index, hn::Vec<Four>& left,
                          hn::Vec<Four>& right) {
  const Four d;
#if HWY_TARGET == HWY_SCALAR
  left = hn::LoadU(d, p + index[0]);
  right = hn::LoadU(d, p + index[0] + 1);
#else
  const hn::Half<Four> half;
  const auto pair = [&](int k) HWY_ATTR { return hn::LoadU(half, p + index[k]); };
  const auto lower = hn::Combine(d, pair(1), pair(0)), upper = hn::Combine(d, pair(3), pair(2));
  left = hn::ConcatEven(d, upper, lower);
  right = hn::ConcatOdd(d, upper, lower);
#endif
}

// One channel: a vector of pixels at a time.
// @param shift floats from a pixel to the one sampled instead.
HWY_INLINE void SampleGrey(const LevelView& image, ptrdiff_t shift, const Places& places, int n,
                           std::array<PixelRow, 1>& out) {
  const Four d;
  const float* upper = image.pixels + shift;
  const float* lower = upper + image.stride;
  for (int k = 0; k < n; k += int(hn::Lanes(d))) {
    const int32_t* index = places.index.data() + k;
    hn::Vec<Four> a, b, c, e;
    LoadPairs(upper, index, a, b);
    LoadPairs(lower, index, c, e);
    hn::StoreU(Interpolate(a, b, c, e, hn::LoadU(d, &places.fx[k]), hn::LoadU(d, &places.fy[k])), d,
               &out[0][k]);
  }
}

// From four pixels' channels to four channels' pixels.
HWY_INLINE void Transpose(const float* pixels, int k, std::array<PixelRow, 4>& channels) {
#if HWY_TARGET == HWY_SCALAR
  for (int i = 0; i < 16; ++i) channels[size_t(i % 4)][k + i / 4] = pixels[i];
#else
  const hn::FixedTag<float, 4> d;
  hn::Vec<decltype(d)> c0, c1, c2, c3;
  hn::LoadInterleaved4(d, pixels, c0, c1, c2, c3);
  hn::StoreU(c0, d, &channels[0][k]);
  hn::StoreU(c1, d, &channels[1][k]);
  hn::StoreU(c2, d, &channels[2][k]);
  hn::StoreU(c3, d, &channels[3][k]);
#endif
}

// Four channels: a pixel at a time, and four of them are turned. Rows first: both pixels of a row
// lie side by side.
HWY_INLINE void SampleFour(const LevelView& image, ptrdiff_t shift, const Places& places, int n,
                           std::array<PixelRow, 4>& out) {
  const hn::CappedTag<float, 8> d;
  const Four half;
  constexpr int kPair = 8;
  for (int k = 0; k < n; k += 4) {
    alignas(32) float value[16], pair[kPair];
    for (int i = 0; i < 4; ++i) {
      const float* upper = image.pixels + shift + places.index[size_t(k + i)];
      const auto fy = hn::Set(d, places.fy[k + i]);
      const auto between = [&](int at) HWY_ATTR {
        const auto u = hn::LoadU(d, upper + at);
        return hn::Add(u, hn::Mul(fy, hn::Sub(hn::LoadU(d, upper + image.stride + at), u)));
      };
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
      static_cast<void>(pair);
      const auto both = between(0);
      const auto left = hn::LowerHalf(half, both), right = hn::UpperHalf(half, both);
      hn::StoreU(hn::Add(left, hn::Mul(hn::Set(half, places.fx[k + i]), hn::Sub(right, left))),
                 half, value + 4 * i);
#else
      for (int at = 0; at < kPair; at += int(hn::Lanes(d))) hn::StoreU(between(at), d, pair + at);
      for (int c = 0; c < 4; c += int(hn::Lanes(half))) {
        const auto left = hn::LoadU(half, pair + c), right = hn::LoadU(half, pair + 4 + c);
        hn::StoreU(hn::Add(left, hn::Mul(hn::Set(half, places.fx[k + i]), hn::Sub(right, left))),
                   half, value + 4 * i + c);
      }
#endif
    }
    Transpose(value, k, out);
  }
}

template <size_t N>
HWY_INLINE void SampleAt(const LevelView& image, ptrdiff_t shift, const Places& places, int n,
                         std::array<PixelRow, N>& out) {
  if constexpr (N == 1)
    SampleGrey(image, shift, places, n, out);
  else
    SampleFour(image, shift, places, n, out);
}

template <size_t N>
HWY_INLINE void Differences(const LevelView& image, ptrdiff_t step, const Places& places, int n,
                            std::array<PixelRow, N>& slope) {
  std::array<PixelRow, N> before;
  SampleAt(image, -step, places, n, before);
  SampleAt(image, step, places, n, slope);
  for (size_t c = 0; c < N; ++c)
    for (int k = 0; k < n; ++k) slope[c][k] = 0.5f * (slope[c][k] - before[c][k]);
}

template <int N>
void SamplePatch(const LevelView& image, const PaddedPattern& pattern, const PatchWarp& warp,
                 PatchValues<N>& out) {
  Places places;
  Place(pattern, warp, image, places);
  SampleAt(image, 0, places, pattern.padded, out.value);
}

// With derivatives: interpolated central differences. Those of the interpolation itself change
// from pixel to pixel, which is noise where but every second pixel is looked at.
template <int N>
void SamplePatch(const LevelView& image, const PaddedPattern& pattern, const PatchWarp& warp,
                 PatchSlopes<N>& out) {
  Places places;
  Place(pattern, warp, image, places);
  SampleAt(image, 0, places, pattern.padded, out.value);
  Differences(image, N, places, pattern.padded, out.d_x);
  Differences(image, ptrdiff_t(image.stride), places, pattern.padded, out.d_y);
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::flow::internal
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
