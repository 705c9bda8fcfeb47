#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include <sgf/synth/scene.h>

/// Building blocks of the scenes: placing, materials, and furniture that several scenes share.
/// Lengths in m. Unless said otherwise a piece stands on z = 0, is centred on x = 0 and faces -y
/// with its back at y = 0, so that it can be put against a wall; what stands free is centred on y =
/// 0 too.
namespace sgf::synth {

using Parts = std::vector<Part>;

// Placing.

/// Turned by `yaw_deg` (degrees, anticlockwise seen from above), then moved to (x, y, z).
Eigen::Affine3f At(float x, float y, float z = 0, float yaw_deg = 0);

/// The same at another place.
Patches Put(Patches patches, float x, float y, float z = 0, float yaw_deg = 0);
Parts Put(Parts parts, float x, float y, float z = 0, float yaw_deg = 0);
Parts Transformed(Parts parts, const Eigen::Affine3f& T);

/// Turned about the x axis: positive angles tip the upper end towards -y.
Patches Tilted(Patches patches, float angle_deg);
Parts Tilted(Parts parts, float angle_deg);

/// All of both.
Parts operator+(Parts a, const Parts& b);

/// A number in [low, high) that depends on nothing but `seed` and `index`.
float Vary(uint32_t seed, uint32_t index, float low, float high);

// Materials.

/// One colour (linear albedo).
Material Plain(float red, float green, float blue);

/// A texture that repeats every `tile_m`, coloured by `tint`.
Material Tiled(int texture, float tile_m, const Eigen::Vector3f& tint = Eigen::Vector3f::Ones());

/// One texture image over each patch.
Material Fitted(int texture);

/// The material with a glossy surface.
Material Glossy(Material material, float specular, float shininess, float mirror = 0);

// Plain shapes.

/// Axis-aligned box between x0 and x1, y0 and y1, z0 and z1.
Patches Block(float x0, float x1, float y0, float y1, float z0, float z1);

/// Upright sheet facing -y.
Patches Panel(float width, float height);

/// Level sheet at height z, facing up; `CeilingSheet` faces down.
Patches FloorSheet(float x0, float x1, float y0, float y1, float z);
Patches CeilingSheet(float x0, float x1, float y0, float y1, float z);

/// Four square legs whose outer faces span x by y, centred on the z axis.
Patches Legs(float x, float y, float height, float thickness);

/// Frame of square bars in the plane y = 0, protruding to -y, around an opening of width by height.
Patches BarFrame(float width, float height, float bar, float depth);

/// Rectangular hole in a wall: x from left to right, z from bottom to top.
struct Opening {
  float left, right, bottom, top;
};

/// Wall facing -y around an opening, and the sides of the opening, `depth` deep.
Patches WallAround(float width, float height, const Opening& opening);
Patches Reveal(const Opening& opening, float depth);

// Furniture.

/// Centred on y = 0: a table with four legs, a round one on a foot, a chair that faces -y.
Parts Table(float x, float y, float height, const Material& top, const Material& legs);
Parts RoundTable(float radius, float height, const Material& top, const Material& foot);
Parts Chair(const Material& wood, const Material& seat);

/// Chair with a round foot and a padded back, as at desks; centred on y = 0.
Parts OfficeChair(const Material& cloth, const Material& metal);

/// Sofa for as many as `seats`; an armchair with one.
Parts Sofa(int seats, const Material& cloth, const Material& cushion, const Material& feet);

/// Rack of boards with sides and back. `rows` equal compartments.
Parts Shelf(float width, float height, float depth, int rows, const Material& wood);

/// Row of upright books, side by side from -width / 2 to width / 2, their backs facing -y at y = 0.
Parts BookRow(float width, float height, const std::vector<Material>& cloths,
              const Material& lettering, uint32_t seed);

/// Cupboard with `columns` by `rows` fronts, each with a knob.
Parts Cabinet(const Eigen::Vector3f& size, int columns, int rows, const Material& body,
              const Material& front, const Material& knob);

/// Framed picture hanging with its lower edge at z = 0.
Parts Picture(float width, float height, const Material& frame, const Material& picture);

/// Door leaf with frame and handle.
Parts Door(float width, float height, const Material& frame, const Material& leaf,
           const Material& handle);

/// Window frame with `columns` casements, filling the opening, centred on y = 0.
Patches WindowFrame(const Opening& opening, int columns);

/// Ribbed radiator with pipes to the floor.
Patches Radiator(float width, float height);

/// Flat screen on a foot: television, monitor.
Parts Screen(float width, float height, const Material& body, const Material& picture);

/// Pot plant of arching leaves, centred on y = 0.
Parts Plant(float height, int leaves, const Material& pot, const Material& leaf, uint32_t seed);

/// Things that stand on tables, centred on the z axis.
Patches Cup(float scale = 1);
Patches Plate(float radius);
Patches Bowl(float radius);
Patches Vase(float height);
Patches Bottle(float height);

/// Closed cardboard box with a strip of tape; centred on y = 0.
Parts Carton(const Eigen::Vector3f& size, const Material& board, const Material& tape);

}  // namespace sgf::synth
