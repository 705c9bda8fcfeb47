#pragma once

#include <compare>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sgf/vio/calibration.h>

/// What is known of a window's frames from the measurements that have left it.
namespace sgf::vio {

inline constexpr int kPoseParameters = 6;    ///< rotation, position
inline constexpr int kMotionParameters = 9;  ///< velocity, gyroscope's and accelerometer's bias

enum class Part { kPose, kMotion, kCalibration };

/// A frame's pose or motion, or the calibration, among the parameters, in the tangent of Plus():
/// differences from where it was linearised.
struct BlockId {
  int frame = 0;
  Part part = Part::kPose;

  int size() const {
    return part == Part::kPose     ? kPoseParameters
           : part == Part::kMotion ? kMotionParameters
                                   : kCalibrationParameters;
  }
  auto operator<=>(const BlockId&) const = default;
};

inline constexpr BlockId kCalibrationBlock{-1, Part::kCalibration};

/// |S x + e|^2 / 2 in the parameters x of blocks, one after the other. Kept as a square root, so
/// that numbers have half the digits of the normal equations' (Demmel et al., "Square root bundle
/// adjustment for large-scale reconstruction", 2021; Demmel et al., "Square root marginalization
/// for sliding-window bundle adjustment", 2021).
class SquareRootPrior {
 public:
  const std::vector<BlockId>& blocks() const { return blocks_; }
  const Eigen::MatrixXd& S() const { return S_; }
  const Eigen::VectorXd& e() const { return e_; }

  bool Has(BlockId block) const;

  /// Where the parameters of a block begin. @throws Error for one that is not there.
  int OffsetOf(BlockId block) const;

  /// Adds |S x + e|^2 / 2 of some blocks, in this order; those that are new are appended.
  void Add(std::span<const BlockId> blocks, const Eigen::MatrixXd& S, const Eigen::VectorXd& e);

  /// Takes blocks out, minimising over their parameters. Those that are not there are ignored.
  void Marginalize(std::span<const BlockId> blocks);

 private:
  std::vector<BlockId> blocks_;
  Eigen::MatrixXd S_;
  Eigen::VectorXd e_;
};

}  // namespace sgf::vio
