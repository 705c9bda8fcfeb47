#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include <sgf/alignment/residual_table.h>
#include <sgf/alignment/solver.h>
#include <sgf/core/error.h>
#include <sgf/odometry/stereo_depth.h>

namespace sgf::odometry {
namespace {

using alignment::SampleChannels;
using Warp = alignment::EpipolarWarp<float>;

/// The pixels of one patch of the left image.
template <class Residual>
struct Patch {
  using Reference = typename Residual::template Reference<float>;
  std::array<Warp::Input, alignment::kMaxPatternPixels> rays;
  std::array<Reference, alignment::kMaxPatternPixels> references;
  std::array<Eigen::Vector2f, alignment::kMaxPatternPixels> gradients;
  size_t size = 0;

  std::span<const Warp::Input> Rays() const { return {rays.data(), size}; }
  std::span<const Reference> References() const { return {references.data(), size}; }
};

template <class Residual>
class Refiner {
 public:
  Refiner(const SampleChannels& left, const SampleChannels& right, const Camera& camera,
          double baseline_m, const RefinementOptions& options)
      : left_(left),
        right_(right),
        camera_(camera),
        options_(options),
        offsets_(alignment::Offsets(options.pattern)),
        disparity_per_inverse_depth_(camera.fx * baseline_m) {
    T_right_left_.p.x() = -baseline_m;
  }

  /// @return whether the point is to be kept.
  bool operator()(alignment::ReferencePoint& point) const {
    Patch<Residual> patch;
    if (!Fill(point.pixel, patch)) return false;
    Warp warp(camera_, T_right_left_, point.inverse_depth);
    alignment::NormalEquations<double, 1> last;
    const alignment::SolverOptions solver{.max_iterations = options_.max_iterations};
    alignment::Minimize<1>(
        warp, [&](const Warp& w) { return Linearize(patch, w); },
        [](Warp w, const Eigen::Matrix<double, 1, 1>& delta) {
          w.Update(delta.cast<float>());
          return w;
        },
        solver, last);
    const double change_px =
        std::abs(warp.inverse_depth - point.inverse_depth) * disparity_per_inverse_depth_;
    if (last.residuals() == 0 || !(change_px <= options_.max_change_px) ||
        Correlation(patch, warp) < options_.min_correlation)
      return false;
    point.inverse_depth = warp.inverse_depth;
    return point.inverse_depth > 0;
  }

 private:
  bool Fill(const Eigen::Vector2f& centre, Patch<Residual>& patch) const {
    for (const Eigen::Vector2f& offset : offsets_) {
      const Eigen::Vector2f pixel = centre + offset;
      if (!left_.Inside<float>(pixel)) return false;
      const auto at = left_.Sample<float>(pixel);
      patch.rays[patch.size] = {static_cast<float>((pixel.x() - camera_.cx) / camera_.fx),
                                static_cast<float>((pixel.y() - camera_.cy) / camera_.fy)};
      patch.references[patch.size] = Residual::template MakeReference<float>(at);
      patch.gradients[patch.size++] = {at.value[alignment::kGradientX],
                                       at.value[alignment::kGradientY]};
    }
    return true;
  }

  alignment::NormalEquations<double, 1> Linearize(const Patch<Residual>& patch,
                                                  const Warp& warp) const {
    alignment::NormalEquations<double, 1> sum;
    alignment::LinearizePatch<float>(Residual{}, right_, warp, patch.Rays(), patch.References(),
                                     [&](size_t, const auto& r, const auto& J) {
                                       sum.Add(r.template cast<double>(), J.template cast<double>(),
                                               1.0);
                                       sum.AddCost(0.5 * r.squaredNorm());
                                     });
    return sum;
  }

  float Correlation(const Patch<Residual>& patch, const Warp& warp) const {
    alignment::GradientCorrelation correlation;
    for (size_t k = 0; k < patch.size; ++k) {
      Warp::Point point;
      if (!warp.At(patch.rays[k], point) || !right_.Inside(point.pixel)) return 0;
      const auto at = right_.Sample(point.pixel).value;
      correlation.Add(point.A().transpose() *
                          Eigen::Vector2f(at[alignment::kGradientX], at[alignment::kGradientY]),
                      patch.gradients[k]);
    }
    return correlation.Value();
  }

  const SampleChannels& left_;
  const SampleChannels& right_;
  const Camera& camera_;
  const RefinementOptions& options_;
  std::span<const Eigen::Vector2f> offsets_;
  double disparity_per_inverse_depth_;
  SE3 T_right_left_;
};

}  // namespace

void CheckOptions(const RefinementOptions& options) {
  if (alignment::FindResidual(options.residual).name == "bit_planes" ||
      options.residual == "photo_affine")
    throw Error("refinement.residual", fmt::format("'{}' cannot refine depths", options.residual));
  if (options.max_iterations < 1)
    throw Error("refinement.max_iterations",
                fmt::format("is {}; it has to be positive", options.max_iterations));
}

void RefineDepths(const SampleChannels& left, const SampleChannels& right, const Camera& camera,
                  double baseline_m, const RefinementOptions& options,
                  std::vector<alignment::ReferencePoint>& points) {
  alignment::VisitResidual(options.residual, [&](const auto& residual) {
    using Residual = std::remove_cvref_t<decltype(residual)>;
    if constexpr (std::is_same_v<typename Residual::Channels, SampleChannels> &&
                  Residual::kExtraParameters == 0) {
      const Refiner<Residual> refine(left, right, camera, baseline_m, options);
      std::erase_if(points, [&](alignment::ReferencePoint& point) { return !refine(point); });
    }
  });
}

}  // namespace sgf::odometry
