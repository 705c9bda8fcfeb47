#include <algorithm>
#include <utility>

#include <ceres/ceres.h>

#include <sgf/core/require.h>
#include <sgf/vio/window.h>
#include <sgf/vio/window_costs.h>

namespace sgf::vio {

using Eigen::MatrixXd, Eigen::VectorXd;

namespace {

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

}  // namespace

void CheckOptions(const WindowOptions& options) {
  Require(options.max_iterations >= 1, "window.max_iterations", options.max_iterations, "positive");
  Require(options.sigma_px > 0, "window.sigma_px", options.sigma_px, "positive");
  Require(options.huber_sigmas > 0, "window.huber_sigmas", options.huber_sigmas, "positive");
  Require(options.outlier_px > 0, "window.outlier_px", options.outlier_px, "positive");
  Require(options.tolerance >= 0, "window.tolerance", options.tolerance, "at least 0");
  Require(options.gravity > 0, "window.gravity", options.gravity, "positive");
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

}  // namespace sgf::vio
