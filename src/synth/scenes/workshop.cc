#include <algorithm>
#include <cmath>
#include <utility>

#include <sgf/synth/arithmetic.h>
#include <sgf/synth/scenes/workshop.h>

namespace sgf::synth {

Patches Put(Patches patches, const Eigen::Vector3f& place, float yaw_deg) {
  return Put(std::move(patches), place.x(), place.y(), place.z(), yaw_deg);
}

Parts Put(Parts parts, const Eigen::Vector3f& place, float yaw_deg) {
  return Put(std::move(parts), place.x(), place.y(), place.z(), yaw_deg);
}

Patches AlongX(Patches patches) {
  const Eigen::AngleAxisf turn(kPi / 2, Eigen::Vector3f::UnitY());
  return Transformed(std::move(patches), Eigen::Affine3f(turn));
}

Patches AlongY(Patches patches) {
  const Eigen::AngleAxisf turn(-kPi / 2, Eigen::Vector3f::UnitX());
  return Transformed(std::move(patches), Eigen::Affine3f(turn));
}

Patches BoxAt(const Eigen::Vector3f& bottom_centre, const Eigen::Vector3f& size) {
  return Put(Box(size.x(), size.y(), size.z()), bottom_centre);
}

Patches Towards(const Eigen::Vector3f& from, const Eigen::Vector3f& to, Patches patches) {
  const auto turn = Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), to - from);
  return Transformed(std::move(patches), Eigen::Translation3f(from) * turn);
}

Patches Bar(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float width) {
  return Towards(from, to, Box(width, width, (to - from).norm()));
}

Patches Rod(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float radius) {
  const Eigen::Vector3f along = to - from;
  const Eigen::Vector3f x = radius * along.unitOrthogonal();
  const Eigen::Vector3f y = along.normalized().cross(x);
  return {MakePatch(radius < 0.03f ? 8 : 16, 1, [&](float s, float t) -> Eigen::Vector3f {
    return from + t * along + std::cos(2 * kPi * s) * x + std::sin(2 * kPi * s) * y;
  })};
}

Patches Cable(const std::vector<Eigen::Vector3f>& points, float radius) {
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
    return centre(t) + radius * (std::cos(2 * kPi * s) * x + std::sin(2 * kPi * s) * y);
  })};
}

Patches Ring(float radius, float tube_radius) {
  return {MakePatch(24, 6, [=](float s, float t) -> Eigen::Vector3f {
    const float r = radius + tube_radius * std::cos(2 * kPi * t);
    return {r * std::cos(2 * kPi * s), r * std::sin(2 * kPi * s),
            tube_radius * std::sin(2 * kPi * t)};
  })};
}

Patches Hoop(float radius, float width, float thickness) {
  const float r = radius + thickness, h = width / 2;
  return Lathe({{radius, -h}, {r, -h}, {r, h}, {radius, h}});
}

Patches Front(const Eigen::Vector3f& lower_left, float width, float height) {
  return Quad(lower_left, {width, 0, 0}, {0, 0, height});
}

Patches Sheet(const Eigen::Vector3f& centre, float length_x, float length_y) {
  return Quad(centre - Eigen::Vector3f(length_x, length_y, 0) / 2, {length_x, 0, 0},
              {0, length_y, 0});
}

Material Tiled(Scene& scene, std::string_view texture, float tile_m, const Eigen::Vector3f& tint) {
  return Tiled(scene.AddTexture(texture), tile_m, tint);
}

Material Fitted(Scene& scene, std::string_view texture) {
  return Fitted(scene.AddTexture(texture));
}

AreaLight LampTowards(const std::string& group, const Eigen::Vector3f& centre,
                      const Eigen::Vector3f& target, float width, float height,
                      const Eigen::Vector3f& radiance) {
  const Eigen::Vector3f normal = (target - centre).normalized();
  const Eigen::Vector3f s = width * Eigen::Vector3f::UnitZ().cross(normal).normalized();
  const Eigen::Vector3f t = height * normal.cross(s).normalized();
  return {group, centre - s / 2 - t / 2, s, t, radiance};
}

Parts Crate(const Material& plastic) {
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
