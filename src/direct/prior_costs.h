#pragma once

#include <algorithm>
#include <array>

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include <sgf/core/camera.h>
#include <sgf/core/square_root.h>
#include <sgf/direct/prior.h>

/// What is known of a window before its measurements, as costs for Ceres. All have blocks of
/// kFrameParameters parameters.
namespace sgf::direct {

/// The camera takes a key-frame's place among the parameters, after all of them: fx, fy, cx, cy as
/// differences from where it was linearised, and four without a meaning.
inline constexpr int kCameraId = -1, kIntrinsics = 4;

/// @return fx, fy, cx, cy, px.
inline std::array<double*, kIntrinsics> IntrinsicsOf(Camera& camera) {
  return {&camera.fx, &camera.fy, &camera.cx, &camera.cy};
}

/// What is known of the camera beforehand.
class CameraCost : public ceres::SizedCostFunction<kFrameParameters, kFrameParameters> {
 public:
  CameraCost(Camera linearization, Camera expected, double sigma_px) : sigma_px_(sigma_px) {
    offset_.setZero();
    for (int k = 0; k < kIntrinsics; ++k)
      offset_(k) = *IntrinsicsOf(linearization)[k] - *IntrinsicsOf(expected)[k];
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    Eigen::Map<FrameParameters> r(residuals);
    r = (offset_ + Eigen::Map<const FrameParameters>(parameters[0])) / sigma_px_;
    using Block = Eigen::Matrix<double, kFrameParameters, kFrameParameters>;
    if (jacobians && jacobians[0]) {
      Eigen::Map<Block> J(jacobians[0]);
      J = Block::Identity() / sigma_px_;
    }
    return true;
  }

 private:
  double sigma_px_;
  FrameParameters offset_;
};

/// What is known of a brightness beforehand.
struct BrightnessBelief {
  Eigen::Vector2d sigma;
  Eigen::Vector2d offset;  ///< of the linearisation from what is expected
};

class BrightnessCost : public ceres::SizedCostFunction<2, kFrameParameters> {
 public:
  explicit BrightnessCost(const BrightnessBelief& belief)
      : sigma_(belief.sigma), offset_(belief.offset) {}
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
    EvaluateRows(root_.S, root_.e, parameter_block_sizes(), parameters, residuals, jacobians);
    return true;
  }

 private:
  SquareRoot root_;
};

}  // namespace sgf::direct
