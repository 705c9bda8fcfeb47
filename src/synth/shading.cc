#include <cmath>
#include <numbers>

#include <sgf/synth/shading.h>

namespace sgf::synth::internal {

namespace {

using Eigen::Array4f;
using Eigen::Vector3f;

// Highlights weaker than this share of their peak are left out.
constexpr float kHighlightCutoff = 1e-3f;

}  // namespace

LampFrame::LampFrame(const AreaLight& light, int light_group) : lamp(&light), group(light_group) {
  const Vector3f cross = light.edge_s.cross(light.edge_t);
  area = cross.norm();
  normal = cross / area;
  dual_s = light.edge_t.cross(normal) / light.edge_s.dot(light.edge_t.cross(normal));
  dual_t = normal.cross(light.edge_s) / light.edge_t.dot(normal.cross(light.edge_s));
  centre = light.corner + 0.5f * (light.edge_s + light.edge_t);
  radius =
      0.5f * std::max((light.edge_s + light.edge_t).norm(), (light.edge_s - light.edge_t).norm());
}

Vector3f LampFrame::Nearest(const Ray& ray) const {
  const float slope = ray.direction.dot(normal);
  if (slope >= 0) return centre;
  const Vector3f q =
      ray.origin + (lamp->corner - ray.origin).dot(normal) / slope * ray.direction - lamp->corner;
  return lamp->corner + std::clamp(q.dot(dual_s), 0.0f, 1.0f) * lamp->edge_s +
         std::clamp(q.dot(dual_t), 0.0f, 1.0f) * lamp->edge_t;
}

Shader::Shader(const Scene& scene, const RayScene& rays, const BakedLight& baked)
    : scene_(scene), rays_(rays), baked_(baked) {
  for (size_t k = 0; k < scene.lights.size(); ++k)
    lamps_.emplace_back(scene.lights[k], baked.lamp_groups()[k]);
  for (const Surface& s : rays.surfaces()) {
    const float cosine = s.material ? std::pow(kHighlightCutoff, 1 / s.material->shininess) : 1.0f;
    lobes_.push_back({cosine, std::sqrt(1 - cosine * cosine) / cosine, 1 / cosine});
  }
}

/// Albedo over a square of side `width` m.
Array4f Shader::Albedo(const Surface& surface, float s, float t, float width) const {
  const Material& m = *surface.material;
  const Array4f tint = Rgb(m.tint);
  if (m.texture < 0) return tint;
  const Texture& texture = scene_.textures[m.texture];
  const Patch& p = *surface.patch;
  if (m.fit) return tint * texture.Sample(s, t, width / std::min(p.length_s_m, p.length_t_m));
  const float scale = 1 / m.tile_m;
  return tint * texture.Sample(s * p.length_s_m * scale, t * p.length_t_m * scale, width * scale);
}

/// Lamps in a Phong lobe about the mirrored line of sight. An area lamp stands for its point
/// nearest to that line (Karis, "Real Shading in Unreal Engine 4", 2013), dimmed by its baked
/// shadow.
void Shader::AddHighlights(const Sight& sight, const Ray& mirrored, const Vector3f& normal,
                           const GroupLight& lit, PixelLight& light) const {
  const Material& m = *surface(sight.hit).material;
  const Lobe& lobe = lobes_[sight.hit.surface];
  for (const LampFrame& lamp : lamps_) {
    // Most lamps are far from the lobe, which their bounding spheres tell without a root.
    const Vector3f to_centre = lamp.centre - mirrored.origin;
    const float along = to_centre.dot(mirrored.direction);
    const float reach = std::max(along, 0.0f) * lobe.tangent + lamp.radius * lobe.secant;
    if (along < -lamp.radius || to_centre.squaredNorm() - along * along > reach * reach) continue;
    const Vector3f d = lamp.Nearest(mirrored) - mirrored.origin;
    const float d2 = d.squaredNorm();
    const Vector3f l = d / std::sqrt(d2);
    const float cosine = l.dot(mirrored.direction);
    if (!(cosine >= lobe.cosine && l.dot(normal) > 0)) continue;
    const float solid_angle = lamp.area * std::max(0.0f, -l.dot(lamp.normal)) / d2;
    const float filled =
        std::min(1.0f, solid_angle * (m.shininess + 1) / (2 * std::numbers::pi_v<float>));
    light.groups[lamp.group] +=
        Rgb(lamp.lamp->radiance) *
        (sight.count * m.specular * filled * lit[lamp.group][3] * std::pow(cosine, m.shininess));
  }
}

/// Highlights, and a mirrored ray with Schlick's share.
void Shader::AddGloss(const Sight& sight, const GroupLight& lit, PixelLight& light,
                      std::vector<MirrorRay>& mirrors) const {
  const Surface& s = surface(sight.hit);
  const Material& m = *s.material;
  if (m.specular <= 0 && m.mirror <= 0) return;
  const SurfacePoint at = At(*s.patch, sight.hit.s, sight.hit.t);
  const Vector3f normal = at.normal.dot(sight.direction) > 0 ? Vector3f(-at.normal) : at.normal;
  const float slope = normal.dot(sight.direction);
  const Ray mirrored{at.point + kLift * normal, sight.direction - 2 * slope * normal};
  if (m.specular > 0) AddHighlights(sight, mirrored, normal, lit, light);
  if (m.mirror <= 0) return;
  const float flat = 1 - std::min(1.0f, -slope);
  const float share = m.mirror + (1 - m.mirror) * flat * flat * flat * flat * flat;
  mirrors.push_back(
      {mirrored, sight.count * share, sight.width, (at.point - sight.origin).norm(), sight.pixel});
}

void Shader::AddSky(const Vector3f& direction, float share, PixelLight& light) const {
  if (scene_.sky) light.groups[baked_.sky_group()] += share * SkyRadiance(*scene_.sky, direction);
}

void Shader::AddLamp(const Surface& lamp, const Vector3f& direction, float share,
                     PixelLight& light) const {
  if (lamp.lamp->edge_s.cross(lamp.lamp->edge_t).dot(direction) < 0)
    light.groups[lamp.group] += share * Rgb(lamp.lamp->radiance);
}

void Shader::AddMirrored(const MirrorRay& mirror, const Hit& seen, PixelLight& light) const {
  if (seen.surface < 0) return AddSky(mirror.ray.direction, mirror.share, light);
  const Surface& s = surface(seen);
  if (s.lamp) return AddLamp(s, mirror.ray.direction, mirror.share, light);
  GroupLight lit;
  baked_.grid(seen.surface).Sample(seen.s, seen.t, groups(), lit);
  const float spread = 1 + seen.distance / std::max(mirror.distance, kLift);
  const Array4f albedo = mirror.share * Albedo(s, seen.s, seen.t, mirror.width * spread);
  for (int g = 0; g < groups(); ++g) light.groups[g] += albedo * lit[g];
}

void Shader::AddSight(const Sight& sight, PixelLight& light,
                      std::vector<MirrorRay>& mirrors) const {
  const Hit& hit = sight.hit;
  if (hit.surface < 0) return AddSky(sight.direction, sight.count, light);
  if (surface(hit).lamp) return AddLamp(surface(hit), sight.direction, sight.count, light);
  GroupLight lit;
  baked_.grid(hit.surface).Sample(hit.s, hit.t, groups(), lit);
  const Array4f albedo = sight.count * Albedo(surface(hit), hit.s, hit.t, sight.width);
  for (int g = 0; g < groups(); ++g) {
    const Array4f matt = albedo * lit[g];
    light.groups[g] += matt;
    light.diffuse += matt;
  }
  AddGloss(sight, lit, light, mirrors);
}

/// Samples on one surface are shaded once, in their middle: texture and baked light are smooth over
/// a pixel, the one by its filter, the other by being coarser.
PixelLight Shader::Shade(const Samples& samples, float angle, int pixel,
                         std::vector<MirrorRay>& mirrors) const {
  // Half-way between the side of a sample's share of the pixel and of the pixel: the bilinear
  // look-up adds to the filter.
  const float side = angle * 0.5f * (1 + std::sqrt(static_cast<float>(samples.count)));
  PixelLight light;
  unsigned done = 0;
  for (int k = 0; k < samples.count; ++k) {
    if (done >> k & 1) continue;
    const Hit& first = samples.hits[k];
    Sight sight{first, samples.rays[k].origin, samples.rays[k].direction, 0, 1, pixel};
    for (int j = k + 1; j < samples.count; ++j) {
      const Hit& other = samples.hits[j];
      // On a closed patch, s may jump from 1 to 0 between samples.
      if (other.surface != first.surface || std::abs(other.s - first.s) > 0.5f) continue;
      sight.hit.s += other.s;
      sight.hit.t += other.t;
      sight.direction += samples.rays[j].direction;
      sight.count += 1;
      done |= 1u << j;
    }
    sight.hit.s /= sight.count;
    sight.hit.t /= sight.count;
    sight.direction.normalize();
    if (first.surface >= 0) {
      const float slant =
          std::abs(first.plane_normal.dot(sight.direction)) / first.plane_normal.norm();
      sight.width = first.distance * side / std::sqrt(std::max(slant, 0.05f));
    }
    AddSight(sight, light, mirrors);
  }
  return light;
}

}  // namespace sgf::synth::internal
