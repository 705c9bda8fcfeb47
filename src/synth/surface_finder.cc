#include <cmath>
#include <limits>
#include <utility>

#include <sgf/core/error.h>
#include <sgf/synth/ray_scene.h>
#include <sgf/synth/surface_finder.h>

namespace sgf::synth {

struct SurfaceFinder::Impl {
  explicit Impl(Scene s) : scene(std::move(s)), rays(scene) {}
  Scene scene;
  internal::RayScene rays;
};

SurfaceFinder::SurfaceFinder(Scene scene) {
  if (scene.objects.empty()) throw Error("scene " + scene.name, "has no objects");
  impl_ = std::make_unique<Impl>(std::move(scene));
}

SurfaceFinder::~SurfaceFinder() = default;

NearestSurface SurfaceFinder::Nearest(const Eigen::Vector3d& point) const {
  const internal::NearPlace found = impl_->rays.Nearest(point.cast<float>());
  if (found.surface < 0) return {point, std::numeric_limits<double>::quiet_NaN(), 0};
  const Eigen::Vector3d place = found.place.cast<double>();
  const Eigen::Vector3d away = point - place;
  const double side = away.dot(found.plane_normal.cast<double>());
  return {place, std::copysign(away.norm(), side), impl_->rays.surfaces()[found.surface].id};
}

}  // namespace sgf::synth
