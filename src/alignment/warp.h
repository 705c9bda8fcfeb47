#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

/// Warps: where a pixel of the reference image is found in the current one, W(u; p), and how that
/// place and the directions there change with the parameters p.
///
/// A gradient is a vector: to be compared with one of the reference it is carried there, as A^T
/// grad I with A = dW/du. The chain rule of a carried gradient thus has two terms, one from the
/// gradient's own change with the place and one from A's change, which every warp states as
/// Turn(v) = d(A^T v)/dp at constant v.
namespace sgf::alignment {

template <class T>
using Vector2 = Eigen::Matrix<T, 2, 1>;

template <class T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

/// The cross product as a matrix: Cross(a) b = a x b.
template <class T>
Eigen::Matrix<T, 3, 3> Cross(const Vector3<T>& a) {
  return (Eigen::Matrix<T, 3, 3>() << T(0), -a.z(), a.y(), a.z(), T(0), -a.x(), -a.y(), a.x(), T(0))
      .finished();
}

/// Camera coordinates at depth 1 of a pixel of a camera without distortion.
template <class T>
Vector2<T> RayOf(const Camera& camera, const Vector2<T>& pixel) {
  return {static_cast<T>((pixel.x() - camera.cx) / camera.fx),
          static_cast<T>((pixel.y() - camera.cy) / camera.fy)};
}

/// The motion (exp(w), v) of v (m) before w (rad).
inline SE3 Perturbation(const Eigen::Matrix<double, 6, 1>& delta) {
  return {ExpSO3(delta.tail<3>()), delta.head<3>()};
}

/// W(u) = centre + offset + p: parameters (x, y), px.
template <class T>
struct TranslationWarp {
  using Scalar = T;
  static constexpr int kParameters = 2;
  using Parameters = Eigen::Matrix<T, kParameters, 1>;
  using Input = Vector2<T>;  ///< offset of the pixel from the patch's centre, px

  struct Point {
    Vector2<T> pixel;
    Eigen::Matrix<T, 2, 2> A() const { return Eigen::Matrix<T, 2, 2>::Identity(); }
    Eigen::Matrix<T, 2, 2> Jacobian() const { return Eigen::Matrix<T, 2, 2>::Identity(); }
    Eigen::Matrix<T, 2, 2> Turn(const Vector2<T>& /*v*/) const {
      return Eigen::Matrix<T, 2, 2>::Zero();
    }
  };

  Vector2<T> centre = Vector2<T>::Zero();  ///< of the patch in the current image, px

  bool At(const Input& offset, Point& point) const {
    point.pixel = centre + offset;
    return true;
  }
  void Update(const Parameters& delta) { centre += delta; }
};

/// W(u) = centre + s R(angle) offset: parameters (x, y) px, angle rad and, with kScaled, log s.
template <class T, bool kScaled>
struct PlanarWarp {
  using Scalar = T;
  static constexpr int kParameters = kScaled ? 4 : 3;
  using Parameters = Eigen::Matrix<T, kParameters, 1>;
  using Input = Vector2<T>;  ///< offset of the pixel from the patch's centre, px

  struct Point {
    Vector2<T> pixel;
    Vector2<T> arm;  ///< from the centre to the pixel
    Eigen::Matrix<T, 2, 2> a;

    const Eigen::Matrix<T, 2, 2>& A() const { return a; }

    Eigen::Matrix<T, 2, kParameters> Jacobian() const {
      Eigen::Matrix<T, 2, kParameters> J;
      J.template leftCols<2>().setIdentity();
      J.col(2) = Vector2<T>(-arm.y(), arm.x());
      if constexpr (kScaled) J.col(3) = arm;
      return J;
    }

    Eigen::Matrix<T, 2, kParameters> Turn(const Vector2<T>& v) const {
      Eigen::Matrix<T, 2, kParameters> turn = Eigen::Matrix<T, 2, kParameters>::Zero();
      turn.col(2) = a.transpose() * Vector2<T>(v.y(), -v.x());
      if constexpr (kScaled) turn.col(3) = a.transpose() * v;
      return turn;
    }
  };

  Vector2<T> centre = Vector2<T>::Zero();  ///< of the patch in the current image, px
  T angle = T(0);                          ///< rad
  T log_scale = T(0);

  bool At(const Input& offset, Point& point) const {
    using std::cos, std::exp, std::sin;
    const T scale = kScaled ? T(exp(log_scale)) : T(1);
    const T c = scale * cos(angle), s = scale * sin(angle);
    point.a << c, -s, s, c;
    point.arm = point.a * offset;
    point.pixel = centre + point.arm;
    return true;
  }
  void Update(const Parameters& delta) {
    centre += delta.template head<2>();
    angle += delta(2);
    if constexpr (kScaled) log_scale += delta(3);
  }
};

template <class T>
using Se2Warp = PlanarWarp<T, false>;
template <class T>
using SimilarityWarp = PlanarWarp<T, true>;

/// A pixel of the reference image on a surface. A plane's inverse depth is linear in the pixel, so
/// that its slope tells how the surface is slanted.
template <class T>
struct PixelAtDepth {
  Vector2<T> ray;    ///< camera coordinates at depth 1
  T inverse_depth;   ///< 1/m, along the optical axis; 0 is at infinity
  Vector2<T> slope;  ///< of the inverse depth, 1/m per px
};

namespace warp_internal {

/// Projection of X = R ray + inverse_depth p and what its derivatives are made of:
/// dX/du = R diag(1/fx, 1/fy) + p slope^T.
template <class T>
struct Projection {
  Vector2<T> pixel;
  Vector3<T> X;
  Eigen::Matrix<T, 2, 3> d_X;  ///< d pixel / d X
  Eigen::Matrix<T, 3, 2> d_u;  ///< d X / d u
  T fx, fy;

  Eigen::Matrix<T, 2, 2> A() const { return d_X * d_u; }

  /// Second derivative of v . pixel by X.
  Eigen::Matrix<T, 3, 3> Hessian(const Vector2<T>& v) const {
    const T iz = T(1) / X.z();
    const T a = -v.x() * fx * iz * iz, b = -v.y() * fy * iz * iz;
    const T c = T(-2) * (a * X.x() + b * X.y()) * iz;
    return (Eigen::Matrix<T, 3, 3>() << T(0), T(0), a, T(0), T(0), b, a, b, c).finished();
  }
};

/// A pinhole camera and a motion T_current_reference.
template <class T>
struct Projector {
  T fx, fy, cx, cy;
  Eigen::Matrix<T, 3, 3> R;
  Vector3<T> p;

  Projector() = default;
  Projector(const Camera& camera, const SE3& T_cur_ref)
      : fx(T(camera.fx)),
        fy(T(camera.fy)),
        cx(T(camera.cx)),
        cy(T(camera.cy)),
        R(T_cur_ref.R.toRotationMatrix().cast<T>()),
        p(T_cur_ref.p.cast<T>()) {}

  /// @return false for a point that is not in front of the camera.
  bool operator()(const PixelAtDepth<T>& u, Projection<T>& out) const {
    out.X = R.col(0) * u.ray.x() + R.col(1) * u.ray.y() + R.col(2) + u.inverse_depth * p;
    if (!(out.X.z() > T(1e-3))) return false;
    const T iz = T(1) / out.X.z();
    const T x = out.X.x() * iz, y = out.X.y() * iz;
    out.pixel = {fx * x + cx, fy * y + cy};
    out.d_X << fx * iz, T(0), -fx * x * iz, T(0), fy * iz, -fy * y * iz;
    out.d_u.col(0) = R.col(0) / fx + p * u.slope.x();
    out.d_u.col(1) = R.col(1) / fy + p * u.slope.y();
    out.fx = fx;
    out.fy = fy;
    return true;
  }
};

}  // namespace warp_internal

/// W(u) = pi(R pi^-1(u) + inverse_depth p) for T_cur_ref = (R, p). Parameters: a left perturbation,
/// T <- (exp(w), v) T, translation v (m) before rotation w (rad).
template <class T>
struct Se3Warp {
  using Scalar = T;
  static constexpr int kParameters = 6;
  using Parameters = Eigen::Matrix<T, kParameters, 1>;
  using Input = PixelAtDepth<T>;

  struct Point : warp_internal::Projection<T> {
    T inverse_depth;
    Vector2<T> slope;

    /// d X / d p = [inverse_depth I, -[X]x]
    Eigen::Matrix<T, 3, 6> Motion() const {
      Eigen::Matrix<T, 3, 6> motion;
      motion.template leftCols<3>() = inverse_depth * Eigen::Matrix<T, 3, 3>::Identity();
      motion.template rightCols<3>() = -Cross<T>(this->X);
      return motion;
    }
    Eigen::Matrix<T, 2, 6> Jacobian() const { return this->d_X * Motion(); }

    /// With q = d_X^T v: d_u^T (Hessian(v) dX/dp + [0, [q]x]) + [slope q^T, 0], since d_u turns
    /// with the motion and the translation carries the slope.
    Eigen::Matrix<T, 2, 6> Turn(const Vector2<T>& v) const {
      const Vector3<T> q = this->d_X.transpose() * v;
      Eigen::Matrix<T, 3, 6> d_q = this->Hessian(v) * Motion();
      d_q.template rightCols<3>() += Cross<T>(q);
      Eigen::Matrix<T, 2, 6> turn = this->d_u.transpose() * d_q;
      turn.template leftCols<3>() += slope * q.transpose();
      return turn;
    }
  };

  Camera camera;  ///< of both images
  SE3 T_cur_ref;
  warp_internal::Projector<T> projector;

  Se3Warp(const Camera& camera_in, const SE3& T_cur_ref_in)
      : camera(camera_in), T_cur_ref(T_cur_ref_in), projector(camera_in, T_cur_ref_in) {}

  bool At(const Input& u, Point& point) const {
    point.inverse_depth = u.inverse_depth;
    point.slope = u.slope;
    return projector(u, point);
  }
  /// The motion is kept in double precision whatever T.
  void Update(const Eigen::Matrix<double, 6, 1>& delta) {
    *this = {camera, Perturbation(delta) * T_cur_ref};
  }
};

/// The same with a known motion: the parameter is the inverse depth (1/m) of the patch's centre,
/// which moves the patch along its epipolar line.
template <class T>
struct EpipolarWarp {
  using Scalar = T;
  static constexpr int kParameters = 1;
  using Parameters = Eigen::Matrix<T, kParameters, 1>;
  using Input = PixelAtDepth<T>;  ///< with inverse depths against that of the patch's centre

  struct Point : warp_internal::Projection<T> {
    Vector3<T> p;
    Vector2<T> Jacobian() const { return this->d_X * p; }
    Vector2<T> Turn(const Vector2<T>& v) const {
      return this->d_u.transpose() * (this->Hessian(v) * p);
    }
  };

  warp_internal::Projector<T> projector;
  T inverse_depth;

  EpipolarWarp(const Camera& camera, const SE3& T_cur_ref, T inverse_depth_in)
      : projector(camera, T_cur_ref), inverse_depth(inverse_depth_in) {}

  bool At(const Input& u, Point& point) const {
    point.p = projector.p;
    return projector({u.ray, inverse_depth + u.inverse_depth, u.slope}, point);
  }
  void Update(const Parameters& delta) { inverse_depth += delta(0); }
};

}  // namespace sgf::alignment
