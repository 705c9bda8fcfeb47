#pragma once

// Internal to sgf::synth: the geometry of a scene as Embree sees it.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sgf/synth/scene.h>

struct RTCRayHit;

namespace sgf::synth::internal {

/// Rays start this far off a surface (m), so that they do not hit it again.
inline constexpr float kLift = 1e-3f;

/// What a ray hits: a patch of an object, or a lamp.
struct Surface {
  const Patch* patch = nullptr;        ///< null for lamps
  const Material* material = nullptr;  ///< null for lamps
  int id = 0;                          ///< object index + 1; 0 for lamps
  int group = 0;                       ///< light group; lamps only
  const AreaLight* lamp = nullptr;     ///< null for objects
};

/// Where a ray hits a surface.
struct Hit {
  int surface = -1;              ///< index in RayScene::surfaces(); -1: nothing
  unsigned quad = 0;             ///< of the patch's grid
  float distance = 0;            ///< in lengths of the ray's direction
  float s = 0, t = 0;            ///< surface coordinates in [0, 1]
  Eigen::Vector3f plane_normal;  ///< of the flat piece that was hit, of either sign and any length
};

struct Ray {
  Eigen::Vector3f origin;
  Eigen::Vector3f direction;  ///< of any length
};

/// Where geometry comes nearest to a point.
struct NearPlace {
  int surface = -1;              ///< index in RayScene::surfaces(); -1: none
  Eigen::Vector3f place;         ///< m
  Eigen::Vector3f plane_normal;  ///< of the flat piece, as those of its patch, of any length
};

/// Embree's scene. Always on the SSE4.2 code path, with robust intersection: other instruction sets
/// give other depths in the last bits. Built by one thread, so that the tree is always the same.
class RayScene {
 public:
  /// @param scene has to outlive this.
  explicit RayScene(const Scene& scene);
  ~RayScene();

  /// Patches of all objects in order, then the lamps that are not hidden.
  const std::vector<Surface>& surfaces() const { return surfaces_; }

  /// First hits of any number of rays; neighbours should go similar ways.
  void Intersect(std::span<const Ray> rays, Hit* hits) const;

  /// First hit of a ray that is alone.
  Hit Intersect(const Ray& ray) const;

  /// The place of all geometry that is nearest to a point; none for a point that is not finite.
  NearPlace Nearest(const Eigen::Vector3f& point) const;

  /// Whether anything lies between two points, the ends left out.
  bool Blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const;

 private:
  struct Embree;
  Hit Answer(const RTCRayHit& query) const;
  void AddPatch(const Patch& patch);
  void AddLamp(const AreaLight& lamp);

  std::vector<Surface> surfaces_;
  std::unique_ptr<Embree> embree_;
};

}  // namespace sgf::synth::internal
