#include <algorithm>
#include <array>

#include <Eigen/Cholesky>

#include <sgf/vio/visual_equations.h>
#include <sgf/vio/window.h>
#include <sgf/vio/window_costs.h>

namespace sgf::vio {

using Eigen::Index, Eigen::Matrix3d, Eigen::MatrixXd, Eigen::VectorXd;

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
