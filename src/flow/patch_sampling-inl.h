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

// Rows of two pixels' two channels each, interpolated between the rows: a pixel's left neighbour,
// then its right one.
HWY_INLINE hn::Vec<Four> BetweenRows(const float* upper, size_t stride, float fy) {
  const Four d;
  const auto u = hn::LoadU(d, upper), l = hn::LoadU(d, upper + stride);
  return hn::Add(u, hn::Mul(hn::Set(d, fy), hn::Sub(l, u)));
}

// Two channels, four pixels at a time. Rows first: both pixels of a row lie side by side.
HWY_INLINE void SampleTwo(const LevelView& image, ptrdiff_t shift, const Places& places, int n,
                          std::array<PixelRow, 2>& out) {
#if HWY_TARGET == HWY_SCALAR
  for (int k = 0; k < n; ++k) {
    const float* upper = image.pixels + shift + places.index[size_t(k)];
    const float* lower = upper + image.stride;
    for (size_t c = 0; c < 2; ++c) {
      const float left = upper[c] + places.fy[k] * (lower[c] - upper[c]);
      const float right = upper[c + 2] + places.fy[k] * (lower[c + 2] - upper[c + 2]);
      out[c][k] = left + places.fx[k] * (right - left);
    }
  }
#else
  const Four d;
  const hn::RepartitionToWide<Four> pair;  // both channels of a pixel
  const auto channels = [&](auto v) HWY_ATTR { return hn::BitCast(d, v); };
  const auto pixels = [&](auto v) HWY_ATTR { return hn::BitCast(pair, v); };
  for (int k = 0; k < n; k += 4) {
    const auto row = [&](int i) HWY_ATTR {
      return pixels(BetweenRows(image.pixels + shift + places.index[size_t(k + i)], image.stride,
                                places.fy[k + i]));
    };
    const auto fx = hn::LoadU(d, &places.fx[k]);
    const auto between = [&](auto a, auto b, auto f) HWY_ATTR {
      const auto left = channels(hn::InterleaveLower(pair, a, b));
      const auto right = channels(hn::InterleaveUpper(pair, a, b));
      return hn::Add(left, hn::Mul(f, hn::Sub(right, left)));
    };
    const auto first = between(row(0), row(1), hn::InterleaveLower(d, fx, fx));
    const auto second = between(row(2), row(3), hn::InterleaveUpper(d, fx, fx));
    hn::StoreU(hn::ConcatEven(d, second, first), d, &out[0][k]);
    hn::StoreU(hn::ConcatOdd(d, second, first), d, &out[1][k]);
  }
#endif
}

template <size_t N>
HWY_INLINE void SampleAt(const LevelView& image, ptrdiff_t shift, const Places& places, int n,
                         std::array<PixelRow, N>& out) {
  if constexpr (N == 1)
    SampleGrey(image, shift, places, n, out);
  else
    SampleTwo(image, shift, places, n, out);
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
  if constexpr (N == 2) out.epsilon = image.EpsilonAt(warp.centre);
  SampleAt(image, 0, places, pattern.padded, out.value);
}

// With derivatives: interpolated central differences. Those of the interpolation itself change
// from pixel to pixel, which is noise where but every second pixel is looked at.
template <int N>
void SamplePatch(const LevelView& image, const PaddedPattern& pattern, const PatchWarp& warp,
                 PatchSlopes<N>& out) {
  Places places;
  Place(pattern, warp, image, places);
  if constexpr (N == 2) out.epsilon = image.EpsilonAt(warp.centre);
  SampleAt(image, 0, places, pattern.padded, out.value);
  Differences(image, N, places, pattern.padded, out.d_x);
  Differences(image, ptrdiff_t(image.stride), places, pattern.padded, out.d_y);
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::flow::internal
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
