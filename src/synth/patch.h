#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace sgf::synth {

/// A parametric surface: a grid of nu x nv quads over (s, t) in [0, 1]^2. Everything solid in a
/// scene is made of patches, so that every surface point has coordinates for its texture and for
/// its baked light. The visible side is the one the normals point to; both sides are hit by rays.
struct Patch {
  int nu = 1, nv = 1;                    ///< quads along s and t
  std::vector<Eigen::Vector3f> points;   ///< m, (nu + 1) * (nv + 1) grid points, s fastest
  std::vector<Eigen::Vector3f> normals;  ///< unit, one per grid point
  float length_s_m = 1;                  ///< mean length of the lines of constant t
  float length_t_m = 1;                  ///< mean length of the lines of constant s
};

using Patches = std::vector<Patch>;

/// A patch through the points f(s, t), with smooth normals along df/ds x df/dt.
/// @param f returns Eigen::Vector3f for float s, t in [0, 1].
template <class F>
Patch MakePatch(int nu, int nv, F&& f);

/// The patch through grid points (s fastest): computes normals and lengths. Opposite borders that
/// are the same but for rounding (sin and cos of a full turn) are joined, without a seam in the
/// normals.
Patch PatchFromPoints(int nu, int nv, std::vector<Eigen::Vector3f> points);

/// Sets length_s_m and length_t_m from the points.
void ComputeLengths(Patch& patch);

/// The patches moved (and scaled) by an affine map.
/// @throws Error for a map that mirrors or flattens.
Patches Transformed(Patches patches, const Eigen::Affine3f& T);

/// All of both.
Patches operator+(Patches a, const Patches& b);

// Solids. z points up; unless said otherwise they stand on z = 0, centred on the z axis. Lengths in
// m.

/// Parallelogram corner + s * edge_s + t * edge_t, facing edge_s x edge_t.
Patches Quad(const Eigen::Vector3f& corner, const Eigen::Vector3f& edge_s,
             const Eigen::Vector3f& edge_t);

/// Closed box of size (x, y, z). On upright faces t points up; on the others it points along y.
Patches Box(float x, float y, float z);

/// Box with rounded edges and corners; the radius is cut to half the shortest side.
Patches RoundedBox(float x, float y, float z, float radius);

/// Closed cylinder, or with another radius at the top a truncated cone.
Patches Cylinder(float radius, float height);
Patches Cone(float bottom_radius, float top_radius, float height);

/// Sphere centred at the origin.
Patches Sphere(float radius);

/// Flat disc at height 0, facing up.
Patches Disc(float radius);

/// Prism: a polygon in (x, z), counter-clockwise seen from -y, drawn out along y to `depth`,
/// centred on y = 0. Every line of constant x must cut the polygon once only (car bodies, gables,
/// arches, stairs do). Walls are smooth where the polygon turns by less than 41 degrees, except at
/// its first point.
/// @throws Error for fewer than three points, or a polygon that is clockwise or cut more than once.
Patches Extrude(const std::vector<Eigen::Vector2f>& polygon, float depth);

/// Surface of revolution about z through (radius, height) points, smooth where the profile turns by
/// less than 41 degrees; outside is to the right of the way from the first point to the last.
Patches Lathe(const std::vector<Eigen::Vector2f>& profile);

/// Round pipe along a polyline whose corners are rounded off by bends of three pipe radii, or less
/// where there is no room; open at both ends.
Patches Tube(const std::vector<Eigen::Vector3f>& path, float radius);

/// Soft box whose faces bulge by `puff` m in their middle, except the one it lies on: cushions,
/// mattresses, sacks.
Patches Cushion(float x, float y, float z, float puff);

/// Hanging or lying cloth: a vertical sheet of width x (along x) and height z with `folds` folds of
/// depth `depth`, facing -y; visible from both sides.
Patches Curtain(float x, float z, int folds, float depth);

}  // namespace sgf::synth

#include <sgf/synth/patch-inl.h>
