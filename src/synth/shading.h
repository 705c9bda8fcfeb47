#pragma once

// Internal to sgf::synth: what a camera receives from the surfaces that its rays hit.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <sgf/synth/lightmap.h>
#include <sgf/synth/ray_scene.h>

namespace sgf::synth::internal {

/// What a pixel receives: sums over its samples.
struct PixelLight {
  GroupLight groups;
  Eigen::Array4f diffuse = Eigen::Array4f::Zero();

  PixelLight() { groups.fill(Eigen::Array4f::Zero()); }
};

/// The rays of one pixel and what they hit.
struct Samples {
  const Ray* rays;
  const Hit* hits;
  int count;

  /// Mean surface coordinates of samples on one surface; the rest is the first one's.
  Hit Middle() const {
    Hit middle = hits[0];
    for (int k = 1; k < count; ++k) {
      middle.s += hits[k].s;
      middle.t += hits[k].t;
    }
    middle.s /= static_cast<float>(count);
    middle.t /= static_cast<float>(count);
    return middle;
  }

  bool InOnePlane() const {
    return std::all_of(hits, hits + count, [&](const Hit& hit) {
      return hit.surface == hits[0].surface && hit.quad == hits[0].quad &&
             hit.plane_normal == hits[0].plane_normal;
    });
  }
};

/// Those samples of a pixel that hit the same surface, as one: their mean place and direction.
struct Sight {
  Hit hit;
  Eigen::Vector3f origin;
  Eigen::Vector3f direction;  ///< unit
  float width;                ///< m, side of the filtered square of surface
  float count;                ///< of samples
  int pixel;                  ///< the caller's number of the pixel
};

/// A mirrored ray that is still to be traced.
struct MirrorRay {
  Ray ray;
  float share;     ///< of what it brings, for the sum of the pixel's samples
  float width;     ///< m, side of the filtered square where it starts
  float distance;  ///< m, from the camera to there
  int pixel;       ///< the caller's number of the pixel
};

/// A lamp, with what finding its highlights needs.
struct LampFrame {
  const AreaLight* lamp;
  int group;
  Eigen::Vector3f normal, centre;
  Eigen::Vector3f dual_s, dual_t;  ///< (q - corner).dot(dual_s) is q's share of edge_s
  float area, radius;

  LampFrame(const AreaLight& light, int light_group);

  /// The lamp's point nearest to a ray.
  Eigen::Vector3f Nearest(const Ray& ray) const;
};

/// Adds up light by surface. Pixels are numbered by the caller, who also traces the mirrored rays.
class Shader {
 public:
  /// All arguments have to outlive this.
  Shader(const Scene& scene, const RayScene& rays, const BakedLight& baked);

  /// Light of all samples of a pixel.
  /// @param angle rad, side of a sample's share of the pixel.
  /// @param mirrors takes the mirrored rays that are still to be traced.
  PixelLight Shade(const Samples& samples, float angle, int pixel,
                   std::vector<MirrorRay>& mirrors) const;

  /// Adds what a mirrored ray has hit, matt.
  void AddMirrored(const MirrorRay& mirror, const Hit& seen, PixelLight& light) const;

 private:
  /// A cone of directions about a mirrored line of sight, in which lamps cause highlights.
  struct Lobe {
    float cosine, tangent, secant;
  };

  const Surface& surface(const Hit& hit) const { return rays_.surfaces()[hit.surface]; }
  int groups() const { return baked_.groups(); }

  Eigen::Array4f Albedo(const Surface& surface, float s, float t, float width) const;
  void AddHighlights(const Sight& sight, const Ray& mirrored, const Eigen::Vector3f& normal,
                     const GroupLight& lit, PixelLight& light) const;
  void AddGloss(const Sight& sight, const GroupLight& lit, PixelLight& light,
                std::vector<MirrorRay>& mirrors) const;
  void AddSky(const Eigen::Vector3f& direction, float share, PixelLight& light) const;
  void AddLamp(const Surface& lamp, const Eigen::Vector3f& direction, float share,
               PixelLight& light) const;
  void AddSight(const Sight& sight, PixelLight& light, std::vector<MirrorRay>& mirrors) const;

  const Scene& scene_;
  const RayScene& rays_;
  const BakedLight& baked_;
  std::vector<LampFrame> lamps_;
  std::vector<Lobe> lobes_;  // by surface
};

}  // namespace sgf::synth::internal
