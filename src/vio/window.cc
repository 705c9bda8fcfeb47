#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <ceres/ceres.h>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/core/square_root.h>
#include <sgf/vio/visual_equations.h>
#include <sgf/vio/window.h>

namespace sgf::vio {
namespace {

using Eigen::Index, Eigen::Matrix3d, Eigen::MatrixXd, Eigen::VectorXd;
using Matrix15 = Eigen::Matrix<double, 15, 15>;
using Vector15 = Eigen::Matrix<double, 15, 1>;

/// A window's frames and calibration as parameters: differences from where they are linearised.
class Linearization {
 public:
  /// @param calibrates whether the calibration is estimated; else it is taken as it is.
  Linearization(std::deque<Frame>& frames, const CalibrationEstimate& calibration, bool calibrates)
      : frames_(frames), calibration_(calibration), calibrates_(calibrates) {
    for (Frame& frame : frames) {
      if (!frame.in_prior) frame.linearization = frame.state;
      blocks_.push_back({frame.id, Part::kPose});
      velocities_.push_back({frame.state.velocity, frame.angular_velocity});
    }
    if (calibrates) blocks_.push_back(kCalibrationBlock);
    visual_blocks_ = blocks_.size();
    for (const Frame& frame : frames)
      if (frame.inertial) blocks_.push_back({frame.id, Part::kMotion});
    Index size = 0;
    for (const BlockId block : blocks_) {
      offsets_.push_back(size);
      size += block.size();
    }
    x_.setZero(size);
    for (const Frame& frame : frames)
      if (frame.in_prior) SetParameters(frame.id, Minus(frame.state, frame.linearization));
    if (calibrates)
      x_.segment<kCalibrationParameters>(OffsetOf(kCalibrationBlock)) =
          Minus(calibration.value, calibration.linearization);
    poses_.resize(frames.size());
    UpdatePoses();
  }

  std::deque<Frame>& frames() const { return frames_; }
  const std::vector<BlockId>& blocks() const { return blocks_; }
  /// Those that say where the cameras see the landmarks: poses, calibration. They come first.
  std::span<const BlockId> visual_blocks() const { return {blocks_.data(), visual_blocks_}; }
  Index visual_size() const {
    return kPoseParameters * static_cast<Index>(frames_.size()) +
           (calibrates_ ? kCalibrationParameters : 0);
  }
  VectorXd& x() { return x_; }
  const VectorXd& x() const { return x_; }
  /// Of the body as the cameras see it.
  std::span<const PoseState> poses() const { return poses_; }

  Index OffsetOf(BlockId block) const {
    return offsets_[std::find(blocks_.begin(), blocks_.end(), block) - blocks_.begin()];
  }

  int PositionOf(int id) const {
    const auto it = std::find_if(frames_.begin(), frames_.end(),
                                 [&](const Frame& frame) { return frame.id == id; });
    return static_cast<int>(it - frames_.begin());
  }

  /// The state of a frame at some parameters.
  BodyState StateAt(const Frame& frame, const double* pose, const double* motion) const {
    Vector15 delta = Vector15::Zero();
    delta.head<kPoseParameters>() = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(pose);
    if (motion)
      delta.tail<kMotionParameters>() = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(motion);
    return Plus(frame.linearization, delta);
  }

  BodyState StateOf(const Frame& frame) const {
    return StateAt(frame, x_.data() + OffsetOf({frame.id, Part::kPose}),
                   frame.inertial ? x_.data() + OffsetOf({frame.id, Part::kMotion}) : nullptr);
  }

  /// Derivatives by the parameters are those by the local tangent times this, for the rotation.
  static Matrix3d TurnOf(const Frame& frame, const Eigen::Vector3d& rotation) {
    return frame.in_prior ? Matrix3d::Identity() : RightJacobianSO3(rotation);
  }

  void UpdatePoses() {
    const Calibration now = CalibrationNow();
    for (size_t k = 0; k < frames_.size(); ++k) {
      poses_[k] = PoseAt(k);
      if (!IsSeenElsewhere()) continue;
      poses_[k] = {AsSeen(poses_[k].T_world_body, velocities_[k], now),
                   AsSeen(poses_[k].linearization, velocities_[k], LinearCalibration())};
    }
  }

  /// Derivatives of poses() by all visual parameters; empty where they are these parameters.
  MatrixXd JacobianOfPoses() const {
    if (!IsSeenElsewhere()) return {};
    constexpr int n = kPoseParameters;
    MatrixXd J = MatrixXd::Zero(n * static_cast<Index>(frames_.size()), visual_size());
    for (size_t k = 0; k < frames_.size(); ++k) {
      const PoseState pose = PoseAt(k);
      AsSeenJacobian seen =
          JacobianOfAsSeen(pose.linearization, velocities_[k], LinearCalibration());
      seen.by_pose.leftCols<3>() *= pose.turn;
      const Index at = n * static_cast<Index>(k);
      J.block<n, n>(at, at) = seen.by_pose;
      if (calibrates_)
        J.block<n, kCalibrationParameters>(at, n * frames_.size()) = seen.by_calibration;
    }
    return J;
  }

  Calibration CalibrationNow() const {
    if (!calibrates_) return calibration_.value;
    return Plus(calibration_.linearization,
                x_.segment<kCalibrationParameters>(OffsetOf(kCalibrationBlock)));
  }

  void WriteBack() {
    for (Frame& frame : frames_) {
      const std::int64_t time_ns = frame.state.time_ns;
      frame.state = StateOf(frame);
      frame.state.time_ns = time_ns;
    }
  }

 private:
  /// Of the body itself.
  PoseState PoseAt(size_t k) const {
    const double* pose = x_.data() + offsets_[k];  // poses come first
    const SE3 T = StateAt(frames_[k], pose, nullptr).T_world_body;
    return {T, frames_[k].in_prior ? frames_[k].linearization.T_world_body : T,
            TurnOf(frames_[k], Eigen::Map<const Eigen::Vector3d>(pose))};
  }

  /// Whether the cameras see the body elsewhere than the rig and the time stamps say.
  bool IsSeenElsewhere() const { return calibrates_ || !calibration_.value.IsIdentity(); }

  /// While it is estimated, the prior knows it.
  const Calibration& LinearCalibration() const {
    return calibrates_ ? calibration_.linearization : calibration_.value;
  }

  void SetParameters(int id, const Vector15& delta) {
    x_.segment<kPoseParameters>(OffsetOf({id, Part::kPose})) = delta.head<kPoseParameters>();
    if (const BlockId motion{id, Part::kMotion};
        std::find(blocks_.begin(), blocks_.end(), motion) != blocks_.end())
      x_.segment<kMotionParameters>(OffsetOf(motion)) = delta.tail<kMotionParameters>();
  }

  std::deque<Frame>& frames_;
  const CalibrationEstimate& calibration_;
  bool calibrates_;
  std::vector<BodyVelocity> velocities_;
  std::vector<BlockId> blocks_;
  size_t visual_blocks_ = 0;
  std::vector<Index> offsets_;
  VectorXd x_;
  std::vector<PoseState> poses_;
};

std::vector<LandmarkItem> ItemsOf(const Linearization& at,
                                  std::map<std::int64_t, Landmark>& landmarks) {
  std::vector<LandmarkItem> items;
  for (auto& [id, landmark] : landmarks) {
    LandmarkItem& item = items.emplace_back();
    item.landmark = &landmark;
    item.host = at.PositionOf(landmark.host);
    for (const LandmarkSight& sight : landmark.sights)
      item.frames.push_back(at.PositionOf(sight.frame));
    item.value << landmark.ray, landmark.inverse_depth;
  }
  return items;
}

/// Landmarks as a cost function of all poses and of the calibration. They follow the poses: they
/// are where the linearisation has its minimum for them, so that the solver has a small dense
/// problem. Residuals are the square root of the reduced equations and one more that makes up for
/// the rest of the cost.
class VisualCost : public ceres::CostFunction {
 public:
  VisualCost(const VisualEquations& equations, Linearization& at, std::vector<LandmarkItem>& items)
      : equations_(equations), at_(at), items_(items) {
    for (const BlockId block : at.visual_blocks())
      mutable_parameter_block_sizes()->push_back(block.size());
    set_num_residuals(static_cast<int>(at.visual_size()) + 1);
    linear_x_ = Parameters();
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const auto blocks = at_.visual_blocks();
    const Index n = at_.visual_size();
    Index column = 0;
    for (size_t k = 0; k < blocks.size(); column += blocks[k++].size())
      std::copy_n(parameters[k], blocks[k].size(), at_.x().data() + column);
    Settle();
    Eigen::Map<VectorXd> r(residuals, num_residuals());
    r.setZero();
    if (!jacobians) {
      r(n) = std::sqrt(2 * equations_.Cost(at_.poses(), items_));
      return std::isfinite(r(n));
    }
    ReducedEquations reduced;
    const double cost = equations_.Linearize(at_.poses(), items_, reduced);
    by_parameters_ = at_.JacobianOfPoses();
    if (by_parameters_.size() > 0) {
      reduced.H = by_parameters_.transpose() * reduced.H * by_parameters_;
      reduced.b = by_parameters_.transpose() * reduced.b;
    }
    linear_x_ = Parameters();
    linearized_ = true;
    const SquareRoot root = SquareRootOf(reduced.H, reduced.b);
    r.head(root.e.size()) = root.e;
    r(n) = std::sqrt(std::max(0., 2 * cost - root.e.squaredNorm()));
    column = 0;
    for (size_t k = 0; k < blocks.size(); column += blocks[k++].size()) {
      if (!jacobians[k]) continue;
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor> J(jacobians[k], num_residuals(), blocks[k].size());
      J.setZero();
      J.topRows(root.S.rows()) = root.S.middleCols(column, blocks[k].size());
    }
    return std::isfinite(cost);
  }

  /// Landmarks where they belong for the parameters as they are.
  void Settle() const {
    at_.UpdatePoses();
    if (!linearized_) return;
    const VectorXd step = Parameters() - linear_x_;
    equations_.MoveLandmarks(by_parameters_.size() > 0 ? by_parameters_ * step : step, items_);
  }

 private:
  VectorXd Parameters() const { return at_.x().head(at_.visual_size()); }

  const VisualEquations& equations_;
  Linearization& at_;
  std::vector<LandmarkItem>& items_;
  mutable VectorXd linear_x_;  // Ceres takes cost functions as constant
  mutable MatrixXd by_parameters_;
  mutable bool linearized_ = false;
};

/// Whitened residual of the inertial sensor between two frames.
class InertialCost : public ceres::SizedCostFunction<15, kPoseParameters, kMotionParameters,
                                                     kPoseParameters, kMotionParameters> {
 public:
  InertialCost(const Linearization& at, const Frame& from, const Frame& to, double gravity)
      : at_(at),
        from_(from),
        to_(to),
        gravity_(gravity),
        weight_(to.since_last->SquareRootInformation()) {}

  std::array<BlockId, 4> blocks() const {
    return {{{from_.id, Part::kPose},
             {from_.id, Part::kMotion},
             {to_.id, Part::kPose},
             {to_.id, Part::kMotion}}};
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const BodyState from = at_.StateAt(from_, parameters[0], parameters[1]),
                    to = at_.StateAt(to_, parameters[2], parameters[3]);
    const Preintegration& imu = *to_.since_last;
    Eigen::Map<Vector15> r(residuals);
    r = weight_ * imu.Residual(from, to, gravity_, nullptr, nullptr);
    if (!jacobians) return r.allFinite();
    Matrix15 J_from, J_to;
    imu.Residual(from_.in_prior ? from_.linearization : from, to_.in_prior ? to_.linearization : to,
                 gravity_, &J_from, &J_to);
    J_from.leftCols<3>() *=
        Linearization::TurnOf(from_, Eigen::Map<const Eigen::Vector3d>(parameters[0]));
    J_to.leftCols<3>() *=
        Linearization::TurnOf(to_, Eigen::Map<const Eigen::Vector3d>(parameters[2]));
    const Matrix15 whole_from = weight_ * J_from, whole_to = weight_ * J_to;
    using Pose = Eigen::Matrix<double, 15, kPoseParameters, Eigen::RowMajor>;
    using Motion = Eigen::Matrix<double, 15, kMotionParameters, Eigen::RowMajor>;
    if (jacobians[0]) Eigen::Map<Pose>{jacobians[0]} = whole_from.leftCols<kPoseParameters>();
    if (jacobians[1]) Eigen::Map<Motion>{jacobians[1]} = whole_from.rightCols<kMotionParameters>();
    if (jacobians[2]) Eigen::Map<Pose>{jacobians[2]} = whole_to.leftCols<kPoseParameters>();
    if (jacobians[3]) Eigen::Map<Motion>{jacobians[3]} = whole_to.rightCols<kMotionParameters>();
    return r.allFinite();
  }

 private:
  const Linearization& at_;
  const Frame& from_;
  const Frame& to_;
  double gravity_;
  Matrix15 weight_;
};

/// |S x + e|^2 / 2
class PriorCost : public ceres::CostFunction {
 public:
  explicit PriorCost(const SquareRootPrior& prior) : prior_(prior) {
    set_num_residuals(static_cast<int>(prior.e().size()));
    for (const BlockId block : prior.blocks())
      mutable_parameter_block_sizes()->push_back(block.size());
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    Eigen::Map<VectorXd> r(residuals, num_residuals());
    r = prior_.e();
    Index column = 0;
    for (size_t k = 0; k < prior_.blocks().size(); ++k) {
      const int size = prior_.blocks()[k].size();
      const auto S = prior_.S().middleCols(column, size);
      r += S * Eigen::Map<const VectorXd>(parameters[k], size);
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      if (jacobians && jacobians[k]) Eigen::Map<RowMajor>(jacobians[k], num_residuals(), size) = S;
      column += size;
    }
    return true;
  }

 private:
  const SquareRootPrior& prior_;
};

/// Costs of the inertial sensor between neighbouring frames that both have a motion.
std::deque<InertialCost> InertialCosts(const Linearization& at, double gravity) {
  std::deque<InertialCost> costs;  // cost functions cannot be moved
  const auto& frames = at.frames();
  for (size_t k = 1; k < frames.size(); ++k)
    if (frames[k].since_last && frames[k].inertial && frames[k - 1].inertial)
      costs.emplace_back(at, frames[k - 1], frames[k], gravity);
  return costs;
}

/// RMS of the costs' residuals at the parameters as they are; 0 where there are none.
double ErrorOf(const std::deque<InertialCost>& costs, const Linearization& at) {
  double squares = 0;
  for (const InertialCost& cost : costs) {
    std::array<const double*, 4> parameters;
    for (size_t k = 0; k < parameters.size(); ++k)
      parameters[k] = at.x().data() + at.OffsetOf(cost.blocks()[k]);
    Vector15 r;
    cost.Evaluate(parameters.data(), r.data(), nullptr);
    squares += r.squaredNorm() / 15;
  }
  return costs.empty() ? 0 : std::sqrt(squares / static_cast<double>(costs.size()));
}

ceres::Solver::Options SolverOptions(const WindowOptions& window) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = window.max_iterations;
  options.function_tolerance = window.tolerance;
  // Nearly Gauss-Newton. Tilt, velocity and biases are known by 1e-4 of what single numbers are
  // when the rest is held: with Ceres' 1e4 they would lag behind by many frames.
  options.initial_trust_region_radius = 1e8;
  options.num_threads = 1;  // the order of sums must not depend on them
  options.logging_type = ceres::SILENT;
  return options;
}

/// A cost as rows of [S e] in its blocks, at the parameters as they are.
SquareRoot RowsOf(const ceres::CostFunction& cost, std::span<const BlockId> blocks,
                  const Linearization& at) {
  const int rows = cost.num_residuals();
  SquareRoot result{MatrixXd(rows, 0), VectorXd(rows)};
  std::vector<const double*> parameters;
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J;
  std::vector<double*> jacobians;
  for (const BlockId block : blocks) {
    parameters.push_back(at.x().data() + at.OffsetOf(block));
    J.emplace_back(rows, block.size());
  }
  for (auto& block : J) jacobians.push_back(block.data());
  cost.Evaluate(parameters.data(), result.e.data(), jacobians.data());
  for (size_t k = 0; k < blocks.size(); ++k) {
    const Index column = result.S.cols();
    result.S.conservativeResize(rows, column + blocks[k].size());
    result.S.rightCols(blocks[k].size()) = J[k];
    // Parameters count from where the frame is linearised.
    result.e -= J[k] * at.x().segment(at.OffsetOf(blocks[k]), blocks[k].size());
  }
  return result;
}

/// Adds what landmarks say to a prior of the frames that see them; other frames stay out of it.
void AddLandmarks(const VisualEquations& equations, Linearization& at,
                  std::map<std::int64_t, Landmark>& landmarks, SquareRootPrior& prior) {
  if (landmarks.empty()) return;
  std::vector<LandmarkItem> items = ItemsOf(at, landmarks);
  const auto blocks = at.visual_blocks();
  const SquareRoot rows = RowsOf(VisualCost(equations, at, items), blocks, at);
  std::vector<BlockId> touched;
  MatrixXd S(rows.S.rows(), 0);
  for (Index column = 0; const BlockId block : blocks) {
    const auto columns = rows.S.middleCols(column, block.size());
    column += block.size();
    if (columns.squaredNorm() == 0) continue;
    touched.push_back(block);
    S.conservativeResize(Eigen::NoChange, S.cols() + block.size());
    S.rightCols(block.size()) = columns;
  }
  prior.Add(touched, S, rows.e);
}

}  // namespace

void CheckOptions(const WindowOptions& options) {
  const auto require = [](bool valid, const char* option, double value, const char* range) {
    if (!valid) throw Error(option, fmt::format("is {}; it has to be {}", value, range));
  };
  require(options.max_iterations >= 1, "window.max_iterations", options.max_iterations, "positive");
  require(options.sigma_px > 0, "window.sigma_px", options.sigma_px, "positive");
  require(options.huber_sigmas > 0, "window.huber_sigmas", options.huber_sigmas, "positive");
  require(options.outlier_px > 0, "window.outlier_px", options.outlier_px, "positive");
  require(options.tolerance >= 0, "window.tolerance", options.tolerance, "at least 0");
  require(options.gravity > 0, "window.gravity", options.gravity, "positive");
}

Window::Window(const VioRig& rig, const WindowOptions& options, int threads)
    : rig_(rig), options_(options), threads_(threads) {
  CheckOptions(options);
}

const Frame* Window::Find(int id) const {
  for (const Frame& frame : frames)
    if (frame.id == id) return &frame;
  return nullptr;
}

Frame* Window::Find(int id) { return const_cast<Frame*>(std::as_const(*this).Find(id)); }

SE3 Window::PoseOf(const Frame& frame, int camera) const {
  const SE3& T_world_body = frame.state.T_world_body;
  return (calibration().IsIdentity()
              ? T_world_body
              : AsSeen(T_world_body, {frame.state.velocity, frame.angular_velocity},
                       calibration())) *
         rig_.T_body_cam[camera];
}

void Window::AnchorPose(Frame& frame, const Eigen::Matrix<double, kPoseParameters, 1>& sigmas) {
  frame.linearization = frame.state;
  frame.in_prior = true;
  const BlockId block{frame.id, Part::kPose};
  MatrixXd S = sigmas.cwiseInverse().asDiagonal();
  S.topLeftCorner<3, 3>() *= frame.state.T_world_body.R.toRotationMatrix();
  prior_.Add(std::span(&block, 1), S, VectorXd::Zero(kPoseParameters));
}

void Window::AnchorMotion(Frame& frame, const Eigen::Matrix<double, kMotionParameters, 1>& sigmas) {
  if (!frame.in_prior) frame.linearization = frame.state;
  frame.linearization.velocity = frame.state.velocity;
  frame.linearization.gyro_bias = frame.state.gyro_bias;
  frame.linearization.accel_bias = frame.state.accel_bias;
  frame.inertial = frame.in_prior = true;
  const BlockId motion{frame.id, Part::kMotion};
  prior_.Add(std::span(&motion, 1), MatrixXd(sigmas.cwiseInverse().asDiagonal()),
             VectorXd::Zero(kMotionParameters));
}

void Window::AnchorCalibration(const CalibrationVector& sigmas) {
  constexpr double kHeld = 1e-9;  // rad, m, s
  calibration_.linearization = calibration_.value;
  prior_.Add(std::span(&kCalibrationBlock, 1),
             MatrixXd(sigmas.cwiseMax(kHeld).cwiseInverse().asDiagonal()),
             VectorXd::Zero(kCalibrationParameters));
}

void Window::DropPrior() {
  prior_ = {};
  for (Frame& frame : frames) frame.in_prior = false;
}

void Window::DropInertial(const Eigen::Matrix<double, kPoseParameters, 1>& sigmas) {
  DropPrior();
  for (Frame& frame : frames) {
    frame.inertial = false;
    frame.state = {.time_ns = frame.state.time_ns, .T_world_body = frame.state.T_world_body};
    frame.angular_velocity.setZero();
  }
  AnchorPose(frames.front(), sigmas);
}

WindowSummary Window::Refine() {
  Linearization at(frames, calibration_, calibrates());
  std::vector<LandmarkItem> items = ItemsOf(at, landmarks);
  const VisualEquations equations(rig_, options_, threads_);
  std::vector<VectorXd> parameters;
  std::map<BlockId, double*> pointer;
  for (const BlockId block : at.blocks())
    parameters.push_back(at.x().segment(at.OffsetOf(block), block.size()));
  for (size_t k = 0; k < parameters.size(); ++k) pointer[at.blocks()[k]] = parameters[k].data();

  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (size_t k = 0; k < parameters.size(); ++k)
    problem.AddParameterBlock(parameters[k].data(), at.blocks()[k].size());
  VisualCost visual(equations, at, items);
  std::vector<double*> seen;
  for (const BlockId block : at.visual_blocks()) seen.push_back(pointer.at(block));
  problem.AddResidualBlock(&visual, nullptr, seen);
  std::deque<InertialCost> inertial = InertialCosts(at, options_.gravity);
  for (InertialCost& cost : inertial) {
    std::vector<double*> blocks;
    for (const BlockId block : cost.blocks()) blocks.push_back(pointer.at(block));
    problem.AddResidualBlock(&cost, nullptr, blocks);
  }
  PriorCost prior(prior_);
  if (prior.num_residuals() > 0) {
    std::vector<double*> blocks;
    for (const BlockId block : prior_.blocks()) blocks.push_back(pointer.at(block));
    problem.AddResidualBlock(&prior, nullptr, blocks);
  }

  ceres::Solver::Summary report;
  ceres::Solve(SolverOptions(options_), &problem, &report);
  WindowSummary summary;
  summary.iterations = static_cast<int>(report.iterations.size());
  summary.cost = report.final_cost;
  summary.usable = report.IsSolutionUsable();
  for (const VectorXd& block : parameters) summary.usable = summary.usable && block.allFinite();
  if (!summary.usable) return summary;  // nothing was written
  for (size_t k = 0; k < parameters.size(); ++k)
    at.x().segment(at.OffsetOf(at.blocks()[k]), parameters[k].size()) = parameters[k];
  visual.Settle();
  at.WriteBack();
  calibration_.value = at.CalibrationNow();
  summary.inertial_error = ErrorOf(inertial, at);
  for (const LandmarkItem& item : items) {
    item.landmark->ray = item.value.head<2>();
    item.landmark->inverse_depth = item.value.z();
    item.landmark->inverse_depth_variance = item.H_inverse(2, 2);
    summary.sights += static_cast<int>(item.frames.size());
  }
  return summary;
}

int Window::RemoveOutliers() {
  const Linearization at(frames, calibration_, calibrates());
  const std::vector<LandmarkItem> items = ItemsOf(at, landmarks);
  const VisualEquations equations(rig_, options_, threads_);
  int outliers = 0;
  for (const LandmarkItem& item : items) {
    std::vector<LandmarkSight> good;
    for (size_t k = 0; k < item.frames.size(); ++k) {
      if (equations.ErrorPx(at.poses(), item, k) <= options_.outlier_px)
        good.push_back(item.landmark->sights[k]);
      else
        ++outliers;
    }
    item.landmark->sights = std::move(good);
  }
  std::erase_if(landmarks, [](const auto& entry) {
    const Landmark& landmark = entry.second;
    return landmark.sights.empty() || !(landmark.inverse_depth > 0) || !landmark.ray.allFinite();
  });
  return outliers;
}

void Window::Marginalize(std::span<const int> leaving, std::span<const int> motions) {
  const auto leaves = [&](int id) {
    return std::find(leaving.begin(), leaving.end(), id) != leaving.end();
  };
  const auto slows = [&](int id) {
    return leaves(id) || std::find(motions.begin(), motions.end(), id) != motions.end();
  };
  Linearization at(frames, calibration_, calibrates());
  std::map<std::int64_t, Landmark> hosted;
  for (const auto& [id, landmark] : landmarks)
    if (leaves(landmark.host)) hosted.emplace(id, landmark);
  AddLandmarks(VisualEquations(rig_, options_, threads_), at, hosted, prior_);
  for (const InertialCost& cost : InertialCosts(at, options_.gravity)) {
    const auto blocks = cost.blocks();
    if (!slows(blocks[0].frame) && !slows(blocks[2].frame)) continue;
    const SquareRoot rows = RowsOf(cost, blocks, at);
    prior_.Add(blocks, rows.S, rows.e);
    Find(blocks[2].frame)->since_last.reset();
  }
  for (Frame& frame : frames)
    if (prior_.Has({frame.id, Part::kPose}) || prior_.Has({frame.id, Part::kMotion}))
      frame.in_prior = true;

  std::vector<BlockId> gone;
  for (const int id : leaving) gone.insert(gone.end(), {{id, Part::kPose}, {id, Part::kMotion}});
  for (const int id : motions) gone.push_back({id, Part::kMotion});
  prior_.Marginalize(gone);
  for (const int id : motions) Find(id)->inertial = false;
  std::erase_if(frames, [&](const Frame& frame) { return leaves(frame.id); });
  for (auto it = landmarks.begin(); it != landmarks.end();) {
    Landmark& landmark = it->second;
    std::erase_if(landmark.sights, [&](const LandmarkSight& sight) { return leaves(sight.frame); });
    it = leaves(landmark.host) || landmark.sights.empty() ? landmarks.erase(it) : std::next(it);
  }
}

namespace {

using MotionJacobian = Eigen::Matrix<double, kPoseParameters, 2 * kPoseParameters>;

/// How a pose in coordinates of the one before changes with both, all in the order of Plus().
MotionJacobian JacobianOfMotion(const SE3& before, const SE3& now) {
  const SE3 motion = before.Inverse() * now;
  const Matrix3d R = before.R.conjugate().toRotationMatrix();
  MotionJacobian J = MotionJacobian::Zero();
  J.block<3, 3>(kRotation, kRotation) = -motion.R.conjugate().toRotationMatrix();
  J.block<3, 3>(kPosition, kRotation) = HatSO3(motion.p);
  J.block<3, 3>(kPosition, kPosition) = -R;
  J.block<3, 3>(kRotation, kPoseParameters + kRotation).setIdentity();
  J.block<3, 3>(kPosition, kPoseParameters + kPosition) = R;
  return J;
}

}  // namespace

FrameCovariance Window::CovarianceOf(const Frame& frame) const {
  std::deque<Frame> copy = frames;
  std::map<std::int64_t, Landmark> seen = landmarks;
  Linearization at(copy, calibration_, calibrates());
  std::vector<LandmarkItem> items = ItemsOf(at, seen);
  const VisualEquations equations(rig_, options_, threads_);
  MatrixXd H = MatrixXd::Zero(at.x().size(), at.x().size());
  ReducedEquations reduced;
  equations.Linearize(at.poses(), items, reduced);
  if (const MatrixXd J = at.JacobianOfPoses(); J.size() > 0)
    reduced.H = J.transpose() * reduced.H * J;
  H.topLeftCorner(reduced.H.rows(), reduced.H.cols()) = reduced.H;
  const auto add = [&](std::span<const BlockId> blocks, const MatrixXd& S) {
    Index row = 0;
    for (const BlockId a : blocks) {
      Index column = 0;
      for (const BlockId b : blocks) {
        H.block(at.OffsetOf(a), at.OffsetOf(b), a.size(), b.size()) +=
            S.middleCols(row, a.size()).transpose() * S.middleCols(column, b.size());
        column += b.size();
      }
      row += a.size();
    }
  };
  for (const InertialCost& cost : InertialCosts(at, options_.gravity))
    add(cost.blocks(), RowsOf(cost, cost.blocks(), at).S);
  add(prior_.blocks(), prior_.S());
  // Parameters have units of their own.
  const VectorXd unit = (H.diagonal().array() + 1e-10).rsqrt();
  const MatrixXd scaled = unit.asDiagonal() * H * unit.asDiagonal();
  const MatrixXd inverse = unit.asDiagonal() *
                           scaled.ldlt().solve(MatrixXd::Identity(H.rows(), H.cols())) *
                           unit.asDiagonal();
  FrameCovariance covariance;
  if (calibrates()) {
    const Index at_calibration = at.OffsetOf(kCalibrationBlock);
    covariance.calibration = inverse.block<kCalibrationParameters, kCalibrationParameters>(
        at_calibration, at_calibration);
  }
  const Index pose = at.OffsetOf({frame.id, Part::kPose});
  covariance.state.topLeftCorner<6, 6>() = inverse.block<6, 6>(pose, pose);
  if (frame.inertial) {
    const Index motion = at.OffsetOf({frame.id, Part::kMotion});
    covariance.state.bottomRightCorner<9, 9>() = inverse.block<9, 9>(motion, motion);
    covariance.state.topRightCorner<6, 9>() = inverse.block<6, 9>(pose, motion);
    covariance.state.bottomLeftCorner<9, 6>() = inverse.block<9, 6>(motion, pose);
  }
  if (frame.id == frames.front().id) return covariance;
  const Frame& before = *std::prev(
      std::find_if(frames.begin(), frames.end(), [&](const Frame& f) { return f.id == frame.id; }));
  const MotionJacobian J = JacobianOfMotion(before.state.T_world_body, frame.state.T_world_body);
  const std::array poses = {at.OffsetOf({before.id, Part::kPose}), pose};
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      covariance.motion += J.middleCols<6>(6 * i) * inverse.block<6, 6>(poses[i], poses[j]) *
                           J.middleCols<6>(6 * j).transpose();
  return covariance;
}

}  // namespace sgf::vio
