#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sgf/core/always_inline.h>
#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

/// Warps: where a pixel of the reference image is found in the current one, W(u; p), and how that
/// place and the directions there change with the parameters p.
///
/// A gradient is a vector: to be compared with one of the reference it is carried there, as A^T
/// grad I with A = dW/du. The chain rule of a carried gradient thus has two terms, one from the
/// gradient's own change with the place and one from A's change. Derivatives are handed back from
/// the residual to the parameters (reverse mode), in two parts that every warp's Point has, each a
/// column of the parameters' length:
///
///     Along(c)   = c^T dW/dp
///     Turn(w, v) = w^T d(A^T v)/dp    at constant w and v
namespace sgf::alignment {

template <class T>
using Vector2 = Eigen::Matrix<T, 2, 1>;

template <class T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

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
    Vector2<T> Along(const Vector2<T>& c) const { return c; }
    Vector2<T> Turn(const Vector2<T>& /*w*/, const Vector2<T>& /*v*/) const {
      return Vector2<T>::Zero();
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

    Parameters Along(const Vector2<T>& c) const {
      Parameters along;
      along.template head<2>() = c;
      along(2) = c.y() * arm.x() - c.x() * arm.y();
      if constexpr (kScaled) along(3) = c.dot(arm);
      return along;
    }

    Parameters Turn(const Vector2<T>& w, const Vector2<T>& v) const {
      const Vector2<T> forth = a * w;
      Parameters turn = Parameters::Zero();
      turn(2) = forth.x() * v.y() - forth.y() * v.x();
      if constexpr (kScaled) turn(3) = forth.dot(v);
      return turn;
    }
  };

  Vector2<T> centre = Vector2<T>::Zero();  ///< of the patch in the current image, px
  T angle = T(0);                          ///< rad
  T log_scale = T(0);

  /// dW/du, the same everywhere.
  Eigen::Matrix<T, 2, 2> Linear() const {
    using std::cos, std::exp, std::sin;
    const T scale = kScaled ? T(exp(log_scale)) : T(1);
    const T c = scale * cos(angle), s = scale * sin(angle);
    Eigen::Matrix<T, 2, 2> a;
    a << c, -s, s, c;
    return a;
  }

  bool At(const Input& offset, Point& point) const {
    Place(offset, Linear(), point);
    return true;
  }
  /// The same with Linear() at hand: sines and cosines are taken once for all pixels of a patch.
  SGF_ALWAYS_INLINE void Place(const Input& offset, const Eigen::Matrix<T, 2, 2>& linear,
                               Point& point) const {
    point.a = linear;
    point.arm = linear * offset;
    point.pixel = centre + point.arm;
  }
  void Update(const Parameters& delta) {
    centre += delta.template head<2>();
    angle += delta(2);
    if constexpr (kScaled) log_scale += delta(3);
  }
  /// Goes back by a step of the reference: W <- W o W(delta)^-1, for derivatives that were taken at
  /// the reference (inverse-compositional; Baker, Matthews, "Lucas-Kanade 20 years on", 2004).
  void UpdateInverse(const Parameters& delta) {
    angle -= delta(2);
    if constexpr (kScaled) log_scale -= delta(3);
    centre -= Linear() * delta.template head<2>();
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
/// dX/du = R diag(1/fx, 1/fy) + p slope^T, and d pixel / d X = [fx 0 -fx x; 0 fy -fy y] / z with
/// x = X/z and y = Y/z.
template <class T>
struct Projection {
  Vector2<T> pixel;
  Vector3<T> X;
  Vector3<T> d_ux, d_uy;  ///< d X / d u, column by column
  T fx_z, fy_z, x, y, inv_z;

  Eigen::Matrix<T, 2, 2> A() const {
    Eigen::Matrix<T, 2, 2> A;
    A << fx_z * (d_ux.x() - x * d_ux.z()), fx_z * (d_uy.x() - x * d_uy.z()),
        fy_z * (d_ux.y() - y * d_ux.z()), fy_z * (d_uy.y() - y * d_uy.z());
    return A;
  }

  /// v^T d pixel / d X
  Vector3<T> BackToX(const Vector2<T>& v) const {
    const T a = fx_z * v.x(), b = fy_z * v.y();
    return {a, b, -(a * x + b * y)};
  }

  /// The second derivative of v . pixel by X, times t.
  Vector3<T> HessianTimes(const Vector2<T>& v, const Vector3<T>& t) const {
    const T a = -fx_z * inv_z * v.x(), b = -fy_z * inv_z * v.y();
    return {a * t.z(), b * t.z(), a * t.x() + b * t.y() - T(2) * (a * x + b * y) * t.z()};
  }
};

/// A pinhole camera and a motion T_current_reference.
template <class T>
struct Projector {
  T fx, fy, cx, cy;
  Eigen::Matrix<T, 3, 3> R;
  Vector3<T> p;
  Vector3<T> R_per_px_x, R_per_px_y;  ///< R's first columns over fx and fy

  Projector() = default;
  Projector(const Camera& camera, const SE3& T_cur_ref)
      : fx(T(camera.fx)),
        fy(T(camera.fy)),
        cx(T(camera.cx)),
        cy(T(camera.cy)),
        R(T_cur_ref.R.toRotationMatrix().cast<T>()),
        p(T_cur_ref.p.cast<T>()),
        R_per_px_x(R.col(0) / fx),
        R_per_px_y(R.col(1) / fy) {}

  /// @return false for a point that is not in front of the camera: of less than a thousandth of its
  /// depth in the reference.
  bool operator()(const PixelAtDepth<T>& u, Projection<T>& out) const {
    // Component by component: vectors of three are not always inlined.
    for (int k = 0; k < 3; ++k)
      out.X(k) = R(k, 0) * u.ray.x() + R(k, 1) * u.ray.y() + R(k, 2) + u.inverse_depth * p(k);
    if (!(out.X.z() > T(1e-3))) return false;
    out.inv_z = T(1) / out.X.z();
    out.x = out.X.x() * out.inv_z;
    out.y = out.X.y() * out.inv_z;
    out.pixel = {fx * out.x + cx, fy * out.y + cy};
    out.fx_z = fx * out.inv_z;
    out.fy_z = fy * out.inv_z;
    for (int k = 0; k < 3; ++k) {
      out.d_ux(k) = R_per_px_x(k) + p(k) * u.slope.x();
      out.d_uy(k) = R_per_px_y(k) + p(k) * u.slope.y();
    }
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

    Parameters Along(const Vector2<T>& c) const { return AlongX(this->BackToX(c)); }

    /// With A^T v = d_u^T q for q = v^T d pixel / d X, and t = d_u w: q changes by the Hessian with
    /// X, d_u turns with the motion, and the translation carries the slope.
    Parameters Turn(const Vector2<T>& w, const Vector2<T>& v) const {
      const Vector3<T> t = this->d_ux * w.x() + this->d_uy * w.y();
      const Vector3<T> q = this->BackToX(v);
      Parameters turn = AlongX(this->HessianTimes(v, t));
      turn.template head<3>() += slope.dot(w) * q;
      turn.template tail<3>() += t.cross(q);
      return turn;
    }

   private:
    /// m^T dX/dp = m^T [inverse_depth I, -[X]x]
    Parameters AlongX(const Vector3<T>& m) const {
      Parameters along;
      along.template head<3>() = inverse_depth * m;
      along.template tail<3>() = this->X.cross(m);
      return along;
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
    Parameters Along(const Vector2<T>& c) const { return Parameters(this->BackToX(c).dot(p)); }
    Parameters Turn(const Vector2<T>& w, const Vector2<T>& v) const {
      const Vector3<T> t = this->d_ux * w.x() + this->d_uy * w.y();
      return Parameters(this->HessianTimes(v, p).dot(t));
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

/// Both at once: the parameters of Se3Warp, then that of EpipolarWarp.
template <class T>
struct Se3DepthWarp {
  using Scalar = T;
  static constexpr int kParameters = 7;
  using Parameters = Eigen::Matrix<T, kParameters, 1>;
  using Input = PixelAtDepth<T>;  ///< with inverse depths against that of the patch's centre

  struct Point : Se3Warp<T>::Point {
    Vector3<T> p;
    Parameters Along(const Vector2<T>& c) const {
      return Joined(Motion::Along(c), this->BackToX(c).dot(p));
    }
    Parameters Turn(const Vector2<T>& w, const Vector2<T>& v) const {
      const Vector3<T> t = this->d_ux * w.x() + this->d_uy * w.y();
      return Joined(Motion::Turn(w, v), this->HessianTimes(v, p).dot(t));
    }

   private:
    using Motion = typename Se3Warp<T>::Point;
    static Parameters Joined(const Eigen::Matrix<T, 6, 1>& motion, T depth) {
      Parameters joined;
      joined.template head<6>() = motion;
      joined(6) = depth;
      return joined;
    }
  };

  Se3Warp<T> motion;
  T inverse_depth;

  Se3DepthWarp(const Camera& camera, const SE3& T_cur_ref, T inverse_depth_in)
      : motion(camera, T_cur_ref), inverse_depth(inverse_depth_in) {}

  bool At(const Input& u, Point& point) const {
    point.p = motion.projector.p;
    return motion.At({u.ray, inverse_depth + u.inverse_depth, u.slope}, point);
  }
  void Update(const Eigen::Matrix<double, kParameters, 1>& delta) {
    motion.Update(delta.template head<6>());
    inverse_depth += static_cast<T>(delta(6));
  }
};

/// The same, and the camera of both images: fx, fy, cx, cy (px) follow as parameters. They change
/// the reference's rays as well.
template <class T>
struct Se3DepthCameraWarp {
  using Scalar = T;
  static constexpr int kParameters = 11;
  using Parameters = Eigen::Matrix<T, kParameters, 1>;
  using Input = PixelAtDepth<T>;  ///< with rays of the camera `of_rays`, depths as in Se3DepthWarp

  struct Point : Se3DepthWarp<T>::Point {
    Vector2<T> ray;                     ///< of the reference
    Vector3<T> R_per_px_x, R_per_px_y;  ///< d X / d pixel of the reference
    Vector2<T> inv_f;

    Parameters Along(const Vector2<T>& c) const {
      Parameters along = AlongRays(this->BackToX(c));
      along.template head<7>() = Base::Along(c);
      along(7) += c.x() * this->x;
      along(8) += c.y() * this->y;
      along(9) += c.x();
      along(10) += c.y();
      return along;
    }

    /// As in Se3Warp, q changes with X; it and t have the focal lengths as factors as well.
    Parameters Turn(const Vector2<T>& w, const Vector2<T>& v) const {
      const Vector3<T> t = this->d_ux * w.x() + this->d_uy * w.y();
      const Vector3<T> q = this->BackToX(v);
      Parameters turn = AlongRays(this->HessianTimes(v, t));
      turn.template head<7>() = Base::Turn(w, v);
      turn(7) +=
          v.x() * this->inv_z * (t.x() - this->x * t.z()) - q.dot(R_per_px_x) * w.x() * inv_f.x();
      turn(8) +=
          v.y() * this->inv_z * (t.y() - this->y * t.z()) - q.dot(R_per_px_y) * w.y() * inv_f.y();
      return turn;
    }

   private:
    using Base = typename Se3DepthWarp<T>::Point;
    /// m^T dX/dp for the camera's parameters, zero for the others.
    Parameters AlongRays(const Vector3<T>& m) const {
      Parameters along = Parameters::Zero();
      along(9) = -m.dot(R_per_px_x);
      along(10) = -m.dot(R_per_px_y);
      along(7) = along(9) * ray.x();
      along(8) = along(10) * ray.y();
      return along;
    }
  };

  Se3DepthWarp<T> moved;
  Vector2<T> ray_scale, ray_shift;  ///< from the first camera's rays to those of the present one

  /// @param of_rays that inputs have their rays from.
  Se3DepthCameraWarp(const Camera& camera, const SE3& T_cur_ref, T inverse_depth,
                     const Camera& of_rays)
      : moved(camera, T_cur_ref, inverse_depth),
        ray_scale(T(of_rays.fx / camera.fx), T(of_rays.fy / camera.fy)),
        ray_shift(T((of_rays.cx - camera.cx) / camera.fx),
                  T((of_rays.cy - camera.cy) / camera.fy)) {}

  bool At(const Input& u, Point& point) const {
    const auto& projector = moved.motion.projector;
    point.ray = u.ray.cwiseProduct(ray_scale) + ray_shift;
    point.R_per_px_x = projector.R_per_px_x;
    point.R_per_px_y = projector.R_per_px_y;
    point.inv_f = {T(1) / projector.fx, T(1) / projector.fy};
    return moved.At({point.ray, u.inverse_depth, u.slope}, point);
  }
};

}  // namespace sgf::alignment
