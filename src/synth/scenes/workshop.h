#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <sgf/synth/scenes/furniture.h>

/// Small technical shapes that the machine hall and the motion-capture rooms share. Lengths in m.
namespace sgf::synth {

/// Turned by `yaw_deg`, then moved to `place`.
Patches Put(Patches patches, const Eigen::Vector3f& place, float yaw_deg = 0);
Parts Put(Parts parts, const Eigen::Vector3f& place, float yaw_deg = 0);

/// What stood on the origin along z lies along x, or along y.
Patches AlongX(Patches patches);
Patches AlongY(Patches patches);

/// Box of size (x, y, z) whose bottom is centred at a point.
Patches BoxAt(const Eigen::Vector3f& bottom_centre, const Eigen::Vector3f& size);

/// What stood on the origin along z stands on `from` and points to `to`.
Patches Towards(const Eigen::Vector3f& from, const Eigen::Vector3f& to, Patches patches);

/// Square bar from one point to another.
Patches Bar(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float width);

/// Thin round bar from one point to another, without ends.
Patches Rod(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float radius);

/// Cable that runs smoothly through points (Catmull-Rom), for lying on floors: nowhere upright.
Patches Cable(const std::vector<Eigen::Vector3f>& points, float radius);

/// Slim ring about z with centre line radius `radius`, centred at the origin.
Patches Ring(float radius, float tube_radius);

/// Flat hoop about z round a cylinder of that radius, centred at the origin.
Patches Hoop(float radius, float width, float thickness);

/// Upright sheet facing -y.
Patches Front(const Eigen::Vector3f& lower_left, float width, float height);

/// Level sheet facing up.
Patches Sheet(const Eigen::Vector3f& centre, float length_x, float length_y);

/// A texture of the scene's own, repeating or as one picture.
Material Tiled(Scene& scene, std::string_view texture, float tile_m,
               const Eigen::Vector3f& tint = Eigen::Vector3f::Ones());
Material Fitted(Scene& scene, std::string_view texture);

/// Rectangular lamp at `centre`, upper edge level, that shines to `target`.
AreaLight LampTowards(const std::string& group, const Eigen::Vector3f& centre,
                      const Eigen::Vector3f& target, float width, float height,
                      const Eigen::Vector3f& radiance);

/// Plastic stacking crate of 0.6 x 0.4 x 0.3 m with ribs, open at the top.
Parts Crate(const Material& plastic);

}  // namespace sgf::synth
