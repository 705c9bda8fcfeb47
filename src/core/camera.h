#pragma once

#include <optional>

#include <Eigen/Core>

namespace sgf {

/// Pinhole camera with radial-tangential (Brown-Conrady) distortion, as OpenCV and EuRoC use it, or
/// with that of a fisheye lens by one parameter (Devernay, Faugeras, "Straight lines have to be
/// straight", 2001), as TUM's monocular sequences use it. The camera looks along +z, x points right
/// and y down. Pixel (0, 0) is the centre of the upper left pixel.
struct Camera {
  int width = 0, height = 0;              ///< px
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;  ///< distortion; all 0 for an ideal pinhole
  double omega = 0;  ///< rad: field of view of the fisheye lens' model; the others are 0 then

  /// Whether any distortion is set.
  bool distorted() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || omega != 0; }

  /// Image (px) of a point in camera coordinates with z > 0; it may lie outside the image.
  /// Points far outside the field of view may come back into it where the distortion folds.
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const;

  /// Ray of a pixel: camera coordinates of its point at z = 1. Inverts the distortion to 1e-9 px.
  /// @throws Error where the distortion cannot be inverted (far outside the image it was made for).
  Eigen::Vector3d Unproject(const Eigen::Vector2d& pixel) const;

  /// The same; nothing where there is no ray.
  std::optional<Eigen::Vector3d> TryUnproject(const Eigen::Vector2d& pixel) const;

  /// @throws Error naming what is wrong with the parameters (sizes or focal lengths not positive,
  /// numbers not finite, omega outside [0, pi) or beside other distortion).
  void Check() const;
};

}  // namespace sgf
