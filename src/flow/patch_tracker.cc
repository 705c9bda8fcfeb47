// Tracking of patches, compiled once per instruction set by Highway.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/flow/patch_tracker.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <type_traits>

#include <Eigen/LU>
#include <hwy/highway.h>

#include <sgf/alignment/solver.h>
#include <sgf/flow/patch_sampling-inl.h>
#include <sgf/flow/patch_template.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::flow::internal {
namespace HWY_NAMESPACE {

using Eigen::Matrix2f, Eigen::Vector2f, Eigen::Vector3f;

constexpr int kParameters = PatchWarp::kParameters;

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
                                      PatchReference<kOfIntensity<Residual>>& reference) {
#pragma GCC ivdep
  for (int k = 0; k < n; ++k)
    reference.Set(k, Residual::template MakeReference<float>(at.WithSlopes(k)));
}

// Slopes of a reference's gradients, H, as an image turned by A shows them: A H A^T.
template <class Reference>
SGF_FLATTEN inline void Turn(const Reference& slopes, const Matrix2f& linear, int n,
                             PatchSlopes<2>& at) {
  const float c = linear(0, 0), s = linear(1, 0);
#pragma GCC ivdep
  for (int k = 0; k < n; ++k) {
    const float xx = slopes[0][0][k], xy = slopes[1][0][k];
    const float yx = slopes[0][1][k], yy = slopes[1][1][k];
    const float xx_a = c * xx - s * yx, xy_a = c * xy - s * yy;
    const float yx_a = s * xx + c * yx, yy_a = s * xy + c * yy;
    at.d_x[0][k] = xx_a * c - xy_a * s;
    at.d_y[0][k] = xx_a * s + xy_a * c;
    at.d_x[1][k] = yx_a * c - yy_a * s;
    at.d_y[1][k] = yx_a * s + yy_a * c;
  }
}

// Residuals and their derivatives by the warp's parameters.
template <class Residual, class Slopes>
SGF_FLATTEN inline void Linearize(const Residual& residual, const Slopes& at, const PatchWarp& warp,
                                  const PatchReference<kOfIntensity<Residual>>& reference,
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
    if constexpr (!kOfIntensity<Residual>) {
      pyramid.gradient.resize(pyramid.grey.size());
      for (size_t level = 0; level < pyramid.grey.size(); ++level)
        pyramid.gradient[level].epsilon = alignment::MakeGradientChannels(
            pyramid.grey[level], options_.image, pyramid.gradient[level].gradients);
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
      float squares = 0;
      for (size_t c = 0; c < r.size(); ++c) {
        for (int p = 0; p < kParameters; ++p) sum(p, 3) += Dot(J[c][size_t(p)], r[c], n);
        squares += Dot(r[c], r[c], n);
      }
      equations.AddSum(sum);
      equations.AddCost(0.5 * squares, pattern_.size);
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
  return alignment::VisitStudiedResidual(
      options.residual, [&](const auto& residual) -> std::unique_ptr<const PatchTracker> {
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
  return alignment::VisitStudiedResidual(name, [](const auto& residual) {
    return kTrackable<std::remove_cvref_t<decltype(residual)>>;
  });
}

}  // namespace sgf::flow::internal
#endif  // HWY_ONCE
