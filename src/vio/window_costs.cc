#include <algorithm>
#include <cmath>

#include <sgf/vio/window_costs.h>

namespace sgf::vio {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

VisualCost::VisualCost(const VisualEquations& equations, Linearization& at,
                       std::vector<LandmarkItem>& items)
    : equations_(equations), at_(at), items_(items) {
  for (const BlockId block : at.visual_blocks())
    mutable_parameter_block_sizes()->push_back(block.size());
  set_num_residuals(static_cast<int>(at.visual_size()) + 1);
  linear_x_ = Parameters();
}

bool VisualCost::Evaluate(double const* const* parameters, double* residuals,
                          double** jacobians) const {
  const auto blocks = at_.visual_blocks();
  const Index n = at_.visual_size();
  Index column = 0;
  for (size_t k = 0; k < blocks.size(); column += blocks[k++].size())
    std::copy_n(parameters[k], blocks[k].size(), at_.x().data() + column);
  Settle();
  if (!jacobians) {
    std::fill_n(residuals, n, 0.);
    residuals[n] = std::sqrt(2 * equations_.Cost(at_.poses(), items_));
    return std::isfinite(residuals[n]);
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
  EvaluateReduced(cost, reduced.H, reduced.b, parameter_block_sizes(), residuals, jacobians);
  return std::isfinite(cost);
}

void VisualCost::Settle() const {
  at_.UpdatePoses();
  if (!linearized_) return;
  const VectorXd step = Parameters() - linear_x_;
  equations_.MoveLandmarks(by_parameters_.size() > 0 ? by_parameters_ * step : step, items_);
}

InertialCost::InertialCost(const Linearization& at, const Frame& from, const Frame& to,
                           double gravity)
    : at_(at),
      from_(from),
      to_(to),
      gravity_(gravity),
      weight_(to.since_last->SquareRootInformation()) {}

bool InertialCost::Evaluate(double const* const* parameters, double* residuals,
                            double** jacobians) const {
  const BodyState from = at_.StateAt(from_, parameters[0], parameters[1]),
                  to = at_.StateAt(to_, parameters[2], parameters[3]);
  const Preintegration& imu = *to_.since_last;
  Eigen::Map<StateVector> r(residuals);
  r = weight_ * imu.Residual(from, to, gravity_, nullptr, nullptr);
  if (!jacobians) return r.allFinite();
  StateMatrix J_from, J_to;
  imu.Residual(from_.in_prior ? from_.linearization : from, to_.in_prior ? to_.linearization : to,
               gravity_, &J_from, &J_to);
  J_from.leftCols<3>() *=
      Linearization::TurnOf(from_, Eigen::Map<const Eigen::Vector3d>(parameters[0]));
  J_to.leftCols<3>() *=
      Linearization::TurnOf(to_, Eigen::Map<const Eigen::Vector3d>(parameters[2]));
  const StateMatrix whole_from = weight_ * J_from, whole_to = weight_ * J_to;
  using Pose = Eigen::Matrix<double, kStateSize, kPoseParameters, Eigen::RowMajor>;
  using Motion = Eigen::Matrix<double, kStateSize, kMotionParameters, Eigen::RowMajor>;
  if (jacobians[0]) Eigen::Map<Pose>{jacobians[0]} = whole_from.leftCols<kPoseParameters>();
  if (jacobians[1]) Eigen::Map<Motion>{jacobians[1]} = whole_from.rightCols<kMotionParameters>();
  if (jacobians[2]) Eigen::Map<Pose>{jacobians[2]} = whole_to.leftCols<kPoseParameters>();
  if (jacobians[3]) Eigen::Map<Motion>{jacobians[3]} = whole_to.rightCols<kMotionParameters>();
  return r.allFinite();
}

PriorCost::PriorCost(const SquareRootPrior& prior) : prior_(prior) {
  set_num_residuals(static_cast<int>(prior.e().size()));
  for (const BlockId block : prior.blocks())
    mutable_parameter_block_sizes()->push_back(block.size());
}

bool PriorCost::Evaluate(double const* const* parameters, double* residuals,
                         double** jacobians) const {
  EvaluateRows(prior_.S(), prior_.e(), parameter_block_sizes(), parameters, residuals, jacobians);
  return true;
}

std::deque<InertialCost> InertialCosts(const Linearization& at, double gravity) {
  std::deque<InertialCost> costs;  // cost functions cannot be moved
  const auto& frames = at.frames();
  for (size_t k = 1; k < frames.size(); ++k)
    if (frames[k].since_last && frames[k].inertial && frames[k - 1].inertial)
      costs.emplace_back(at, frames[k - 1], frames[k], gravity);
  return costs;
}

double ErrorOf(const std::deque<InertialCost>& costs, const Linearization& at) {
  double squares = 0;
  for (const InertialCost& cost : costs) {
    std::array<const double*, 4> parameters;
    for (size_t k = 0; k < parameters.size(); ++k)
      parameters[k] = at.x().data() + at.OffsetOf(cost.blocks()[k]);
    StateVector r;
    cost.Evaluate(parameters.data(), r.data(), nullptr);
    squares += r.squaredNorm() / kStateSize;
  }
  return costs.empty() ? 0 : std::sqrt(squares / static_cast<double>(costs.size()));
}

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

}  // namespace sgf::vio
