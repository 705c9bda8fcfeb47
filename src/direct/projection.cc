#include <sgf/alignment/warp.h>
#include <sgf/direct/projection.h>

namespace sgf::direct {

Projection Project(const Camera& camera, const SE3& T_target_host, const Eigen::Vector2f& pixel,
                   double inverse_depth) {
  const Eigen::Vector2d ray = alignment::RayOf<double>(camera, pixel.cast<double>());
  const Eigen::Vector3d X = T_target_host.R * ray.homogeneous() + inverse_depth * T_target_host.p;
  if (!(X.z() > 1e-3)) return {};
  constexpr float kMargin = 4;  // px
  Projection seen;
  seen.pixel = {static_cast<float>(camera.fx * X.x() / X.z() + camera.cx),
                static_cast<float>(camera.fy * X.y() / X.z() + camera.cy)};
  seen.inverse_depth = static_cast<float>(inverse_depth / X.z());
  seen.in_view = seen.pixel.x() >= kMargin && seen.pixel.y() >= kMargin &&
                 seen.pixel.x() < camera.width - 1 - kMargin &&
                 seen.pixel.y() < camera.height - 1 - kMargin;
  return seen;
}

}  // namespace sgf::direct
