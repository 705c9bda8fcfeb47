#pragma once

#include <Eigen/Core>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

namespace sgf::direct {

/// Where a pixel of known inverse depth is in another camera's image.
struct Projection {
  bool in_view = false;  ///< far enough inside for a patch to be sampled
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  float inverse_depth = 0;  ///< in the other camera
};

/// @param camera that of both images, without distortion.
/// @param inverse_depth along the optical axis, in units of the translation.
Projection Project(const Camera& camera, const SE3& T_target_host, const Eigen::Vector2f& pixel,
                   double inverse_depth);

}  // namespace sgf::direct
