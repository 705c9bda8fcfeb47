#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>

#include <ceres/ceres.h>
#include <fmt/core.h>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/core/require.h>
#include <sgf/core/square_root.h>
#include <sgf/direct/prior_costs.h>
#include <sgf/direct/window.h>
#include <sgf/direct/window_patches.h>

namespace sgf::direct {
namespace {

using Eigen::MatrixXd, Eigen::VectorXd;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kHeld = 1e9;  // information of a parameter that is held

/// Normal equations in the parameters of all key-frames, inverse depths eliminated.
struct Reduced {
  MatrixXd H;
  VectorXd b;
};

/// delta_rel = delta_cur - Ad(T_cur_ref) delta_ref for left perturbations of both poses.
Matrix6d Adjoint(const SE3& T) {
  const Eigen::Matrix3d R = T.R.toRotationMatrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.bottomRightCorner<3, 3>() = R;
  adjoint.topRightCorner<3, 3>() = HatSO3(T.p) * R;
  return adjoint;
}

FrameParameters ParametersOf(const Keyframe& frame) {
  FrameParameters x;
  const Eigen::Quaterniond turn = frame.T_cam_world.R * frame.linearization.R.conjugate();
  x.head<3>() = frame.T_cam_world.p - turn * frame.linearization.p;
  x.segment<3>(3) = LogSO3(turn);
  x(6) = frame.brightness.a - frame.brightness_linearization.a;
  x(7) = frame.brightness.b - frame.brightness_linearization.b;
  return x;
}

void SetParameters(const FrameParameters& x, Keyframe& frame) {
  frame.T_cam_world = alignment::Perturbation(x.head<6>()) * frame.linearization;
  frame.brightness = {frame.brightness_linearization.a + x(6),
                      frame.brightness_linearization.b + x(7)};
}

}  // namespace

class WindowOptimizer::Engine {
  using RelativeByFrame = Eigen::Matrix<double, kRelativeParameters, kFrameParameters>;

  struct Pair : KeyframePair {
    RelativeByFrame by_host, by_target;  ///< of relative parameters by the key-frames' own
  };

  /// Normal equations in the relative parameters of a pair of key-frames.
  struct PairSum {
    int host = -1, target = -1;
    Eigen::Matrix<double, kRelativeParameters, kRelativeParameters> H =
        Eigen::Matrix<double, kRelativeParameters, kRelativeParameters>::Zero();
    RelativeParameters b = RelativeParameters::Zero();
  };

  /// A point of the window; its patch has the same number.
  struct Point {
    ActivePoint* point = nullptr;
    int host = 0;
    int first = 0, last = 0;  ///< its items
    double depth = 0;         ///< inverse depth now
    double linear_depth = 0;  ///< where it was linearised
    double information = 0;   ///< H_dd
    double slope = 0;         ///< b_d
  };

  enum class Sight { kGood, kOutlier, kOutOfView };

  /// A point as a key-frame sees it.
  struct Item {
    int point = 0, target = 0;
    Sight sight = Sight::kGood;
    double cost = 0;  ///< sum of rho / 2 over the pixels; when out of view, as it was before
    double information = 0, slope = 0;                       ///< its share of H_dd and b_d
    RelativeParameters across = RelativeParameters::Zero();  ///< H_xd, 0 for the depth itself
  };

  /// The window as a cost function of its key-frames. Inverse depths follow them: they are where
  /// the linearisation has its minimum for the key-frames' parameters, so that the solver has a
  /// small dense problem (the Schur complement of what Ceres would eliminate itself from blocks
  /// that take 13 MB to hand over). Residuals are the square root of the reduced equations and one
  /// more that makes up for the rest of the cost.
  class WindowCost : public ceres::CostFunction {
   public:
    WindowCost(Engine& engine, Window& window) : engine_(engine), window_(window) {
      mutable_parameter_block_sizes()->assign(engine.Blocks(window), kFrameParameters);
      set_num_residuals(kFrameParameters * static_cast<int>(engine.Blocks(window)) + 1);
    }

    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override {
      engine_.MoveTo(window_, parameters);
      const double cost = engine_.Evaluate(window_, jacobians != nullptr);
      if (!jacobians) {
        std::fill_n(residuals, num_residuals(), 0.);
        residuals[0] = std::sqrt(2 * cost);
        return std::isfinite(cost);
      }
      const Reduced reduced = engine_.Reduce(window_);
      EvaluateReduced(cost, reduced.H, reduced.b, parameter_block_sizes(), residuals, jacobians);
      return std::isfinite(cost);
    }

   private:
    Engine& engine_;
    Window& window_;
  };

 public:
  Engine(const Camera& camera, const WindowOptions& options, int threads)
      : given_camera_(camera),
        camera_(camera),
        camera_linearization_(camera),
        options_(options),
        refines_camera_(options.sigma_intrinsics > 0),
        threads_(threads),
        patches_(MakeWindowPatches(options.residual, camera, refines_camera_)) {
    by_camera_.setZero();
    if (refines_camera_)
      by_camera_.block<kIntrinsics, kIntrinsics>(kRelativeCamera, 0).setIdentity();
  }

  const Camera& camera() const { return camera_; }

  WindowSummary Refine(Window& window, const Prior& prior, bool exposures_known) {
    LinearizeHere(window, prior);
    Collect(window, [](const ActivePoint&) { return true; });
    WindowSummary summary;
    if (items_.empty()) return summary;
    SetScale(window);
    summary = Solve(window, prior, exposures_known);
    summary.scale = scale_;
    if (summary.usable) WriteBack(window, summary);
    return summary;
  }

  void Marginalize(Window& window, std::span<const std::pair<int, const ActivePoint*>> points,
                   Prior& prior) {
    LinearizeHere(window, prior);
    std::vector<const ActivePoint*> chosen;
    for (const auto& [host, point] : points) chosen.push_back(point);
    std::sort(chosen.begin(), chosen.end());
    Collect(window, [&](const ActivePoint& point) {
      return std::binary_search(chosen.begin(), chosen.end(), &point);
    });
    if (items_.empty()) return;
    Evaluate(window, true);
    const Reduced reduced = Reduce(window);
    std::vector<int> ids;
    for (const auto& frame : window) {
      ids.push_back(frame->id);
      frame->in_prior = true;
    }
    if (refines_camera_) ids.push_back(kCameraId);
    // The prior's parameters count from the linearisation, those here from where it is now.
    prior.Add(ids, reduced.H, reduced.b - reduced.H * x_);
  }

  /// Adds what is known of a key-frame's brightness beforehand.
  void AddBrightness(const Keyframe& frame, bool exposures_known, Prior& prior) const {
    const BrightnessBelief belief = BrightnessKnown(frame, exposures_known);
    const Eigen::Array2d weight = belief.sigma.array().square().inverse();
    FrameParameters H = FrameParameters::Zero(), b = H;
    H.tail<2>() = weight;
    b.tail<2>() = weight * belief.offset.array();
    prior.Add({frame.id}, H.asDiagonal().toDenseMatrix(), b);
  }

 private:
  static auto FrameOf(VectorXd& x, size_t k) {
    return x.segment<kFrameParameters>(kFrameParameters * static_cast<Eigen::Index>(k));
  }

  /// Parameter blocks of a window: its key-frames and maybe the camera.
  size_t Blocks(const Window& window) const { return window.size() + (refines_camera_ ? 1 : 0); }

  /// Derivatives are taken where things are now, unless the prior says where.
  void LinearizeHere(Window& window, const Prior& prior) {
    for (const auto& frame : window) {
      if (frame->in_prior) continue;
      frame->linearization = frame->T_cam_world;
      frame->brightness_linearization = frame->brightness;
    }
    const auto& known = prior.frames();
    if (std::find(known.begin(), known.end(), kCameraId) == known.end())
      camera_linearization_ = camera_;
  }

  template <class Chosen>
  void Collect(Window& window, const Chosen& chosen) {
    patches_->Clear();
    points_.clear();
    items_.clear();
    std::map<int, int> position;
    for (size_t k = 0; k < window.size(); ++k) position[window[k]->id] = static_cast<int>(k);
    for (size_t h = 0; h < window.size(); ++h)
      for (ActivePoint& point : window[h]->points)
        if (chosen(point)) AddPoint(*window[h], static_cast<int>(h), position, point);
    order_.resize(items_.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](int a, int b) { return PairOf(a) < PairOf(b); });
    x_.setZero(kFrameParameters * static_cast<Eigen::Index>(Blocks(window)));
    for (size_t k = 0; k < window.size(); ++k) FrameOf(x_, k) = ParametersOf(*window[k]);
    if (refines_camera_)
      for (int k = 0; k < kIntrinsics; ++k)
        FrameOf(x_, window.size())(k) =
            *IntrinsicsOf(camera_)[k] - *IntrinsicsOf(camera_linearization_)[k];
    linear_x_ = x_;
  }

  void AddPoint(const Keyframe& host, int h, const std::map<int, int>& position,
                ActivePoint& point) {
    patches_->Add(host.image(), point.pixel);
    const int first = static_cast<int>(items_.size());
    for (const Observation& seen : point.observations)
      items_.push_back(
          {.point = static_cast<int>(points_.size()), .target = position.at(seen.target)});
    points_.push_back({.point = &point,
                       .host = h,
                       .first = first,
                       .last = static_cast<int>(items_.size()),
                       .depth = point.inverse_depth,
                       .linear_depth = point.inverse_depth});
  }

  /// Items of a pair are worked on together: they wait for the same image.
  std::pair<int, int> PairOf(int item) const {
    return {items_[item].target, points_[items_[item].point].host};
  }

  /// Takes on the key-frames' parameters, and the inverse depths that go with them.
  void MoveTo(Window& window, double const* const* parameters) {
    for (size_t k = 0; k < Blocks(window); ++k)
      FrameOf(x_, k) = Eigen::Map<const FrameParameters>(parameters[k]);
    MoveTo(window);
  }

  void MoveTo(Window& window) {
    for (size_t k = 0; k < window.size(); ++k) SetParameters(FrameOf(x_, k), *window[k]);
    if (refines_camera_)
      for (int k = 0; k < kIntrinsics; ++k)
        *IntrinsicsOf(camera_)[k] =
            *IntrinsicsOf(camera_linearization_)[k] + FrameOf(x_, window.size())(k);
    if (pairs_.empty()) return;
    const VectorXd step = x_ - linear_x_;
    std::vector<RelativeParameters> relative;  // of each pair
    for (size_t k = 0; k < pairs_.size(); ++k) {
      const int host = static_cast<int>(k / window.size()),
                target = static_cast<int>(k % window.size());
      relative.push_back(pairs_[k].by_host * Segment(step, host) +
                         pairs_[k].by_target * Segment(step, target));
      if (refines_camera_)
        relative.back() += by_camera_ * Segment(step, static_cast<int>(window.size()));
    }
    for (Point& point : points_) {
      if (!(point.information > 0)) continue;
      double slope = point.slope;
      for (int i = point.first; i < point.last; ++i) {
        slope += items_[i].across.dot(relative[PairIndex(window, i)]);
      }
      constexpr double kLeastShare = 0.2;  // an inverse depth stays positive
      point.depth = std::max(point.linear_depth - slope / point.information,
                             kLeastShare * point.linear_depth);
    }
  }

  static FrameParameters Segment(const VectorXd& x, int frame) {
    return x.segment<kFrameParameters>(kFrameParameters * frame);
  }

  size_t PairIndex(const Window& window, int item) const {
    return points_[items_[item].point].host * window.size() + items_[item].target;
  }
  const Pair& PairAt(const Window& window, int item) const {
    return pairs_[PairIndex(window, item)];
  }

  Pair MakePair(const Keyframe& host, const Keyframe& target) const {
    const SE3 T_now = target.T_cam_world * host.T_cam_world.Inverse();
    const SE3 T_linear = target.linearization * host.linearization.Inverse();
    Pair pair{{{camera_, T_now, 0, given_camera_},
               {camera_linearization_, T_linear, 0, given_camera_},
               Between(host.brightness, target.brightness)},
              RelativeByFrame::Zero(),
              RelativeByFrame::Zero()};
    pair.by_target.topLeftCorner<6, 6>().setIdentity();
    pair.by_host.topLeftCorner<6, 6>() = -Adjoint(T_linear);
    // alpha = a_h - a_t, beta = b_h - exp(alpha) b_t
    const Brightness &a = host.brightness_linearization, &b = target.brightness_linearization;
    const double gain = std::exp(Between(a, b).alpha);
    pair.by_host.block<2, 2>(kRelativeBrightness, 6) << 1, 0, -gain * b.b, 1;
    pair.by_target.block<2, 2>(kRelativeBrightness, 6) << -1, 0, gain * b.b, -gain;
    return pair;
  }

  void MakePairs(const Window& window) {
    pairs_.clear();
    for (const auto& host : window)
      for (const auto& target : window) pairs_.push_back(MakePair(*host, *target));
  }

  /// Cost of the window as it is now, and with `linearize` all that Reduce() and MoveTo() need.
  double Evaluate(const Window& window, bool linearize) {
    MakePairs(window);
    const int count = static_cast<int>(items_.size());
    const int batches = (count + kBatch - 1) / kBatch;
    if (linearize) sums_.assign(batches, {});
    ParallelFor(batches, threads_, [&](int batch) {
      for (int k = batch * kBatch; k < std::min(count, (batch + 1) * kBatch); ++k) {
        Item& item = items_[order_[k]];
        if (linearize)
          Linearize(window, item, PairAt(window, order_[k]), SumOf(sums_[batch], order_[k]));
        else
          Judge(patches_->Cost(item.point, points_[item.point].depth, PairAt(window, order_[k]),
                               window[item.target]->image(), scale_),
                item);
      }
    });
    double cost = 0;
    for (const Item& item : items_) cost += item.cost;
    if (!linearize) return cost;
    linear_x_ = x_;
    for (Point& point : points_) {
      point.linear_depth = point.depth;
      point.information = point.slope = 0;
      for (int i = point.first; i < point.last; ++i) {
        point.information += items_[i].information;
        point.slope += items_[i].slope;
      }
    }
    return cost;
  }

  /// Beyond a limit an observation costs the same however bad it is.
  void Judge(const std::optional<double>& cost, Item& item) const {
    const double most = options_.max_cost * kPatchPixels;
    if (!cost) {
      item.sight = Sight::kOutOfView;
      return;
    }
    item.sight = *cost > most ? Sight::kOutlier : Sight::kGood;
    item.cost = 0.5 * std::min(*cost, most);
  }

  /// The sum of an item's pair in a batch, whose items are sorted by pairs.
  PairSum& SumOf(std::vector<PairSum>& sums, int item) const {
    const int host = points_[items_[item].point].host, target = items_[item].target;
    if (sums.empty() || sums.back().host != host || sums.back().target != target)
      sums.push_back({.host = host, .target = target});
    return sums.back();
  }

  void Linearize(const Window& window, Item& item, const Pair& pair, PairSum& sum) const {
    RelativeEquations equations;
    Judge(patches_->Linearize(item.point, points_[item.point].depth, pair,
                              window[item.target]->image(), scale_, equations),
          item);
    item.information = item.slope = 0;
    item.across.setZero();
    if (item.sight != Sight::kGood) return;
    if (refines_camera_) {
      sum.H += equations.H;
    } else {
      constexpr int n = kRelativeCamera;  // all that plays a part
      sum.H.topLeftCorner<n, n>() += equations.H.topLeftCorner<n, n>();
    }
    sum.b += equations.b;
    item.information = equations.H(kRelativeDepth, kRelativeDepth);
    item.slope = equations.b(kRelativeDepth);
    item.across = equations.H.col(kRelativeDepth);
    item.across(kRelativeDepth) = 0;
  }

  /// The last linearisation without inverse depths.
  Reduced Reduce(const Window& window) const {
    Reduced total{MatrixXd::Zero(x_.size(), x_.size()), VectorXd::Zero(x_.size())};
    for (const auto& sums : sums_)
      for (const PairSum& sum : sums) AddPair(window, sum, total);
    const int count = static_cast<int>(points_.size());
    const int batches = (count + kBatch - 1) / kBatch;
    std::vector<Reduced> parts(batches);
    ParallelFor(batches, threads_, [&](int batch) {
      parts[batch] = {MatrixXd::Zero(x_.size(), x_.size()), VectorXd::Zero(x_.size())};
      for (int p = batch * kBatch; p < std::min(count, (batch + 1) * kBatch); ++p)
        SubtractDepth(window, points_[p], parts[batch]);
    });
    for (const Reduced& part : parts) {
      total.H += part.H;
      total.b += part.b;
    }
    total.H = total.H.selfadjointView<Eigen::Lower>();
    return total;
  }

  /// Adds to the lower triangle.
  void AddPair(const Window& window, const PairSum& sum, Reduced& total) const {
    constexpr int n = kFrameParameters;
    const Pair& pair = pairs_[sum.host * window.size() + sum.target];
    const int camera = static_cast<int>(window.size());
    const std::array<std::pair<int, const RelativeByFrame*>, 3> blocks = {
        {{sum.host, &pair.by_host}, {sum.target, &pair.by_target}, {camera, &by_camera_}}};
    for (const auto& [row, by_row] : std::span(blocks).first(refines_camera_ ? 3 : 2)) {
      total.b.segment<n>(n * row) += by_row->transpose() * sum.b;
      const Eigen::Matrix<double, n, kRelativeParameters> to_row = by_row->transpose() * sum.H;
      for (const auto& [col, by_col] : std::span(blocks).first(refines_camera_ ? 3 : 2))
        if (col <= row) total.H.block<n, n>(n * row, n * col) += to_row * *by_col;
    }
  }

  void SubtractDepth(const Window& window, const Point& point, Reduced& part) const {
    if (!(point.information > 0)) return;
    constexpr int n = kFrameParameters;
    constexpr size_t kMostBlocks = kMostKeyframes + 2;  // the newest and the camera as well
    std::array<int, kMostBlocks> blocks;
    std::array<FrameParameters, kMostBlocks> across;
    int count = 1;
    blocks[0] = point.host;
    across[0].setZero();
    RelativeParameters sum = RelativeParameters::Zero();
    for (int i = point.first; i < point.last; ++i) {
      if (items_[i].sight != Sight::kGood) continue;
      const Pair& pair = PairAt(window, i);
      across[0] += pair.by_host.transpose().lazyProduct(items_[i].across);
      blocks[count] = items_[i].target;
      across[count++] = pair.by_target.transpose().lazyProduct(items_[i].across);
      sum += items_[i].across;
    }
    if (refines_camera_) {
      blocks[count] = static_cast<int>(window.size());
      across[count++] = by_camera_.transpose() * sum;
    }
    const double inverse = 1 / point.information;
    for (int i = 0; i < count; ++i) {
      part.b.segment<n>(n * blocks[i]) -= inverse * point.slope * across[i];
      for (int j = 0; j < count; ++j)
        if (blocks[j] <= blocks[i])
          part.H.block<n, n>(n * blocks[i], n * blocks[j]).noalias() -=
              (inverse * across[i]) * across[j].transpose();
    }
  }

  /// Standard deviation of the residuals in view, from some of the observations.
  void SetScale(const Window& window) {
    MakePairs(window);
    constexpr size_t kStride = 4;
    std::vector<std::array<float, kPatchPixels>> norms((items_.size() + kStride - 1) / kStride);
    std::vector<int> counts(norms.size());
    ParallelForBatches(static_cast<int>(norms.size()), threads_, [&](int k) {
      const int i = order_[kStride * k];
      counts[k] =
          patches_->SquaredNorms(items_[i].point, points_[items_[i].point].depth, PairAt(window, i),
                                 window[items_[i].target]->image(), norms[k]);
    });
    std::vector<float> all;
    for (size_t k = 0; k < norms.size(); ++k)
      all.insert(all.end(), norms[k].begin(), norms[k].begin() + counts[k]);
    scale_ = std::max<double>(alignment::MedianScale(std::span(all), patches_->dim()),
                              patches_->least_scale());
    pairs_.clear();
  }

  WindowSummary Solve(Window& window, const Prior& prior, bool exposures_known) {
    ceres::Problem::Options problem_options;
    problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(problem_options);
    std::vector<FrameParameters> parameters(Blocks(window));
    std::vector<double*> blocks;
    for (size_t k = 0; k < parameters.size(); ++k) {
      parameters[k] = FrameOf(x_, k);
      blocks.push_back(parameters[k].data());
    }
    WindowCost window_cost(*this, window);
    problem.AddResidualBlock(&window_cost, nullptr, blocks);
    std::deque<BrightnessCost> brightness;  // cost functions cannot be moved
    for (size_t k = 0; k < window.size(); ++k) {
      brightness.emplace_back(BrightnessKnown(*window[k], exposures_known));
      problem.AddResidualBlock(&brightness.back(), nullptr, blocks[k]);
    }
    CameraCost camera_cost(camera_linearization_, given_camera_, options_.sigma_intrinsics);
    if (refines_camera_) problem.AddResidualBlock(&camera_cost, nullptr, blocks.back());
    PriorCost prior_cost(prior);
    std::vector<double*> prior_blocks;
    for (int id : prior.frames()) {
      if (id == kCameraId) prior_blocks.push_back(blocks.back());
      for (size_t k = 0; k < window.size(); ++k)
        if (window[k]->id == id) prior_blocks.push_back(blocks[k]);
    }
    if (prior_cost.num_residuals() > 0)
      problem.AddResidualBlock(&prior_cost, nullptr, prior_blocks);

    const VectorXd before = x_;
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = options_.max_iterations;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-4;
    ceres::Solver::Summary report;
    ceres::Solve(options, &problem, &report);
    WindowSummary summary;
    summary.iterations = static_cast<int>(report.iterations.size());
    summary.usable = report.IsSolutionUsable();
    for (size_t k = 0; k < parameters.size(); ++k) {
      FrameOf(x_, k) = parameters[k];
      summary.usable = summary.usable && parameters[k].allFinite();
    }
    if (refines_camera_) summary.usable = summary.usable && IsPlausible(parameters.back());
    if (!summary.usable) {
      x_ = before;
      for (Point& point : points_) point.information = 0;  // depths stay as well
    }
    MoveTo(window);
    return summary;
  }

  /// Whether the focal lengths are within a factor of two of those given.
  bool IsPlausible(const FrameParameters& camera) const {
    const double fx = camera_linearization_.fx + camera(0),
                 fy = camera_linearization_.fy + camera(1);
    const auto near = [](double a, double b) { return a > 0.5 * b && a < 2 * b; };
    return near(fx, given_camera_.fx) && near(fy, given_camera_.fy);
  }

  BrightnessBelief BrightnessKnown(const Keyframe& frame, bool exposures_known) const {
    const Eigen::Vector2d sigma =
        exposures_known ? Eigen::Vector2d(options_.sigma_a_known, options_.sigma_b_known)
                        : Eigen::Vector2d(options_.sigma_a, options_.sigma_b);
    // Where the residual says nothing of brightness it stays as tracking found it.
    const bool stays = !patches_->has_brightness() && !exposures_known;
    const Brightness expected = stays ? frame.brightness : Brightness{frame.log_exposure, 0};
    return {sigma,
            {frame.brightness_linearization.a - expected.a,
             frame.brightness_linearization.b - expected.b}};
  }

  void WriteBack(Window& window, WindowSummary& summary) {
    Evaluate(window, true);
    for (const Point& from : points_) {
      ActivePoint& point = *from.point;
      point.inverse_depth = from.depth;
      point.variance = from.information > 0 ? 1 / from.information : INFINITY;
      std::vector<Observation> good;
      for (int i = from.first; i < from.last; ++i) {
        if (items_[i].sight != Sight::kGood) continue;
        Observation& observation = good.emplace_back(point.observations[i - from.first]);
        point.support += !observation.counted;
        observation.counted = true;
      }
      point.observations = std::move(good);
      const int seen = static_cast<int>(point.observations.size());
      summary.observations += seen;
      summary.outliers += from.last - from.first - seen;
    }
    for (const auto& frame : window)
      std::erase_if(frame->points, [](const ActivePoint& point) {
        return point.observations.empty() || !(point.inverse_depth > 0);
      });
  }

  static constexpr int kBatch = 128;  // of items or points whose sums are taken together, in order

  Camera given_camera_, camera_, camera_linearization_;
  RelativeByFrame by_camera_;  ///< of relative parameters by the camera's
  WindowOptions options_;
  bool refines_camera_;
  int threads_;
  std::unique_ptr<WindowPatches> patches_;
  std::vector<Point> points_;
  std::vector<Item> items_;  ///< those of a point together
  std::vector<int> order_;   ///< of items, pair by pair
  VectorXd x_, linear_x_;    ///< the key-frames' parameters, now and at the last linearisation
  std::vector<Pair> pairs_;  ///< host by host
  std::vector<std::vector<PairSum>> sums_;  ///< of the last linearisation, by batches of items
  double scale_ = 1;
};

void CheckOptions(const WindowOptions& options) {
  if (!HasWindowPatches(options.residual, false))
    throw Error("window.residual", fmt::format("'{}' cannot refine a window", options.residual));
  if (options.sigma_intrinsics > 0 && !HasWindowPatches(options.residual, true))
    throw Error("window.sigma_intrinsics",
                fmt::format("has to be 0 with '{}': only 'photo_affine' refines the camera",
                            options.residual));
  Require(options.sigma_intrinsics >= 0, "window.sigma_intrinsics", options.sigma_intrinsics,
          "at least 0");
  Require(options.max_iterations >= 1, "window.max_iterations", options.max_iterations, "positive");
  Require(options.max_cost > 0, "window.max_cost", options.max_cost, "positive");
  Require(options.sigma_a > 0, "window.sigma_a", options.sigma_a, "positive");
  Require(options.sigma_b > 0, "window.sigma_b", options.sigma_b, "positive");
  Require(options.sigma_a_known > 0, "window.sigma_a_known", options.sigma_a_known, "positive");
  Require(options.sigma_b_known > 0, "window.sigma_b_known", options.sigma_b_known, "positive");
}

WindowOptimizer::WindowOptimizer(const Camera& camera, const WindowOptions& options, int threads) {
  CheckOptions(options);
  engine_ = std::make_unique<Engine>(camera, options, threads);
}

WindowOptimizer::~WindowOptimizer() = default;

const Camera& WindowOptimizer::camera() const { return engine_->camera(); }

void WindowOptimizer::Anchor(Keyframe& first) {
  first.in_prior = true;
  first.linearization = first.T_cam_world;
  first.brightness_linearization = first.brightness;
  constexpr int n = kFrameParameters;
  Eigen::Matrix<double, n, n> H = Eigen::Matrix<double, n, n>::Zero();
  H.diagonal().head<6>().setConstant(kHeld);
  prior_ = {};
  prior_.Add({first.id}, H, FrameParameters::Zero());
}

WindowSummary WindowOptimizer::Refine(Window& window, bool exposures_known) {
  exposures_known_ = exposures_known;
  return engine_->Refine(window, prior_, exposures_known);
}

void WindowOptimizer::Marginalize(Window& window,
                                  std::span<const std::pair<int, const ActivePoint*>> points) {
  engine_->Marginalize(window, points, prior_);
}

void WindowOptimizer::Marginalize(const Keyframe& frame) {
  const auto& frames = prior_.frames();
  if (std::find(frames.begin(), frames.end(), frame.id) == frames.end()) return;
  engine_->AddBrightness(frame, exposures_known_, prior_);
  prior_.Marginalize(frame.id);
}

}  // namespace sgf::direct
