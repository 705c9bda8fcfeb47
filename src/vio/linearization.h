#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sgf/vio/calibration.h>
#include <sgf/vio/prior.h>
#include <sgf/vio/visual_equations.h>
#include <sgf/vio/window.h>

/// What a window's costs are functions of.
namespace sgf::vio {

/// A window's frames and calibration as parameters: differences from where they are linearised.
class Linearization {
 public:
  /// @param frames those that the prior does not know are linearised where they are.
  /// @param calibrates whether the calibration is estimated; else it is taken as it is.
  Linearization(std::deque<Frame>& frames, const CalibrationEstimate& calibration, bool calibrates);

  std::deque<Frame>& frames() const { return frames_; }
  const std::vector<BlockId>& blocks() const { return blocks_; }
  /// Those that say where the cameras see the landmarks: poses, calibration. They come first.
  std::span<const BlockId> visual_blocks() const { return {blocks_.data(), visual_blocks_}; }
  Eigen::Index visual_size() const {
    return kPoseParameters * static_cast<Eigen::Index>(frames_.size()) +
           (calibrates_ ? kCalibrationParameters : 0);
  }
  /// Of all blocks, one after the other.
  Eigen::VectorXd& x() { return x_; }
  const Eigen::VectorXd& x() const { return x_; }
  /// Of the body as the cameras see it.
  std::span<const PoseState> poses() const { return poses_; }

  /// Where a block begins in x().
  Eigen::Index OffsetOf(BlockId block) const;

  /// Of a frame among the frames.
  int PositionOf(int id) const;

  /// The state of a frame at some parameters.
  /// @param pose kPoseParameters of them. @param motion kMotionParameters, or null for none.
  BodyState StateAt(const Frame& frame, const double* pose, const double* motion) const;

  /// Derivatives by the parameters are those by the local tangent times this, for the rotation.
  static Eigen::Matrix3d TurnOf(const Frame& frame, const Eigen::Vector3d& rotation);

  /// Takes poses() to where x() is.
  void UpdatePoses();

  /// Derivatives of poses() by all visual parameters; empty where they are these parameters.
  Eigen::MatrixXd JacobianOfPoses() const;

  Calibration CalibrationNow() const;

  /// Takes the frames' states to where x() is.
  void WriteBack();

 private:
  BodyState StateOf(const Frame& frame) const;

  /// Of the body itself.
  PoseState PoseAt(size_t k) const;

  /// Whether the cameras see the body elsewhere than the rig and the time stamps say.
  bool IsSeenElsewhere() const { return calibrates_ || !calibration_.value.IsIdentity(); }

  /// While it is estimated, the prior knows it.
  const Calibration& LinearCalibration() const {
    return calibrates_ ? calibration_.linearization : calibration_.value;
  }

  void SetParameters(int id, const StateVector& delta);

  std::deque<Frame>& frames_;
  const CalibrationEstimate& calibration_;
  bool calibrates_;
  std::vector<BodyVelocity> velocities_;
  std::vector<BlockId> blocks_;
  size_t visual_blocks_ = 0;
  std::vector<Eigen::Index> offsets_;
  Eigen::VectorXd x_;
  std::vector<PoseState> poses_;
};

/// A window's landmarks with their frames' positions.
std::vector<LandmarkItem> ItemsOf(const Linearization& at,
                                  std::map<std::int64_t, Landmark>& landmarks);

}  // namespace sgf::vio
