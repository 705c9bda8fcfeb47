#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include <sgf/alignment/residual.h>
#include <sgf/alignment/robust.h>
#include <sgf/alignment/solver.h>

/// Alignment of single patches: tracking in the plane, depth along the epipolar line.
namespace sgf::alignment {

/// Standard deviation of residuals with `dim` components from the median of their squared norms,
/// as if they were Gaussian; 1 without any.
/// @param squared_norms is reordered.
template <class T>
T MedianScale(std::span<T> squared_norms, int dim) {
  if (squared_norms.empty()) return T(1);
  const size_t middle = squared_norms.size() / 2;
  std::nth_element(squared_norms.begin(), squared_norms.begin() + middle, squared_norms.end());
  // Median of chi squared with dim degrees of freedom (Wilson and Hilferty, 1931).
  const double median = dim * std::pow(1 - 2.0 / (9 * dim), 3);
  return static_cast<T>(std::max(std::sqrt(squared_norms[middle] / median), 1e-6));
}

/// The pixels of a reference patch.
template <class Residual, class Warp>
struct Patch {
  using T = typename Warp::Scalar;
  using Input = typename Warp::Input;
  using Reference = typename Residual::template Reference<T>;

  std::array<Input, kMaxPatternPixels> inputs;
  std::array<Reference, kMaxPatternPixels> references;
  size_t size = 0;

  std::span<const Input> Inputs() const { return {inputs.data(), size}; }
  std::span<const Reference> References() const { return {references.data(), size}; }
};

/// Fills a patch with the pixels around a centre.
/// @param input_of offset from the centre (px) -> Warp::Input
/// @return whether all of it lies inside the image.
template <class Residual, class Warp, class Image, class InputOf>
bool MakePatch(const Image& image, const Vector2<typename Warp::Scalar>& centre,
               std::span<const Eigen::Vector2f> offsets, const InputOf& input_of,
               Patch<Residual, Warp>& patch) {
  using T = typename Warp::Scalar;
  patch.size = 0;
  for (const Eigen::Vector2f& offset_px : offsets) {
    const Vector2<T> offset = offset_px.template cast<T>();
    const Vector2<T> pixel = centre + offset;
    if (!image.Inside(pixel)) return false;
    patch.inputs[patch.size] = input_of(offset);
    patch.references[patch.size++] = Residual::template MakeReference<T>(image.Sample(pixel));
  }
  return true;
}

/// Normal equations of a patch; empty where it is not whole in view.
template <class Residual, class Warp, class Image>
NormalEquations<double, Warp::kParameters> LinearizeWhole(const Residual& residual,
                                                          const Image& image,
                                                          const Patch<Residual, Warp>& patch,
                                                          const RobustLoss<double>& loss,
                                                          const Warp& warp) {
  using T = typename Warp::Scalar;
  NormalEquations<double, Warp::kParameters> sum;
  RobustCost<double> cost(loss);
  LinearizePatch<T>(residual, image, warp, patch.Inputs(), patch.References(),
                    [&](size_t, const auto& r, const auto& J) {
                      const double s = r.squaredNorm();
                      sum.Add(r.template cast<double>(), J.template cast<double>(), loss.Weight(s));
                      cost.Add(s);
                    });
  sum.AddCost(cost.Value(), cost.residuals());
  return sum;
}

/// Finds the warp at which the current image looks like the patch, from `warp` on. The scale of the
/// robust loss is that of the residuals at the start.
/// @return what the solver says; not converged where the patch left the image.
template <class Residual, class Warp, class Image>
SolverSummary AlignPatch(const Residual& residual, const Image& image,
                         const Patch<Residual, Warp>& patch, RobustKind kind,
                         const SolverOptions& options, Warp& warp) {
  using T = typename Warp::Scalar;
  RobustLoss<double> loss{kind};
  if (kind != RobustKind::kNone) {
    std::array<T, kMaxPatternPixels> norms;
    const bool in_view =
        EvaluatePatch<T>(residual, image, warp, patch.Inputs(), patch.References(),
                         [&](size_t k, const auto& r) { norms[k] = r.squaredNorm(); });
    loss.scale = MedianScale(std::span(norms.data(), in_view ? patch.size : 0), Residual::kDim);
  }
  NormalEquations<double, Warp::kParameters> last;
  SolverSummary summary = Minimize<Warp::kParameters>(
      warp, [&](const Warp& w) { return LinearizeWhole(residual, image, patch, loss, w); },
      [](Warp w, const auto& delta) {
        w.Update(delta.template cast<T>());
        return w;
      },
      options, last);
  summary.converged = summary.converged && last.residuals() > 0;
  return summary;
}

}  // namespace sgf::alignment
