#pragma once

// Internal to sgf::synth: light that lamps and sky send onto surfaces, baked once.

#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include <sgf/synth/ray_scene.h>
#include <sgf/synth/renderer.h>

namespace sgf::synth::internal {

/// Most light groups a scene may have.
inline constexpr int kMaxGroups = 6;

/// Radiance that a white diffuse surface would send, by light group: RGB, and as fourth component
/// the share of the lamps' direct light that is not in shadow.
using GroupLight = std::array<Eigen::Array4f, kMaxGroups>;

/// A grid of baked light over a patch, at texel centres, all groups of a texel together.
struct LightGrid {
  int columns = 0, rows = 0;
  std::vector<Eigen::Array4f> texels;  ///< (row * columns + column) * groups + group

  /// Bilinear at (s, t) in [0, 1]^2.
  void Sample(float s, float t, int groups, GroupLight& light) const;
};

/// Baked light of all surfaces of a scene: direct light of the lamps with soft shadows, sky light
/// and light from other surfaces. The latter two change slowly and are found on a coarser grid.
class BakedLight {
 public:
  /// All arguments have to outlive this.
  BakedLight(const Scene& scene, const RayScene& rays, const RenderOptions& options);

  int groups() const { return groups_; }
  int sky_group() const { return sky_group_; }  ///< -1 without a sky

  /// Group of every lamp of the scene.
  const std::vector<int>& lamp_groups() const { return lamp_groups_; }

  /// Light on a surface of an object.
  const LightGrid& grid(int surface) const { return grids_[surface]; }

 private:
  void MakeGrids();
  void BakeDirect();
  void AddBounce(const std::vector<LightGrid>& gathered);
  std::vector<LightGrid> Gather() const;
  void ForEachRow(const std::vector<LightGrid>& grids,
                  const std::function<void(int surface, int row)>& body) const;
  /// Irradiance over pi that unit radiance of a lamp causes: with shadows, and without.
  struct LampShare {
    float open = 0, all = 0;
  };
  LampShare ShareOf(const AreaLight& lamp, const Eigen::Vector3f& point,
                    const Eigen::Vector3f& normal, int side) const;
  Eigen::Array4f Lamp(const AreaLight& lamp, const Eigen::Vector3f& point,
                      const Eigen::Vector3f& normal) const;
  void GatherAt(int surface, float s, float t, Eigen::Array4f* light) const;
  void AddArriving(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                   Eigen::Array4f* light) const;

  const Scene& scene_;
  const RayScene& rays_;
  const RenderOptions& options_;
  int groups_;
  int sky_group_ = -1;
  std::vector<int> lamp_groups_;
  std::vector<LightGrid> grids_;
};

/// Point and unit normal of a patch at surface coordinates.
struct SurfacePoint {
  Eigen::Vector3f point, normal;
};
SurfacePoint At(const Patch& patch, float s, float t);

/// Interpolated normal where a ray hit, not normalised.
Eigen::Vector3f NormalAt(const Patch& patch, float s, float t);

/// Radiance of the sky along a unit direction.
Eigen::Array4f SkyRadiance(const Sky& sky, const Eigen::Vector3f& direction);

inline Eigen::Array4f Rgb(const Eigen::Vector3f& rgb) { return {rgb.x(), rgb.y(), rgb.z(), 0.0f}; }

}  // namespace sgf::synth::internal
