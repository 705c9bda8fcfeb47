#pragma once

#include <array>
#include <cmath>
#include <span>
#include <type_traits>

#include <Eigen/Core>

#include <sgf/alignment/level.h>
#include <sgf/alignment/pattern.h>
#include <sgf/alignment/warp.h>
#include <sgf/metrics/registry.h>

/// What alignment minimises: residuals between pixels of a reference patch and the current image
/// where a warp finds them, with their derivative by the warp's parameters. The chain rule from
/// sample to pixel to warp stands here and nowhere else.
namespace sgf::alignment {

/// Gradient at a place, as its channels have it.
template <class T>
Vector2<T> GradientOf(const Eigen::Array<T, 4, 1>& channels) {
  return {channels[kGradientX], channels[kGradientY]};
}

/// Derivative of a channel by the place.
template <class T, int N>
Vector2<T> SlopeOf(const ChannelsAt<T, N>& at, int channel) {
  return {at.d_x[channel], at.d_y[channel]};
}

/// The sample of channels whose gradient is carried by A, g' = A^T g. Epsilon is a squared gradient
/// of the image at hand and scales with A in the mean, by ||A||^2 / 2: a similarity leaves the
/// normalised gradient's length as it is.
template <class T>
SGF_ALWAYS_INLINE metrics::Sample<T> CarrySample(const Eigen::Array<T, 4, 1>& channels,
                                                 const Eigen::Matrix<T, 2, 2>& A) {
  const Vector2<T> carried = A.transpose() * GradientOf(channels);
  // Row by row: Eigen's own sum of four floats keeps loops over pixels from becoming SIMD code.
  const T norm2 = A.row(0).squaredNorm() + A.row(1).squaredNorm();
  return metrics::MakeSample<T>(channels[kIntensity], carried.x(), carried.y(),
                                static_cast<double>(channels[kEpsilon] * norm2 / T(2)));
}

/// Derivative by the warp's parameters of what changes by d_intensity and by w with a sample's
/// intensity and carried gradient. With H, the derivative of the gradient by the place:
///
///     d I  = grad(I)^T dW/dp
///     d g' = A^T H dW/dp + (dA^T/dp) g
///
/// Epsilon is held constant, as in the derivatives of the dissimilarities.
template <class T, class Point>
auto BackToWarp(const ChannelsAt<T, 4>& at, const Point& point, T d_intensity,
                const Vector2<T>& w) {
  const Vector2<T> v = point.A() * w;
  const Vector2<T> along = d_intensity * SlopeOf(at, kIntensity) + v.x() * SlopeOf(at, kGradientX) +
                           v.y() * SlopeOf(at, kGradientY);
  return (point.Along(along) + point.Turn(w, GradientOf(at.value))).eval();
}

/// Residual of a pointwise dissimilarity, Metric(current, reference).
template <class Metric>
struct PointResidual {
  using Channels = SampleChannels;
  static constexpr int kDim = Metric::kDim;
  static constexpr int kExtraParameters = 0;
  /// Whether the derivative at the reference itself serves for all iterations: for differences that
  /// vanish at equality. A cost's own derivative vanishes there.
  static constexpr bool kInverseCompositional =
      Metric::kInfo.traits.zero_at_equality &&
      Metric::kInfo.traits.residual != metrics::ResidualKind::kNonNegative;

  template <class T>
  using Reference = metrics::Sample<T>;  ///< what is kept of a reference pixel

  Metric metric;

  template <class T>
  static Reference<T> MakeReference(const ChannelsAt<T, 4>& at) {
    return CarrySample<T>(at.value, Eigen::Matrix<T, 2, 2>::Identity());
  }

  template <class T>
  Eigen::Matrix<T, kDim, 1> Value(const Eigen::Array<T, 4, 1>& channels,
                                  const Eigen::Matrix<T, 2, 2>& A,
                                  const Reference<T>& reference) const {
    return Vectorized(metric(CarrySample<T>(channels, A), reference));
  }

  /// @param[out] J derivative by the warp's parameters.
  template <class T, class Point, int P>
  Eigen::Matrix<T, kDim, 1> Linearize(const ChannelsAt<T, 4>& at, const Point& point,
                                      const Reference<T>& reference,
                                      Eigen::Matrix<T, kDim, P>& J) const {
    const metrics::Sample<T> current = CarrySample<T>(at.value, point.A());
    const auto d = metric.Derivative(current, reference);
    for (int k = 0; k < kDim; ++k)
      J.row(k) =
          BackToWarp<T>(at, point, d.intensity(k), d.gradient.row(k).transpose()).transpose();
    return Vectorized(metric(current, reference));
  }

 private:
  template <class T>
  static Eigen::Matrix<T, 1, 1> Vectorized(T scalar) {
    return Eigen::Matrix<T, 1, 1>(scalar);
  }
  template <class T>
  static Eigen::Matrix<T, 2, 1> Vectorized(const Eigen::Matrix<T, 2, 1>& vector) {
    return vector;
  }
};

/// Photometric difference with an affine brightness, exp(alpha) I_cur + beta - I_ref, whose two
/// parameters follow those of the warp (Engel, Koltun, Cremers, "Direct sparse odometry", 2016).
struct AffinePhotoResidual {
  using Channels = SampleChannels;
  static constexpr int kDim = 1;
  static constexpr int kExtraParameters = 2;
  static constexpr bool kInverseCompositional = false;

  template <class T>
  using Reference = T;  ///< intensity

  double alpha = 0;
  double beta = 0;  ///< grey levels

  template <class T>
  static Reference<T> MakeReference(const ChannelsAt<T, 4>& at) {
    return at.value[kIntensity];
  }

  template <class T>
  Eigen::Matrix<T, 1, 1> Value(const Eigen::Array<T, 4, 1>& channels,
                               const Eigen::Matrix<T, 2, 2>& /*A*/, T reference) const {
    return Eigen::Matrix<T, 1, 1>(T(std::exp(alpha)) * channels[kIntensity] + T(beta) - reference);
  }

  template <class T, class Point, int P>
  Eigen::Matrix<T, 1, 1> Linearize(const ChannelsAt<T, 4>& at, const Point& point, T reference,
                                   Eigen::Matrix<T, 1, P>& J) const {
    const T gain = T(std::exp(alpha));
    J.template head<P - 2>() = point.Along(gain * SlopeOf(at, kIntensity)).transpose();
    J(P - 2) = gain * at.value[kIntensity];
    J(P - 1) = T(1);
    return Value<T>(at.value, {}, reference);
  }

  void Update(const Eigen::Vector2d& delta) {
    alpha += delta.x();
    beta += delta.y();
  }
};

/// Differences of the eight bit-planes.
struct BitPlanesResidual {
  using Channels = BitPlanes;
  static constexpr int kDim = 8;
  static constexpr int kExtraParameters = 0;
  static constexpr bool kInverseCompositional = true;

  template <class T>
  using Reference = Eigen::Array<T, 8, 1>;

  template <class T>
  static Reference<T> MakeReference(const ChannelsAt<T, 8>& at) {
    return at.value;
  }

  template <class T>
  Eigen::Matrix<T, 8, 1> Value(const Eigen::Array<T, 8, 1>& channels,
                               const Eigen::Matrix<T, 2, 2>& /*A*/,
                               const Reference<T>& reference) const {
    return (channels - reference).matrix();
  }

  template <class T, class Point, int P>
  Eigen::Matrix<T, 8, 1> Linearize(const ChannelsAt<T, 8>& at, const Point& point,
                                   const Reference<T>& reference, Eigen::Matrix<T, 8, P>& J) const {
    for (int k = 0; k < kDim; ++k) J.row(k) = point.Along(SlopeOf(at, k)).transpose();
    return (at.value - reference).matrix();
  }
};

/// Basalt's patch residual (metrics::Lssd), in which all pixels of a patch depend on each other.
struct LssdResidual {
  using Channels = SampleChannels;
  static constexpr int kDim = 1;  ///< for each pixel of the patch
  static constexpr int kExtraParameters = 0;
  static constexpr bool kInverseCompositional = true;

  template <class T>
  using Reference = metrics::Sample<T>;

  template <class T>
  static Reference<T> MakeReference(const ChannelsAt<T, 4>& at) {
    metrics::Sample<T> sample{};
    sample.intensity = at.value[kIntensity];
    return sample;
  }
};

/// Whether each pixel's residual depends on that pixel alone.
template <class Residual>
inline constexpr bool kPointwise = !std::is_same_v<Residual, LssdResidual>;

/// Where a warp finds a patch's pixels.
template <class Warp>
using WarpedPatch = std::array<typename Warp::Point, kMaxPatternPixels>;

/// Warps the pixels of a patch. @return whether the whole patch is in view.
template <class Image, class Warp>
bool WarpPatch(const Image& image, const Warp& warp, std::span<const typename Warp::Input> inputs,
               WarpedPatch<Warp>& points) {
  for (size_t k = 0; k < inputs.size(); ++k)
    if (!warp.At(inputs[k], points[k]) || !image.Inside(points[k].pixel)) return false;
  return true;
}

/// Calls sink(k, r) with the residuals of a patch's pixels k, vectors of Residual::kDim.
/// @param image a ChannelImage, or anything with its Inside() and Sample().
/// @param inputs, references of the patch's pixels, at most kMaxPatternPixels.
/// @return whether the whole patch is in view; the sink is not called otherwise.
template <class T, class Residual, class Image, class Warp, class Sink>
bool EvaluatePatch(const Residual& residual, const Image& image, const Warp& warp,
                   std::span<const typename Warp::Input> inputs,
                   std::span<const typename Residual::template Reference<T>> references,
                   Sink&& sink) {
  WarpedPatch<Warp> points;
  if (!WarpPatch(image, warp, inputs, points)) return false;
  if constexpr (kPointwise<Residual>) {
    for (size_t k = 0; k < inputs.size(); ++k)
      sink(k, residual.template Value<T>(image.Sample(points[k].pixel).value, points[k].A(),
                                         references[k]));
  } else {
    std::array<metrics::Sample<T>, kMaxPatternPixels> samples;
    for (size_t k = 0; k < inputs.size(); ++k)
      samples[k] = Residual::template MakeReference<T>(image.Sample(points[k].pixel));
    const auto r = metrics::Lssd{}(
        std::span<const metrics::Sample<T>>(samples.data(), inputs.size()), references);
    for (size_t k = 0; k < inputs.size(); ++k) sink(k, Eigen::Matrix<T, 1, 1>(r(k)));
  }
  return true;
}

/// Calls sink(k, r, J) with the residuals and their derivatives by the warp's (and the residual's
/// extra) parameters. As EvaluatePatch() otherwise.
template <class T, class Residual, class Image, class Warp, class Sink>
bool LinearizePatch(const Residual& residual, const Image& image, const Warp& warp,
                    std::span<const typename Warp::Input> inputs,
                    std::span<const typename Residual::template Reference<T>> references,
                    Sink&& sink) {
  constexpr int P = Warp::kParameters + Residual::kExtraParameters;
  WarpedPatch<Warp> points;
  if (!WarpPatch(image, warp, inputs, points)) return false;
  if constexpr (kPointwise<Residual>) {
    for (size_t k = 0; k < inputs.size(); ++k) {
      Eigen::Matrix<T, Residual::kDim, P> J;
      const auto r = residual.Linearize(image.Sample(points[k].pixel), points[k], references[k], J);
      sink(k, r, J);
    }
  } else {
    std::array<metrics::Sample<T>, kMaxPatternPixels> samples;
    Eigen::Matrix<T, Eigen::Dynamic, P, 0, kMaxPatternPixels, P> J_intensity(inputs.size(), P);
    for (size_t k = 0; k < inputs.size(); ++k) {
      const auto at = image.Sample(points[k].pixel);
      samples[k] = Residual::template MakeReference<T>(at);
      J_intensity.row(k) = points[k].Along(SlopeOf(at, kIntensity)).transpose();
    }
    const std::span<const metrics::Sample<T>> current(samples.data(), inputs.size());
    const auto r = metrics::Lssd{}(current, references);
    const Eigen::Matrix<T, Eigen::Dynamic, P> J = metrics::Lssd{}.Jacobian(current) * J_intensity;
    for (size_t k = 0; k < inputs.size(); ++k)
      sink(k, Eigen::Matrix<T, 1, 1>(r(k)), Eigen::Matrix<T, 1, P>(J.row(k)));
  }
  return true;
}

/// Whether a residual compares samples of two images and has no parameters of its own, as tracking
/// and depth need it.
template <class Residual>
inline constexpr bool kOfSamplesAlone =
    std::is_same_v<typename Residual::Channels, SampleChannels>&& Residual::kExtraParameters == 0;

/// How alike the gradients of two patches are, whatever gain and offset between them:
/// sum(g . h) / sqrt(sum |g|^2 sum |h|^2), in [-1, 1]; 0 where one is flat.
struct GradientCorrelation {
  float gh = 0, gg = 0, hh = 0;

  void Add(const Vector2<float>& g, const Vector2<float>& h) {
    gh += g.dot(h);
    gg += g.squaredNorm();
    hh += h.squaredNorm();
  }
  float Value() const { return gg > 0 && hh > 0 ? gh / std::sqrt(gg * hh) : 0; }
};

}  // namespace sgf::alignment
