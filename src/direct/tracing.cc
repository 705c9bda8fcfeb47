#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/direct/tracing.h>

namespace sgf::direct {
namespace {

using alignment::GradientOf, alignment::SampleChannels;
using Warp = alignment::EpipolarWarp<float>;
using Eigen::Matrix2f, Eigen::Vector2f, Eigen::Vector3f;

/// A reference sample as an image of another brightness would have it.
metrics::Sample<float> Brightened(const metrics::Sample<float>& sample, float gain, float offset) {
  const float epsilon =
      std::max(sample.reg_norm * sample.reg_norm - sample.norm * sample.norm, 0.f);
  return metrics::MakeSample<float>(gain * sample.intensity + offset, gain * sample.gx,
                                    gain * sample.gy, gain * gain * epsilon);
}

template <class Residual>
class DepthEstimatorOf : public DepthEstimator {
  using Patch = alignment::Patch<Residual, Warp>;

 public:
  DepthEstimatorOf(const Camera& camera, const TracingOptions& options)
      : camera_(camera), options_(options) {}

  void Trace(const Keyframe& host, const SampleChannels& image, const SE3& T_target_host,
             const RelativeBrightness& relative, ImmaturePoint& point) const override {
    Warp warp(camera_, T_target_host, point.inverse_depth_min);
    Line line;
    if (!LineOf(warp, point, line)) {
      point.status = TraceStatus::kOutOfView;
      return;
    }
    point.interval_px = line.length;
    constexpr float kSettled = 1.5f;  // px
    const bool bounded = std::isfinite(point.inverse_depth_max);
    if (bounded && line.length < kSettled) {
      point.status = TraceStatus::kSkipped;
      return;
    }
    const float error_px = ErrorAlong(point.structure, line);
    if (bounded) {
      constexpr float kWorthwhile = 3;  // times its error a line has to be long
      if (kWorthwhile * error_px > line.length) {
        point.status = TraceStatus::kUncertain;
        return;
      }
    } else if (error_px > kMostErrorPx) {
      point.status = TraceStatus::kUncertain;
      return;
    }
    Patch patch;
    if (!MakePatchOf(host.image(), point.pixel, relative, patch)) {
      point.status = TraceStatus::kOutOfView;
      return;
    }
    Search(image, patch, warp, line, point);
    if (point.status != TraceStatus::kGood) return;
    Narrow(host.image(), image, patch, line, error_px, warp, point);
    point.outliers = point.status == TraceStatus::kOutlier ? point.outliers + 1 : 0;
  }

  RefinedDepth Refine(const Keyframe& host, const Vector2f& pixel, double inverse_depth,
                      std::span<const View> views) const override {
    std::vector<Patch> patches(views.size());
    std::vector<Warp> warps;
    for (size_t k = 0; k < views.size(); ++k) {
      const RelativeBrightness relative = Between(host.brightness, views[k].target->brightness);
      if (!MakePatchOf(host.image(), pixel, relative, patches[k])) return {};
      warps.emplace_back(camera_, views[k].T_target_host, static_cast<float>(inverse_depth));
    }
    std::vector<float> norms;
    for (size_t k = 0; k < views.size(); ++k)
      alignment::EvaluatePatch<float>(
          residual_, views[k].target->image(), warps[k], patches[k].Inputs(),
          patches[k].References(),
          [&](size_t, const auto& r) { norms.push_back(r.squaredNorm()); });
    if (norms.empty()) return {};
    const alignment::RobustLoss<double> loss{
        alignment::RobustKind::kHuber,
        static_cast<double>(alignment::MedianScale(std::span(norms), Residual::kDim))};
    const auto linearize = [&](float depth) {
      alignment::NormalEquations<double, 1> sum;
      for (size_t k = 0; k < views.size(); ++k) {
        Warp warp = warps[k];
        warp.inverse_depth = depth;
        sum +=
            alignment::LinearizeWhole(residual_, views[k].target->image(), patches[k], loss, warp);
      }
      return sum;
    };
    float depth = static_cast<float>(inverse_depth);
    alignment::NormalEquations<double, 1> last;
    alignment::Minimize<1>(
        depth, linearize,
        [](float d, const auto& delta) { return d + static_cast<float>(delta(0)); }, Solver(),
        last);
    RefinedDepth result{depth, last.H()(0, 0) / (loss.scale * loss.scale)};
    for (size_t k = 0; k < views.size(); ++k) {
      warps[k].inverse_depth = depth;
      if (Correlation(host.image(), pixel, views[k].target->image(), warps[k]) >=
          options_.min_correlation)
        result.seen_by.push_back(static_cast<int>(k));
    }
    if (!(depth > 0)) result.seen_by.clear();
    return result;
  }

 private:
  static constexpr float kMostErrorPx = 3;
  static constexpr float kInfinite = 1e30f;

  /// Where a point may be in the other image.
  struct Line {
    Vector2f from;       ///< at the interval's least inverse depth
    Vector2f direction;  ///< of unit length, of growing inverse depth
    float length = 0;    ///< px
    Matrix2f A;          ///< derivative of the warp at `from`
    Vector3f X;          ///< at infinity
    Vector3f p;
  };

  /// A hundredth of the cost is far less than what noise moves a point by.
  alignment::SolverOptions Solver() const {
    return {.max_iterations = options_.max_iterations, .tolerance = 1e-2};
  }

  bool MakePatchOf(const SampleChannels& image, const Vector2f& pixel,
                   const RelativeBrightness& relative, Patch& patch) const {
    const auto input = [&](const Vector2f& offset) {
      return Warp::Input{alignment::RayOf<float>(camera_, pixel + offset), 0, Vector2f::Zero()};
    };
    if (!alignment::MakePatch(image, pixel, alignment::Offsets(alignment::Pattern::kDso8), input,
                              patch))
      return false;
    const float gain = static_cast<float>(std::exp(-relative.alpha));
    const float offset = -gain * static_cast<float>(relative.beta);
    for (size_t k = 0; k < patch.size; ++k)
      patch.references[k] = Brightened(patch.references[k], gain, offset);
    return true;
  }

  bool LineOf(const Warp& warp, const ImmaturePoint& point, Line& line) const {
    const alignment::PixelAtDepth<float> centre{alignment::RayOf<float>(camera_, point.pixel), 0,
                                                Vector2f::Zero()};
    Warp::Point from;
    if (!warp.At(centre, from)) return false;
    line.from = from.pixel;
    line.A = from.A();
    line.p = warp.projector.p;
    line.X = from.X - point.inverse_depth_min * line.p;
    // Towards the epipole, from.pixel's derivative by the inverse depth.
    const Vector2f direction(from.fx_z * (line.p.x() - from.x * line.p.z()),
                             from.fy_z * (line.p.y() - from.y * line.p.z()));
    const float speed = direction.norm();
    if (!(speed > 1e-6f)) return false;
    line.direction = direction / speed;
    const auto most = static_cast<float>(options_.max_length * (camera_.width + camera_.height));
    line.length = most;
    if (std::isfinite(point.inverse_depth_max)) {
      Warp to = warp;
      to.inverse_depth = point.inverse_depth_max;
      Warp::Point end;
      if (!to.At(centre, end)) return false;
      line.length = std::min(most, (end.pixel - line.from).norm());
    }
    return true;
  }

  /// Standard deviation (px) along the line of what is found, from how its direction lies to the
  /// gradients of the patch: noise moves an edge across itself (Engel, Sturm, Cremers,
  /// "Semi-dense visual odometry for a monocular camera", 2013).
  static float ErrorAlong(const Matrix2f& structure, const Line& line) {
    const Vector2f along = (line.A.inverse() * line.direction).normalized();
    const float with = along.dot(structure * along);
    return with > 0 ? 0.2f + 0.2f * structure.trace() / with : INFINITY;
  }

  /// Inverse depth of the place on the line at a distance from its beginning.
  float InverseDepthAt(const Line& line, float distance) const {
    const Vector2f pixel = line.from + distance * line.direction;
    const Vector2f ray = alignment::RayOf<float>(camera_, pixel);
    // (X + d p) projects to the ray: X_i + d p_i = ray_i (X_z + d p_z).
    const bool horizontal = std::abs(line.direction.x()) > std::abs(line.direction.y());
    const int i = horizontal ? 0 : 1;
    return (line.X(i) - ray(i) * line.X.z()) / (ray(i) * line.p.z() - line.p(i));
  }

  /// Dissimilarity of a patch whose pixels lie at these offsets from a place; infinite out of view.
  /// What is above `enough` need not be the whole sum.
  float Cost(const SampleChannels& image, const Patch& patch, const Vector2f& place,
             const std::array<Vector2f, kPatchPixels>& shape, const Matrix2f& A,
             float enough) const {
    float cost = 0;
    for (int k = 0; k < kPatchPixels && cost <= enough; ++k) {
      const Vector2f pixel = place + shape[k];
      if (!image.Inside(pixel)) return kInfinite;
      cost +=
          residual_.template Value<float>(image.Value(pixel), A, patch.references[k]).squaredNorm();
    }
    return cost;
  }

  /// The best place on the line in steps of a pixel.
  void Search(const SampleChannels& image, const Patch& patch, Warp& warp, const Line& line,
              ImmaturePoint& point) const {
    constexpr int kMostSteps = 99, kOwnRadius = 2;
    std::array<float, kMostSteps> costs;
    const int steps = std::clamp(static_cast<int>(std::ceil(line.length)) + 1, 2, kMostSteps);
    const float stride = line.length / static_cast<float>(steps - 1);
    std::array<Vector2f, kPatchPixels> shape;
    const auto offsets = alignment::Offsets(alignment::Pattern::kDso8);
    for (int k = 0; k < kPatchPixels; ++k) shape[k] = line.A * offsets[k];
    const Vector2f step = stride * line.direction;
    // Costs only have to be told apart up to where the best one is unambiguous.
    float enough = kInfinite;
    for (int k = 0; k < steps; ++k) {
      costs[k] =
          Cost(image, patch, line.from + static_cast<float>(k) * step, shape, line.A, enough);
      enough = std::min(enough, static_cast<float>(options_.min_quality) * costs[k]);
    }
    const int best =
        static_cast<int>(std::min_element(costs.begin(), costs.begin() + steps) - costs.begin());
    if (!(costs[best] < kInfinite)) {
      point.status = TraceStatus::kOutOfView;
      return;
    }
    float second = kInfinite;
    for (int k = 0; k < steps; ++k)
      if (std::abs(k - best) > kOwnRadius) second = std::min(second, costs[k]);
    // A short line has no second best and says nothing new about ambiguity.
    const float quality = second / std::max(costs[best], 1e-12f);
    if (steps > 10 || point.found == 0 || quality < point.quality)
      point.quality = std::min(quality, 1e6f);
    warp.inverse_depth = InverseDepthAt(line, static_cast<float>(best) * stride);
    point.status = TraceStatus::kGood;
  }

  float Correlation(const SampleChannels& host, const Vector2f& pixel, const SampleChannels& image,
                    const Warp& warp) const {
    alignment::GradientCorrelation correlation;
    for (const Vector2f& offset : alignment::Offsets(alignment::Pattern::kDso8)) {
      Warp::Point point;
      if (!warp.At({alignment::RayOf<float>(camera_, pixel + offset), 0, Vector2f::Zero()},
                   point) ||
          !image.Inside(point.pixel))
        return -1;
      correlation.Add(point.A().transpose() * GradientOf(image.Value(point.pixel)),
                      GradientOf(host.Value<float>(pixel + offset)));
    }
    return correlation.Value();
  }

  /// Refines along the line and sets the interval around what is found.
  void Narrow(const SampleChannels& host, const SampleChannels& image, const Patch& patch,
              const Line& line, float error_px, Warp& warp, ImmaturePoint& point) const {
    const Warp found = warp;
    AlignPatch(residual_, image, patch, alignment::RobustKind::kNone, Solver(), warp);
    Warp::Point place, before;
    const alignment::PixelAtDepth<float> centre{alignment::RayOf<float>(camera_, point.pixel), 0,
                                                Vector2f::Zero()};
    constexpr float kMostRefinement = 2;  // px
    const bool near = found.At(centre, before) && warp.At(centre, place) &&
                      (place.pixel - before.pixel).norm() <= kMostRefinement;
    if (!near || Correlation(host, point.pixel, image, warp) < options_.min_correlation) {
      point.status = TraceStatus::kOutlier;
      return;
    }
    const float distance = (place.pixel - line.from).dot(line.direction);
    float low = InverseDepthAt(line, distance - error_px);
    float high = InverseDepthAt(line, distance + error_px);
    if (low > high) std::swap(low, high);
    if (!std::isfinite(low) || !std::isfinite(high) || high <= 0) {
      point.status = TraceStatus::kOutlier;
      return;
    }
    point.inverse_depth_min = std::max(low, 0.f);
    point.inverse_depth_max = high;
    point.interval_px = 2 * error_px;
    ++point.found;
  }

  Camera camera_;
  TracingOptions options_;
  Residual residual_;
};

template <class Residual>
inline constexpr bool kEstimatesDepth =
    std::is_same_v<typename Residual::Channels, SampleChannels>&& Residual::kExtraParameters == 0 &&
    alignment::kPointwise<Residual>;

}  // namespace

void CheckOptions(const TracingOptions& options) {
  alignment::VisitResidual(options.residual, [&](const auto& residual) {
    if constexpr (!kEstimatesDepth<std::remove_cvref_t<decltype(residual)>>)
      throw Error("depth.residual", fmt::format("'{}' cannot estimate depth", options.residual));
  });
  Require(options.max_length > 0 && options.max_length <= 0.05, "depth.max_length",
          options.max_length, "in (0, 0.05]");
  Require(options.min_correlation > -1 && options.min_correlation < 1, "depth.min_correlation",
          options.min_correlation, "in (-1, 1)");
  Require(options.min_quality >= 1, "depth.min_quality", options.min_quality, "at least 1");
  Require(options.max_iterations >= 1, "depth.max_iterations", options.max_iterations, "positive");
}

ImmaturePoint MakeImmaturePoint(const SampleChannels& image, const Vector2f& pixel) {
  ImmaturePoint point{.pixel = pixel};
  for (const Vector2f& offset : alignment::Offsets(alignment::Pattern::kDso8)) {
    const Vector2f gradient = GradientOf(image.Value<float>(pixel + offset));
    point.structure += gradient * gradient.transpose();
  }
  return point;
}

std::unique_ptr<const DepthEstimator> MakeDepthEstimator(const Camera& camera,
                                                         const TracingOptions& options) {
  CheckOptions(options);
  return alignment::VisitResidual(
      options.residual, [&](const auto& residual) -> std::unique_ptr<const DepthEstimator> {
        using Residual = std::remove_cvref_t<decltype(residual)>;
        if constexpr (kEstimatesDepth<Residual>)
          return std::make_unique<DepthEstimatorOf<Residual>>(camera, options);
        return nullptr;
      });
}

}  // namespace sgf::direct
