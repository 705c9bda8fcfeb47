#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <sgf/vio/window.h>

/// Normal equations of what a window's landmarks say of its poses.
namespace sgf::vio {

/// A landmark whose frames are known by their positions in the window.
struct LandmarkItem {
  Landmark* landmark = nullptr;
  int host = 0;
  std::vector<int> frames = {};               ///< of each sight
  Eigen::Vector3d value = {0, 0, 0};          ///< ray and inverse depth now
  Eigen::Vector3d linearization = {0, 0, 0};  ///< at the last linearisation
  Eigen::Matrix3d H_inverse = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  /// H between the landmark and each pose that it touches.
  struct Across {
    int frame;
    Eigen::Matrix<double, 3, kPoseParameters> H;
  };
  std::vector<Across> across = {};
};

/// Poses of the window's frames: where they are and where derivatives are taken.
struct PoseState {
  SE3 T_world_body, linearization;
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  ///< of the local tangent by the parameters
};

/// H and b of all poses, six parameters each, landmarks eliminated.
struct ReducedEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

/// Errors of sights, (f / sigma) (projection - ray), under Huber's loss.
class VisualEquations {
 public:
  VisualEquations(const VioRig& rig, const WindowOptions& options, int threads);

  /// Sum of rho / 2 at the landmarks' values.
  double Cost(std::span<const PoseState> poses, std::span<const LandmarkItem> items) const;

  /// The same, and normal equations with the landmarks eliminated; the items remember what
  /// MoveLandmarks() needs.
  double Linearize(std::span<const PoseState> poses, std::span<LandmarkItem> items,
                   ReducedEquations& reduced) const;

  /// Landmarks follow the poses as the last linearisation says.
  /// @param step of all poses since then.
  void MoveLandmarks(const Eigen::VectorXd& step, std::span<LandmarkItem> items) const;

  /// Error of a sight, px; infinite behind the camera.
  double ErrorPx(std::span<const PoseState> poses, const LandmarkItem& item, size_t sight) const;

 private:
  struct Seen;
  bool See(std::span<const PoseState> poses, const LandmarkItem& item, size_t sight,
           bool derivatives, Seen& seen) const;
  double LinearizeItem(std::span<const PoseState> poses, LandmarkItem& item,
                       ReducedEquations& part) const;

  VioRig rig_;
  std::vector<SE3> T_cam_body_;
  double weight_;  ///< f / sigma
  double huber_, sigma_px_;
  int threads_;
};

}  // namespace sgf::vio
