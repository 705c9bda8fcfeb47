#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include <sgf/core/square_root.h>
#include <sgf/vio/linearization.h>
#include <sgf/vio/prior.h>
#include <sgf/vio/visual_equations.h>
#include <sgf/vio/window.h>

/// What is measured and known of a window, as costs for Ceres.
namespace sgf::vio {

/// Landmarks as a cost function of all poses and of the calibration. They follow the poses: they
/// are where the linearisation has its minimum for them, so that the solver has a small dense
/// problem. Residuals are the square root of the reduced equations and one more that makes up for
/// the rest of the cost.
class VisualCost : public ceres::CostFunction {
 public:
  VisualCost(const VisualEquations& equations, Linearization& at, std::vector<LandmarkItem>& items);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

  /// Landmarks where they belong for the parameters as they are.
  void Settle() const;

 private:
  Eigen::VectorXd Parameters() const { return at_.x().head(at_.visual_size()); }

  const VisualEquations& equations_;
  Linearization& at_;
  std::vector<LandmarkItem>& items_;
  mutable Eigen::VectorXd linear_x_;  // Ceres takes cost functions as constant
  mutable Eigen::MatrixXd by_parameters_;
  mutable bool linearized_ = false;
};

/// Whitened residual of the inertial sensor between two frames.
class InertialCost : public ceres::SizedCostFunction<kStateSize, kPoseParameters, kMotionParameters,
                                                     kPoseParameters, kMotionParameters> {
 public:
  InertialCost(const Linearization& at, const Frame& from, const Frame& to, double gravity);

  std::array<BlockId, 4> blocks() const {
    return {{{from_.id, Part::kPose},
             {from_.id, Part::kMotion},
             {to_.id, Part::kPose},
             {to_.id, Part::kMotion}}};
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const Linearization& at_;
  const Frame& from_;
  const Frame& to_;
  double gravity_;
  StateMatrix weight_;
};

/// |S x + e|^2 / 2
class PriorCost : public ceres::CostFunction {
 public:
  explicit PriorCost(const SquareRootPrior& prior);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const SquareRootPrior& prior_;
};

/// Costs of the inertial sensor between neighbouring frames that both have a motion.
std::deque<InertialCost> InertialCosts(const Linearization& at, double gravity);

/// RMS of the costs' residuals at the parameters as they are; 0 where there are none.
double ErrorOf(const std::deque<InertialCost>& costs, const Linearization& at);

/// A cost as rows of [S e] in its blocks, at the parameters as they are.
SquareRoot RowsOf(const ceres::CostFunction& cost, std::span<const BlockId> blocks,
                  const Linearization& at);

/// Adds what landmarks say to a prior of the frames that see them; other frames stay out of it.
void AddLandmarks(const VisualEquations& equations, Linearization& at,
                  std::map<std::int64_t, Landmark>& landmarks, SquareRootPrior& prior);

}  // namespace sgf::vio
