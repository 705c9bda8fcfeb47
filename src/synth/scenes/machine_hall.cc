#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include <sgf/synth/arithmetic.h>
#include <sgf/synth/scenes/workshop.h>

// A machine hall of 18 x 10 x 7 m: x in [-9, 9], y in [-5, 5], z in [0, 7]. Everything stands along
// the walls or hangs above 4.6 m, so that |x| <= 6.5, |y| <= 2.2, 0.8 <= z <= 4 is free for flying.
// The west end (x < -5) has no lamps overhead and is dark.
//
// Things are built facing -y, as against the north wall; those at the other walls are turned.

namespace sgf::synth {
namespace {

using Eigen::Vector3f;

constexpr float kHalfLength = 9;
constexpr float kHalfWidth = 5;
constexpr float kHeight = 7;
constexpr float kFaceNorth = 180, kFaceEast = 90, kFaceWest = -90;

// Materials.

Material Enamel(float r, float g, float b) { return Glossy(Plain(r, g, b), 0.08f, 60); }

// Materials that several things share.
struct Palette {
  Material concrete, brick, plaster, dirty_render, roof_sheet, shutter;
  Material steel, plate, rust, grating, perforated, hazard;
  Material wood, cardboard, fabric, rubber, leather;
  Material panel, label, text_poster, diagram_poster, sign, door, map, calendar;
  Material green = Enamel(0.10f, 0.24f, 0.16f);
  Material blue = Enamel(0.08f, 0.16f, 0.34f);
  Material grey = Enamel(0.36f, 0.38f, 0.38f);
  Material cream = Enamel(0.62f, 0.58f, 0.46f);
  Material yellow = Enamel(0.72f, 0.48f, 0.05f);
  Material red = Enamel(0.50f, 0.05f, 0.04f);
  Material white = Enamel(0.75f, 0.75f, 0.72f);
  Material dark = Enamel(0.05f, 0.05f, 0.055f);
};

Palette MakePalette(Scene& scene) {
  Palette p;
  p.concrete = Glossy(Tiled(scene, "concrete", 3), 0.05f, 25);
  p.brick = Tiled(scene, "brick", 1.6f);
  p.plaster = Tiled(scene, "plaster", 3);
  p.dirty_render = Tiled(scene, "render_dirty", 4);
  p.roof_sheet = Tiled(scene, "shutter_slats", 2.4f, {0.7f, 0.7f, 0.7f});
  p.shutter = Glossy(Tiled(scene, "shutter_slats", 1.6f), 0.06f, 40);
  p.steel = Glossy(Tiled(scene, "metal_brushed", 1.2f), 0.2f, 40, 0.15f);
  p.plate = Glossy(Tiled(scene, "metal_plate", 1), 0.1f, 30);
  p.rust = Tiled(scene, "rust", 1.2f);
  p.grating = Tiled(scene, "grating", 0.6f);
  p.perforated = Tiled(scene, "perforated", 0.5f);
  p.hazard = Tiled(scene, "hazard_stripes", 0.6f);
  p.wood = Tiled(scene, "wood_planks", 0.9f);
  p.cardboard = Tiled(scene, "cardboard", 0.8f);
  p.fabric = Tiled(scene, "fabric_weave", 0.5f);
  p.rubber = Glossy(Tiled(scene, "asphalt", 0.4f, {0.5f, 0.5f, 0.5f}), 0.04f, 15);
  p.leather = Glossy(Tiled(scene, "leather", 0.6f), 0.08f, 30);
  p.panel = Glossy(Fitted(scene, "control_panel"), 0.06f, 60);
  p.label = Fitted(scene, "label_sheet");
  p.text_poster = Fitted(scene, "poster_text");
  p.diagram_poster = Fitted(scene, "poster_diagram");
  p.sign = Glossy(Fitted(scene, "shop_sign"), 0.06f, 60);
  p.door = Fitted(scene, "door_panel");
  p.map = Fitted(scene, "map");
  p.calendar = Fitted(scene, "calendar");
  return p;
}

// Vessels, pipes and beams.

// An H-beam standing on the origin: web along x.
Patches Beam(float width, float height) {
  const float flange = 0.02f;
  return Box(width, flange / 2, height) + Put(Box(flange, width, height), -width / 2, 0) +
         Put(Box(flange, width, height), width / 2, 0);
}

// Cylinder along z from `bottom` to `top`, both ends dished.
Patches Vessel(float radius, float bottom, float top) {
  const float r = radius, dish = 0.32f * radius, low = bottom + dish, high = top - dish;
  return Lathe({{0, bottom}, {0.75f * r, bottom + 0.3f * dish}, {r, low}}) +
         Lathe({{r, low}, {r, high}}) +
         Lathe({{r, high}, {0.75f * r, top - 0.3f * dish}, {0, top}});
}

// Standing pressure vessel with dished ends on four legs.
Parts Tank(const Palette& p, const Material& skin, float radius, float height) {
  const float r = radius, h = height;
  Patches bands, fittings;
  for (const float z : {0.62f, h / 2 + 0.18f, h - 0.3f})
    bands = bands + Put(Hoop(r, 0.06f, 0.02f), 0, 0, z);
  fittings = Rod({0, 0, h - 0.05f}, {0, 0, h + 0.25f}, 0.09f) +
             Put(Cylinder(0.16f, 0.04f), 0, 0, h + 0.25f) +
             Put(AlongY(Cylinder(0.24f, 0.1f)), 0, -r - 0.06f, 0.45f * h) +
             Rod({0.68f * r, -0.9f * r, 0.8f}, {0.68f * r, -0.9f * r, h - 0.5f}, 0.02f);
  const float plate_y = -r - 0.02f;
  return {{Vessel(r, 0.35f, h), skin},
          {bands + fittings, p.grey},
          {Legs(1.25f * r, 1.25f * r, 0.6f, 0.1f), p.dark},
          {Front({-0.2f, plate_y, 0.66f * h}, 0.4f, 0.28f), p.label}};
}

// Pressure vessel lying along x on two saddles.
Parts LyingTank(const Palette& p, const Material& skin, float radius, float length) {
  const float r = radius, h = length / 2, axis = radius + 0.35f;
  Patches fittings, saddles;
  for (const float x : {-h, -h / 3, h / 3, h})
    fittings = fittings + Put(AlongX(Hoop(r, 0.07f, 0.02f)), x, 0, axis);
  for (const float x : {-0.6f * h, 0.6f * h})
    saddles = saddles + BoxAt({x, 0, 0}, {0.2f, 1.4f * r, 0.35f + 0.3f * r});
  fittings = fittings + Rod({0, 0, axis + r - 0.05f}, {0, 0, axis + r + 0.3f}, 0.15f) +
             Put(Cylinder(0.24f, 0.06f), 0, 0, axis + r + 0.3f) +
             Put(AlongY(Cylinder(0.2f, 0.1f)), 0.5f * h, -r - 0.07f, axis);
  return {{Put(AlongX(Vessel(r, -h - 0.25f, h + 0.25f)), 0, 0, axis), skin},
          {fittings, p.grey},
          {saddles, p.rust},
          {Front({-0.55f * h, -r - 0.02f, axis - 0.12f}, 0.4f, 0.28f), p.label}};
}

// A pipe along a polyline, with flanges every 2.2 m of its straight pieces.
Parts PipeRun(const Material& pipe, const Material& flange, const std::vector<Vector3f>& path,
              float radius) {
  Patches flanges;
  for (size_t i = 0; i + 1 < path.size(); ++i) {
    const Vector3f direction = (path[i + 1] - path[i]).normalized();
    const float length = (path[i + 1] - path[i]).norm();
    for (float at = 0.5f; at < length - 0.3f; at += 2.2f)
      flanges = flanges +
                Towards(path[i] + at * direction, path[i + 1], Hoop(radius, 0.06f, 0.7f * radius));
  }
  return {{Tube(path, radius), pipe}, {flanges, flange}};
}

// Stop valve on a pipe along x: body, stem, hand wheel towards -y.
Parts Valve(const Palette& p, float pipe_radius) {
  const float wheel = 2.2f * pipe_radius, reach = 4 * pipe_radius;
  Patches spokes = Rod({-wheel, -reach, 0}, {wheel, -reach, 0}, 0.01f) +
                   Rod({0, -reach, -wheel}, {0, -reach, wheel}, 0.01f);
  return {{Sphere(1.8f * pipe_radius), p.grey},
          {Rod({0, 0, 0}, {0, -reach, 0}, 0.02f), p.steel},
          {Put(AlongY(Ring(wheel, 0.018f)), 0, -reach) + spokes, p.red}};
}

// Centrifugal pump with its motor on a base frame: motor to +x, suction to -x, delivery upwards.
Parts Pump(const Palette& p, const Material& paint) {
  Patches fins;
  for (int i = 0; i < 9; ++i)
    fins = fins + Put(AlongX(Hoop(0.21f, 0.02f, 0.04f)), 0.12f + 0.07f * i, 0, 0.45f);
  const Patches motor = Put(AlongX(Cylinder(0.21f, 0.7f)), 0.08f, 0, 0.45f);
  const Patches volute = Put(AlongX(Put(Cylinder(0.3f, 0.22f), 0, 0, -0.11f)), -0.35f, 0, 0.45f) +
                         Put(AlongX(Cylinder(0.1f, 0.4f)), -0.85f, 0, 0.45f) +
                         Rod({-0.35f, 0.2f, 0.5f}, {-0.35f, 0.2f, 0.95f}, 0.08f);
  const Patches flanges = Put(AlongX(Cylinder(0.16f, 0.05f)), -0.9f, 0, 0.45f) +
                          Put(Cylinder(0.14f, 0.05f), -0.35f, 0.2f, 0.95f) +
                          Put(AlongX(Cylinder(0.08f, 0.34f)), -0.24f, 0, 0.45f);
  const Patches frame = BoxAt({0, 0, 0}, {1.9f, 0.6f, 0.12f}) +
                        BoxAt({0.4f, 0, 0.12f}, {0.5f, 0.4f, 0.14f}) +
                        BoxAt({-0.35f, 0, 0.12f}, {0.2f, 0.3f, 0.1f});
  return {{motor + fins, paint},
          {volute, p.rust},
          {flanges + BoxAt({0.45f, 0, 0.65f}, {0.25f, 0.2f, 0.12f}), p.grey},
          {frame, p.concrete}};
}

// Storage.

Parts Pallet(const Palette& p) {
  Patches boards;
  for (int i = 0; i < 7; ++i)
    boards = boards + BoxAt({-0.54f + 0.18f * i, 0, 0.12f}, {0.12f, 0.8f, 0.022f});
  for (const float y : {-0.35f, 0.0f, 0.35f})
    boards = boards + BoxAt({0, y, 0}, {1.2f, 0.1f, 0.12f});
  return {{boards, p.wood}};
}

Parts Barrel(const Material& paint, const Palette& p) {
  Patches body = Cylinder(0.28f, 0.86f) + Put(Hoop(0.27f, 0.04f, 0.015f), 0, 0, 0.87f);
  for (const float z : {0.3f, 0.6f}) body = body + Put(Hoop(0.28f, 0.04f, 0.012f), 0, 0, z);
  return {{body, paint}, {Put(Cylinder(0.04f, 0.03f), 0.15f, 0, 0.86f), p.grey}};
}

// Heavy-duty shelving, 2.7 m wide.
Parts Rack(const Palette& p, int levels, float pitch) {
  const float width = 2.7f, depth = 0.9f, height = levels * pitch + 0.3f;
  Patches beams, boards;
  for (int i = 0; i < levels; ++i) {
    const float z = 0.15f + i * pitch;
    for (const float y : {-depth / 2, depth / 2})
      beams = beams + BoxAt({0, y, z}, {width, 0.05f, 0.1f});
    boards = boards + BoxAt({0, 0, z + 0.1f}, {width - 0.1f, depth, 0.025f});
  }
  Patches braces;
  for (const float x : {-width / 2, width / 2})
    for (float z = 0.2f; z + 0.8f < height; z += 0.8f)
      braces = braces + Bar({x, -depth / 2, z}, {x, depth / 2, z + 0.8f}, 0.03f);
  return {{Legs(width, depth, height, 0.09f), p.blue},
          {beams, p.yellow},
          {boards, p.wood},
          {braces, p.grey}};
}

// Wooden spool of cable lying on its side along y.
Parts CableDrum(const Palette& p, float radius) {
  Patches flanges;
  for (const float y : {-0.35f, 0.27f})
    flanges = flanges + Put(AlongY(Cylinder(radius, 0.06f)), 0, y, radius);
  Patches cable;
  for (int i = 0; i < 9; ++i)
    cable = cable + Put(AlongY(Ring(0.68f * radius, 0.035f)), 0, -0.26f + 0.06f * i, radius);
  return {{flanges, p.wood},
          {cable, p.dark},
          {Put(AlongY(Cylinder(0.06f, 0.75f)), 0, -0.4f, radius), p.grey}};
}

Parts Sack(const Material& cloth) { return {{RoundedBox(0.7f, 0.42f, 0.16f, 0.075f), cloth}}; }

// Switchgear and machines.

Parts ControlCabinet(const Palette& p, const Material& paint) {
  const float front = -0.28f;
  const Patches trim = BoxAt({0, 0, 0}, {0.76f, 0.5f, 0.1f}) +
                       Front({-0.372f, front - 0.002f, 0.86f}, 0.744f, 0.012f) +
                       Rod({0.33f, front - 0.03f, 1.0f}, {0.33f, front - 0.03f, 1.25f}, 0.015f) +
                       Rod({0.33f, front - 0.03f, 0.45f}, {0.33f, front - 0.03f, 0.7f}, 0.015f);
  return {{Put(RoundedBox(0.78f, 0.55f, 1.95f, 0.02f), 0, 0, 0.1f), paint},
          {trim, p.dark},
          {Front({-0.28f, front, 1.1f}, 0.56f, 0.8f), p.panel},
          {Front({-0.25f, front, 0.2f}, 0.5f, 0.3f), p.perforated},
          {Front({-0.3f, front, 0.6f}, 0.2f, 0.16f), p.label}};
}

// Desk with a sloping panel.
Parts ControlDesk(const Palette& p) {
  const Patches slope = Quad({-0.8f, -0.38f, 0.8f}, {1.6f, 0, 0}, {0, 0.5f, 0.3f});
  const Patches sides =
      BoxAt({0, 0, 0.05f}, {1.64f, 0.7f, 0.74f}) + BoxAt({0, 0.25f, 0.79f}, {1.64f, 0.2f, 0.3f});
  return {{sides, p.cream}, {slope, p.panel}, {BoxAt({0, 0.05f, 0}, {1.5f, 0.6f, 0.05f}), p.dark}};
}

// Lathe, 2.6 m long.
Parts TurningLathe(const Palette& p) {
  const Patches body = BoxAt({-0.9f, 0, 0}, {0.7f, 0.6f, 0.75f}) +
                       BoxAt({0.95f, 0, 0}, {0.5f, 0.5f, 0.75f}) +
                       Put(RoundedBox(0.75f, 0.6f, 0.65f, 0.04f), -0.9f, 0, 0.75f) +
                       Put(RoundedBox(0.35f, 0.3f, 0.35f, 0.03f), 0.95f, 0, 0.9f);
  const Patches bed = BoxAt({0.1f, 0, 0.7f}, {2.4f, 0.4f, 0.18f});
  const Patches ways = BoxAt({0.35f, -0.12f, 0.88f}, {1.7f, 0.05f, 0.04f}) +
                       BoxAt({0.35f, 0.12f, 0.88f}, {1.7f, 0.05f, 0.04f}) +
                       Put(AlongX(Cylinder(0.17f, 0.14f)), -0.53f, 0, 1.1f) +
                       Put(AlongX(Cylinder(0.045f, 1.1f)), -0.4f, 0, 1.1f);
  const Patches carriage = BoxAt({0.2f, -0.1f, 0.86f}, {0.4f, 0.6f, 0.12f}) +
                           BoxAt({0.2f, -0.1f, 0.98f}, {0.2f, 0.3f, 0.12f}) +
                           Put(AlongY(Ring(0.1f, 0.015f)), 0.2f, -0.46f, 0.9f);
  const Patches guard =
      Front({-0.55f, 0.34f, 0.75f}, 1.9f, 0.75f) + BoxAt({0.25f, 0, 0.1f}, {1.5f, 0.6f, 0.08f});
  return {{body + bed, p.green},
          {ways, p.steel},
          {carriage, p.grey},
          {guard, p.plate},
          {Front({-1.2f, -0.305f, 0.85f}, 0.45f, 0.45f), p.panel}};
}

// Column drilling machine.
Parts PillarDrill(const Palette& p) {
  const Patches head = Put(RoundedBox(0.34f, 0.7f, 0.42f, 0.06f), 0, -0.12f, 1.6f) +
                       BoxAt({0, -0.1f, 0}, {0.5f, 0.6f, 0.1f});
  const Patches column = Rod({0, 0.1f, 0.1f}, {0, 0.1f, 1.65f}, 0.06f) +
                         Rod({0, -0.3f, 1.3f}, {0, -0.3f, 1.62f}, 0.04f) +
                         Rod({0, -0.3f, 1.12f}, {0, -0.3f, 1.3f}, 0.012f);
  Patches handles;
  for (const float z : {1.58f, 1.72f})
    handles = handles + Rod({0.18f, -0.2f, 1.65f}, {0.34f, -0.32f, z}, 0.012f);
  return {{head, p.blue},
          {column + handles, p.steel},
          {BoxAt({0, -0.25f, 0.95f}, {0.42f, 0.42f, 0.05f}), p.plate}};
}

// Hydraulic press with four columns, 3.7 m high; its long side along x.
Parts Press(const Palette& p) {
  const Patches frame =
      BoxAt({0, 0, 0}, {2.1f, 1.4f, 0.7f}) + BoxAt({0, 0, 3.0f}, {2.1f, 1.4f, 0.55f});
  Patches columns, nuts;
  for (const float x : {-0.85f, 0.85f})
    for (const float y : {-0.5f, 0.5f}) {
      columns = columns + Rod({x, y, 0.7f}, {x, y, 3.0f}, 0.11f);
      for (const float z : {0.7f, 2.88f, 3.55f}) nuts = nuts + Put(Cylinder(0.17f, 0.12f), x, y, z);
    }
  const Patches ram =
      Rod({0, 0, 2.2f}, {0, 0, 3.0f}, 0.28f) + Rod({0, 0, 3.5f}, {0, 0, 4.1f}, 0.35f);
  const Patches slide =
      BoxAt({0, 0, 1.8f}, {1.95f, 1.25f, 0.4f}) + BoxAt({0, 0, 0.7f}, {1.2f, 0.9f, 0.25f});
  return {
      {frame, p.green},
      {columns + ram, p.steel},
      {slide, p.grey},
      {nuts, p.dark},
      {Front({-0.975f, -0.63f, 1.82f}, 1.95f, 0.12f) + Front({-1.05f, -0.705f, 0.52f}, 2.1f, 0.15f),
       p.hazard},
      {Front({-0.35f, -0.705f, 3.1f}, 0.7f, 0.35f), p.sign}};
}

// Axial wall fan: a square shroud, eight blades, a hub and a guard of rings.
Parts WallFan(const Palette& p, float radius) {
  Patches blades, guard;
  for (int i = 0; i < 8; ++i) {
    const float a = Radians(45.0f * i + 10), b = a + Radians(26);
    blades = blades + Quad({0.2f * radius * std::cos(a), -0.1f, 0.2f * radius * std::sin(a)},
                           {0.75f * radius * std::cos(a), 0, 0.75f * radius * std::sin(a)},
                           {0.4f * radius * (std::cos(b) - std::cos(a)), 0.08f,
                            0.4f * radius * (std::sin(b) - std::sin(a))});
    guard = guard + Rod({0, -0.2f, 0}, {radius * std::cos(a), -0.2f, radius * std::sin(a)}, 0.008f);
  }
  for (const float ring : {0.25f, 0.5f, 0.75f, 1.0f})
    guard = guard + Put(AlongY(Ring(ring * radius, 0.01f)), 0, -0.2f);
  const Patches shroud = Put(AlongY(Ring(1.03f * radius, 0.1f)), 0, -0.1f);
  const Patches hub = Put(AlongY(Cylinder(0.2f * radius, 0.14f)), 0, -0.18f);
  return {{Front({-1.2f * radius, -0.01f, -1.2f * radius}, 2.4f * radius, 2.4f * radius), p.dark},
          {shroud, p.grey},
          {blades + hub, p.steel},
          {guard, p.cream}};
}

// Air compressor: lying receiver with a two-cylinder block and a belt guard on top.
Parts Compressor(const Palette& p) {
  Patches cylinders = BoxAt({-0.3f, 0, 0.72f}, {0.5f, 0.35f, 0.25f});
  for (const float x : {-0.42f, -0.18f})
    for (int i = 0; i < 5; ++i)
      cylinders = cylinders + Put(Hoop(0.08f, 0.03f, 0.03f), x, 0, 0.99f + 0.06f * i);
  for (const float x : {-0.42f, -0.18f})
    cylinders = cylinders + Put(Cylinder(0.08f, 0.34f), x, 0, 0.97f);
  const Patches motor = Put(AlongX(Cylinder(0.16f, 0.4f)), 0.2f, 0, 0.9f);
  const Patches guard = Put(AlongY(Cylinder(0.26f, 0.06f)), 0, -0.24f, 0.95f);
  return LyingTank(p, p.blue, 0.3f, 1.1f) +
         Parts{{cylinders, p.grey}, {motor, p.green}, {guard, p.perforated}};
}

// Workshop.

Parts Workbench(const Palette& p) {
  const float length = 2.2f;
  const Patches vice = BoxAt({-0.7f, -0.3f, 0.9f}, {0.16f, 0.3f, 0.14f}) +
                       BoxAt({-0.7f, -0.45f, 0.9f}, {0.16f, 0.06f, 0.18f}) +
                       Rod({-0.7f, -0.6f, 0.96f}, {-0.7f, -0.3f, 0.96f}, 0.02f) +
                       Rod({-0.82f, -0.58f, 0.96f}, {-0.58f, -0.58f, 0.96f}, 0.012f);
  Patches drawers, handles;
  for (int i = 0; i < 4; ++i) {
    drawers = drawers + BoxAt({0.65f, -0.33f, 0.12f + 0.18f * i}, {0.6f, 0.04f, 0.16f});
    handles = handles + BoxAt({0.65f, -0.37f, 0.2f + 0.18f * i}, {0.3f, 0.03f, 0.02f});
  }
  return {{BoxAt({0, 0, 0.84f}, {length, 0.75f, 0.06f}), p.wood},
          {Legs(length - 0.1f, 0.65f, 0.84f, 0.07f) + BoxAt({0.65f, 0, 0.1f}, {0.66f, 0.6f, 0.74f}),
           p.grey},
          {drawers, p.red},
          {vice, p.blue},
          {handles, p.steel}};
}

// Board of hand tools for the wall.
Parts ToolBoard(const Palette& p) {
  Patches steel, grips;
  for (int i = 0; i < 7; ++i) {  // spanners, from small to large
    const float x = -0.95f + 0.13f * i, length = 0.16f + 0.04f * i;
    steel = steel + BoxAt({x, -0.03f, 0.75f - length}, {0.025f, 0.012f, length}) +
            Put(AlongY(Ring(0.03f, 0.012f)), x, -0.025f, 0.75f);
  }
  for (int i = 0; i < 6; ++i) {  // screwdrivers
    const float x = 0.1f + 0.09f * i;
    grips = grips + Rod({x, -0.04f, 0.62f}, {x, -0.04f, 0.74f}, 0.018f);
    steel = steel + Rod({x, -0.04f, 0.42f}, {x, -0.04f, 0.62f}, 0.006f);
  }
  for (int i = 0; i < 3; ++i) {  // hammers
    const float x = 0.7f + 0.14f * i;
    grips = grips + BoxAt({x, -0.03f, 0.35f}, {0.025f, 0.025f, 0.32f});
    steel = steel + BoxAt({x, -0.03f, 0.67f}, {0.11f, 0.04f, 0.04f});
  }
  grips = grips + Put(AlongY(Ring(0.12f, 0.02f)), -0.7f, -0.03f, 0.22f) +
          Put(AlongY(Ring(0.09f, 0.025f)), 0.1f, -0.03f, 0.2f);
  return {{BoxAt({0, 0, 0}, {2.2f, 0.03f, 0.9f}), p.perforated}, {steel, p.steel}, {grips, p.red}};
}

Parts ToolTrolley(const Palette& p) {
  Patches drawers;
  for (int i = 0; i < 5; ++i)
    drawers = drawers + BoxAt({0, -0.235f, 0.2f + 0.13f * i}, {0.62f, 0.02f, 0.115f});
  Patches castors;
  for (const float x : {-0.28f, 0.28f})
    for (const float y : {-0.16f, 0.16f})
      castors = castors + Put(AlongX(Cylinder(0.06f, 0.04f)), x - 0.02f, y, 0.06f);
  return {{BoxAt({0, 0, 0.13f}, {0.68f, 0.45f, 0.75f}), p.red},
          {drawers, Enamel(0.62f, 0.1f, 0.06f)},
          {castors, p.dark},
          {BoxAt({0, 0, 0.88f}, {0.7f, 0.47f, 0.02f}), p.rubber}};
}

Parts Locker(const Palette& p) {
  Patches slots;
  for (int i = 0; i < 5; ++i)
    for (const float x : {-0.19f, 0.19f})
      slots = slots + Front({x - 0.08f, -0.256f, 1.55f + 0.035f * i}, 0.16f, 0.01f);
  return {{Box(0.78f, 0.5f, 1.85f), p.grey},
          {slots + Front({-0.004f, -0.254f, 0.05f}, 0.008f, 1.75f) +
               Rod({0.06f, -0.27f, 0.9f}, {0.06f, -0.27f, 1.02f}, 0.012f),
           p.dark},
          {Front({-0.32f, -0.255f, 1.2f}, 0.24f, 0.18f), p.label}};
}

Parts GasBottle(const Material& paint, const Palette& p) {
  const Patches body = Lathe({{0, 0},
                              {0.11f, 0},
                              {0.11f, 1.2f},
                              {0.09f, 1.32f},
                              {0.04f, 1.4f},
                              {0.04f, 1.46f},
                              {0, 1.46f}});
  return {
      {body, paint},
      {Put(Cylinder(0.025f, 0.1f), 0, 0, 1.46f) + Put(Ring(0.04f, 0.01f), 0, 0, 1.55f), p.steel}};
}

Parts FireExtinguisher(const Palette& p) {
  const Patches body =
      Lathe({{0, 0}, {0.08f, 0}, {0.08f, 0.42f}, {0.05f, 0.5f}, {0.02f, 0.52f}, {0, 0.52f}});
  return {{body, p.red},
          {BoxAt({0, -0.03f, 0.52f}, {0.04f, 0.14f, 0.05f}) +
               Tube({{0, -0.08f, 0.53f}, {0.1f, -0.08f, 0.4f}, {0.1f, -0.05f, 0.1f}}, 0.012f),
           p.dark},
          {Front({-0.05f, -0.085f, 0.15f}, 0.1f, 0.16f), p.label}};
}

Parts HoseReel(const Palette& p) {
  Patches hose;
  for (int i = 0; i < 4; ++i)
    for (const float r : {0.18f, 0.24f})
      hose = hose + Put(AlongY(Ring(r, 0.027f)), 0, -0.12f - 0.055f * i);
  Patches discs = Put(AlongY(Cylinder(0.33f, 0.015f)), 0, -0.08f) +
                  Put(AlongY(Ring(0.31f, 0.018f)), 0, -0.36f) +
                  Put(AlongY(Cylinder(0.05f, 0.38f)), 0, -0.38f);
  return {{hose, p.dark}, {discs, p.red}};
}

// Access.

// Cat ladder for the wall, with a cage from 2.2 m up.
Parts CagedLadder(const Palette& p, float height) {
  Patches rails, rungs, hoops;
  for (const float x : {-0.22f, 0.22f})
    rails = rails + Bar({x, -0.2f, 0}, {x, -0.2f, height}, 0.045f);
  for (float z = 0.3f; z < height; z += 0.28f)
    rungs = rungs + Rod({-0.22f, -0.2f, z}, {0.22f, -0.2f, z}, 0.015f);
  for (float z = 2.2f; z < height; z += 0.7f)
    hoops = hoops + Put(Ring(0.36f, 0.015f), 0, -0.48f, z);
  for (const float x : {-0.25f, 0.0f, 0.25f})
    hoops = hoops +
            Rod({x, x == 0 ? -0.84f : -0.74f, 2.2f}, {x, x == 0 ? -0.84f : -0.74f, height}, 0.012f);
  return {{rails + rungs, p.yellow}, {hoops, p.grey}};
}

// Railing along x from the origin.
Parts Railing(const Palette& p, float length) {
  Patches bars = Rod({0, 0, 1.05f}, {length, 0, 1.05f}, 0.022f) +
                 Rod({0, 0, 0.55f}, {length, 0, 0.55f}, 0.016f);
  const int posts = static_cast<int>(std::ceil(length / 1.2f));
  for (int i = 0; i <= posts; ++i)
    bars = bars + Rod({i * length / posts, 0, 0}, {i * length / posts, 0, 1.05f}, 0.022f);
  return {{bars, p.yellow}, {BoxAt({length / 2, 0, 0}, {length, 0.012f, 0.12f}), p.hazard}};
}

// Stairs up from the origin towards -x.
Parts Stairs(const Palette& p, float run, float rise, int steps) {
  Patches treads, strings, rails;
  for (int i = 0; i < steps; ++i)
    treads = treads + BoxAt({-run * (i + 0.5f) / steps, 0, rise * (i + 1) / steps - 0.04f},
                            {0.26f, 0.9f, 0.04f});
  for (const float y : {-0.47f, 0.47f}) {
    strings = strings + Bar({0, y, 0.05f}, {-run, y, rise + 0.02f}, 0.09f);
    rails = rails + Rod({0, y, 1.0f}, {-run, y, rise + 1.05f}, 0.022f);
    for (int i = 0; i <= 3; ++i)
      rails = rails +
              Rod({-run * i / 3, y, rise * i / 3}, {-run * i / 3, y, rise * i / 3 + 1.0f}, 0.018f);
  }
  return {{treads, p.grating}, {strings, p.grey}, {rails, p.yellow}};
}

// Vehicles and cranes.

// Fork-lift truck, forks towards +x, 2.5 m long.
Parts ForkLift(const Palette& p) {
  const Patches body = Put(RoundedBox(1.3f, 1.0f, 0.55f, 0.08f), -0.25f, 0, 0.25f) +
                       Put(RoundedBox(0.5f, 1.05f, 0.75f, 0.1f), -0.75f, 0, 0.35f);
  Patches wheels, posts, mast, forks;
  for (const float y : {-0.52f, 0.4f}) {
    wheels = wheels + Put(AlongY(Cylinder(0.3f, 0.16f)), 0.35f, y, 0.3f) +
             Put(AlongY(Cylinder(0.24f, 0.14f)), -0.65f, y, 0.24f);
    posts = posts + Bar({0.35f, y + 0.06f, 0.75f}, {0.15f, y + 0.06f, 2.05f}, 0.06f) +
            Bar({-0.75f, y + 0.06f, 1.0f}, {-0.6f, y + 0.06f, 2.05f}, 0.06f);
  }
  for (int i = 0; i < 6; ++i)
    posts = posts + BoxAt({-0.58f + 0.14f * i, 0, 2.05f}, {0.04f, 1.0f, 0.05f});
  for (const float y : {-0.3f, 0.3f}) {
    mast = mast + BoxAt({0.75f, y, 0.08f}, {0.12f, 0.09f, 2.2f});
    forks = forks + BoxAt({1.35f, y, 0.1f}, {1.0f, 0.12f, 0.04f}) +
            BoxAt({0.86f, y, 0.1f}, {0.04f, 0.12f, 0.5f});
  }
  for (const float z : {0.3f, 1.2f, 2.2f}) mast = mast + BoxAt({0.75f, 0, z}, {0.08f, 0.6f, 0.08f});
  const Patches seat = Put(RoundedBox(0.45f, 0.5f, 0.12f, 0.05f), -0.35f, 0, 0.8f) +
                       Put(RoundedBox(0.12f, 0.5f, 0.55f, 0.05f), -0.58f, 0, 0.85f);
  return {
      {body, p.yellow},       {wheels, p.rubber},
      {posts + mast, p.dark}, {forks, p.steel},
      {seat, p.leather},      {Quad({-0.3f, -0.505f, 0.35f}, {0.5f, 0, 0}, {0, 0, 0.25f}), p.sign}};
}

// Roof truss across the hall, its bottom chord at the origin's height.
Patches Truss(float span, float height, int fields) {
  Patches bars = Bar({0, -span / 2, 0}, {0, span / 2, 0}, 0.1f) +
                 Bar({0, -span / 2, height}, {0, span / 2, height}, 0.1f);
  for (int i = 0; i < fields; ++i) {
    const float y0 = span * (static_cast<float>(i) / fields - 0.5f), y1 = y0 + span / fields;
    const bool rising = i % 2 == 0;
    bars = bars + Bar({0, y0, rising ? 0 : height}, {0, y1, rising ? height : 0}, 0.06f);
  }
  return bars;
}

// Overhead crane across the hall at the origin's x: two girders, trolley, and a hook down to 4.7 m.
Parts BridgeCrane(const Palette& p, float rail_z, float trolley_y) {
  Patches girders, cables;
  for (const float x : {-0.45f, 0.45f})
    girders = girders + BoxAt({x, 0, rail_z + 0.1f}, {0.3f, 8.9f, 0.5f});
  for (const float y : {-4.4f, 4.4f})
    girders = girders + BoxAt({0, y, rail_z}, {1.8f, 0.25f, 0.3f});
  const float top = rail_z + 0.6f;
  for (const float x : {-0.1f, 0.1f})
    cables = cables + Rod({x, trolley_y, 5.05f}, {x, trolley_y, top}, 0.012f);
  const Patches trolley = BoxAt({0, trolley_y, top}, {1.2f, 0.9f, 0.08f}) +
                          Put(AlongX(Cylinder(0.16f, 0.6f)), -0.3f, trolley_y, top + 0.22f) +
                          BoxAt({0.4f, trolley_y, top + 0.08f}, {0.3f, 0.5f, 0.3f});
  const Patches hook = Tube({{0, trolley_y, 5.0f},
                             {0, trolley_y, 4.86f},
                             {0.09f, trolley_y, 4.8f},
                             {0, trolley_y, 4.72f},
                             {-0.09f, trolley_y, 4.79f}},
                            0.022f);
  return {{girders, p.yellow},
          {trolley, p.grey},
          {cables, p.steel},
          {hook + Put(Cylinder(0.09f, 0.1f), 0, trolley_y, 5.0f), p.dark},
          {Quad({-0.605f, 1.2f, rail_z + 0.15f}, {0, -2.4f, 0}, {0, 0, 0.4f}), p.sign},
          {BoxAt({0, trolley_y, 5.02f}, {0.3f, 0.14f, 0.16f}), p.hazard}};
}

// Placing things in the hall.

void AddShell(Scene& scene, const Palette& p) {
  const float x = kHalfLength, y = kHalfWidth, base = 1.4f;
  scene.Add("floor", Quad({-x, -y, 0}, {2 * x, 0, 0}, {0, 2 * y, 0}), p.concrete);
  scene.Add("roof", Quad({-x, y, kHeight}, {2 * x, 0, 0}, {0, -2 * y, 0}), p.roof_sheet);
  scene.Add("north wall", Front({-x, y, base}, 2 * x, kHeight - base), p.brick);
  scene.Add("north plinth", Front({-x, y, 0}, 2 * x, base), Plain(0.30f, 0.36f, 0.34f));
  scene.Add("south wall", Quad({x, -y, base}, {-2 * x, 0, 0}, {0, 0, kHeight - base}), p.plaster);
  scene.Add("south plinth", Quad({x, -y, 0}, {-2 * x, 0, 0}, {0, 0, base}),
            Plain(0.30f, 0.36f, 0.34f));
  scene.Add("east wall", Quad({x, y, 0}, {0, -2 * y, 0}, {0, 0, kHeight}),
            Plain(0.55f, 0.54f, 0.50f));
  scene.Add("west wall", Quad({-x, -y, 0}, {0, 2 * y, 0}, {0, 0, kHeight}), p.dirty_render);
}

void AddFrame(Scene& scene, const Palette& p) {
  const float rail_z = 5.35f;
  for (int i = 0; i < 6; ++i) {
    const float x = -7.5f + 3 * i;
    scene.Add(fmt::format("roof truss {}", i + 1), Put(Truss(9.9f, 0.65f, 10), x, 0, 6.25f),
              p.grey);
    scene.Add(fmt::format("north column {}", i + 1), Put(Beam(0.26f, 6.2f), x, 4.84f), p.green);
    scene.Add(fmt::format("south column {}", i + 1), Put(Beam(0.26f, 6.2f), x, -4.84f), p.green);
  }
  for (const float y : {-4.4f, 4.4f}) {
    Parts rail = {{BoxAt({0, y, rail_z - 0.35f}, {17.9f, 0.2f, 0.3f}), p.green},
                  {BoxAt({0, y, rail_z - 0.05f}, {17.9f, 0.06f, 0.05f}), p.rust}};
    for (int i = 0; i < 6; ++i)
      rail[0].patches =
          rail[0].patches + BoxAt({-7.5f + 3 * i, y * 1.06f, rail_z - 0.55f}, {0.2f, 0.5f, 0.2f});
    scene.Add(y < 0 ? "south crane rail" : "north crane rail", rail);
  }
  scene.Add("bridge crane", Put(BridgeCrane(p, rail_z, 1.0f), 2.9f, 0));
}

void AddFloorMarks(Scene& scene, const Palette& p) {
  const Material paint = Plain(0.70f, 0.52f, 0.08f);
  const float z = 0.003f;
  for (const float y : {-2.55f, 2.55f})
    scene.Add(y < 0 ? "south lane line" : "north lane line", Sheet({0, y, z}, 14, 0.1f), paint);
  Patches dashes;
  for (int i = 0; i < 9; ++i) dashes = dashes + Sheet({-5.6f + 1.4f * i, 1.55f, z}, 0.7f, 0.08f);
  scene.Add("lane dashes", dashes, Plain(0.65f, 0.65f, 0.62f));
  scene.Add("threshold stripes", Sheet({7.6f, 0, z}, 0.5f, 4.2f), p.hazard);
  scene.Add("press stripes", Sheet({-6.9f, 0, z}, 0.4f, 3.2f), p.hazard);
  scene.Add("drain",
            {{Sheet({0, 0, z}, 11, 0.3f), p.grating},
             {Sheet({0, -0.18f, z}, 11, 0.05f) + Sheet({0, 0.18f, z}, 11, 0.05f), p.plate}});
  const std::vector<std::pair<Vector3f, float>> plates = {
      {{-4.2f, 1.4f, z}, 1.2f}, {{0.8f, -1.5f, z}, 1.0f}, {{4.9f, -0.9f, z}, 1.4f}};
  for (size_t i = 0; i < plates.size(); ++i)
    scene.Add(fmt::format("floor plate {}", i + 1), Sheet(plates[i].first, plates[i].second, 1),
              p.plate);
}

// A puddle with a wavy rim, just above the floor.
Patches Stain(float radius) {
  return {MakePatch(48, 2, [=](float s, float t) -> Vector3f {
    const float angle = Radians(-360 * s);
    const float rim = 0.7f + 0.18f * std::sin(2 * angle + 1) + 0.12f * std::sin(5 * angle);
    return {t * radius * rim * std::cos(angle), t * radius * rim * std::sin(angle), 0.003f};
  })};
}

// What lies about on the floor; nothing higher than 0.2 m.
void AddFloorGoods(Scene& scene, const Palette& p) {
  Patches stock;
  for (int i = 0; i < 6; ++i)
    stock = stock + Rod({2.2f + 0.1f * (i % 3), -1.95f + 0.11f * i, 0.045f},
                        {5.4f + 0.15f * (i % 2), -2.05f + 0.11f * i, 0.045f}, 0.045f);
  scene.Add("pipe stock", stock, p.steel);
  scene.Add(
      "loose planks",
      Put(BoxAt({0, 0, 0}, {2.6f, 0.22f, 0.04f}) + BoxAt({0.2f, 0.26f, 0}, {2.2f, 0.22f, 0.04f}) +
              Put(Box(2.4f, 0.2f, 0.04f), 0.1f, 0.1f, 0.04f, 9),
          -4.6f, -0.95f, 0, 28),
      p.wood);
  scene.Add("sheet metal",
            Put(Box(1.5f, 1.0f, 0.02f) + Put(Box(1.3f, 0.9f, 0.02f), 0.1f, 0.05f, 0.02f, 7), 3.2f,
                1.0f, 0, -18),
            p.steel);
  scene.Add("oil stain", Put(Stain(0.4f), 1.1f, 0.75f) + Put(Stain(0.3f), -3.4f, 2.0f),
            Glossy(Plain(0.09f, 0.085f, 0.08f), 0.1f, 60, 0.06f));
  scene.Add("rubber mat", Put(Box(2.2f, 0.5f, 0.012f), 1.8f, 2.6f), p.rubber);
  scene.Add("empty pallet", Put(Pallet(p), -1.6f, 1.1f, 0, 15));
  scene.Add("air hose",
            Cable({{-6.0f, -3, 0.02f},
                   {-4.8f, -1.8f, 0.02f},
                   {-3.6f, -2.1f, 0.02f},
                   {-2.2f, -0.7f, 0.02f},
                   {-0.9f, -1.4f, 0.02f},
                   {0.2f, -0.9f, 0.02f}},
                  0.018f),
            p.red);
  scene.Add("extension lead",
            Cable({{6.8f, 2.7f, 0.016f},
                   {5.2f, 1.6f, 0.016f},
                   {3.6f, 2.0f, 0.016f},
                   {2.4f, 0.9f, 0.016f},
                   {1.2f, 1.7f, 0.016f}},
                  0.015f),
            Plain(0.04f, 0.04f, 0.04f));
}

void AddVessels(Scene& scene, const Palette& p) {
  scene.Add("tank 1", Put(Tank(p, p.steel, 0.8f, 3.1f), -7.7f, 3.85f));
  scene.Add("tank 2", Put(Tank(p, p.steel, 0.8f, 3.1f), -5.85f, 3.95f));
  scene.Add("tank 3", Put(Tank(p, p.cream, 0.55f, 2.4f), -4.3f, 4.15f));
  scene.Add("boiler", Put(LyingTank(p, p.steel, 0.7f, 2.1f), -0.6f, 4.0f));
  const std::vector<Vector3f> filters = {
      {-7.4f, -4.3f, 2.75f}, {-6.1f, -4.3f, 2.75f}, {-4.8f, -4.3f, 2.75f}};
  for (size_t i = 0; i < filters.size(); ++i)
    scene.Add(fmt::format("filter {}", i + 1),
              Put(Tank(p, p.blue, 0.38f, 1.5f), filters[i], kFaceNorth));
  scene.Add("heat exchanger lower",
            Put(LyingTank(p, p.rust, 0.34f, 1.3f), -8.1f, 2.05f, 0, kFaceEast));
  scene.Add("heat exchanger upper",
            Put(LyingTank(p, p.rust, 0.34f, 1.3f), -8.1f, 2.05f, 1.05f, kFaceEast));
}

struct Pipe {
  std::string name;
  std::vector<Vector3f> path;
  float radius;
  Material skin;
};

std::vector<Pipe> Pipes(const Palette& p) {
  std::vector<Pipe> pipes;
  const std::vector<std::pair<float, Material>> mains = {
      {0.09f, p.steel}, {0.07f, p.cream}, {0.06f, p.green}, {0.06f, p.red}, {0.045f, p.grey}};
  float z = 3.25f;
  for (size_t i = 0; i < mains.size(); ++i, z += 0.22f)
    pipes.push_back({fmt::format("north main {}", i + 1),
                     {{-8.7f, 4.62f, z}, {8.8f, 4.62f, z}},
                     mains[i].first,
                     mains[i].second});
  pipes.push_back(
      {"tank 1 riser",
       {{-7.7f, 3.85f, 3.3f}, {-7.7f, 3.85f, 3.9f}, {-7.7f, 4.55f, 3.9f}, {-7.7f, 4.55f, 6.2f}},
       0.08f,
       p.cream});
  pipes.push_back({"tank 2 riser",
                   {{-5.85f, 3.95f, 3.3f}, {-5.85f, 3.95f, 4.5f}, {-8.8f, 3.95f, 4.5f}},
                   0.08f,
                   p.cream});
  pipes.push_back(
      {"boiler flue",
       {{-0.6f, 4.0f, 2.05f}, {-0.6f, 4.0f, 4.6f}, {-0.6f, 2.7f, 5.3f}, {-0.6f, 2.7f, 6.9f}},
       0.17f,
       p.steel});
  pipes.push_back(
      {"boiler feed",
       {{0.1f, 4.0f, 1.7f}, {0.1f, 4.0f, 2.6f}, {0.1f, 4.5f, 2.6f}, {0.1f, 4.5f, 3.25f}},
       0.06f,
       p.green});
  pipes.push_back({"pump header", {{-8.6f, -4.6f, 2.2f}, {-0.6f, -4.6f, 2.2f}}, 0.11f, p.blue});
  for (int i = 0; i < 3; ++i) {
    const float x = -7.0f + 2.3f * i;
    pipes.push_back({fmt::format("pump {} delivery", i + 1),
                     {{x + 0.35f, -4.2f, 1.0f},
                      {x + 0.35f, -4.2f, 1.7f},
                      {x + 0.35f, -4.6f, 1.7f},
                      {x + 0.35f, -4.6f, 2.15f}},
                     0.08f,
                     p.blue});
  }
  for (int i = 0; i < 4; ++i) {
    const float y = -2.95f + 0.24f * i;
    pipes.push_back({fmt::format("west riser {}", i + 1),
                     {{-8.8f, y, 0}, {-8.8f, y, 4.4f}, {-8.2f, y, 4.9f}, {-8.2f, y, 6.9f}},
                     0.07f,
                     i % 2 == 0 ? p.rust : p.cream});
  }
  return pipes;
}

void AddPipes(Scene& scene, const Palette& p) {
  for (const Pipe& pipe : Pipes(p))
    scene.Add(pipe.name, PipeRun(pipe.skin, p.grey, pipe.path, pipe.radius));
  const std::vector<Vector3f> valves = {{-3.4f, 4.62f, 3.25f},
                                        {0.7f, 4.62f, 3.47f},
                                        {3.6f, 4.62f, 3.25f},
                                        {-6.0f, -4.6f, 2.2f},
                                        {-2.2f, -4.6f, 2.2f}};
  for (size_t i = 0; i < valves.size(); ++i)
    scene.Add(fmt::format("valve {}", i + 1),
              Put(Valve(p, 0.09f), valves[i], valves[i].y() < 0 ? kFaceNorth : 0));
  Patches duct = Tube({{-8.9f, 3.3f, 5.9f}, {7.2f, 3.3f, 5.9f}}, 0.3f);
  Patches outlets, rings;
  for (int i = 0; i < 6; ++i) {
    const float x = -7.6f + 2.7f * i;
    outlets = outlets + Put(Cone(0.26f, 0.16f, 0.3f), x, 3.3f, 5.35f);
    rings = rings + Put(AlongX(Hoop(0.3f, 0.06f, 0.02f)), x + 1.3f, 3.3f, 5.9f);
  }
  scene.Add("ventilation duct", {{duct, p.steel}, {outlets + rings, p.grey}});
  Patches tray = BoxAt({0, -4.75f, 4.55f}, {17.6f, 0.4f, 0.03f}) +
                 BoxAt({0, -4.56f, 4.55f}, {17.6f, 0.02f, 0.1f});
  Patches cables;
  for (int i = 0; i < 4; ++i)
    cables = cables +
             Tube({{-8.8f, -4.6f - 0.07f * i, 4.61f}, {8.8f, -4.6f - 0.07f * i, 4.61f}}, 0.025f);
  scene.Add("cable tray", {{tray, p.perforated}, {cables, p.dark}});
}

void AddMachines(Scene& scene, const Palette& p) {
  for (int i = 0; i < 3; ++i)
    scene.Add(fmt::format("pump {}", i + 1),
              Put(Pump(p, i == 1 ? p.green : p.blue), -7.0f + 2.3f * i, -4.0f, 0, kFaceNorth));
  scene.Add("compressor", Put(Compressor(p), -0.4f, -4.2f, 0, kFaceNorth));
  scene.Add("lathe", Put(TurningLathe(p), 2.3f, 4.1f));
  scene.Add("pillar drill", Put(PillarDrill(p), 3.1f, -4.4f, 0, kFaceNorth));
  scene.Add("press", Put(Press(p), -8.1f, 0.1f, 0, kFaceEast));
  scene.Add("wall fan", Put(WallFan(p, 0.75f), -8.98f, 0.9f, 5.3f, kFaceEast));
  scene.Add("control desk", Put(ControlDesk(p), -7.7f, -2.2f, 0, kFaceEast));
  scene.Add("fork-lift truck", Put(ForkLift(p), 7.9f, -3.9f, 0, 180));
  const std::vector<std::pair<Vector3f, float>> cabinets = {{{-3.3f, 4.68f, 0}, 0},
                                                            {{-2.5f, 4.68f, 0}, 0},
                                                            {{3.9f, 4.68f, 0}, 0},
                                                            {{-8.68f, 3.0f, 0}, kFaceEast},
                                                            {{-8.68f, -3.9f, 0}, kFaceEast}};
  for (size_t i = 0; i < cabinets.size(); ++i)
    scene.Add(fmt::format("control cabinet {}", i + 1),
              Put(ControlCabinet(p, i % 2 == 0 ? p.grey : p.cream), cabinets[i].first,
                  cabinets[i].second));
}

// The walkway along the south wall, its stairs, and the ladder in the north.
void AddAccess(Scene& scene, const Palette& p) {
  const float west = -8.9f, east = 0.3f, south = -4.95f, north = -3.45f, z = 2.7f;
  scene.Add("walkway", {{Block(west, east, south, north, z - 0.05f, z), p.grating},
                        {Block(west, east, north - 0.08f, north, z - 0.22f, z - 0.05f), p.hazard}});
  for (int i = 0; i < 4; ++i)
    scene.Add(fmt::format("walkway post {}", i + 1),
              Put(Beam(0.14f, z - 0.2f), -8.2f + 2.7f * i, north - 0.1f), p.grey);
  scene.Add("walkway railing", Put(Railing(p, east - west), west, north - 0.05f, z));
  scene.Add("stairs", Put(Stairs(p, 2.4f, z, 12), 2.7f, -3.95f));
  scene.Add("caged ladder", Put(CagedLadder(p, 5.2f), 0.95f, 4.98f));
}

void AddWorkshop(Scene& scene, const Palette& p) {
  scene.Add("workbench", Put(Workbench(p), 4.7f, -4.55f, 0, kFaceNorth));
  scene.Add("tool board", Put(ToolBoard(p), 4.7f, -4.97f, 1.35f, kFaceNorth));
  scene.Add("tool trolley", Put(ToolTrolley(p), 6.3f, -4.6f, 0, kFaceNorth + 12));
  for (int i = 0; i < 3; ++i)
    scene.Add(fmt::format("locker {}", i + 1),
              Put(Locker(p), 8.72f, 2.75f + 0.8f * i, 0, kFaceWest));
  for (int i = 0; i < 3; ++i)
    scene.Add(fmt::format("gas bottle {}", i + 1),
              Put(GasBottle(i == 1 ? p.grey : p.red, p), 0.75f + 0.27f * i, -4.75f));
  scene.Add("work lamp stand",
            Rod({-6.9f, -3.1f, 0}, {-6.9f, -3.1f, 1.9f}, 0.02f) +
                Rod({-7.2f, -3.2f, 0}, {-6.9f, -3.1f, 0.7f}, 0.015f) +
                Rod({-6.6f, -3.3f, 0}, {-6.9f, -3.1f, 0.7f}, 0.015f) +
                Rod({-6.8f, -2.8f, 0}, {-6.9f, -3.1f, 0.7f}, 0.015f),
            p.yellow);
  scene.Add("fire extinguisher 1", Put(FireExtinguisher(p), 8.85f, -2.05f, 0.9f, kFaceWest));
  scene.Add("fire extinguisher 2", Put(FireExtinguisher(p), -1.5f, 4.6f, 0.9f));
  scene.Add("hose reel", Put(HoseReel(p), 0.35f, 4.98f, 1.5f));
}

// Twelve plastic crates in three stacks, and cartons and crates in the rack.
void AddBoxes(Scene& scene, const Palette& p) {
  const std::vector<Material> plastics = {Glossy(p.blue, 0.12f, 40), Glossy(p.red, 0.12f, 40),
                                          Glossy(p.grey, 0.12f, 40), Glossy(p.yellow, 0.12f, 40)};
  const std::vector<std::pair<Vector3f, int>> stacks = {
      {{8.3f, 0.95f, 0}, 5},      {{8.3f, 1.65f, 0}, 4},    {{7.8f, 1.7f, 0}, 2},
      {{4.55f, 4.25f, 0.28f}, 2}, {{5.3f, 4.3f, 1.08f}, 1}, {{6.1f, 4.25f, 1.08f}, 2}};
  int number = 0;
  for (const auto& [place, count] : stacks)
    for (int i = 0; i < count; ++i, ++number)
      scene.Add(fmt::format("crate {}", number + 1),
                Put(Crate(plastics[number % 4]), place + Vector3f(0, 0, 0.31f * i),
                    place.x() > 7 ? 90.0f + 4 * (number % 3) : 2 * (number % 3)));
  scene.Add("storage rack", Put(Rack(p, 3, 0.8f), 5.3f, 4.35f));
  struct Load {
    Vector3f place, size;
    float yaw_deg;
  };
  const std::vector<Load> cartons = {{{5.3f, 4.3f, 0.28f}, {0.6f, 0.5f, 0.45f}, 4},
                                     {{6.1f, 4.3f, 0.28f}, {0.7f, 0.6f, 0.5f}, -3},
                                     {{4.5f, 4.3f, 1.08f}, {0.5f, 0.5f, 0.4f}, 5},
                                     {{4.45f, 4.3f, 1.48f}, {0.4f, 0.4f, 0.22f}, -8},
                                     {{4.4f, 4.3f, 1.88f}, {0.7f, 0.6f, 0.5f}, 0},
                                     {{5.2f, 4.3f, 1.88f}, {0.55f, 0.5f, 0.6f}, 6},
                                     {{6.0f, 4.3f, 1.88f}, {0.8f, 0.6f, 0.35f}, -2},
                                     {{7.9f, -1.3f, 0.0f}, {0.6f, 0.8f, 0.6f}, 90},
                                     {{7.95f, -1.25f, 0.6f}, {0.5f, 0.5f, 0.4f}, 75}};
  const Material tape = Glossy(Plain(0.42f, 0.30f, 0.16f), 0.1f, 30);
  for (size_t i = 0; i < cartons.size(); ++i)
    scene.Add(fmt::format("carton {}", i + 1), Put(Carton(cartons[i].size, p.cardboard, tape),
                                                   cartons[i].place, cartons[i].yaw_deg));
}

void AddBulkGoods(Scene& scene, const Palette& p) {
  const std::vector<Vector3f> barrels = {
      {6.95f, 4.6f, 0}, {7.55f, 4.6f, 0},    {8.05f, 4.65f, 0.0f}, {7.25f, 4.05f, 0},
      {7.9f, 4.05f, 0}, {7.5f, 4.45f, 0.9f}, {-6.0f, -3.15f, 0},   {1.45f, -3.15f, 0}};
  for (size_t i = 0; i < barrels.size(); ++i)
    scene.Add(fmt::format("barrel {}", i + 1), Put(Barrel(i % 3 == 0   ? p.blue
                                                          : i % 3 == 1 ? p.rust
                                                                       : p.yellow,
                                                          p),
                                                   barrels[i], 40.0f * i));
  for (int i = 0; i < 4; ++i)
    scene.Add(fmt::format("pallet {}", i + 1),
              Put(Pallet(p), 8.2f, -0.4f, 0.145f * i, 90.0f + 2 * (i % 2)));
  for (int i = 0; i < 4; ++i)
    scene.Add(fmt::format("sack {}", i + 1),
              Put(Sack(p.fabric), 8.2f + 0.05f * (i % 2), -0.65f + 0.45f * (i % 2),
                  0.58f + 0.15f * (i / 2), 6.0f * i));
  scene.Add("cable drum 1", Put(CableDrum(p, 0.5f), 6.9f, 3.35f, 0, 20));
  scene.Add("cable drum 2", Put(CableDrum(p, 0.36f), -6.95f, 3.12f, 0, -35));
}

// Doors, windows, signs and papers on the walls.
void AddWallFittings(Scene& scene, const Palette& p) {
  scene.Add(
      "rolling shutter",
      {{Quad({8.96f, 1.9f, 0}, {0, -3.8f, 0}, {0, 0, 4.1f}), p.shutter},
       {Block(8.88f, 9, -2.08f, -1.9f, 0, 4.2f) + Block(8.88f, 9, 1.9f, 2.08f, 0, 4.2f), p.hazard},
       {BoxAt({8.75f, 0, 4.3f}, {0.5f, 4.2f, 0.5f}), p.grey}});
  scene.Add("door", Put(Door(0.95f, 2.1f, p.grey, p.door, p.steel), 8.99f, -2.75f, 0, kFaceWest));
  const Material milky_glass = Glossy(Plain(0.42f, 0.48f, 0.52f), 0.2f, 150, 0.12f);
  for (int i = 0; i < 5; ++i) {
    const Opening opening = {-1, 1, 0, 1.3f};
    scene.Add(fmt::format("window {}", i + 1), Put(Parts{{WindowFrame(opening, 4), p.white},
                                                         {Front({-1, 0, 0}, 2, 1.3f), milky_glass}},
                                                   -6.0f + 3 * i, -4.96f, 3.1f, kFaceNorth));
  }
  struct Paper {
    std::string name;
    Vector3f place;
    float width, height, yaw_deg;
    Material picture;
  };
  const std::vector<Paper> papers = {
      {"safety poster", {-1.95f, 4.97f, 1.5f}, 0.6f, 0.85f, 0, p.text_poster},
      {"wiring diagram", {1.6f, 4.97f, 1.55f}, 0.9f, 0.65f, 0, p.diagram_poster},
      {"machine poster", {2.9f, 4.97f, 1.6f}, 0.8f, 1.1f, 0, p.diagram_poster},
      {"calendar", {6.1f, -4.98f, 1.5f}, 0.45f, 0.65f, kFaceNorth, p.calendar},
      {"escape plan", {8.98f, -3.65f, 1.4f}, 0.8f, 0.6f, kFaceWest, p.map},
      {"exit sign", {8.97f, -2.75f, 2.3f}, 0.6f, 0.25f, kFaceWest, p.sign},
      {"notice", {7.0f, -4.98f, 1.4f}, 0.6f, 0.8f, kFaceNorth, p.text_poster},
      {"hall sign", {-4.5f, -3.42f, 2.2f}, 1.4f, 0.3f, kFaceNorth, p.sign},
      {"dark end notice", {-8.98f, -1.2f, 1.7f}, 0.6f, 0.8f, kFaceEast, p.text_poster},
      {"east map", {8.97f, 2.4f, 2.3f}, 1.6f, 1.2f, kFaceWest, p.map}};
  for (const Paper& paper : papers)
    scene.Add(paper.name, Put(Panel(paper.width, paper.height), paper.place, paper.yaw_deg),
              paper.picture);
}

// A fitting that holds a lamp of length x width under it.
Patches LampHousing(float length, float width) {
  return BoxAt({0, 0, 0.005f}, {length + 0.06f, width + 0.06f, 0.09f});
}

void AddLights(Scene& scene, const Palette& p) {
  for (const float x : {0.0f, 6.0f}) {
    const float half_x = 0.9f, half_y = 1.5f, z = kHeight - 0.06f;
    scene.lights.push_back({"skylights",
                            {x - half_x, half_y, z},
                            {2 * half_x, 0, 0},
                            {0, -2 * half_y, 0},
                            {17, 18.5f, 20}});
    Patches bars = Block(x - half_x - 0.1f, x - half_x, -half_y, half_y, z - 0.1f, kHeight) +
                   Block(x + half_x, x + half_x + 0.1f, -half_y, half_y, z - 0.1f, kHeight);
    for (int i = 0; i < 4; ++i)
      bars = bars + Block(x - half_x, x + half_x, -half_y + i - 0.03f, -half_y + i + 0.03f,
                          z - 0.08f, z - 0.02f);
    scene.Add(x < 3 ? "skylight frame 1" : "skylight frame 2", bars, p.white);
  }
  int number = 0;
  for (const float y : {-1.9f, 1.9f})
    for (const float x : {-7.2f, -1.6f, 4.4f}) {
      const bool broken = x < -5;
      const float length = 3.2f, width = 0.22f, z = 6.1f;
      Patches housing = Put(LampHousing(length, width), x, y, z);
      if (broken)
        housing = housing + Put(AlongX(Cylinder(0.03f, length)), x - length / 2, y, z - 0.03f);
      scene.Add(fmt::format("row lamp housing {}", ++number), housing, p.white);
      if (!broken)
        scene.lights.push_back({"ceiling_rows",
                                {x - length / 2, y + width / 2, z},
                                {length, 0, 0},
                                {0, -width, 0},
                                {30, 28, 24}});
    }
  // One lamp on the stand in the dark end, turned to the press, and one over the workbench.
  scene.lights.push_back(LampTowards("work_lamps", {-6.9f, -3.1f, 1.95f}, {-8.1f, 0.1f, 1.6f}, 0.3f,
                                     0.25f, {100, 85, 60}));
  scene.lights.push_back(
      {"work_lamps", {4.2f, -4.35f, 2.6f}, {1.0f, 0, 0}, {0, -0.15f, 0}, {30, 28, 24}});
  scene.Add("bench lamp housing",
            Put(LampHousing(1.0f, 0.15f), 4.7f, -4.425f, 2.6f) +
                Rod({4.7f, -4.425f, 2.65f}, {4.7f, -4.98f, 2.9f}, 0.02f),
            p.dark);
}

}  // namespace

Scene MachineHall() {
  Scene scene;
  scene.name = "machine_hall";
  const Palette palette = MakePalette(scene);
  AddShell(scene, palette);
  AddFrame(scene, palette);
  AddFloorMarks(scene, palette);
  AddFloorGoods(scene, palette);
  AddVessels(scene, palette);
  AddPipes(scene, palette);
  AddMachines(scene, palette);
  AddAccess(scene, palette);
  AddWorkshop(scene, palette);
  AddBoxes(scene, palette);
  AddBulkGoods(scene, palette);
  AddWallFittings(scene, palette);
  AddLights(scene, palette);
  scene.views = {{"tanks", {3.0f, -1.8f, 1.8f}, {-5.5f, 3.8f, 1.9f}},
                 {"workshop", {-1.5f, 2.0f, 2.0f}, {5.0f, -4.0f, 1.6f}},
                 {"gate", {0.5f, -1.2f, 1.5f}, {8.5f, 1.2f, 1.8f}},
                 {"pumps", {1.0f, 1.5f, 1.6f}, {-5.0f, -4.2f, 1.6f}},
                 {"dark_end", {-1.8f, -0.6f, 2.2f}, {-8.5f, 0.6f, 1.9f}},
                 {"machines", {-2.2f, -1.6f, 1.7f}, {2.5f, 4.3f, 1.6f}},
                 {"length", {6.3f, 1.8f, 2.4f}, {-6.0f, -1.2f, 2.3f}}};
  return scene;
}

}  // namespace sgf::synth
