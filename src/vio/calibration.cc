#include <sgf/vio/calibration.h>

namespace sgf::vio {

using Eigen::Matrix3d, Eigen::Vector3d;

Calibration Plus(const Calibration& calibration, const CalibrationVector& delta) {
  Calibration moved = calibration;
  moved.T_body_rig.R = (moved.T_body_rig.R * ExpSO3(delta.head<3>())).normalized();
  moved.T_body_rig.p += delta.segment<3>(3);
  moved.time_offset_s += delta(6);
  return moved;
}

CalibrationVector Minus(const Calibration& to, const Calibration& from) {
  CalibrationVector delta;
  delta << LogSO3(from.T_body_rig.R.conjugate() * to.T_body_rig.R),
      to.T_body_rig.p - from.T_body_rig.p, to.time_offset_s - from.time_offset_s;
  return delta;
}

SE3 AsSeen(const SE3& T_world_body, const BodyVelocity& velocity, const Calibration& calibration) {
  const double offset_s = calibration.time_offset_s;
  const SE3 then{T_world_body.R * ExpSO3(offset_s * velocity.angular),
                 T_world_body.p + offset_s * velocity.linear};
  return then * calibration.T_body_rig;
}

AsSeenJacobian JacobianOfAsSeen(const SE3& T_world_body, const BodyVelocity& velocity,
                                const Calibration& calibration) {
  const SE3& rig = calibration.T_body_rig;
  const Vector3d turn = calibration.time_offset_s * velocity.angular;
  const Matrix3d R = T_world_body.R.toRotationMatrix(), E = ExpSO3(turn).toRotationMatrix(),
                 C = rig.R.conjugate().toRotationMatrix();
  // A turn about a fixed axis commutes with more of it, so its own angular rate stays as it is.
  AsSeenJacobian J;
  J.by_pose.setZero();
  J.by_pose.topLeftCorner<3, 3>() = C * E.transpose();
  J.by_pose.bottomLeftCorner<3, 3>() = -R * HatSO3(E * rig.p);
  J.by_pose.bottomRightCorner<3, 3>().setIdentity();
  J.by_calibration.setZero();
  J.by_calibration.topLeftCorner<3, 3>().setIdentity();
  J.by_calibration.block<3, 3>(3, 3) = R * E;
  J.by_calibration.col(6) << C * velocity.angular,
      velocity.linear + R * E * velocity.angular.cross(rig.p);
  return J;
}

}  // namespace sgf::vio
