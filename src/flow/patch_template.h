#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <type_traits>

#include <Eigen/Core>

#include <sgf/alignment/as_extracted.h>
#include <sgf/alignment/residual.h>
#include <sgf/core/always_inline.h>
#include <sgf/flow/patch_tracker.h>

/// What a patch tracker computes with: patches pixel by pixel, a row of numbers for each channel.
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

/// Whether patches can be followed by a dissimilarity: `photo`, and those that alignment can
/// minimise and an offset leaves alone, which look at gradients only. Not by `agm`, whose square is
/// that of `gm`, nor by `ngf`, which has no minimum at equality.
template <class Metric>
inline constexpr bool kFollowable = std::is_same_v<Metric, metrics::Photo> ||
                                    (alignment::kAlignable<Metric> &&
                                     Metric::kInfo.traits.offset_invariant &&
                                     !std::is_same_v<Metric, metrics::Agm> &&
                                     !std::is_same_v<Metric, metrics::Ngf>);

/// The same of a residual.
template <class Residual>
inline constexpr bool kTrackable = std::is_same_v<Residual, alignment::LssdResidual>;
template <class Metric>
inline constexpr bool kTrackable<alignment::PointResidual<Metric>> = kFollowable<Metric>;

/// Whether a residual looks at intensities, so that no gradients have to be made. All others look
/// at gradients alone.
template <class Residual>
inline constexpr bool kOfIntensity =
    !alignment::kPointwise<Residual> ||
    std::is_same_v<Residual, alignment::PointResidual<metrics::Photo>>;

/// Channels of a level: intensity, or both of the gradient.
template <class Residual>
inline constexpr int kChannelsOf =
    kOfIntensity<Residual> ? 1 : alignment::GradientChannels::kChannels;

/// A level of a pyramid, interleaved channels.
struct LevelView {
  const float* pixels;
  int cols, rows;
  int channels;
  size_t stride;             ///< floats from row to row
  const cv::Mat1f* epsilon;  ///< of the gradients

  bool Has(const Eigen::Vector2f& p, float margin) const {
    return p.x() >= margin && p.y() >= margin && p.x() <= float(cols - 1) - margin &&
           p.y() <= float(rows - 1) - margin;
  }

  /// Of a patch: where it is not that of the whole image, its centre's serves for all of it.
  float EpsilonAt(const Eigen::Vector2f& centre) const {
    const auto index = [](float p, int size) {
      return std::clamp(static_cast<int>(p + 0.5f), 0, size - 1);
    };
    return (*epsilon)(index(centre.y(), epsilon->rows), index(centre.x(), epsilon->cols));
  }
};

template <class Residual>
LevelView ViewOf(const Pyramid& pyramid, int level) {
  if constexpr (kOfIntensity<Residual>) {
    const cv::Mat1f& grey = pyramid.grey[static_cast<size_t>(level)];
    return {grey[0], grey.cols, grey.rows, 1, grey.step1(), nullptr};
  } else {
    const auto& [gradients, epsilon] = pyramid.gradient[static_cast<size_t>(level)];
    constexpr int kChannels = alignment::GradientChannels::kChannels;
    return {gradients.At(0, 0),
            gradients.cols(),
            gradients.rows(),
            kChannels,
            size_t(gradients.cols()) * kChannels,
            &epsilon};
  }
}

/// Channels as residuals take them, from those of a level.
template <int N>
SGF_ALWAYS_INLINE Eigen::Array4f AsSample(const std::array<PixelRow, N>& rows, int k,
                                          float epsilon) {
  if constexpr (N == 1)
    return {rows[0][k], 0, 0, 0};
  else
    return {0, rows[0][k], rows[1][k], epsilon};
}

/// Channels at the pixels of a patch.
template <int N>
struct PatchValues {
  std::array<PixelRow, N> value;
  float epsilon = 0;

  SGF_ALWAYS_INLINE Eigen::Array4f At(int k) const { return AsSample<N>(value, k, epsilon); }
};

/// And their derivatives by the place.
template <int N>
struct PatchSlopes : PatchValues<N> {
  std::array<PixelRow, N> d_x, d_y;

  SGF_ALWAYS_INLINE alignment::ChannelsAt<float, 4> WithSlopes(int k) const {
    // Epsilon counts as constant.
    return {this->At(k), AsSample<N>(d_x, k, 0), AsSample<N>(d_y, k, 0)};
  }
};

/// Samples of the reference's pixels: as many of their members as the residual looks at.
template <bool kIntensity>
struct PatchReference {
  std::array<PixelRow, kIntensity ? 1 : 7> member;

  SGF_ALWAYS_INLINE metrics::Sample<float> At(int k) const {
    if constexpr (kIntensity)
      return {member[0][k], 0, 0, 0, 0, 0, 0, 0};
    else
      return {0,
              member[0][k],
              member[1][k],
              member[2][k],
              member[3][k],
              member[4][k],
              member[5][k],
              member[6][k]};
  }
  SGF_ALWAYS_INLINE void Set(int k, const metrics::Sample<float>& s) {
    if constexpr (kIntensity) {
      member[0][k] = s.intensity;
    } else {
      const float members[] = {s.gx, s.gy, s.norm, s.reg_norm, s.ax, s.ay, s.r};
      for (size_t m = 0; m < member.size(); ++m) member[m][k] = members[m];
    }
  }
};

/// A patch at one level.
template <class Residual>
struct LevelTemplate {
  static constexpr bool kInverse = Residual::kInverseCompositional;
  bool usable;
  float divisor;  ///< of lssd
  PatchReference<kOfIntensity<Residual>> reference;
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
