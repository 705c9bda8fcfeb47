#pragma once

#include <vector>

#include <Eigen/Core>

/// What is known of a window's key-frames from the measurements that have left it.
namespace sgf::direct {

/// Parameters of a key-frame: a left perturbation of T_cam_world (translation before rotation),
/// then a and b of its brightness; all as differences from its linearisation.
inline constexpr int kFrameParameters = 8;
using FrameParameters = Eigen::Matrix<double, kFrameParameters, 1>;

/// A quadratic x^T H x / 2 + b^T x in the parameters x of key-frames, one after the other.
class Prior {
 public:
  const std::vector<int>& frames() const { return frames_; }
  const Eigen::MatrixXd& H() const { return H_; }
  const Eigen::VectorXd& b() const { return b_; }

  /// Adds a key-frame of which nothing is known; does nothing for one that is there.
  void AddFrame(int id);

  /// Where the parameters of a key-frame begin. @throws Error for one that is not there.
  int OffsetOf(int id) const;

  /// Adds x^T H x / 2 + b^T x of the key-frames `ids`, in this order.
  void Add(const std::vector<int>& ids, const Eigen::MatrixXd& H, const Eigen::VectorXd& b);

  /// Takes a key-frame out, minimising over its parameters (Schur complement).
  void Marginalize(int id);

 private:
  std::vector<int> frames_;
  Eigen::MatrixXd H_;
  Eigen::VectorXd b_;
};

}  // namespace sgf::direct
