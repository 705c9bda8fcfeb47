#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>

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
  explicit PriorCost(const Prior& prior) : root_(prior.Root()) {
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
  Prior::SquareRoot root_;
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
  static constexpr int kRows = kPatchPixels * kDim;
  static constexpr int kRelative = 7 + Residual::kExtraParameters;
  static constexpr bool kBrightness = Residual::kExtraParameters == 2;
  using Reference = typename Residual::template Reference<float>;
  using FrameJacobian = Eigen::Matrix<double, kRows, kFrameParameters, Eigen::RowMajor>;
  using Rows = Eigen::Matrix<double, kRows, 1>;

  /// How one key-frame sees the points of another.
  struct Pair {
    Warp now, linear;  ///< where they are and where derivatives are taken
    Residual residual;
    Matrix6d adjoint;
    double gain = 1, target_b = 0;  ///< of the brightness where derivatives are taken
  };

  /// The pixels of a point.
  struct PointPatch {
    ActivePoint* point = nullptr;
    int host = 0;
    double depth = 0;  ///< inverse depth, the solver's parameter
    std::array<alignment::Vector2<float>, kPatchPixels> rays = {};
    std::array<Reference, kPatchPixels> references = {};
  };

  enum class Sight { kGood, kOutlier, kOutOfView };

  /// A point as a key-frame sees it.
  struct Item {
    int patch = 0, target = 0;
    Sight sight = Sight::kGood;
    double mean_cost = 0;
    Rows residual = Rows::Zero();
    FrameJacobian d_host = FrameJacobian::Zero(), d_target = FrameJacobian::Zero();
    Rows d_depth = Rows::Zero();
  };

  /// A residual block whose numbers are computed by Evaluate(), all at once.
  class ItemCost : public ceres::SizedCostFunction<kRows, kFrameParameters, kFrameParameters, 1> {
   public:
    explicit ItemCost(const Item& item) : item_(item) {}
    bool Evaluate(double const* const* /*parameters*/, double* residuals,
                  double** jacobians) const override {
      Copy(item_.residual, residuals);
      if (!jacobians) return true;
      if (jacobians[0]) Copy(item_.d_host, jacobians[0]);
      if (jacobians[1]) Copy(item_.d_target, jacobians[1]);
      if (jacobians[2]) Copy(item_.d_depth, jacobians[2]);
      return true;
    }

   private:
    template <class M>
    static void Copy(const M& from, double* to) {
      std::copy(from.data(), from.data() + from.size(), to);
    }
    const Item& item_;
  };

  class Callback : public ceres::EvaluationCallback {
   public:
    Callback(EngineOf& engine, Window& window) : engine_(engine), window_(window) {}
    void PrepareForEvaluation(bool jacobians, bool /*new_point*/) override {
      engine_.UseParameters(window_);
      engine_.Evaluate(window_, jacobians);
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
    Collect(window, [](const Keyframe&, const ActivePoint&) { return true; });
    WindowSummary summary;
    summary.scale = SetScale(window);
    if (items_.empty()) return summary;
    summary = Solve(window, prior, exposures_known);
    summary.scale = scale_;
    if (!summary.usable) return summary;
    Evaluate(window, true);
    WriteBack(window, summary);
    return summary;
  }

  void Marginalize(Window& window, std::span<const std::pair<int, const ActivePoint*>> points,
                   Prior& prior) override {
    LinearizeHere(window);
    std::vector<const ActivePoint*> chosen;
    for (const auto& [host, point] : points) chosen.push_back(point);
    std::sort(chosen.begin(), chosen.end());
    Collect(window, [&](const Keyframe&, const ActivePoint& point) {
      return std::binary_search(chosen.begin(), chosen.end(), &point);
    });
    if (items_.empty()) return;
    Evaluate(window, true);
    const Eigen::Index size = kFrameParameters * static_cast<Eigen::Index>(window.size());
    MatrixXd H = MatrixXd::Zero(size, size);
    VectorXd b = VectorXd::Zero(size);
    for (size_t first = 0; first < items_.size();) {
      size_t last = first;
      while (last < items_.size() && items_[last].patch == items_[first].patch) ++last;
      AddWithoutPoint(std::span(items_).subspan(first, last - first), H, b);
      first = last;
    }
    std::vector<int> ids;
    for (const auto& frame : window) {
      ids.push_back(frame->id);
      frame->in_prior = true;
    }
    prior.Add(ids, H, b);
  }

 private:
  template <class Chosen>
  void Collect(Window& window, const Chosen& chosen) {
    patches_.clear();
    items_.clear();
    std::map<int, int> position;
    for (size_t k = 0; k < window.size(); ++k) position[window[k]->id] = static_cast<int>(k);
    for (size_t h = 0; h < window.size(); ++h)
      for (ActivePoint& point : window[h]->points) {
        if (!chosen(*window[h], point)) continue;
        PointPatch patch{.point = &point, .host = static_cast<int>(h)};
        patch.depth = point.inverse_depth;
        for (int k = 0; k < kPatchPixels; ++k) {
          const Eigen::Vector2f pixel = point.pixel + offsets_[k];
          patch.rays[k] = alignment::RayOf<float>(camera_, pixel);
          patch.references[k] = Residual::template MakeReference<float>(
              window[h]->image().template Sample<float>(pixel));
        }
        for (const Observation& seen : point.observations)
          items_.push_back(
              {.patch = static_cast<int>(patches_.size()), .target = position.at(seen.target)});
        patches_.push_back(patch);
      }
    frames_.resize(window.size());
    for (size_t k = 0; k < window.size(); ++k) frames_[k] = ParametersOf(*window[k]);
  }

  void UseParameters(Window& window) {
    for (size_t k = 0; k < window.size(); ++k) SetParameters(frames_[k], *window[k]);
  }

  Pair MakePair(const Keyframe& host, const Keyframe& target) const {
    const SE3 T_now = target.T_cam_world * host.T_cam_world.Inverse();
    const SE3 T_linear = target.linearization * host.linearization.Inverse();
    Pair pair{{camera_, T_now, 0}, {camera_, T_linear, 0}, {}, Adjoint(T_linear)};
    if constexpr (kBrightness) {
      const RelativeBrightness relative = Between(host.brightness, target.brightness);
      pair.residual.alpha = relative.alpha;
      pair.residual.beta = relative.beta;
      pair.gain =
          std::exp(Between(host.brightness_linearization, target.brightness_linearization).alpha);
      pair.target_b = target.brightness_linearization.b;
    }
    return pair;
  }

  void MakePairs(const Window& window) {
    const size_t n = window.size();
    pairs_.clear();
    for (size_t h = 0; h < n; ++h)
      for (size_t t = 0; t < n; ++t) pairs_.push_back(MakePair(*window[h], *window[t]));
  }

  /// Everything that the solver asks for, from the window's state.
  void Evaluate(const Window& window, bool jacobians) {
    MakePairs(window);
    ParallelForBatches(static_cast<int>(items_.size()), threads_,
                       [&](int k) { EvaluateItem(window, jacobians, items_[k]); });
  }

  void EvaluateItem(const Window& window, bool jacobians, Item& item) const {
    const PointPatch& patch = patches_[item.patch];
    const Pair& pair = pairs_[patch.host * window.size() + item.target];
    const auto& image = window[item.target]->image();
    const auto input = [&](int k) {
      return Warp::Input{patch.rays[k], static_cast<float>(patch.depth),
                         alignment::Vector2<float>::Zero()};
    };
    std::array<Warp::Point, kPatchPixels> now;
    item.sight = Sight::kGood;
    for (int k = 0; k < kPatchPixels && item.sight == Sight::kGood; ++k)
      if (!pair.now.At(input(k), now[k]) || !image.Inside(now[k].pixel))
        item.sight = Sight::kOutOfView;
    if (item.sight == Sight::kOutOfView) {  // keeps its cost: it must not pay to look away
      SetConstant(item);
      return;
    }
    const alignment::RobustLoss<double> loss{alignment::RobustKind::kHuber, 1};
    const double inverse_scale = 1 / scale_;
    double cost = 0;
    for (int k = 0; k < kPatchPixels; ++k) {
      const auto at = image.Sample(now[k].pixel);
      const Eigen::Matrix<double, kDim, 1> r =
          inverse_scale *
          pair.residual.template Value<float>(at.value, now[k].A(), patch.references[k])
              .template cast<double>();
      const double s = r.squaredNorm(), rho = loss.Rho(s);
      // The loss enters as a factor: its square times |r|^2 is rho.
      const double factor = s > 0 ? std::sqrt(rho / s) : 1;
      item.residual.template segment<kDim>(kDim * k) = factor * r;
      cost += rho;
      if (!jacobians) continue;
      Warp::Point linear;
      if (!pair.linear.At(input(k), linear)) {
        item.sight = Sight::kOutOfView;
        SetConstant(item);
        return;
      }
      Eigen::Matrix<float, kDim, kRelative> J;
      pair.residual.Linearize(at, linear, patch.references[k], J);
      SetJacobian(pair, (loss.Weight(s) / factor * inverse_scale) * J.template cast<double>(), k,
                  item);
    }
    item.mean_cost = cost / kPatchPixels;
    if (item.mean_cost > options_.max_cost) {
      item.sight = Sight::kOutlier;
      item.residual.setConstant(std::sqrt(options_.max_cost * kPatchPixels / kRows));
      SetConstant(item);
    }
  }

  static void SetConstant(Item& item) {
    item.d_host.setZero();
    item.d_target.setZero();
    item.d_depth.setZero();
  }

  static void SetJacobian(const Pair& pair, const Eigen::Matrix<double, kDim, kRelative>& J, int k,
                          Item& item) {
    auto d_host = item.d_host.template middleRows<kDim>(kDim * k);
    auto d_target = item.d_target.template middleRows<kDim>(kDim * k);
    d_target.template leftCols<6>() = J.template leftCols<6>();
    d_host.template leftCols<6>().noalias() = -J.template leftCols<6>() * pair.adjoint;
    item.d_depth.template segment<kDim>(kDim * k) = J.col(6);
    if constexpr (kBrightness) {
      // alpha = a_h - a_t, beta = b_h - exp(alpha) b_t
      const auto d_a = J.col(7) - pair.gain * pair.target_b * J.col(8);
      d_host.col(6) = d_a;
      d_target.col(6) = -d_a;
      d_host.col(7) = J.col(8);
      d_target.col(7) = -pair.gain * J.col(8);
    } else {
      d_host.template rightCols<2>().setZero();
      d_target.template rightCols<2>().setZero();
    }
  }

  /// Standard deviation of the residuals in view.
  double SetScale(const Window& window) {
    scale_ = 1;
    MakePairs(window);
    std::vector<std::array<float, kPatchPixels>> norms(items_.size());
    ParallelForBatches(static_cast<int>(items_.size()), threads_, [&](int i) {
      const PointPatch& patch = patches_[items_[i].patch];
      const Pair& pair = pairs_[patch.host * window.size() + items_[i].target];
      const auto& image = window[items_[i].target]->image();
      norms[i].fill(-1);
      for (int k = 0; k < kPatchPixels; ++k) {
        Warp::Point point;
        const Warp::Input input{patch.rays[k], static_cast<float>(patch.point->inverse_depth),
                                alignment::Vector2<float>::Zero()};
        if (!pair.now.At(input, point) || !image.Inside(point.pixel)) continue;
        norms[i][k] = pair.residual
                          .template Value<float>(image.Value(point.pixel), point.A(),
                                                 patch.references[k])
                          .squaredNorm();
      }
    });
    std::vector<float> all;
    for (const auto& some : norms)
      for (float norm : some)
        if (norm >= 0) all.push_back(norm);
    scale_ = alignment::MedianScale(std::span(all), kDim);
    return scale_;
  }

  WindowSummary Solve(Window& window, const Prior& prior, bool exposures_known) {
    Callback callback(*this, window);
    ceres::Problem::Options problem_options;
    problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.disable_all_safety_checks = true;
    problem_options.evaluation_callback = &callback;
    ceres::Problem problem(problem_options);
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (PointPatch& patch : patches_) {
      problem.AddParameterBlock(&patch.depth, 1);
      ordering->AddElementToGroup(&patch.depth, 0);
    }
    for (FrameParameters& frame : frames_) {
      problem.AddParameterBlock(frame.data(), kFrameParameters);
      ordering->AddElementToGroup(frame.data(), 1);
    }
    std::deque<ItemCost> costs;  // cost functions cannot be moved
    for (const Item& item : items_) {
      costs.emplace_back(item);
      PointPatch& patch = patches_[item.patch];
      problem.AddResidualBlock(&costs.back(), nullptr, frames_[patch.host].data(),
                               frames_[item.target].data(), &patch.depth);
    }
    std::deque<BrightnessCost> brightness;
    for (size_t k = 0; k < window.size(); ++k) {
      brightness.emplace_back(*window[k],
                              exposures_known ? options_.sigma_a_known : options_.sigma_a,
                              exposures_known ? options_.sigma_b_known : options_.sigma_b);
      problem.AddResidualBlock(&brightness.back(), nullptr, frames_[k].data());
    }
    PriorCost prior_cost(prior);
    std::vector<double*> prior_blocks;
    for (int id : prior.frames())
      for (size_t k = 0; k < window.size(); ++k)
        if (window[k]->id == id) prior_blocks.push_back(frames_[k].data());
    if (prior_cost.num_residuals() > 0)
      problem.AddResidualBlock(&prior_cost, nullptr, prior_blocks);

    const std::vector<FrameParameters> before = frames_;
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.linear_solver_ordering = ordering;
    options.max_num_iterations = options_.max_iterations;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-4;
    ceres::Solver::Summary report;
    ceres::Solve(options, &problem, &report);
    WindowSummary summary;
    summary.iterations = static_cast<int>(report.iterations.size());
    summary.usable = report.IsSolutionUsable();
    for (const FrameParameters& x : frames_) summary.usable = summary.usable && x.allFinite();
    if (!summary.usable) frames_ = before;
    UseParameters(window);
    return summary;
  }

  void WriteBack(Window& window, WindowSummary& summary) {
    for (PointPatch& patch : patches_) {
      patch.point->inverse_depth = patch.depth;
      patch.point->observations.clear();
      patch.point->variance = 0;
    }
    for (const Item& item : items_) {
      ActivePoint& point = *patches_[item.patch].point;
      if (item.sight != Sight::kGood) {
        ++summary.outliers;
        continue;
      }
      ++summary.observations;
      point.observations.push_back({window[item.target]->id, item.mean_cost});
      point.variance += item.d_depth.squaredNorm();  // information, turned round below
      point.support = std::max(point.support, static_cast<int>(point.observations.size()));
    }
    for (const auto& frame : window) {
      for (ActivePoint& point : frame->points)
        point.variance = point.variance > 0 ? 1 / point.variance : INFINITY;
      std::erase_if(frame->points, [](const ActivePoint& point) {
        return point.observations.empty() || !(point.inverse_depth > 0);
      });
    }
  }

  /// Adds what a point's observations say of the key-frames, its inverse depth eliminated.
  void AddWithoutPoint(std::span<const Item> items, MatrixXd& H, VectorXd& b) const {
    const PointPatch& patch = patches_[items.front().patch];
    const Eigen::Index host = kFrameParameters * patch.host;
    double H_d = 0, b_d = 0;
    VectorXd H_fd = VectorXd::Zero(b.size());
    for (const Item& item : items) {
      if (item.sight != Sight::kGood) continue;
      const Eigen::Index target = kFrameParameters * item.target;
      // Residuals as they would be at the linearisation.
      const Rows r =
          item.residual - item.d_host * frames_[patch.host] - item.d_target * frames_[item.target];
      constexpr int n = kFrameParameters;
      H.block<n, n>(host, host) += item.d_host.transpose() * item.d_host;
      H.block<n, n>(target, target) += item.d_target.transpose() * item.d_target;
      const Eigen::Matrix<double, n, n> across = item.d_host.transpose() * item.d_target;
      H.block<n, n>(host, target) += across;
      H.block<n, n>(target, host) += across.transpose();
      b.segment<n>(host) += item.d_host.transpose() * r;
      b.segment<n>(target) += item.d_target.transpose() * r;
      H_fd.segment<n>(host) += item.d_host.transpose() * item.d_depth;
      H_fd.segment<n>(target) += item.d_target.transpose() * item.d_depth;
      H_d += item.d_depth.squaredNorm();
      b_d += item.d_depth.dot(r);
    }
    if (!(H_d > 0)) return;
    H.noalias() -= H_fd * (H_fd / H_d).transpose();
    b.noalias() -= H_fd * (b_d / H_d);
  }

  Camera camera_;
  WindowOptions options_;
  int threads_;
  std::span<const Eigen::Vector2f> offsets_;
  std::vector<PointPatch> patches_;
  std::vector<Item> items_;  ///< those of a point together
  std::vector<FrameParameters> frames_;
  std::vector<Pair> pairs_;  ///< host by host
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
