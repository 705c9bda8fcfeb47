// Tracking of patches, compiled once per instruction set by Highway.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/flow/patch_tracker.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>

#include <Eigen/LU>
#include <hwy/highway.h>

#include <sgf/alignment/residual.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/alignment/solver.h>
#include <sgf/flow/patch_tracker.h>

// All of what is called is compiled into the function, for its instruction set: the definitions of
// residuals and warps stand in ordinary headers, and loops over pixels that call them become SIMD
// code of this instruction set.
#define SGF_FLATTEN [[gnu::flatten]]

#ifndef SGF_FLOW_PATCH_TRACKER_TYPES_
#define SGF_FLOW_PATCH_TRACKER_TYPES_
namespace sgf::flow::internal {

/// Sums are taken in as many parts on every instruction set.
inline constexpr int kLanes = 8;

/// A number for each pixel of a patch.
struct PixelRow {
  std::array<float, alignment::kMaxPatternPixels> v;
  float& operator[](int k) { return v[static_cast<size_t>(k)]; }
  const float& operator[](int k) const { return v[static_cast<size_t>(k)]; }
};

/// A pattern, filled up to a multiple of kLanes by pixels that do not count.
struct PaddedPattern {
  PixelRow x{}, y{};  ///< offsets, px
  PixelRow mask{};    ///< 1 for the pattern's pixels, 0 for others
  int size = 0, padded = 0;
  float radius = 0;  ///< px

  explicit PaddedPattern(alignment::Pattern pattern) {
    for (const Eigen::Vector2f& offset : alignment::Offsets(pattern)) {
      x[size] = offset.x();
      y[size] = offset.y();
      mask[size++] = 1;
      radius = std::max(radius, offset.norm());
    }
    padded = (size + kLanes - 1) / kLanes * kLanes;
  }
};

/// Dissimilarities that patches can be followed by. Magnitudes (sad, agm, pm) have no curvature and
/// ngf no minimum at equality.
using TrackableMetrics =
    std::tuple<metrics::Photo, metrics::Gm, metrics::Gn, metrics::Ugf, metrics::Sgf, metrics::Sgf2,
               metrics::Sgf3, metrics::Ngv, metrics::Sgv, metrics::Sgf3Vec>;

template <class Residual, class... Metrics>
constexpr bool IsOf(std::tuple<Metrics...>*) {
  return (std::is_same_v<Residual, alignment::PointResidual<Metrics>> || ...);
}

template <class Residual>
inline constexpr bool kTrackable = std::is_same_v<Residual, alignment::LssdResidual> ||
                                   IsOf<Residual>(static_cast<TrackableMetrics*>(nullptr));

/// Whether a residual looks at intensities alone, so that no gradients have to be made.
template <class Residual>
inline constexpr bool kIntensityAlone =
    !alignment::kPointwise<Residual> ||
    std::is_same_v<Residual, alignment::PointResidual<metrics::Photo>>;

/// Channels of a level: intensity alone, or all of SampleChannels.
template <class Residual>
inline constexpr int kChannelsOf =
    kIntensityAlone<Residual> ? 1 : alignment::SampleChannels::kChannels;

/// A level of a pyramid, interleaved channels.
struct LevelView {
  const float* pixels;
  int cols, rows;
  size_t stride;  ///< floats from row to row

  bool Has(const Eigen::Vector2f& p, float margin) const {
    return p.x() >= margin && p.y() >= margin && p.x() <= float(cols - 1) - margin &&
           p.y() <= float(rows - 1) - margin;
  }
};

template <class Residual>
LevelView ViewOf(const Pyramid& pyramid, int level) {
  if constexpr (kIntensityAlone<Residual>) {
    const cv::Mat1f& grey = pyramid.grey[static_cast<size_t>(level)];
    return {grey[0], grey.cols, grey.rows, grey.step1()};
  } else {
    const auto& samples = pyramid.samples[static_cast<size_t>(level)];
    return {samples.At(0, 0), samples.cols(), samples.rows(), size_t(samples.cols()) * 4};
  }
}

/// Channels at the pixels of a patch.
template <int N>
struct PatchValues {
  std::array<PixelRow, N> value;

  SGF_ALWAYS_INLINE Eigen::Array4f At(int k) const {
    Eigen::Array4f channels = Eigen::Array4f::Zero();
    for (int c = 0; c < N; ++c) channels[c] = value[size_t(c)][k];
    return channels;
  }
};

/// And their derivatives by the place.
template <int N>
struct PatchSlopes : PatchValues<N> {
  std::array<PixelRow, N> d_x, d_y;

  SGF_ALWAYS_INLINE alignment::ChannelsAt<float, 4> WithSlopes(int k) const {
    alignment::ChannelsAt<float, 4> at{this->At(k), Eigen::Array4f::Zero(), Eigen::Array4f::Zero()};
    for (int c = 0; c < N; ++c) {
      at.d_x[c] = d_x[size_t(c)][k];
      at.d_y[c] = d_y[size_t(c)][k];
    }
    return at;
  }
};

/// Samples of the reference's pixels: as many of their members as the residual looks at.
template <bool kIntensity>
struct PatchReference {
  std::array<PixelRow, kIntensity ? 1 : 8> member;

  SGF_ALWAYS_INLINE metrics::Sample<float> At(int k) const {
    if constexpr (kIntensity)
      return {member[0][k], 0, 0, 0, 0, 0, 0, 0};
    else
      return {member[0][k], member[1][k], member[2][k], member[3][k],
              member[4][k], member[5][k], member[6][k], member[7][k]};
  }
  SGF_ALWAYS_INLINE void Set(int k, const metrics::Sample<float>& s) {
    member[0][k] = s.intensity;
    if constexpr (!kIntensity) {
      const float others[] = {s.gx, s.gy, s.norm, s.reg_norm, s.ax, s.ay, s.r};
      for (size_t m = 0; m < 7; ++m) member[m + 1][k] = others[m];
    }
  }
};

/// A patch at one level.
template <class Residual>
struct LevelTemplate {
  static constexpr bool kInverse = Residual::kInverseCompositional;
  bool usable;
  float divisor;  ///< of lssd
  PatchReference<kIntensityAlone<Residual>> reference;
  /// How the channels change with the place, for residuals that are linearised at the current
  /// image: at the minimum it shows the same, and five patches would have to be sampled there.
  std::array<std::array<PixelRow, kInverse ? 0 : kChannelsOf<Residual>>, 2> slopes;
  /// H^-1 J^T, whose product with the residuals is the step.
  std::array<std::array<PixelRow, kInverse ? PatchWarp::kParameters : 0>, Residual::kDim> gain;
};

template <class Residual>
struct TemplateOf : PatchTemplate {
  explicit TemplateOf(int levels)
      : level(std::make_unique_for_overwrite<LevelTemplate<Residual>[]>(size_t(levels))) {}
  std::unique_ptr<LevelTemplate<Residual>[]> level;
};

}  // namespace sgf::flow::internal
#endif  // SGF_FLOW_PATCH_TRACKER_TYPES_

HWY_BEFORE_NAMESPACE();
namespace sgf::flow::internal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Eigen::Matrix2f, Eigen::Vector2f, Eigen::Vector3f;

constexpr int kParameters = PatchWarp::kParameters;

// The pixels of the images between which the pixels of a patch lie, and where.
struct Places {
  std::array<int32_t, alignment::kMaxPatternPixels> index;  // of the upper left one
  PixelRow fx, fy;
};

// Places beyond the border are moved to it: a pixel inside, so that they have neighbours.
SGF_FLATTEN inline void Place(const PaddedPattern& pattern, const PatchWarp& warp,
                              const LevelView& image, Places& places) {
  const Matrix2f linear = warp.Linear();
  const float most_x = std::nextafter(float(image.cols - 2), 0.f);
  const float most_y = std::nextafter(float(image.rows - 2), 0.f);
  const int stride = static_cast<int>(image.stride);
  const int channels = stride / image.cols > 1 ? 4 : 1;
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

// Sum of products over a patch's pixels, in kLanes parts.
SGF_ALWAYS_INLINE float Dot(const PixelRow& a, const PixelRow& b, int n) {
  float parts[kLanes] = {};
  for (int k = 0; k < n; k += kLanes)
    for (int lane = 0; lane < kLanes; ++lane) parts[lane] += a[k + lane] * b[k + lane];
  return ((parts[0] + parts[1]) + (parts[2] + parts[3])) +
         ((parts[4] + parts[5]) + (parts[6] + parts[7]));
}

template <class Residual>
using Residuals = std::array<PixelRow, Residual::kDim>;
template <class Residual>
using Jacobians = std::array<std::array<PixelRow, kParameters>, Residual::kDim>;

// Residuals of a patch's pixels.
template <class Residual, class Values>
SGF_FLATTEN inline void Evaluate(const Residual& residual, const Values& at, const Matrix2f& linear,
                                 const LevelTemplate<Residual>& level, const PaddedPattern& pattern,
                                 Residuals<Residual>& r) {
  const Matrix2f A = linear;
  if constexpr (alignment::kPointwise<Residual>) {
#pragma GCC ivdep
    for (int k = 0; k < pattern.padded; ++k) {
      const auto value = residual.template Value<float>(at.At(k), A, level.reference.At(k));
      for (int c = 0; c < Residual::kDim; ++c) r[size_t(c)][k] = value(c);
    }
  } else {
    const float divisor = metrics::Lssd::Divisor(Dot(at.value[0], pattern.mask, pattern.padded),
                                                 size_t(pattern.size));
    for (int k = 0; k < pattern.padded; ++k)
      r[0][k] = metrics::Lssd::Component(at.value[0][k], divisor, level.reference.member[0][k],
                                         level.divisor);
  }
}

// The samples of a reference.
template <class Residual, class Slopes>
SGF_FLATTEN inline void MakeReference(const Slopes& at, int n,
                                      PatchReference<kIntensityAlone<Residual>>& reference) {
#pragma GCC ivdep
  for (int k = 0; k < n; ++k)
    reference.Set(k, Residual::template MakeReference<float>(at.WithSlopes(k)));
}

// Slopes of a reference's gradients, H, as an image turned by A shows them: A H A^T.
template <class Reference>
SGF_FLATTEN inline void Turn(const Reference& slopes, const Matrix2f& linear, int n,
                             PatchSlopes<4>& at) {
  using alignment::kGradientX, alignment::kGradientY;
  const float c = linear(0, 0), s = linear(1, 0);
#pragma GCC ivdep
  for (int k = 0; k < n; ++k) {
    const float xx = slopes[0][kGradientX][k], xy = slopes[1][kGradientX][k];
    const float yx = slopes[0][kGradientY][k], yy = slopes[1][kGradientY][k];
    const float xx_a = c * xx - s * yx, xy_a = c * xy - s * yy;
    const float yx_a = s * xx + c * yx, yy_a = s * xy + c * yy;
    at.d_x[kGradientX][k] = xx_a * c - xy_a * s;
    at.d_y[kGradientX][k] = xx_a * s + xy_a * c;
    at.d_x[kGradientY][k] = yx_a * c - yy_a * s;
    at.d_y[kGradientY][k] = yx_a * s + yy_a * c;
    at.d_x[0][k] = at.value[kGradientX][k];
    at.d_y[0][k] = at.value[kGradientY][k];
    at.d_x[3][k] = at.d_y[3][k] = 0;  // epsilon counts as constant
  }
}

// Residuals and their derivatives by the warp's parameters.
template <class Residual, class Slopes>
SGF_FLATTEN inline void Linearize(const Residual& residual, const Slopes& at, const PatchWarp& warp,
                                  const PatchReference<kIntensityAlone<Residual>>& reference,
                                  const PaddedPattern& pattern, Residuals<Residual>& r,
                                  Jacobians<Residual>& J) {
  const Matrix2f linear = warp.Linear();
#pragma GCC ivdep
  for (int k = 0; k < pattern.padded; ++k) {
    PatchWarp::Point point;
    warp.Place({pattern.x[k], pattern.y[k]}, linear, point);
    Eigen::Matrix<float, Residual::kDim, kParameters> J_k;
    const auto value = residual.Linearize(at.WithSlopes(k), point, reference.At(k), J_k);
    for (int c = 0; c < Residual::kDim; ++c) {
      r[size_t(c)][k] = value(c) * pattern.mask[k];
      for (int p = 0; p < kParameters; ++p)
        J[size_t(c)][size_t(p)][k] = J_k(c, p) * pattern.mask[k];
    }
  }
}

// The same for lssd, at the reference itself.
template <class Slopes>
SGF_FLATTEN inline void LinearizeLssd(const Slopes& at, const PatchWarp& warp, float divisor,
                                      bool divided, const PaddedPattern& pattern,
                                      std::array<PixelRow, kParameters>& J) {
  const Matrix2f linear = warp.Linear();
#pragma GCC ivdep
  for (int k = 0; k < pattern.padded; ++k) {
    PatchWarp::Point point;
    warp.Place({pattern.x[k], pattern.y[k]}, linear, point);
    const Vector3f d_i = point.Along({at.d_x[0][k], at.d_y[0][k]});
    for (int p = 0; p < kParameters; ++p) J[size_t(p)][k] = d_i(p);
  }
  for (PixelRow& row : J) {
    const float d_mean =
        divided ? Dot(row, pattern.mask, pattern.padded) / float(pattern.size) : 0.f;
    for (int k = 0; k < pattern.padded; ++k)
      row[k] = pattern.mask[k] * metrics::Lssd::Derivative(at.value[0][k], divisor, row[k], d_mean);
  }
}

inline Vector2f ToLevel(const Vector2f& p, int level) {
  return {float(alignment::ToLevel(p.x(), level)), float(alignment::ToLevel(p.y(), level))};
}
inline Vector2f FromLevel(const Vector2f& p, int level) {
  return {float(alignment::FromLevel(p.x(), level)), float(alignment::FromLevel(p.y(), level))};
}

template <class Residual>
Eigen::Matrix3d HessianOf(const Jacobians<Residual>& J, int n) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  for (const auto& component : J)
    for (int p = 0; p < kParameters; ++p)
      for (int q = 0; q <= p; ++q)
        H(p, q) += double(Dot(component[size_t(p)], component[size_t(q)], n));
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  return H;
}

// Whether all parameters can be told from one another.
inline bool Observable(const Eigen::Matrix3d& H) {
  // The determinant is 1 for independent parameters of unit curvature, 0 for dependent ones.
  constexpr double kLeast = 1e-6;
  return H.determinant() > kLeast * H.diagonal().prod();
}

template <class Residual>
class TrackerOf final : public PatchTracker {
  static constexpr int N = kChannelsOf<Residual>;
  using Level = LevelTemplate<Residual>;

 public:
  explicit TrackerOf(const TrackerOptions& options)
      : options_(options), pattern_(options.pattern) {}

  void MakePyramid(const cv::Mat& grey, Pyramid& pyramid) const override {
    alignment::GreyPyramid(grey, options_.levels, pyramid.grey);
    if constexpr (!kIntensityAlone<Residual>) {
      pyramid.samples.resize(pyramid.grey.size());
      for (size_t level = 0; level < pyramid.grey.size(); ++level)
        alignment::MakeSampleChannels(pyramid.grey[level], {}, pyramid.samples[level]);
    }
  }

  std::unique_ptr<PatchTemplate> NewTemplate() const override {
    return std::make_unique<TemplateOf<Residual>>(options_.levels);
  }

  bool MakeTemplate(const Pyramid& image, const Vector2f& centre, int used,
                    PatchTemplate& patch) const override {
    auto& levels = static_cast<TemplateOf<Residual>&>(patch).level;
    for (int level = 0; level < used; ++level) {
      const LevelView view = ViewOf<Residual>(image, level);
      PatchWarp warp;
      warp.centre = ToLevel(centre, level);
      levels[size_t(level)].usable =
          view.Has(warp.centre, Margin(level)) && MakeLevel(view, warp, levels[size_t(level)]);
    }
    return levels[0].usable;
  }

  Vector2f Likeliest(const PatchTemplate& patch, const Pyramid& image,
                     std::span<const Vector2f> places) const override {
    const auto& templates = static_cast<const TemplateOf<Residual>&>(patch).level;
    int level = options_.levels - 1;
    while (level > 0 && !templates[size_t(level)].usable) --level;
    const LevelView view = ViewOf<Residual>(image, level);
    Vector2f best = places.front();
    float least = INFINITY;
    for (const Vector2f& place : places) {
      PatchWarp warp;
      warp.centre = ToLevel(place, level);
      if (!view.Has(warp.centre, Margin(level))) continue;
      const float cost = CostAt(templates[size_t(level)], view, warp);
      if (!(cost < least)) continue;
      least = cost;
      best = place;
    }
    return best;
  }

  bool Track(const PatchTemplate& patch, const Pyramid& image, int levels,
             PatchWarp& warp) const override {
    const auto& templates = static_cast<const TemplateOf<Residual>&>(patch).level;
    for (int level = std::min(levels, options_.levels) - 1; level >= 0; --level) {
      const Level& reference = templates[size_t(level)];
      PatchWarp at = warp;
      at.centre = ToLevel(at.centre, level);
      if (!reference.usable || !TrackLevel(reference, ViewOf<Residual>(image, level), level, at)) {
        if (level == 0) return false;
        continue;  // the next finer one starts where this one did
      }
      at.centre = FromLevel(at.centre, level);
      warp = at;
    }
    return true;
  }

 private:
  // At the finest level the patch is whole in view, at others its centre.
  float Margin(int level) const { return level == 0 ? pattern_.radius + 1 : 1; }

  bool MakeLevel(const LevelView& view, const PatchWarp& warp, Level& level) const {
    PatchSlopes<N> at;
    SamplePatch(view, pattern_, warp, at);
    MakeReference<Residual>(at, pattern_.padded, level.reference);
    if constexpr (!Residual::kInverseCompositional) {
      level.slopes = {at.d_x, at.d_y};
      // A cost has no slope here. The gradients' own shows whether there is anything to follow.
      using Gradients = alignment::PointResidual<metrics::Gn>;
      Residuals<Gradients> r;
      Jacobians<Gradients> J;
      Linearize(Gradients{}, at, warp, level.reference, pattern_, r, J);
      return Observable(HessianOf<Gradients>(J, pattern_.padded));
    } else {
      Jacobians<Residual> J;
      LinearizeReference(at, warp, level, J);
      return MakeGain(J, level);
    }
  }

  void LinearizeReference(const PatchSlopes<N>& at, const PatchWarp& warp, Level& level,
                          Jacobians<Residual>& J) const {
    if constexpr (alignment::kPointwise<Residual>) {
      Residuals<Residual> r;
      Linearize(residual_, at, warp, level.reference, pattern_, r, J);
    } else {
      const float sum = Dot(at.value[0], pattern_.mask, pattern_.padded);
      level.divisor = metrics::Lssd::Divisor(sum, size_t(pattern_.size));
      LinearizeLssd(at, warp, level.divisor, sum > 0, pattern_, J[0]);
    }
  }

  bool MakeGain(const Jacobians<Residual>& J, Level& level) const {
    const Eigen::Matrix3d H = HessianOf<Residual>(J, pattern_.padded);
    if (!Observable(H)) return false;
    const Eigen::Matrix3f inverse = H.inverse().cast<float>();
    for (size_t c = 0; c < J.size(); ++c)
      for (int p = 0; p < kParameters; ++p)
        for (int k = 0; k < pattern_.padded; ++k)
          level.gain[c][size_t(p)][k] =
              inverse(p, 0) * J[c][0][k] + inverse(p, 1) * J[c][1][k] + inverse(p, 2) * J[c][2][k];
    return inverse.allFinite();
  }

  float CostAt(const Level& reference, const LevelView& view, const PatchWarp& warp) const {
    PatchValues<N> at;
    SamplePatch(view, pattern_, warp, at);
    Residuals<Residual> r;
    Evaluate(residual_, at, warp.Linear(), reference, pattern_, r);
    float cost = 0;
    for (PixelRow& component : r) {
      for (int k = 0; k < pattern_.padded; ++k) component[k] *= pattern_.mask[k];
      cost += Dot(component, component, pattern_.padded);
    }
    return cost;
  }

  bool TrackLevel(const Level& reference, const LevelView& view, int level, PatchWarp& warp) const {
    if constexpr (Residual::kInverseCompositional)
      return TrackInverse(reference, view, level, warp);
    else
      return TrackForward(reference, view, level, warp);
  }

  // Inverse-compositional Gauss-Newton.
  bool TrackInverse(const Level& reference, const LevelView& view, int level,
                    PatchWarp& warp) const {
    for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
      if (!view.Has(warp.centre, Margin(level))) return false;
      PatchValues<N> at;
      SamplePatch(view, pattern_, warp, at);
      Residuals<Residual> r;
      Evaluate(residual_, at, warp.Linear(), reference, pattern_, r);
      Vector3f step = Vector3f::Zero();
      for (size_t c = 0; c < r.size(); ++c)
        for (int p = 0; p < kParameters; ++p)
          step(p) += Dot(reference.gain[c][size_t(p)], r[c], pattern_.padded);
      if (!step.allFinite()) return false;
      warp.UpdateInverse(step);
      if (Small(step, level)) break;
    }
    return view.Has(warp.centre, Margin(level));
  }

  // Whether a step moves no pixel of the patch by more than the tolerance. Coarse levels only have
  // to bring the next one near.
  bool Small(const Vector3f& step, int level) const {
    constexpr float kCoarse = 10;
    const float tolerance = float(options_.tolerance_px) * (level == 0 ? 1.f : kCoarse);
    return step.head<2>().norm() + std::abs(step(2)) * pattern_.radius < tolerance;
  }

  alignment::NormalEquations<double, kParameters> EquationsAt(const Level& reference,
                                                              const LevelView& view, int level,
                                                              const PatchWarp& warp) const {
    alignment::NormalEquations<double, kParameters> equations;
    if constexpr (!Residual::kInverseCompositional) {
      if (!view.Has(warp.centre, Margin(level))) return equations;
      PatchSlopes<N> at;
      SamplePatch(view, pattern_, warp, static_cast<PatchValues<N>&>(at));
      Turn(reference.slopes, warp.Linear(), pattern_.padded, at);
      Residuals<Residual> r;
      Jacobians<Residual> J;
      Linearize(residual_, at, warp, reference.reference, pattern_, r, J);
      const int n = pattern_.padded;
      Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
      sum.topLeftCorner<3, 3>() = HessianOf<Residual>(J, n);
      for (int p = 0; p < kParameters; ++p) sum(p, 3) = Dot(J[0][size_t(p)], r[0], n);
      equations.AddSum(sum);
      equations.AddCost(0.5 * Dot(r[0], r[0], n), pattern_.size);
    }
    return equations;
  }

  // Linearised at the current image: for costs, whose slope vanishes at their own minimum.
  bool TrackForward(const Level& reference, const LevelView& view, int level,
                    PatchWarp& warp) const {
    alignment::NormalEquations<double, kParameters> last;
    alignment::SolverOptions options{.max_iterations = options_.max_iterations, .tolerance = 1e-6};
    alignment::Minimize<kParameters>(
        warp, [&](const PatchWarp& w) { return EquationsAt(reference, view, level, w); },
        [](PatchWarp w, const Eigen::Vector3d& delta) {
          w.Update(delta.cast<float>());
          return w;
        },
        options, last);
    return last.residuals() > 0;
  }

  Residual residual_;
  TrackerOptions options_;
  PaddedPattern pattern_;
};

std::unique_ptr<const PatchTracker> MakeTracker(const TrackerOptions& options) {
  return alignment::VisitResidual(options.residual,
                                  [&](const auto& residual) -> std::unique_ptr<const PatchTracker> {
                                    using Residual = std::remove_cvref_t<decltype(residual)>;
                                    if constexpr (kTrackable<Residual>)
                                      return std::make_unique<TrackerOf<Residual>>(options);
                                    else
                                      return nullptr;
                                  });
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::flow::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sgf::flow::internal {

HWY_EXPORT(MakeTracker);

std::unique_ptr<const PatchTracker> MakePatchTracker(const TrackerOptions& options) {
  return HWY_DYNAMIC_DISPATCH(MakeTracker)(options);
}

bool CanTrack(std::string_view name) {
  return alignment::VisitResidual(name, [](const auto& residual) {
    return kTrackable<std::remove_cvref_t<decltype(residual)>>;
  });
}

}  // namespace sgf::flow::internal
#endif  // HWY_ONCE
