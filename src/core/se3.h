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

/// Smallest rotation that takes the direction of `from` to that of `to`; of opposite ones, a half
/// turn. Defined apart, as Eigen's treatment of opposite directions takes a singular value
/// decomposition and seconds to compile.
Eigen::Quaterniond RotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// The matrix of the cross product with w: HatSO3(w) x = w.cross(x).
inline Eigen::Matrix3d HatSO3(const Eigen::Vector3d& w) {
  Eigen::Matrix3d m;
  m << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return m;
}

/// Jr with Exp(w + d) = Exp(w) Exp(Jr d) to first order in d (Forster et al., "On-manifold
/// preintegration for real-time visual-inertial odometry", 2017, equation 8).
inline Eigen::Matrix3d RightJacobianSO3(const Eigen::Vector3d& w) {
  const double square = w.squaredNorm(), angle = std::sqrt(square);
  // (1 - cos x)/x^2 and (x - sin x)/x^3 to the order at which the next term is below double
  // precision; the closed forms cancel at small angles.
  const bool small = angle < 0.02;
  const double half_sinc = small ? 0 : std::sin(0.5 * angle) / angle;
  const double first =
      small ? 0.5 - square / 24 + square * square / 720 : 2 * half_sinc * half_sinc;
  const double second = small ? 1.0 / 6 - square / 120 + square * square / 5040
                              : (angle - std::sin(angle)) / (square * angle);
  const Eigen::Matrix3d hat = HatSO3(w);
  return Eigen::Matrix3d::Identity() - first * hat + second * hat * hat;
}

/// The inverse of RightJacobianSO3(w), for rotations of less than a full turn: Log(Exp(w) Exp(d)) =
/// w + Jr^-1 d to first order in d (Forster et al., equation 9).
inline Eigen::Matrix3d InverseRightJacobianSO3(const Eigen::Vector3d& w) {
  const double square = w.squaredNorm(), half = 0.5 * std::sqrt(square);
  const double second = half < 0.01 ? 1.0 / 12 + square / 720 + square * square / 30240
                                    : (1 - half / std::tan(half)) / square;
  const Eigen::Matrix3d hat = HatSO3(w);
  return Eigen::Matrix3d::Identity() + 0.5 * hat + second * hat * hat;
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

/// So much of a motion, at constant velocity. @param share may be negative or above 1.
inline SE3 PartOf(const SE3& motion, double share) {
  return {ExpSO3(share * LogSO3(motion.R)), share * motion.p};
}

}  // namespace sgf
