#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/core.h>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/core/require.h>

namespace sgf::alignment {
namespace {

using Warp = Se3Warp<float>;
using Input = PixelAtDepth<float>;

constexpr int kBatch = 64;  // points whose sums are taken together, in order

// Coarser levels converge less closely: the next one goes on.
constexpr double kCoarseTolerance = 10;

Vector2<float> PixelOf(const Camera& camera, const Input& input) {
  return {static_cast<float>(camera.fx * input.ray.x() + camera.cx),
          static_cast<float>(camera.fy * input.ray.y() + camera.cy)};
}

double MedianDepth(const std::vector<Input>& inputs) {
  if (inputs.empty()) return 1;
  std::vector<float> depths;
  for (const Input& input : inputs) depths.push_back(input.inverse_depth);
  const auto middle = depths.begin() + static_cast<ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle > 0 ? 1 / *middle : 1;
}

/// Contributions of whole patches at the end, with P parameters.
template <int P>
struct PatchSums {
  NormalEquations<float, P> equations;
  double weight = 0, curvature = 0;  ///< sums over residuals
  Eigen::Matrix<double, P, P> scatter = Eigen::Matrix<double, P, P>::Zero();  ///< of gradients b
  int in_view = 0, inliers = 0;
};

/// Sets the condition and, unless that is hopeless, the pose's covariance: the patches' scatter
/// between inverse curvatures, for which residuals of one patch need not be independent.
template <int P>
void SetCovariance(const Eigen::Matrix<double, P, P>& H, const PatchSums<P>& total,
                   double median_depth, AlignmentResult& result) {
  Eigen::Matrix<double, P, 1> unit = Eigen::Matrix<double, P, 1>::Ones();
  unit.template head<3>().setConstant(median_depth);
  const auto scaled = (unit.asDiagonal() * H * unit.asDiagonal()).eval();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(
      scaled.template topLeftCorner<6, 6>(), Eigen::EigenvaluesOnly);
  const double least = eigen.eigenvalues()(0), most = eigen.eigenvalues()(5);
  result.condition = least > 0 ? most / least : std::numeric_limits<double>::infinity();
  if (!(result.condition < 1e15)) return;
  // The cost's curvature, less than least squares has it; a redescending loss may even turn it
  // negative where hardly anything fits.
  constexpr double kLeastShare = 0.2;
  const double share = std::clamp(total.curvature / total.weight, kLeastShare, 1.0);
  const auto inverse = (share * H).inverse().eval();
  result.covariance = (inverse * total.scatter * inverse).template topLeftCorner<6, 6>();
}

AlignmentFailure FailureOf(int in_view, const AlignmentOptions& options,
                           const AlignmentResult& result) {
  if (in_view < options.min_points) return AlignmentFailure::kFewPoints;
  if (result.overlap < options.min_overlap) return AlignmentFailure::kLittleOverlap;
  if (result.inlier_share < options.min_inlier_share) return AlignmentFailure::kFewInliers;
  if (!(result.condition < options.max_condition) || !result.covariance.allFinite())
    return AlignmentFailure::kIllConditioned;
  return AlignmentFailure::kNone;
}

/// What an alignment is worth by the sums over its patches.
/// @param points patches of the reference, in view or not.
template <int P>
void JudgeSums(const std::vector<PatchSums<P>>& batches, size_t points, double median_depth,
               const AlignmentOptions& options, AlignmentResult& result) {
  PatchSums<P> total;
  NormalEquations<double, P> equations;
  for (const PatchSums<P>& batch : batches) {
    equations += batch.equations;
    total.weight += batch.weight;
    total.curvature += batch.curvature;
    total.scatter += batch.scatter;
    total.in_view += batch.in_view;
    total.inliers += batch.inliers;
  }
  result.mean_cost = equations.MeanCost();
  result.overlap = points ? double(total.in_view) / double(points) : 0;
  result.inlier_share = total.in_view ? double(total.inliers) / total.in_view : 0;
  SetCovariance<P>(equations.H(), total, median_depth, result);
  result.failure = FailureOf(total.in_view, options, result);
}

}  // namespace

class DirectAligner::Engine {
 public:
  virtual ~Engine() = default;
  virtual std::shared_ptr<const Reference> MakeReference(
      const Pyramid& pyramid, std::span<const ReferencePoint> points) const = 0;
  virtual AlignmentResult Align(const Reference& reference, const Pyramid& current,
                                const SE3& guess, int levels) const = 0;
};

template <class Residual>
class DirectAligner::EngineOf : public Engine {
  static constexpr int kParameters = 6 + Residual::kExtraParameters;
  static constexpr int kDim = Residual::kDim;
  using Equations = NormalEquations<double, kParameters>;
  using BatchEquations = NormalEquations<float, kParameters>;
  using Row = typename NormalEquations<float, 6>::Row;
  using Sums = PatchSums<kParameters>;
  using ReferencePixel = typename Residual::template Reference<float>;

  /// Pixels of a level, patch after patch.
  struct Level {
    Camera camera;
    std::vector<Input> inputs = {};
    std::vector<ReferencePixel> pixels = {};
    std::vector<Row> rows = {};  ///< [J r 0] with r to be filled in, kDim for each pixel (inverse)
  };

  struct ReferenceOf : Reference {
    std::vector<Level> levels;
    std::vector<Vector2<float>> gradients;  ///< of the finest level's pixels
    double median_depth = 1;
    size_t points = 0;  ///< of the finest level
  };

  struct State {
    Warp warp;
    Residual residual;
  };

 public:
  EngineOf(const Camera& camera, const AlignmentOptions& options, const Residual& residual)
      : camera_(camera),
        options_(options),
        residual_(residual),
        offsets_(Offsets(options.pattern)) {}

  std::shared_ptr<const Reference> MakeReference(
      const Pyramid& pyramid, std::span<const ReferencePoint> points) const override {
    auto reference = std::make_shared<ReferenceOf>();
    for (int l = 0; l < LevelsOf(pyramid); ++l)
      reference->levels.push_back(MakeLevel(pyramid, l, points));
    const Level& finest = reference->levels.front();
    reference->points = finest.inputs.size() / offsets_.size();
    reference->median_depth = MedianDepth(finest.inputs);
    for (const Input& input : finest.inputs)
      reference->gradients.push_back(
          GradientOf(pyramid.samples[0].Sample(PixelOf(finest.camera, input)).value));
    return reference;
  }

  AlignmentResult Align(const Reference& base, const Pyramid& current, const SE3& guess,
                        int levels) const override {
    const auto& reference = static_cast<const ReferenceOf&>(base);
    AlignmentResult result;
    State state{{camera_, guess}, residual_};
    RobustLoss<float> loss{options_.loss};
    for (int l = std::min(levels, static_cast<int>(reference.levels.size())) - 1; l >= 0; --l) {
      const Level& level = reference.levels[l];
      state.warp = {level.camera, state.warp.T_cur_ref};
      const auto& image = ImageOf(current, l);
      loss.scale = Scale(level, image, state);
      SolverOptions solver = options_.solver;
      if (l > 0) solver.tolerance *= kCoarseTolerance;
      result.iterations += Descend(level, image, loss, solver, state);
    }
    loss.scale = Scale(reference.levels[0], ImageOf(current, 0), state);
    result.T_cur_ref = state.warp.T_cur_ref;
    if constexpr (Residual::kExtraParameters == 2) {
      result.alpha = state.residual.alpha;
      result.beta = state.residual.beta;
    }
    Judge(reference, current, state, loss, result);
    return result;
  }

 private:
  static constexpr bool kOfBitPlanes = std::is_same_v<typename Residual::Channels, BitPlanes>;

  static int LevelsOf(const Pyramid& pyramid) {
    return static_cast<int>(kOfBitPlanes ? pyramid.bit_planes.size() : pyramid.samples.size());
  }

  static const typename Residual::Channels& ImageOf(const Pyramid& pyramid, int level) {
    if constexpr (kOfBitPlanes)
      return pyramid.bit_planes[level];
    else
      return pyramid.samples[level];
  }

  /// Coarser levels have room for fewer points.
  Level MakeLevel(const Pyramid& pyramid, int l, std::span<const ReferencePoint> points) const {
    Level level{.camera = LevelCamera(camera_, l)};
    const auto& image = ImageOf(pyramid, l);
    constexpr size_t kEnough = 150;
    const size_t step = std::clamp<size_t>(points.size() / kEnough, 1, size_t(1) << l);
    for (size_t i = 0; i < points.size(); i += step) AddPatch(image, points[i], l, level);
    if (options_.linearization == Linearization::kInverse) LinearizeAtReference(image, level);
    return level;
  }

  void AddPatch(const typename Residual::Channels& image, const ReferencePoint& point, int l,
                Level& level) const {
    const Eigen::Vector2f centre(static_cast<float>(ToLevel(point.pixel.x(), l)),
                                 static_cast<float>(ToLevel(point.pixel.y(), l)));
    for (const Eigen::Vector2f& offset : offsets_)
      if (!image.template Inside<float>(centre + offset)) return;
    for (const Eigen::Vector2f& offset : offsets_) {
      const Eigen::Vector2f pixel = centre + offset;
      const float scale = static_cast<float>(1 << l);  // px of full size in one of the level
      level.inputs.push_back({RayOf<float>(level.camera, pixel),
                              point.inverse_depth + scale * point.slope.dot(offset),
                              scale * point.slope});
      level.pixels.push_back(
          Residual::template MakeReference<float>(image.template Sample<float>(pixel)));
    }
  }

  void LinearizeAtReference(const typename Residual::Channels& image, Level& level) const {
    const Warp identity(level.camera, SE3{});
    level.rows.assign(level.inputs.size() * kDim, Row::Zero());
    for (size_t first = 0; first < level.inputs.size(); first += offsets_.size())
      LinearizePatch<float>(residual_, image, identity, InputsOf(level, first),
                            PixelsOf(level, first), [&](size_t k, const auto&, const auto& J) {
                              for (int d = 0; d < kDim; ++d)
                                level.rows[(first + k) * kDim + d].template head<6>() =
                                    J.row(d).template head<6>().transpose();
                            });
  }

  std::span<const Input> InputsOf(const Level& level, size_t first) const {
    return {level.inputs.data() + first, offsets_.size()};
  }
  std::span<const ReferencePixel> PixelsOf(const Level& level, size_t first) const {
    return {level.pixels.data() + first, offsets_.size()};
  }

  /// Sum over all patches of body(first pixel, batch sums), in batches added up in order.
  template <class Sum, class Body>
  std::vector<Sum> OverPatches(const Level& level, const Body& body) const {
    const int patches = static_cast<int>(level.inputs.size() / offsets_.size());
    const int batches = (patches + kBatch - 1) / kBatch;
    std::vector<Sum> sums(batches);
    ParallelFor(batches, options_.threads, [&](int batch) {
      for (int p = batch * kBatch; p < std::min(patches, (batch + 1) * kBatch); ++p)
        body(p * offsets_.size(), sums[batch]);
    });
    return sums;
  }

  float Scale(const Level& level, const typename Residual::Channels& image,
              const State& state) const {
    const auto batches =
        OverPatches<std::vector<float>>(level, [&](size_t first, std::vector<float>& norms) {
          EvaluatePatch<float>(state.residual, image, state.warp, InputsOf(level, first),
                               PixelsOf(level, first),
                               [&](size_t, const auto& r) { norms.push_back(r.squaredNorm()); });
        });
    std::vector<float> all;
    for (const auto& norms : batches) all.insert(all.end(), norms.begin(), norms.end());
    return MedianScale(std::span(all), kDim);
  }

  int Descend(const Level& level, const typename Residual::Channels& image,
              const RobustLoss<float>& loss, const SolverOptions& solver, State& state) const {
    Equations last;
    if (options_.linearization == Linearization::kForward) {
      return Minimize<kParameters>(
                 state, [&](const State& s) { return Forward(level, image, loss, s); }, Step,
                 solver, last)
          .iterations;
    }
    if constexpr (Residual::kInverseCompositional) {
      return Minimize<kParameters>(
                 state, [&](const State& s) { return Inverse(level, image, loss, s); }, InverseStep,
                 solver, last)
          .iterations;
    }
    return 0;
  }

  static State Step(const State& state, const typename Equations::Parameters& delta) {
    State next = state;
    next.warp.Update(delta.template head<6>());
    if constexpr (Residual::kExtraParameters == 2) next.residual.Update(delta.template tail<2>());
    return next;
  }

  /// The derivative at the reference is that of a motion before the warp: T <- T (exp(w), v).
  static State InverseStep(const State& state, const typename Equations::Parameters& delta) {
    State next = state;
    next.warp = {state.warp.camera, state.warp.T_cur_ref * Perturbation(delta.template head<6>())};
    return next;
  }

  Equations Forward(const Level& level, const typename Residual::Channels& image,
                    const RobustLoss<float>& loss, const State& state) const {
    Equations total;
    for (const BatchEquations& batch :
         OverPatches<BatchEquations>(level, [&](size_t first, BatchEquations&sum) {
           RobustCost<float> cost(loss);
           LinearizePatch<float>(state.residual, image, state.warp, InputsOf(level, first),
                                 PixelsOf(level, first), [&](size_t, const auto& r, const auto& J) {
                                   const float s = r.squaredNorm();
                                   sum.Add(r, J, loss.Weight(s));
                                   cost.Add(s);
                                 });
           sum.AddCost(cost.Value(), cost.residuals());
         }))
      total += batch;
    return total;
  }

  Equations Inverse(const Level& level, const typename Residual::Channels& image,
                    const RobustLoss<float>& loss, const State& state) const {
    Equations total;
    for (const BatchEquations& batch :
         OverPatches<BatchEquations>(level, [&](size_t first, BatchEquations&sum) {
           RobustCost<float> cost(loss);
           EvaluatePatch<float>(state.residual, image, state.warp, InputsOf(level, first),
                                PixelsOf(level, first), [&](size_t k, const auto& r) {
                                  const float s = r.squaredNorm();
                                  const float weight = loss.Weight(s);
                                  for (int d = 0; d < kDim; ++d) {
                                    Row row = level.rows[(first + k) * kDim + d];
                                    row(6) = r(d);
                                    sum.AddRow(row, weight);
                                  }
                                  cost.Add(s);
                                });
           sum.AddCost(cost.Value(), cost.residuals());
         }))
      total += batch;
    return total;
  }

  void AddToSums(const ReferenceOf& reference, const Pyramid& current, const State& state,
                    const RobustLoss<float>& loss, size_t first, Sums& sum) const {
    const Level& level = reference.levels[0];
    BatchEquations patch;
    RobustCost<float> cost(loss);
    const bool in_view = LinearizePatch<float>(state.residual, ImageOf(current, 0), state.warp,
                                               InputsOf(level, first), PixelsOf(level, first),
                                               [&](size_t, const auto& r, const auto& J) {
                                                 const float s = r.squaredNorm();
                                                 patch.Add(r, J, loss.Weight(s));
                                                 cost.Add(s);
                                                 sum.weight += loss.Weight(s);
                                                 sum.curvature += loss.Curvature(s, kDim);
                                               });
    if (!in_view) return;
    patch.AddCost(cost.Value(), cost.residuals());
    sum.equations += patch;
    sum.scatter += patch.b() * patch.b().transpose();
    ++sum.in_view;
    if (Correlation(reference, current, state.warp, first) >= options_.inlier_correlation)
      ++sum.inliers;
  }

  float Correlation(const ReferenceOf& reference, const Pyramid& current, const Warp& warp,
                    size_t first) const {
    GradientCorrelation correlation;
    for (size_t k = first; k < first + offsets_.size(); ++k) {
      Warp::Point point;
      warp.At(reference.levels[0].inputs[k], point);
      const auto at = current.samples[0].Sample(point.pixel).value;
      correlation.Add(point.A().transpose() * GradientOf(at), reference.gradients[k]);
    }
    return correlation.Value();
  }

  void Judge(const ReferenceOf& reference, const Pyramid& current, const State& state,
             const RobustLoss<float>& loss, AlignmentResult& result) const {
    const std::vector<Sums> batches =
        OverPatches<Sums>(reference.levels[0], [&](size_t first, Sums&sum) {
          AddToSums(reference, current, state, loss, first, sum);
        });
    JudgeSums<kParameters>(batches, reference.points, reference.median_depth, options_, result);
  }

  Camera camera_;
  AlignmentOptions options_;
  Residual residual_;
  std::span<const Eigen::Vector2f> offsets_;
};

void CheckOptions(const AlignmentOptions& options) {
  const ResidualInfo& residual = FindResidual(options.residual);
  if (options.linearization == Linearization::kInverse && !residual.inverse_compositional)
    throw Error("linearization",
                fmt::format("'{}' cannot be linearised at the reference", options.residual));
  Require(options.levels >= 1 && options.levels <= 10, "levels", options.levels, "from 1 to 10");
  Require(options.smallest_side_px >= 8, "smallest_side_px", options.smallest_side_px,
          "at least 8");
  Require(options.solver.max_iterations >= 1, "max_iterations", options.solver.max_iterations,
          "positive");
  Require(options.solver.tolerance >= 0, "tolerance", options.solver.tolerance, "at least 0");
  Require(options.min_points >= 6, "min_points", options.min_points, "at least 6");
  Require(options.inlier_correlation >= -1 && options.inlier_correlation <= 1, "inlier_correlation",
          options.inlier_correlation, "in [-1, 1]");
  Require(options.min_inlier_share >= 0 && options.min_inlier_share <= 1, "min_inlier_share",
          options.min_inlier_share, "in [0, 1]");
  Require(options.min_overlap >= 0 && options.min_overlap <= 1, "min_overlap", options.min_overlap,
          "in [0, 1]");
  Require(options.max_condition > 1, "max_condition", options.max_condition, "above 1");
  Require(options.threads >= 0, "threads", options.threads, "at least 0");
}

DirectAligner::DirectAligner(const Camera& camera, const AlignmentOptions& options)
    : camera_(camera), options_(options) {
  camera.Check();
  if (camera.distorted()) throw Error("camera", "has distortion; rectify its images first");
  CheckOptions(options);
  engine_ = VisitResidual(options.residual, [&](const auto& residual) {
    using Residual = std::remove_cvref_t<decltype(residual)>;
    return std::unique_ptr<const Engine>(
        std::make_unique<EngineOf<Residual>>(camera, options_, residual));
  });
}

DirectAligner::~DirectAligner() = default;
DirectAligner::DirectAligner(DirectAligner&&) noexcept = default;
DirectAligner& DirectAligner::operator=(DirectAligner&&) noexcept = default;

void DirectAligner::MakePyramid(const cv::Mat& grey, Pyramid& pyramid) const {
  if (grey.cols != camera_.width || grey.rows != camera_.height)
    throw Error("image", fmt::format("is {}x{} px; the camera has {}x{}", grey.cols, grey.rows,
                                     camera_.width, camera_.height));
  pyramid.size = grey.size();
  int levels = 1;
  while (levels < options_.levels &&
         (std::min(grey.cols, grey.rows) >> levels) >= options_.smallest_side_px)
    ++levels;
  static thread_local std::vector<cv::Mat1f> greys;  // memory is used again
  GreyPyramid(grey, levels, greys);
  const bool bit_planes = options_.residual == "bit_planes";
  pyramid.samples.resize(bit_planes ? 1 : levels);
  pyramid.bit_planes.resize(bit_planes ? levels : 0);
  for (size_t l = 0; l < pyramid.samples.size(); ++l)
    MakeSampleChannels(greys[l], options_.image, pyramid.samples[l], options_.threads);
  for (size_t l = 0; l < pyramid.bit_planes.size(); ++l)
    MakeBitPlanes(greys[l], pyramid.bit_planes[l]);
}

Pyramid DirectAligner::MakePyramid(const cv::Mat& grey) const {
  Pyramid pyramid;
  MakePyramid(grey, pyramid);
  return pyramid;
}

std::shared_ptr<const DirectAligner::Reference> DirectAligner::MakeReference(
    const Pyramid& pyramid, std::span<const ReferencePoint> points) const {
  return engine_->MakeReference(pyramid, points);
}

AlignmentResult DirectAligner::Align(const Reference& reference, const Pyramid& current,
                                     const SE3& guess, std::optional<int> levels) const {
  Require(levels.value_or(1) >= 1, "levels", levels.value_or(1), "positive");
  return engine_->Align(reference, current, guess, levels.value_or(options_.levels));
}

std::span<const std::pair<const char*, Linearization>> EnumNames(Linearization) {
  static constexpr std::pair<const char*, Linearization> kNames[] = {
      {"forward", Linearization::kForward}, {"inverse", Linearization::kInverse}};
  return kNames;
}

std::span<const std::pair<const char*, AlignmentFailure>> EnumNames(AlignmentFailure) {
  static constexpr std::pair<const char*, AlignmentFailure> kNames[] = {
      {"none", AlignmentFailure::kNone},
      {"few_points", AlignmentFailure::kFewPoints},
      {"little_overlap", AlignmentFailure::kLittleOverlap},
      {"few_inliers", AlignmentFailure::kFewInliers},
      {"ill_conditioned", AlignmentFailure::kIllConditioned}};
  return kNames;
}

}  // namespace sgf::alignment
