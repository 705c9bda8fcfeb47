#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/odometry/stereo_depth.h>

namespace sgf::odometry {
namespace {

using alignment::SampleChannels;
using Warp = alignment::EpipolarWarp<float>;

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
    const auto input = [&](const Eigen::Vector2f& offset) { return InputAt(point, offset); };
    Patch patch;
    if (!alignment::MakePatch(left_, point.pixel, offsets_, input, patch)) return false;
    Warp warp(camera_, T_right_left_, point.inverse_depth);
    const alignment::SolverOptions solver{.max_iterations = options_.max_iterations};
    AlignPatch(Residual{}, right_, patch, alignment::RobustKind::kNone, solver, warp);
    const double change_px =
        std::abs(warp.inverse_depth - point.inverse_depth) * disparity_per_inverse_depth_;
    point.inverse_depth = warp.inverse_depth;
    return warp.inverse_depth > 0 && change_px <= options_.max_change_px &&
           Correlation(point, warp) >= options_.min_correlation;
  }

 private:
  using Patch = alignment::Patch<Residual, Warp>;

  Warp::Input InputAt(const alignment::ReferencePoint& point, const Eigen::Vector2f& offset) const {
    return {alignment::RayOf<float>(camera_, point.pixel + offset), point.slope.dot(offset),
            point.slope};
  }

  float Correlation(const alignment::ReferencePoint& reference, const Warp& warp) const {
    alignment::GradientCorrelation correlation;
    for (const Eigen::Vector2f& offset : offsets_) {
      Warp::Point point;
      if (!warp.At(InputAt(reference, offset), point) || !right_.Inside(point.pixel)) return -2;
      correlation.Add(point.A().transpose() * GradientAt(right_, point.pixel),
                      GradientAt(left_, reference.pixel + offset));
    }
    return correlation.Value();
  }

  static Eigen::Vector2f GradientAt(const SampleChannels& image, const Eigen::Vector2f& pixel) {
    return alignment::GradientOf(image.Sample(pixel).value);
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
  alignment::VisitResidual(options.residual, [&](const auto& residual) {
    if constexpr (!alignment::kOfSamplesAlone<std::remove_cvref_t<decltype(residual)>>)
      throw Error("refinement.residual",
                  fmt::format("'{}' cannot refine depths", options.residual));
  });
  Require(options.max_iterations >= 1, "refinement.max_iterations", options.max_iterations,
          "positive");
  Require(options.max_change_px > 0, "refinement.max_change_px", options.max_change_px, "positive");
  Require(options.min_correlation >= -1 && options.min_correlation < 1,
          "refinement.min_correlation", options.min_correlation, "in [-1, 1)");
}

void RefineDepths(const SampleChannels& left, const SampleChannels& right, const Camera& camera,
                  double baseline_m, const RefinementOptions& options,
                  std::vector<alignment::ReferencePoint>& points) {
  alignment::VisitResidual(options.residual, [&](const auto& residual) {
    using Residual = std::remove_cvref_t<decltype(residual)>;
    if constexpr (alignment::kOfSamplesAlone<Residual>) {
      const Refiner<Residual> refine(left, right, camera, baseline_m, options);
      std::erase_if(points, [&](alignment::ReferencePoint& point) { return !refine(point); });
    }
  });
}

}  // namespace sgf::odometry
