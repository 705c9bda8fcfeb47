#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

/// Rotations and rigid motions. A transform T_a_b maps coordinates in frame b to frame a.
namespace sgf {

/// Rotation by the rotation vector `w` (rad).
inline Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  // sin(x/2)/x and cos(x/2) to the order at which the next term is below double precision.
  const double half_sinc =
      angle > 1e-4 ? std::sin(0.5 * angle) / angle : 0.5 - angle * angle / 48.0;
  const Eigen::Vector3d v = half_sinc * w;
  return Eigen::Quaterniond(std::cos(0.5 * angle), v.x(), v.y(), v.z());
}

/// Rotation vector (rad) of a unit quaternion, of norm at most pi: the inverse of ExpSO3.
inline Eigen::Vector3d LogSO3(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const double sine = q.vec().norm();
  const double cosine = sign * q.w();
  const double scale =
      sine > 1e-6 ? 2.0 * std::atan2(sine, cosine) / sine : 2.0 / cosine * (1 - sine * sine / 3);
  return sign * scale * q.vec();
}

/// A rigid motion: rotation R and translation p (m), as unit quaternion and vector.
struct SE3 {
  Eigen::Quaterniond R = Eigen::Quaterniond::Identity();  ///< of unit norm
  Eigen::Vector3d p = Eigen::Vector3d::Zero();            ///< origin of frame b in frame a, m

  /// Coordinates in frame a of the point with coordinates x in frame b.
  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return R * x + p; }

  /// T_a_c of T_a_b and T_b_c; the rotation is normalised again.
  SE3 operator*(const SE3& other) const { return {(R * other.R).normalized(), R * other.p + p}; }

  /// T_b_a.
  SE3 Inverse() const { return {R.conjugate(), -(R.conjugate() * p)}; }

  /// The homogeneous matrix [R p; 0 1].
  Eigen::Matrix4d Matrix() const {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = R.toRotationMatrix();
    m.topRightCorner<3, 1>() = p;
    return m;
  }
};

}  // namespace sgf
