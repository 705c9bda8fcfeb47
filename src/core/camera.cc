#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/core.h>

#include <sgf/core/camera.h>
#include <sgf/core/error.h>

namespace sgf {

namespace {

/// Distort() for a fisheye lens: the image's radius grows with the angle to the axis.
Eigen::Vector2d DistortFisheye(double omega, const Eigen::Vector2d& n) {
  const double widest = 2 * std::tan(omega / 2);
  const double r = n.norm();
  constexpr double kOnAxis = 1e-8;
  return (r < kOnAxis ? widest / omega : std::atan(r * widest) / (omega * r)) * n;
}

/// Radially and tangentially distorted normalised coordinates and, if asked for, their derivative
/// by the undistorted ones.
Eigen::Vector2d Distort(const Camera& c, const Eigen::Vector2d& n, Eigen::Matrix2d* J) {
  const double x = n.x(), y = n.y(), r2 = n.squaredNorm();
  const double radial = 1 + r2 * (c.k1 + r2 * c.k2);
  if (J) {
    const double slope = 2 * c.k1 + 4 * c.k2 * r2;  // d radial = slope * (x dx + y dy)
    *J << radial + x * x * slope + 2 * c.p1 * y + 6 * c.p2 * x,
        x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y,  //
        x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y,
        radial + y * y * slope + 6 * c.p1 * y + 2 * c.p2 * x;
  }
  return {x * radial + 2 * c.p1 * x * y + c.p2 * (r2 + 2 * x * x),
          y * radial + c.p1 * (r2 + 2 * y * y) + 2 * c.p2 * x * y};
}

/// Squared radius (normalised, undistorted) from which the radial distortion moves points back
/// inwards: the smallest positive root of the derivative of r (1 + k1 r^2 + k2 r^4), if any.
double SquaredFoldRadius(const Camera& c) {
  const double discriminant = 9 * c.k1 * c.k1 - 20 * c.k2;
  const double divisor = discriminant < 0 ? 0 : std::sqrt(discriminant) - 3 * c.k1;
  return divisor > 0 ? 2 / divisor : std::numeric_limits<double>::infinity();
}

/// Inverts DistortFisheye(); nothing from 90 degrees off the axis on.
std::optional<Eigen::Vector2d> UndistortFisheye(double omega, const Eigen::Vector2d& d) {
  const double r = d.norm();
  const double widest = 2 * std::tan(omega / 2);
  if (!(r * omega < std::numbers::pi / 2)) return std::nullopt;
  constexpr double kOnAxis = 1e-8;
  return r < kOnAxis ? omega / widest * d : std::tan(r * omega) / (widest * r) * d;
}

}  // namespace

Eigen::Vector2d Camera::Project(const Eigen::Vector3d& point) const {
  const Eigen::Vector2d n = point.hnormalized();
  const Eigen::Vector2d d = omega != 0 ? DistortFisheye(omega, n) : Distort(*this, n, nullptr);
  return {fx * d.x() + cx, fy * d.y() + cy};
}

Eigen::Vector3d Camera::Unproject(const Eigen::Vector2d& pixel) const {
  if (const auto ray = TryUnproject(pixel)) return *ray;
  throw Error("camera", fmt::format("no ray for pixel ({}, {}): the distortion folds back there",
                                    pixel.x(), pixel.y()));
}

std::optional<Eigen::Vector3d> Camera::TryUnproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d target((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  if (!distorted()) return target.homogeneous();
  if (omega != 0) {
    const auto n = UndistortFisheye(omega, target);
    return n ? std::optional<Eigen::Vector3d>(n->homogeneous()) : std::nullopt;
  }
  Eigen::Vector2d n = target;
  Eigen::Matrix2d J;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Eigen::Vector2d error = target - Distort(*this, n, &J);
    if (error.norm() * std::max(fx, fy) < 1e-9) {
      // Newton's method may have leapt over the fold to a ray that no lens maps here.
      if (n.squaredNorm() >= SquaredFoldRadius(*this)) break;
      return n.homogeneous();
    }
    if (J.determinant() <= 0) break;
    n += J.inverse() * error;
  }
  return std::nullopt;
}

void Camera::Check() const {
  if (width < 1 || height < 1)
    throw Error("camera", fmt::format("size is {}x{} px; it has to be positive", width, height));
  if (!(fx > 0 && fy > 0))
    throw Error("camera",
                fmt::format("focal lengths are {}, {} px; they have to be positive", fx, fy));
  for (const double value : {fx, fy, cx, cy, k1, k2, p1, p2, omega})
    if (!std::isfinite(value))
      throw Error("camera", fmt::format("a parameter is {}; all have to be finite", value));
  if (!(omega >= 0 && omega < std::numbers::pi))
    throw Error("camera", fmt::format("omega is {} rad; it has to be in [0, pi)", omega));
  if (omega != 0 && (k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0))
    throw Error("camera", "has omega and another distortion as well");
}

}  // namespace sgf
