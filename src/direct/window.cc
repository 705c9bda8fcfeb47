#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>

#include <ceres/ceres.h>
#include <fmt/core.h>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/direct/window.h>

namespace sgf::direct {
namespace {

using alignment::Pattern;
using Eigen::MatrixXd, Eigen::VectorXd;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Warp = alignment::Se3DepthWarp<float>;

constexpr int kPatchPixels = 8;
constexpr double kHeld = 1e9;  // information of a parameter that is held

using FrameBlock = Eigen::Matrix<double, kFrameParameters, kFrameParameters>;

/// Normal equations in the parameters of all key-frames, inverse depths eliminated.
struct Reduced {
  MatrixXd H;
  VectorXd b;
};

/// Normal equations in the relative parameters of a pair of key-frames.
struct PairSum {
  int host = -1, target = -1;
  FrameBlock H = FrameBlock::Zero();
  FrameParameters b = FrameParameters::Zero();
};

/// delta_rel = delta_cur - Ad(T_cur_ref) delta_ref for left perturbations of both poses.
Matrix6d Adjoint(const SE3& T) {
  const Eigen::Matrix3d R = T.R.toRotationMatrix();
  Eigen::Matrix3d cross;
  cross << 0, -T.p.z(), T.p.y(), T.p.z(), 0, -T.p.x(), -T.p.y(), T.p.x(), 0;
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.bottomRightCorner<3, 3>() = R;
  adjoint.topRightCorner<3, 3>() = cross * R;
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

/// Derivatives are taken where a key-frame is now, unless the prior says where.
void LinearizeHere(Window& window) {
  for (const auto& frame : window) {
    if (frame->in_prior) continue;
    frame->linearization = frame->T_cam_world;
    frame->brightness_linearization = frame->brightness;
  }
}

/// What is known of a brightness beforehand.
class BrightnessCost : public ceres::SizedCostFunction<2, kFrameParameters> {
 public:
  BrightnessCost(const Keyframe& frame, double sigma_a, double sigma_b)
      : sigma_(sigma_a, sigma_b),
        offset_(frame.brightness_linearization.a - frame.log_exposure,
                frame.brightness_linearization.b) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    for (int k = 0; k < 2; ++k) {
      residuals[k] = (offset_(k) + parameters[0][6 + k]) / sigma_(k);
      if (!jacobians || !jacobians[0]) continue;
      double* row = jacobians[0] + k * kFrameParameters;
      std::fill(row, row + kFrameParameters, 0.);
      row[6 + k] = 1 / sigma_(k);
    }
    return true;
  }

 private:
  Eigen::Vector2d sigma_, offset_;
};

/// The prior as a cost: |S x + e|^2 / 2.
class PriorCost : public ceres::CostFunction {
 public:
  explicit PriorCost(const Prior& prior) : root_(SquareRootOf(prior.H(), prior.b())) {
    set_num_residuals(static_cast<int>(root_.e.size()));
    mutable_parameter_block_sizes()->assign(prior.frames().size(), kFrameParameters);
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    Eigen::Map<VectorXd> r(residuals, root_.e.size());
    r = root_.e;
    for (size_t k = 0; k < parameter_block_sizes().size(); ++k) {
      const auto S =
          root_.S.middleCols<kFrameParameters>(kFrameParameters * static_cast<Eigen::Index>(k));
      r += S * Eigen::Map<const FrameParameters>(parameters[k]);
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, kFrameParameters, Eigen::RowMajor>;
      if (jacobians && jacobians[k]) Eigen::Map<RowMajor>(jacobians[k], S.rows(), S.cols()) = S;
    }
    return true;
  }

 private:
  SquareRoot root_;
};

}  // namespace

class WindowOptimizer::Engine {
 public:
  virtual ~Engine() = default;
  virtual WindowSummary Refine(Window& window, const Prior& prior, bool exposures_known) = 0;
  virtual void Marginalize(Window& window,
                           std::span<const std::pair<int, const ActivePoint*>> points,
                           Prior& prior) = 0;
};

template <class Residual>
class WindowOptimizer::EngineOf : public Engine {
  static constexpr int kDim = Residual::kDim;
  static constexpr bool kBrightness = Residual::kExtraParameters == 2;
  /// Parameters of a point between two key-frames: relative pose, inverse depth and, where the
  /// residual has one, relative brightness.
  static constexpr int kRelative = 7 + Residual::kExtraParameters;
  static constexpr int kDepth = 6;  ///< where the inverse depth is among them
  using Reference = typename Residual::template Reference<float>;
  using Equations = alignment::NormalEquations<float, kRelative>;

  /// How one key-frame sees the points of another.
  struct Pair {
    Warp now, linear;  ///< where they are and where derivatives are taken
    Residual residual;
    FrameBlock by_host, by_target;  ///< of relative pose and brightness by the key-frames' own
  };

  /// The pixels of a point.
  struct PointPatch {
    ActivePoint* point = nullptr;
    int host = 0;
    int first = 0, last = 0;  ///< its items
    double depth = 0;         ///< inverse depth now
    double linear_depth = 0;  ///< where it was linearised
    double information = 0;   ///< H_dd
    double slope = 0;         ///< b_d
    std::array<alignment::Vector2<float>, kPatchPixels> rays = {};
    std::array<Reference, kPatchPixels> references = {};
  };

  enum class Sight { kGood, kOutlier, kOutOfView };

  /// A point as a key-frame sees it.
  struct Item {
    int patch = 0, target = 0;
    Sight sight = Sight::kGood;
    double cost = 0;  ///< sum of rho / 2 over the pixels; when out of view, as it was before
    double information = 0, slope = 0;                 ///< its share of H_dd and b_d
    FrameParameters across = FrameParameters::Zero();  ///< H_xd, x relative pose and brightness
  };

  /// The window as a cost function of its key-frames. Inverse depths follow them: they are where
  /// the linearisation has its minimum for the key-frames' parameters, so that the solver has a
  /// small dense problem (the Schur complement of what Ceres would eliminate itself from blocks
  /// that take 13 MB to hand over). Residuals are the square root of the reduced equations and one
  /// more that makes up for the rest of the cost.
  class WindowCost : public ceres::CostFunction {
   public:
    WindowCost(EngineOf& engine, Window& window) : engine_(engine), window_(window) {
      mutable_parameter_block_sizes()->assign(window.size(), kFrameParameters);
      set_num_residuals(kFrameParameters * static_cast<int>(window.size()) + 1);
    }

    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override {
      engine_.MoveTo(window_, parameters);
      Eigen::Map<VectorXd> r(residuals, num_residuals());
      r.setZero();
      const bool linearize = jacobians != nullptr;
      const double cost = engine_.Evaluate(window_, linearize);
      if (!linearize) {
        r(0) = std::sqrt(2 * cost);
        return std::isfinite(cost);
      }
      const Reduced reduced = engine_.Reduce(window_);
      const SquareRoot root = SquareRootOf(reduced.H, reduced.b);
      r.head(root.e.size()) = root.e;
      r(r.size() - 1) = std::sqrt(std::max(0., 2 * cost - root.e.squaredNorm()));
      for (size_t k = 0; k < window_.size(); ++k) {
        if (!jacobians[k]) continue;
        using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, kFrameParameters, Eigen::RowMajor>;
        Eigen::Map<RowMajor> J(jacobians[k], num_residuals(), kFrameParameters);
        J.setZero();
        J.topRows(root.S.rows()) = root.S.template middleCols<kFrameParameters>(
            kFrameParameters * static_cast<Eigen::Index>(k));
      }
      return std::isfinite(cost);
    }

   private:
    EngineOf& engine_;
    Window& window_;
  };

 public:
  EngineOf(const Camera& camera, const WindowOptions& options, int threads)
      : camera_(camera),
        options_(options),
        threads_(threads),
        offsets_(alignment::Offsets(Pattern::kDso8)) {}

  WindowSummary Refine(Window& window, const Prior& prior, bool exposures_known) override {
    LinearizeHere(window);
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
                   Prior& prior) override {
    LinearizeHere(window);
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
    // The prior's parameters count from the linearisation, those here from where it is now.
    prior.Add(ids, reduced.H, reduced.b - reduced.H * x_);
  }

 private:
  template <class Chosen>
  void Collect(Window& window, const Chosen& chosen) {
    patches_.clear();
    items_.clear();
    std::map<int, int> position;
    for (size_t k = 0; k < window.size(); ++k) position[window[k]->id] = static_cast<int>(k);
    for (size_t h = 0; h < window.size(); ++h)
      for (ActivePoint& point : window[h]->points)
        if (chosen(point)) AddPatch(*window[h], static_cast<int>(h), position, point);
    order_.resize(items_.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](int a, int b) { return PairOf(a) < PairOf(b); });
    x_.resize(kFrameParameters * static_cast<Eigen::Index>(window.size()));
    for (size_t k = 0; k < window.size(); ++k) FrameOf(x_, k) = ParametersOf(*window[k]);
    linear_x_ = x_;
  }

  void AddPatch(const Keyframe& host, int h, const std::map<int, int>& position,
                ActivePoint& point) {
    PointPatch patch{.point = &point,
                     .host = h,
                     .first = static_cast<int>(items_.size()),
                     .depth = point.inverse_depth,
                     .linear_depth = point.inverse_depth};
    for (int k = 0; k < kPatchPixels; ++k) {
      const Eigen::Vector2f pixel = point.pixel + offsets_[k];
      patch.rays[k] = alignment::RayOf<float>(camera_, pixel);
      patch.references[k] =
          Residual::template MakeReference<float>(host.image().template Sample<float>(pixel));
    }
    for (const Observation& seen : point.observations)
      items_.push_back(
          {.patch = static_cast<int>(patches_.size()), .target = position.at(seen.target)});
    patch.last = static_cast<int>(items_.size());
    patches_.push_back(patch);
  }

  /// Items of a pair are worked on together: they wait for the same image.
  std::pair<int, int> PairOf(int item) const {
    return {items_[item].target, patches_[items_[item].patch].host};
  }

  static auto FrameOf(VectorXd& x, size_t k) {
    return x.segment<kFrameParameters>(kFrameParameters * static_cast<Eigen::Index>(k));
  }

  /// Takes on the key-frames' parameters, and the inverse depths that go with them.
  void MoveTo(Window& window, double const* const* parameters) {
    for (size_t k = 0; k < window.size(); ++k)
      FrameOf(x_, k) = Eigen::Map<const FrameParameters>(parameters[k]);
    MoveTo(window);
  }

  void MoveTo(Window& window) {
    for (size_t k = 0; k < window.size(); ++k) SetParameters(FrameOf(x_, k), *window[k]);
    if (pairs_.empty()) return;
    const VectorXd step = x_ - linear_x_;
    for (PointPatch& patch : patches_) {
      if (!(patch.information > 0)) continue;
      double slope = patch.slope;
      for (int i = patch.first; i < patch.last; ++i) {
        const Pair& pair = PairAt(window, i);
        slope += items_[i].across.dot(pair.by_host * Segment(step, patch.host) +
                                      pair.by_target * Segment(step, items_[i].target));
      }
      constexpr double kLeastShare = 0.2;  // an inverse depth stays positive
      patch.depth = std::max(patch.linear_depth - slope / patch.information,
                             kLeastShare * patch.linear_depth);
    }
  }

  static FrameParameters Segment(const VectorXd& x, int frame) {
    return x.segment<kFrameParameters>(kFrameParameters * frame);
  }

  const Pair& PairAt(const Window& window, int item) const {
    return pairs_[patches_[items_[item].patch].host * window.size() + items_[item].target];
  }

  Pair MakePair(const Keyframe& host, const Keyframe& target) const {
    const SE3 T_now = target.T_cam_world * host.T_cam_world.Inverse();
    const SE3 T_linear = target.linearization * host.linearization.Inverse();
    Pair pair{
        {camera_, T_now, 0}, {camera_, T_linear, 0}, {}, FrameBlock::Zero(), FrameBlock::Zero()};
    pair.by_target.template topLeftCorner<6, 6>().setIdentity();
    pair.by_host.template topLeftCorner<6, 6>() = -Adjoint(T_linear);
    if constexpr (kBrightness) {
      const RelativeBrightness relative = Between(host.brightness, target.brightness);
      pair.residual.alpha = relative.alpha;
      pair.residual.beta = relative.beta;
      // alpha = a_h - a_t, beta = b_h - exp(alpha) b_t
      const Brightness &a = host.brightness_linearization, &b = target.brightness_linearization;
      const double gain = std::exp(Between(a, b).alpha);
      pair.by_host.template bottomRightCorner<2, 2>() << 1, 0, -gain * b.b, 1;
      pair.by_target.template bottomRightCorner<2, 2>() << -1, 0, gain * b.b, -gain;
    }
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
        const Pair& pair = PairAt(window, order_[k]);
        Equations equations;
        EvaluateItem(window[item.target]->image(), pair, linearize, item, equations);
        if (linearize) Linearize(equations, item, SumOf(sums_[batch], order_[k]));
      }
    });
    double cost = 0;
    for (const Item& item : items_) cost += item.cost;
    if (!linearize) return cost;
    linear_x_ = x_;
    for (PointPatch& patch : patches_) {
      patch.linear_depth = patch.depth;
      patch.information = patch.slope = 0;
      for (int i = patch.first; i < patch.last; ++i) {
        patch.information += items_[i].information;
        patch.slope += items_[i].slope;
      }
    }
    return cost;
  }

  void EvaluateItem(const alignment::SampleChannels& image, const Pair& pair, bool linearize,
                    Item& item, Equations& equations) const {
    const PointPatch& patch = patches_[item.patch];
    const auto depth = static_cast<float>(patch.depth);
    const auto input = [&](int k) {
      return Warp::Input{patch.rays[k], depth, alignment::Vector2<float>::Zero()};
    };
    std::array<Warp::Point, kPatchPixels> now;
    for (int k = 0; k < kPatchPixels; ++k) {
      if (!pair.now.At(input(k), now[k]) || !image.Inside(now[k].pixel)) {
        item.sight = Sight::kOutOfView;
        return;
      }
      image.Prefetch(now[k].pixel);
    }
    const alignment::RobustLoss<float> loss{alignment::RobustKind::kHuber, 1};
    const auto inverse_scale = static_cast<float>(1 / scale_);
    float cost = 0;
    for (int k = 0; k < kPatchPixels; ++k) {
      if (!linearize) {
        cost += loss.Rho(
            (inverse_scale * pair.residual.template Value<float>(image.Value(now[k].pixel),
                                                                 now[k].A(), patch.references[k]))
                .squaredNorm());
        continue;
      }
      const auto at = image.Sample(now[k].pixel);
      const Eigen::Matrix<float, kDim, 1> r =
          inverse_scale *
          pair.residual.template Value<float>(at.value, now[k].A(), patch.references[k]);
      const float s = r.squaredNorm();
      cost += loss.Rho(s);
      Warp::Point linear;
      if (!pair.linear.At(input(k), linear)) {
        item.sight = Sight::kOutOfView;
        return;
      }
      Eigen::Matrix<float, kDim, kRelative> J;
      pair.residual.Linearize(at, linear, patch.references[k], J);
      equations.Add(r, inverse_scale * J, loss.Weight(s));
    }
    // Beyond the limit an observation costs the same however bad it is.
    const double most = options_.max_cost * kPatchPixels;
    item.sight = cost > most ? Sight::kOutlier : Sight::kGood;
    item.cost = 0.5 * std::min<double>(cost, most);
  }

  /// The sum of an item's pair in a batch, whose items are sorted by pairs.
  PairSum& SumOf(std::vector<PairSum>& sums, int item) const {
    const int host = patches_[items_[item].patch].host, target = items_[item].target;
    if (sums.empty() || sums.back().host != host || sums.back().target != target)
      sums.push_back({.host = host, .target = target});
    return sums.back();
  }

  static void Linearize(const Equations& equations, Item& item, PairSum& sum) {
    item.information = item.slope = 0;
    item.across.setZero();
    if (item.sight != Sight::kGood) return;
    const Eigen::Matrix<double, kRelative, kRelative> H = equations.H();
    const Eigen::Matrix<double, kRelative, 1> b = equations.b();
    item.information = H(kDepth, kDepth);
    item.slope = b(kDepth);
    item.across.template head<6>() = H.template block<6, 1>(0, kDepth);
    sum.H.template topLeftCorner<6, 6>() += H.template topLeftCorner<6, 6>();
    sum.b.template head<6>() += b.template head<6>();
    if constexpr (kBrightness) {
      item.across.template tail<2>() = H.template block<2, 1>(7, kDepth);
      sum.H.template topRightCorner<6, 2>() += H.template block<6, 2>(0, 7);
      sum.H.template bottomLeftCorner<2, 6>() += H.template block<2, 6>(7, 0);
      sum.H.template bottomRightCorner<2, 2>() += H.template block<2, 2>(7, 7);
      sum.b.template tail<2>() += b.template tail<2>();
    }
  }

  /// The last linearisation without inverse depths.
  Reduced Reduce(const Window& window) const {
    Reduced total{MatrixXd::Zero(x_.size(), x_.size()), VectorXd::Zero(x_.size())};
    for (const auto& sums : sums_)
      for (const PairSum& sum : sums) AddPair(window, sum, total);
    const int count = static_cast<int>(patches_.size());
    const int batches = (count + kBatch - 1) / kBatch;
    std::vector<Reduced> parts(batches);
    ParallelFor(batches, threads_, [&](int batch) {
      parts[batch] = {MatrixXd::Zero(x_.size(), x_.size()), VectorXd::Zero(x_.size())};
      for (int p = batch * kBatch; p < std::min(count, (batch + 1) * kBatch); ++p)
        SubtractDepth(window, patches_[p], parts[batch]);
    });
    for (const Reduced& part : parts) {
      total.H += part.H;
      total.b += part.b;
    }
    total.H = total.H.template selfadjointView<Eigen::Lower>();
    return total;
  }

  /// Adds to the lower triangle.
  void AddPair(const Window& window, const PairSum& sum, Reduced& total) const {
    constexpr int n = kFrameParameters;
    const int host = sum.host, target = sum.target;
    const Pair& pair = pairs_[host * window.size() + target];
    total.b.segment<n>(n * host) += pair.by_host.transpose() * sum.b;
    total.b.segment<n>(n * target) += pair.by_target.transpose() * sum.b;
    total.H.block<n, n>(n * host, n * host) += pair.by_host.transpose() * sum.H * pair.by_host;
    total.H.block<n, n>(n * target, n * target) +=
        pair.by_target.transpose() * sum.H * pair.by_target;
    const FrameBlock across = pair.by_target.transpose() * sum.H * pair.by_host;
    if (target > host)
      total.H.block<n, n>(n * target, n * host) += across;
    else
      total.H.block<n, n>(n * host, n * target) += across.transpose();
  }

  void SubtractDepth(const Window& window, const PointPatch& patch, Reduced& part) const {
    if (!(patch.information > 0)) return;
    constexpr int n = kFrameParameters;
    std::array<int, 32> frames;
    std::array<FrameParameters, 32> across;
    int count = 1;
    frames[0] = patch.host;
    across[0].setZero();
    for (int i = patch.first; i < patch.last; ++i) {
      if (items_[i].sight != Sight::kGood) continue;
      const Pair& pair = PairAt(window, i);
      across[0] += pair.by_host.transpose() * items_[i].across;
      frames[count] = items_[i].target;
      across[count++] = pair.by_target.transpose() * items_[i].across;
    }
    const double inverse = 1 / patch.information;
    for (int i = 0; i < count; ++i) {
      part.b.segment<n>(n * frames[i]) -= inverse * patch.slope * across[i];
      for (int j = 0; j < count; ++j)
        if (frames[j] <= frames[i])
          part.H.block<n, n>(n * frames[i], n * frames[j]).noalias() -=
              (inverse * across[i]) * across[j].transpose();
    }
  }

  /// Standard deviation of the residuals in view.
  void SetScale(const Window& window) {
    MakePairs(window);
    std::vector<std::array<float, kPatchPixels>> norms(items_.size());
    ParallelForBatches(static_cast<int>(items_.size()), threads_, [&](int k) {
      const int i = order_[k];
      const PointPatch& patch = patches_[items_[i].patch];
      const Pair& pair = PairAt(window, i);
      const auto& image = window[items_[i].target]->image();
      norms[i].fill(-1);
      for (int p = 0; p < kPatchPixels; ++p) {
        Warp::Point point;
        const Warp::Input input{patch.rays[p], static_cast<float>(patch.depth),
                                alignment::Vector2<float>::Zero()};
        if (!pair.now.At(input, point) || !image.Inside(point.pixel)) continue;
        norms[i][p] =
            pair.residual
                .template Value<float>(image.Value(point.pixel), point.A(), patch.references[p])
                .squaredNorm();
      }
    });
    std::vector<float> all;
    for (const auto& some : norms)
      for (float norm : some)
        if (norm >= 0) all.push_back(norm);
    scale_ = alignment::MedianScale(std::span(all), kDim);
    pairs_.clear();
  }

  WindowSummary Solve(Window& window, const Prior& prior, bool exposures_known) {
    ceres::Problem::Options problem_options;
    problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(problem_options);
    std::vector<FrameParameters> frames(window.size());
    std::vector<double*> blocks;
    for (size_t k = 0; k < window.size(); ++k) {
      frames[k] = FrameOf(x_, k);
      blocks.push_back(frames[k].data());
    }
    WindowCost window_cost(*this, window);
    problem.AddResidualBlock(&window_cost, nullptr, blocks);
    std::deque<BrightnessCost> brightness;  // cost functions cannot be moved
    for (size_t k = 0; k < window.size(); ++k) {
      brightness.emplace_back(*window[k],
                              exposures_known ? options_.sigma_a_known : options_.sigma_a,
                              exposures_known ? options_.sigma_b_known : options_.sigma_b);
      problem.AddResidualBlock(&brightness.back(), nullptr, blocks[k]);
    }
    const PriorCost prior_cost(prior);
    std::vector<double*> prior_blocks;
    for (int id : prior.frames())
      for (size_t k = 0; k < window.size(); ++k)
        if (window[k]->id == id) prior_blocks.push_back(blocks[k]);
    if (prior_cost.num_residuals() > 0)
      problem.AddResidualBlock(const_cast<PriorCost*>(&prior_cost), nullptr, prior_blocks);

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
    for (size_t k = 0; k < window.size(); ++k) {
      FrameOf(x_, k) = frames[k];
      summary.usable = summary.usable && frames[k].allFinite();
    }
    if (!summary.usable) {
      x_ = before;
      for (PointPatch& patch : patches_) patch.information = 0;  // depths stay as well
    }
    MoveTo(window);
    return summary;
  }

  void WriteBack(Window& window, WindowSummary& summary) {
    Evaluate(window, true);
    for (PointPatch& patch : patches_) {
      ActivePoint& point = *patch.point;
      point.inverse_depth = patch.depth;
      point.variance = patch.information > 0 ? 1 / patch.information : INFINITY;
      point.observations.clear();
      for (int i = patch.first; i < patch.last; ++i) {
        if (items_[i].sight != Sight::kGood) continue;
        point.observations.push_back(
            {window[items_[i].target]->id, 2 * items_[i].cost / kPatchPixels});
      }
      const int seen = static_cast<int>(point.observations.size());
      point.support = std::max(point.support, seen);
      summary.observations += seen;
      summary.outliers += patch.last - patch.first - seen;
    }
    for (const auto& frame : window)
      std::erase_if(frame->points, [](const ActivePoint& point) {
        return point.observations.empty() || !(point.inverse_depth > 0);
      });
  }

  static constexpr int kBatch = 128;  // of items or points whose sums are taken together, in order

  Camera camera_;
  WindowOptions options_;
  int threads_;
  std::span<const Eigen::Vector2f> offsets_;
  std::vector<PointPatch> patches_;
  std::vector<Item> items_;  ///< those of a point together
  std::vector<int> order_;   ///< of items, pair by pair
  VectorXd x_, linear_x_;    ///< the key-frames' parameters, now and at the last linearisation
  std::vector<Pair> pairs_;  ///< host by host
  std::vector<std::vector<PairSum>> sums_;  ///< of the last linearisation, by batches of items
  double scale_ = 1;
};

namespace {

template <class Residual>
inline constexpr bool kOfWindows =
    std::is_same_v<typename Residual::Channels, alignment::SampleChannels>&&
        alignment::kPointwise<Residual>;

}  // namespace

void CheckOptions(const WindowOptions& options) {
  alignment::VisitResidual(options.residual, [&](const auto& residual) {
    if constexpr (!kOfWindows<std::remove_cvref_t<decltype(residual)>>)
      throw Error("window.residual", fmt::format("'{}' cannot refine a window", options.residual));
  });
  const auto require = [](bool valid, const char* option, double value) {
    if (!valid) throw Error(option, fmt::format("is {}; it has to be positive", value));
  };
  require(options.max_iterations >= 1, "window.max_iterations", options.max_iterations);
  require(options.max_cost > 0, "window.max_cost", options.max_cost);
  require(options.sigma_a > 0, "window.sigma_a", options.sigma_a);
  require(options.sigma_b > 0, "window.sigma_b", options.sigma_b);
  require(options.sigma_a_known > 0, "window.sigma_a_known", options.sigma_a_known);
  require(options.sigma_b_known > 0, "window.sigma_b_known", options.sigma_b_known);
}

WindowOptimizer::WindowOptimizer(const Camera& camera, const WindowOptions& options, int threads) {
  CheckOptions(options);
  engine_ = alignment::VisitResidual(
      options.residual, [&](const auto& residual) -> std::unique_ptr<Engine> {
        using Residual = std::remove_cvref_t<decltype(residual)>;
        if constexpr (kOfWindows<Residual>)
          return std::make_unique<EngineOf<Residual>>(camera, options, threads);
        return nullptr;
      });
}

WindowOptimizer::~WindowOptimizer() = default;

void WindowOptimizer::Anchor(const Keyframe& first) {
  constexpr int n = kFrameParameters;
  Eigen::Matrix<double, n, n> H = Eigen::Matrix<double, n, n>::Zero();
  H.diagonal().head<6>().setConstant(kHeld);
  prior_ = {};
  prior_.Add({first.id}, H, FrameParameters::Zero());
}

WindowSummary WindowOptimizer::Refine(Window& window, bool exposures_known) {
  return engine_->Refine(window, prior_, exposures_known);
}

void WindowOptimizer::Marginalize(Window& window,
                                  std::span<const std::pair<int, const ActivePoint*>> points) {
  engine_->Marginalize(window, points, prior_);
}

void WindowOptimizer::Marginalize(const Keyframe& frame) {
  const auto& frames = prior_.frames();
  if (std::find(frames.begin(), frames.end(), frame.id) != frames.end())
    prior_.Marginalize(frame.id);
}

}  // namespace sgf::direct
