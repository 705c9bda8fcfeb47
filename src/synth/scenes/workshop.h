#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sgf/synth/scenes/furniture.h>

/// Small technical shapes that the machine hall and the motion-capture rooms share. Lengths in m.
namespace sgf::synth {

/// Turned by `yaw_deg`, then moved to `place`.
inline Patches Put(Patches patches, const Eigen::Vector3f& place, float yaw_deg = 0) {
  return Put(std::move(patches), place.x(), place.y(), place.z(), yaw_deg);
}
inline Parts Put(Parts parts, const Eigen::Vector3f& place, float yaw_deg = 0) {
  return Put(std::move(parts), place.x(), place.y(), place.z(), yaw_deg);
}

/// What stood on the origin along z lies along x, or along y.
inline Patches AlongX(Patches patches) {
  const Eigen::AngleAxisf turn(std::numbers::pi_v<float> / 2, Eigen::Vector3f::UnitY());
  return Transformed(std::move(patches), Eigen::Affine3f(turn));
}
inline Patches AlongY(Patches patches) {
  const Eigen::AngleAxisf turn(-std::numbers::pi_v<float> / 2, Eigen::Vector3f::UnitX());
  return Transformed(std::move(patches), Eigen::Affine3f(turn));
}

/// Box of size (x, y, z) whose bottom is centred at a point.
inline Patches BoxAt(const Eigen::Vector3f& bottom_centre, const Eigen::Vector3f& size) {
  return Put(Box(size.x(), size.y(), size.z()), bottom_centre);
}

/// What stood on the origin along z stands on `from` and points to `to`.
inline Patches Towards(const Eigen::Vector3f& from, const Eigen::Vector3f& to, Patches patches) {
  const auto turn = Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), to - from);
  return Transformed(std::move(patches), Eigen::Translation3f(from) * turn);
}

/// Square bar from one point to another.
inline Patches Bar(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float width) {
  return Towards(from, to, Box(width, width, (to - from).norm()));
}

/// Thin round bar from one point to another, without ends.
inline Patches Rod(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float radius) {
  constexpr float kTurn = 2 * std::numbers::pi_v<float>;
  const Eigen::Vector3f along = to - from;
  const Eigen::Vector3f x = radius * along.unitOrthogonal();
  const Eigen::Vector3f y = along.normalized().cross(x);
  return {MakePatch(radius < 0.03f ? 8 : 16, 1, [&](float s, float t) -> Eigen::Vector3f {
    return from + t * along + std::cos(kTurn * s) * x + std::sin(kTurn * s) * y;
  })};
}

/// Cable that runs smoothly through points (Catmull-Rom), for lying on floors: nowhere upright.
inline Patches Cable(const std::vector<Eigen::Vector3f>& points, float radius) {
  constexpr float kTurn = 2 * std::numbers::pi_v<float>;
  const int pieces = static_cast<int>(points.size()) - 1;
  const auto at = [&](int k) { return points[std::clamp(k, 0, pieces)]; };
  const auto centre = [&](float t) -> Eigen::Vector3f {
    const int k = std::min(static_cast<int>(t * pieces), pieces - 1);
    const float u = t * pieces - k;
    const Eigen::Vector3f a = at(k - 1), b = at(k), c = at(k + 1), d = at(k + 2);
    return b + 0.5f * u * ((c - a) + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)));
  };
  return {MakePatch(6, 10 * pieces, [&](float s, float t) -> Eigen::Vector3f {
    const float h = 0.01f / pieces;
    const Eigen::Vector3f along = centre(std::min(t + h, 1.0f)) - centre(std::max(t - h, 0.0f));
    const Eigen::Vector3f x = along.cross(Eigen::Vector3f::UnitZ()).normalized();
    const Eigen::Vector3f y = along.cross(x).normalized();
    return centre(t) + radius * (std::cos(kTurn * s) * x + std::sin(kTurn * s) * y);
  })};
}

/// Slim ring about z with centre line radius `radius`, centred at the origin.
inline Patches Ring(float radius, float tube_radius) {
  constexpr float kTurn = 2 * std::numbers::pi_v<float>;
  return {MakePatch(24, 6, [=](float s, float t) -> Eigen::Vector3f {
    const float r = radius + tube_radius * std::cos(kTurn * t);
    return {r * std::cos(kTurn * s), r * std::sin(kTurn * s), tube_radius * std::sin(kTurn * t)};
  })};
}

/// Flat hoop about z round a cylinder of that radius, centred at the origin.
inline Patches Hoop(float radius, float width, float thickness) {
  const float r = radius + thickness, h = width / 2;
  return Lathe({{radius, -h}, {r, -h}, {r, h}, {radius, h}});
}

/// Upright sheet facing -y.
inline Patches Front(const Eigen::Vector3f& lower_left, float width, float height) {
  return Quad(lower_left, {width, 0, 0}, {0, 0, height});
}

/// Level sheet facing up.
inline Patches Sheet(const Eigen::Vector3f& centre, float length_x, float length_y) {
  return Quad(centre - Eigen::Vector3f(length_x, length_y, 0) / 2, {length_x, 0, 0},
              {0, length_y, 0});
}

/// A texture of the scene's own, repeating or as one picture.
inline Material Tiled(Scene& scene, std::string_view texture, float tile_m,
                      const Eigen::Vector3f& tint = Eigen::Vector3f::Ones()) {
  return Tiled(scene.AddTexture(texture), tile_m, tint);
}
inline Material Fitted(Scene& scene, std::string_view texture) {
  return Fitted(scene.AddTexture(texture));
}

/// Rectangular lamp at `centre`, upper edge level, that shines to `target`.
inline AreaLight LampTowards(const std::string& group, const Eigen::Vector3f& centre,
                             const Eigen::Vector3f& target, float width, float height,
                             const Eigen::Vector3f& radiance) {
  const Eigen::Vector3f normal = (target - centre).normalized();
  const Eigen::Vector3f s = width * Eigen::Vector3f::UnitZ().cross(normal).normalized();
  const Eigen::Vector3f t = height * normal.cross(s).normalized();
  return {group, centre - s / 2 - t / 2, s, t, radiance};
}

/// Plastic stacking crate of 0.6 x 0.4 x 0.3 m with ribs, open at the top.
inline Parts Crate(const Material& plastic) {
  const float x = 0.6f, y = 0.4f, z = 0.3f, wall = 0.02f;
  Patches box = Box(x, y, wall);
  for (const float side : {-1.0f, 1.0f}) {
    box = box + BoxAt({0, side * (y - wall) / 2, 0}, {x, wall, z});
    box = box + BoxAt({side * (x - wall) / 2, 0, 0}, {wall, y, z});
    for (const float rim : {0.08f, 0.26f})
      box = box + BoxAt({0, side * y / 2, rim}, {x + 0.02f, 0.03f, 0.03f});
    for (int i = 0; i < 5; ++i)
      box = box + BoxAt({-0.24f + 0.12f * static_cast<float>(i), side * (y / 2 + 0.005f), 0},
                        {0.02f, 0.02f, z});
  }
  return {{box, plastic}};
}

}  // namespace sgf::synth
