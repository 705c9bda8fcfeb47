#pragma once

#include <memory>

#include <Eigen/Core>

#include <sgf/synth/scene.h>

namespace sgf::synth {

/// Where the surfaces of a scene come nearest to a point.
struct NearestSurface {
  Eigen::Vector3d place;  ///< world, m
  double offset_m = 0;  ///< the distance; negative on the side that is not seen, such as in a wall
  int object = 0;       ///< id of what it belongs to: index in the scene + 1; 0 for lamps
};

/// Finds the surface nearest to a point: how far an estimated map is off. Lamps that are seen count
/// as surfaces, and so do the backs of things.
class SurfaceFinder {
 public:
  /// @throws Error for a scene without objects.
  explicit SurfaceFinder(Scene scene);
  ~SurfaceFinder();

  /// @param point world, m. One that is not finite has the offset NaN.
  NearestSurface Nearest(const Eigen::Vector3d& point) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sgf::synth
