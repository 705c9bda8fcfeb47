#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include <sgf/synth/arithmetic.h>
#include <sgf/synth/scenes/workshop.h>

// Two furnishings of one motion-capture room of 8 x 8.5 x 4 m: x in [-4, 4], y in [-4.25, 4.25].
// |x| <= 2.2, |y| <= 2.2, 0.6 <= z <= 2.4 is free for flying; things stand along the walls, and
// what lies in the middle is flat.
//
// Things are built facing -y, as against the north wall; those at the other walls are turned.

namespace sgf::synth {
namespace {

using Eigen::Vector3f;

constexpr float kEast = 4, kNorth = 4.25f, kHeight = 4;
constexpr float kFaceNorth = 180, kFaceEast = 90, kFaceWest = -90;

struct Palette {
  Material floor_mat, plaster, ceiling_tile, concrete;
  Material ticking, stripes, cloth, foam, camouflage, carpet, rug;
  Material cardboard, wood, planks, steel, plate, cork, leather;
  Material diagram, text, map, abstract, landscape, screen, label, calendar, door;
  Material white = Plain(0.72f, 0.72f, 0.70f);
  Material black = Glossy(Plain(0.035f, 0.035f, 0.04f), 0.1f, 60);
  Material grey = Glossy(Plain(0.33f, 0.34f, 0.35f), 0.1f, 50);
  Material red = Glossy(Plain(0.48f, 0.05f, 0.04f), 0.1f, 50);
  Material blue = Glossy(Plain(0.05f, 0.14f, 0.40f), 0.1f, 50);
  Material yellow = Glossy(Plain(0.70f, 0.50f, 0.06f), 0.1f, 50);
  Material green = Glossy(Plain(0.08f, 0.30f, 0.14f), 0.1f, 50);
  Material alloy = Glossy(Plain(0.50f, 0.50f, 0.50f), 0.04f, 12);
  Material piping = Plain(0.20f, 0.21f, 0.23f);
  Material tape = Glossy(Plain(0.42f, 0.30f, 0.16f), 0.1f, 30);
};

Palette MakePalette(Scene& scene) {
  Palette p;
  p.floor_mat = Tiled(scene, "foam_mat", 2);
  p.plaster = Tiled(scene, "plaster", 3);
  p.ceiling_tile = Tiled(scene, "perforated", 0.6f, {0.8f, 0.8f, 0.8f});
  p.concrete = Tiled(scene, "concrete", 3);
  p.ticking = Tiled(scene, "mattress_ticking", 0.5f);
  p.stripes = Tiled(scene, "fabric_stripes", 0.7f);
  p.cloth = Tiled(scene, "fabric_weave", 0.4f);
  p.foam = Tiled(scene, "foam", 0.6f);
  p.camouflage = Tiled(scene, "camouflage", 1.5f);
  p.carpet = Tiled(scene, "carpet", 0.8f);
  p.rug = Fitted(scene, "rug");
  p.cardboard = Tiled(scene, "cardboard", 0.8f);
  p.wood = Tiled(scene, "wood_grain", 0.8f);
  p.planks = Tiled(scene, "wood_planks", 0.9f);
  p.steel = Glossy(Tiled(scene, "metal_brushed", 0.8f), 0.2f, 50, 0.12f);
  p.plate = Glossy(Tiled(scene, "metal_plate", 0.6f), 0.12f, 40, 0.05f);
  p.cork = Tiled(scene, "cork", 0.7f);
  p.leather = Glossy(Tiled(scene, "leather", 0.5f), 0.08f, 30);
  p.diagram = Fitted(scene, "poster_diagram");
  p.text = Fitted(scene, "poster_text");
  p.map = Fitted(scene, "map");
  p.abstract = Fitted(scene, "painting_abstract");
  p.landscape = Fitted(scene, "painting_landscape");
  p.screen = Glossy(Fitted(scene, "screen_desktop"), 0.1f, 120, 0.05f);
  p.label = Fitted(scene, "label_sheet");
  p.calendar = Fitted(scene, "calendar");
  p.door = Fitted(scene, "door_panel");
  return p;
}

Material Dyed(Material material, float red, float green, float blue) {
  material.tint = {red, green, blue};
  return material;
}

// Soft things.

// Mattress standing on its edge: a rounded body, a face that bulges, and piping along the rim.
Parts Mattress(const Material& cover, const Material& piping, float width, float height) {
  const float thickness = 0.17f, puff = 0.035f, rim = 0.045f;
  const float x = width / 2 - rim, z0 = rim, z1 = height - rim;
  const auto face = [=](float s, float t) -> Vector3f {
    const float u = 2 * s - 1, v = 2 * t - 1;
    const float bulge = puff * (1 - u * u) * (1 - v * v);
    return {x * u, -thickness - 0.001f - bulge, z0 + t * (z1 - z0)};
  };
  const float y = -thickness + 0.01f, e = width / 2 - 0.012f, top = height - 0.012f;
  const std::vector<Vector3f> loop = {{0, y, 0.015f}, {e, y, 0.015f},  {e, y, top},
                                      {-e, y, top},   {-e, y, 0.015f}, {0, y, 0.015f}};
  return {{Put(RoundedBox(width, thickness, height, rim), 0, -thickness / 2), cover},
          {{MakePatch(10, 10, face)}, cover},
          {Tube(loop, 0.012f), piping}};
}

// A flat thing of that height leaning against a wall at y = 0 behind it.
Parts Leaning(Parts thing, float height, float lean_deg) {
  const float foot = height * std::sin(Radians(lean_deg));
  return Put(Tilted(std::move(thing), -lean_deg), 0, -foot);
}

// A thing that stood on its edge, laid down on its back.
Parts Lying(Parts thing, float height) {
  const Eigen::AngleAxisf turn(-std::numbers::pi_v<float> / 2, Vector3f::UnitX());
  return Transformed(std::move(thing), Eigen::Translation3f(0, -height / 2, 0) * turn);
}

// Technical things.

// Camera of the tracking system under its clamp; looks to -y and down.
Parts TrackingCamera(const Palette& p) {
  const Patches body = Put(RoundedBox(0.13f, 0.12f, 0.13f, 0.015f), 0, 0, -0.065f);
  const Patches lens = Put(AlongY(Cylinder(0.04f, 0.05f)), 0, -0.11f);
  const Patches lamps = Put(AlongY(Ring(0.052f, 0.01f)), 0, -0.065f);
  const Parts head = Tilted(Parts{{body + lens, p.black}, {lamps, p.red}}, 28);
  return Put(head, 0, 0, -0.22f) + Parts{{Rod({0, 0, -0.2f}, {0, 0, 0}, 0.015f), p.steel}};
}

// Triangular lattice truss along x, standing on three corners of its section.
Patches LatticeTruss(float length) {
  const float half = length / 2, w = 0.11f;
  const Vector3f corners[3] = {{0, -w, 0}, {0, w, 0}, {0, 0, 0.19f}};
  Patches bars;
  for (const Vector3f& c : corners)
    bars = bars + Rod(c - Vector3f(half, 0, 0), c + Vector3f(half, 0, 0), 0.02f);
  const int fields = static_cast<int>(length / 0.45f);
  for (int i = 0; i < fields; ++i) {
    const Vector3f a(-half + length * i / fields, 0, 0), b(-half + length * (i + 1) / fields, 0, 0);
    for (int k = 0; k < 3; ++k) {
      const Vector3f& from = corners[k];
      const Vector3f& to = corners[(k + 1) % 3];
      bars = bars + Rod(i % 2 == 0 ? a + from : a + to, i % 2 == 0 ? b + to : b + from, 0.008f);
    }
  }
  return bars;
}

Parts Tripod(const Palette& p, float height) {
  const float hub = 0.55f * height;
  Patches legs = Rod({0, 0, 0.3f * height}, {0, 0, height}, 0.016f);
  for (int i = 0; i < 3; ++i) {
    const float angle = 2.1f * static_cast<float>(i) + 0.4f;
    const Vector3f foot(0.45f * std::cos(angle), 0.45f * std::sin(angle), 0);
    legs = legs + Rod(foot, {0, 0, hub}, 0.013f) +
           Rod(foot * 0.5f + Vector3f(0, 0, hub / 2), {0, 0, 0.3f * height}, 0.008f);
  }
  return {{legs, p.black}, {Put(Cylinder(0.03f, 0.08f), 0, 0, hub - 0.04f), p.grey}};
}

// Transport case with metal edges and corners.
Parts FlightCase(const Palette& p, const Vector3f& size) {
  const Vector3f h(size.x() / 2, size.y() / 2, size.z());
  const float e = 0.03f;
  Patches edges, balls;
  for (const float x : {-h.x(), h.x()})
    for (const float y : {-h.y(), h.y()}) {
      edges = edges + BoxAt({x, y, 0}, {e, e, h.z()});
      for (const float z : {0.02f, h.z() - 0.02f})
        balls = balls + Put(RoundedBox(0.07f, 0.07f, 0.07f, 0.02f), x, y, z - 0.035f);
    }
  for (const float z : {0.0f, 0.62f * h.z(), h.z() - e}) {
    for (const float y : {-h.y(), h.y()}) edges = edges + BoxAt({0, y, z}, {size.x(), e, e});
    for (const float x : {-h.x(), h.x()}) edges = edges + BoxAt({x, 0, z}, {e, size.y(), e});
  }
  const float front = -h.y() - 0.012f;
  const Patches latches = BoxAt({-0.25f * size.x(), front, 0.56f * h.z()}, {0.09f, 0.02f, 0.11f}) +
                          BoxAt({0.25f * size.x(), front, 0.56f * h.z()}, {0.09f, 0.02f, 0.11f});
  return {{Box(size.x(), size.y(), size.z()), p.leather},
          {edges + balls, p.steel},
          {latches, p.plate},
          {Front({-0.09f, -h.y() - 0.003f, 0.2f * h.z()}, 0.18f, 0.12f), p.label}};
}

// Step ladder, open, 1.9 m high.
Parts StepLadder(const Palette& p) {
  Patches rails, treads;
  for (const float x : {-0.25f, 0.25f}) {
    rails = rails + Bar({x * 1.1f, -0.5f, 0}, {x * 0.8f, 0, 1.85f}, 0.04f) +
            Bar({x * 1.1f, 0.45f, 0}, {x * 0.8f, 0, 1.85f}, 0.03f);
  }
  for (int i = 1; i <= 6; ++i) {
    const float z = 0.27f * i;
    treads = treads + BoxAt({0, -0.5f * (1 - z / 1.85f), z}, {0.48f, 0.09f, 0.025f});
  }
  for (const float z : {0.4f, 1.1f})
    rails = rails +
            Rod({-0.25f, 0.45f * (1 - z / 1.85f), z}, {0.25f, 0.45f * (1 - z / 1.85f), z}, 0.012f);
  return {
      {rails, p.steel}, {treads, p.plate}, {BoxAt({0, 0, 1.84f}, {0.46f, 0.14f, 0.03f}), p.red}};
}

Parts FloorFan(const Palette& p) {
  Patches blades, guard;
  for (int i = 0; i < 5; ++i) {
    const float a = 1.257f * i, b = a + 0.75f;
    blades = blades + Quad({0.04f * std::cos(a), -0.02f, 0.04f * std::sin(a)},
                           {0.16f * std::cos(a), 0, 0.16f * std::sin(a)},
                           {0.1f * std::cos(b), 0.04f, 0.1f * std::sin(b)});
  }
  for (int i = 0; i < 12; ++i) {
    const float a = 0.5236f * i;
    guard = guard + Rod({0, -0.08f, 0}, {0.23f * std::cos(a), -0.04f, 0.23f * std::sin(a)}, 0.003f);
  }
  guard = guard + Put(AlongY(Ring(0.23f, 0.008f)), 0, -0.04f) +
          Put(AlongY(Ring(0.12f, 0.004f)), 0, -0.07f);
  return {{Put(blades, 0, 0, 1.2f) + Put(AlongY(Cylinder(0.06f, 0.16f)), 0, -0.02f, 1.2f), p.blue},
          {Put(guard, 0, 0, 1.2f) + Rod({0, 0.08f, 0}, {0, 0.08f, 1.2f}, 0.018f) +
               Put(Cylinder(0.2f, 0.03f), 0, 0.08f),
           p.grey}};
}

// A stack of tyres lying flat.
Parts TyreStack(int count) {
  Patches tyres;
  for (int i = 0; i < count; ++i)
    tyres = tyres + Put(Lathe({{0.2f, 0.02f},
                               {0.27f, 0},
                               {0.32f, 0.03f},
                               {0.33f, 0.1f},
                               {0.32f, 0.17f},
                               {0.27f, 0.2f},
                               {0.2f, 0.18f}}),
                        0.02f * (i % 2), -0.015f * (i % 3), 0.2f * i);
  return {{tyres, Glossy(Plain(0.045f, 0.045f, 0.045f), 0.06f, 15)}};
}

// Curtain on a rail, its upper edge `height` above the floor.
Parts CurtainOnRail(const Material& cloth, const Palette& p, float width, float height) {
  const int folds = static_cast<int>(width / 0.22f);
  return {{Put(Curtain(width, height - 0.06f, folds, 0.14f), 0, -0.14f, 0.03f), cloth},
          {Rod({-width / 2 - 0.1f, -0.14f, height}, {width / 2 + 0.1f, -0.14f, height}, 0.015f),
           p.steel}};
}

Parts Whiteboard(const Palette& p, float width, float height) {
  const Material board = Glossy(Plain(0.78f, 0.78f, 0.78f), 0.1f, 150, 0.06f);
  Patches pens;
  for (int i = 0; i < 3; ++i)
    pens = pens + BoxAt({-0.2f + 0.17f * i, -0.06f, 0.01f}, {0.13f, 0.02f, 0.02f});
  return {{Front({-width / 2, -0.01f, 0}, width, height), board},
          {BarFrame(width, height, 0.03f, 0.03f) + BoxAt({0, -0.06f, -0.02f}, {0.8f, 0.09f, 0.02f}),
           p.steel},
          {pens, p.red},
          {Front({-0.42f * width, -0.013f, 0.35f * height}, 0.4f, 0.5f), p.diagram},
          {Front({0.1f * width, -0.013f, 0.2f * height}, 0.21f, 0.3f) +
               Front({0.26f * width, -0.013f, 0.4f * height}, 0.21f, 0.3f),
           p.text}};
}

// Table with two screens, a keyboard and a computer under it.
Parts Desk(const Palette& p) {
  const Parts screen = Screen(0.56f, 0.34f, p.black, p.screen);
  const Patches keys = BoxAt({-0.1f, -0.2f, 0.74f}, {0.44f, 0.15f, 0.02f}) +
                       BoxAt({0.3f, -0.2f, 0.74f}, {0.06f, 0.1f, 0.03f});
  return Table(1.5f, 0.75f, 0.74f, p.wood, p.grey) + Put(screen, -0.33f, 0.1f, 0.74f, 8) +
         Put(screen, 0.33f, 0.1f, 0.74f, -8) +
         Parts{{keys + BoxAt({0.5f, 0, 0.03f}, {0.2f, 0.45f, 0.45f}), p.black}};
}

Parts LoosePlanks(const Palette& p) {
  return {{Block(-0.24f, -0.04f, -0.03f, 0, 0, 2.4f) + Block(0.0f, 0.18f, -0.03f, 0, 0, 2.2f) +
               Block(0.21f, 0.36f, -0.03f, 0, 0, 1.7f),
           p.planks}};
}

// The room itself.

void AddShell(Scene& scene, const Palette& p) {
  const float x = kEast, y = kNorth, h = kHeight;
  scene.Add("floor", FloorSheet(-x, x, -y, y, 0), p.floor_mat);
  scene.Add("ceiling", CeilingSheet(-x, x, -y, y, h), p.ceiling_tile);
  scene.Add("north wall", Put(Panel(2 * x, h), 0, y), p.plaster);
  scene.Add("south wall", Put(Panel(2 * x, h), 0, -y, 0, kFaceNorth), p.white);
  scene.Add("east wall", Put(Panel(2 * y, h), x, 0, 0, kFaceWest), p.white);
  scene.Add("west wall", Put(Panel(2 * y, h), -x, 0, 0, kFaceEast), p.concrete);
  scene.Add("skirting",
            Block(-x, x, y - 0.015f, y, 0, 0.09f) + Block(-x, x, -y, -y + 0.015f, 0, 0.09f) +
                Block(x - 0.015f, x, -y, y, 0, 0.09f) + Block(-x, -x + 0.015f, -y, y, 0, 0.09f),
            p.grey);
  Patches grid;
  for (int i = 0; i < 6; ++i)
    grid =
        grid + Block(-x, x, -3.6f + 1.44f * i - 0.015f, -3.6f + 1.44f * i + 0.015f, h - 0.02f, h);
  for (int i = 0; i < 6; ++i)
    grid =
        grid + Block(-3.6f + 1.44f * i - 0.015f, -3.6f + 1.44f * i + 0.015f, -y, y, h - 0.015f, h);
  scene.Add("ceiling grid", grid, p.white);
  scene.Add("door",
            Put(Door(0.95f, 2.1f, p.grey, p.door, p.steel), 2.9f, -y + 0.005f, 0, kFaceNorth));
  scene.Add("cable duct",
            Block(-x, x, y - 0.06f, y, 2.86f, 2.95f) + Block(2.2f, 2.28f, -y, -y + 0.05f, 0, h),
            p.white);
  for (int i = 0; i < 3; ++i)
    scene.Add(fmt::format("socket {}", i + 1),
              BoxAt({-3 + 2.6f * i, y - 0.015f, 0.3f}, {0.16f, 0.03f, 0.08f}), p.white);
}

void AddTracking(Scene& scene, const Palette& p) {
  const float x = 3.55f, y = 3.8f, z = 3.3f;
  scene.Add("north truss", Put(LatticeTruss(7.4f), 0, y, z), p.alloy);
  scene.Add("south truss", Put(LatticeTruss(7.4f), 0, -y, z), p.alloy);
  scene.Add("east truss", Put(LatticeTruss(7.9f), x, 0, z, 90), p.alloy);
  scene.Add("west truss", Put(LatticeTruss(7.9f), -x, 0, z, 90), p.alloy);
  Patches hangers;
  for (const float hx : {-x, x})
    for (const float hy : {-y, 0.0f, y})
      hangers = hangers + Rod({hx, hy, z}, {hx, hy, kHeight}, 0.012f);
  scene.Add("truss hangers", hangers, p.grey);
  const std::vector<std::pair<float, float>> places = {
      {-3.4f, 3.8f},  {-1.2f, 3.8f},  {1.2f, 3.8f},    {3.4f, 3.8f},
      {3.55f, 1.3f},  {3.55f, -1.3f}, {3.4f, -3.8f},   {1.2f, -3.8f},
      {-1.2f, -3.8f}, {-3.4f, -3.8f}, {-3.55f, -1.3f}, {-3.55f, 1.3f}};
  int number = 0;
  for (const auto& [cx, cy] : places) {
    const float yaw_deg = std::atan2(-cx, cy) * 180 / std::numbers::pi_v<float>;
    scene.Add(fmt::format("tracking camera {}", ++number),
              Put(TrackingCamera(p), cx, cy, z, yaw_deg));
  }
  scene.Add("camera cables",
            Tube({{-3.5f, 3.95f, z + 0.02f}, {3.5f, 3.95f, z + 0.02f}}, 0.025f) +
                Tube({{3.7f, 3.9f, z + 0.05f}, {3.7f, -3.9f, z + 0.05f}}, 0.025f) +
                Tube({{-3.75f, 3.5f, z + 0.1f}, {-3.95f, 3.3f, 2.4f}, {-3.95f, 3.3f, 0}}, 0.03f),
            p.black);
}

void AddCeilingLamps(Scene& scene, const Palette& p) {
  int number = 0;
  for (const float x : {-1.9f, 1.9f})
    for (const float y : {-2.1f, 2.1f}) {
      const float dx = 0.6f, dy = 0.15f, z = kHeight - 0.07f;
      scene.lights.push_back(
          {"ceiling", {x - dx, y + dy, z}, {2 * dx, 0, 0}, {0, -2 * dy, 0}, {52, 50, 46}});
      scene.Add(fmt::format("ceiling lamp {}", ++number),
                Block(x - dx - 0.03f, x + dx + 0.03f, y - dy - 0.03f, y + dy + 0.03f, z + 0.005f,
                      kHeight),
                p.white);
    }
}

// The window: daylight from a sheet just before the east wall, behind a frame.
void AddWindow(Scene& scene, const Palette& p) {
  const float width = 2.6f, bottom = 1.0f, height = 1.7f, x = kEast - 0.01f;
  scene.lights.push_back(
      {"window", {x, width / 2, bottom}, {0, -width, 0}, {0, 0, height}, {3.0f, 3.4f, 3.9f}});
  const Opening opening = {-width / 2, width / 2, 0, height};
  scene.Add("window frame",
            Put(WindowFrame(opening, 3) + Put(BarFrame(width, height, 0.08f, 0.1f), 0, 0.04f),
                x - 0.04f, 0, bottom, kFaceWest),
            p.white);
  scene.Add(
      "window sill",
      Block(x - 0.25f, x, -width / 2 - 0.1f, width / 2 + 0.1f, bottom - 0.12f, bottom - 0.08f),
      p.wood);
  scene.Add("radiator", Put(Radiator(1.6f, 0.6f), kEast - 0.04f, 0, 0.12f, kFaceWest), p.white);
}

// A lamp on a tripod, turned to `target`.
void AddSpot(Scene& scene, const Palette& p, const std::string& name, const Vector3f& head,
             const Vector3f& target) {
  scene.lights.push_back(LampTowards("spot", head, target, 0.35f, 0.35f, {75, 68, 55}));
  const Vector3f back = head - 0.06f * (target - head).normalized();
  const float yaw_deg =
      std::atan2(target.x() - head.x(), head.y() - target.y()) * 180 / std::numbers::pi_v<float>;
  const float dip_deg =
      std::asin((head.z() - target.z()) / (target - head).norm()) * 180 / std::numbers::pi_v<float>;
  const Patches casing = Tilted(Put(Box(0.39f, 0.1f, 0.39f), 0, 0, -0.195f), dip_deg);
  scene.Add(name, Put(Tripod(p, head.z()), head.x(), head.y()) +
                      Parts{{Put(casing, back, yaw_deg), p.black}});
}

// Furnishing.

struct MattressPlace {
  Vector3f wall_point;  // where its back leans against the wall, z = 0
  float yaw_deg, width, height, lean_deg;
  Material cover;
};

void AddLeaningMattresses(Scene& scene, const Palette& p,
                          const std::vector<MattressPlace>& places) {
  int number = 0;
  for (const MattressPlace& m : places)
    scene.Add(fmt::format("mattress {}", ++number),
              Put(Leaning(Mattress(m.cover, p.piping, m.width, m.height), m.height, m.lean_deg),
                  m.wall_point, m.yaw_deg));
}

struct BoxPlace {
  Vector3f place, size;
  float yaw_deg;
};

void AddCartons(Scene& scene, const Palette& p, const std::vector<BoxPlace>& places) {
  int number = 0;
  for (const BoxPlace& box : places)
    scene.Add(fmt::format("carton {}", ++number),
              Put(Carton(box.size, p.cardboard, p.tape), box.place, box.yaw_deg));
}

void AddFoamBlocks(Scene& scene, const Palette& p, const std::vector<BoxPlace>& places) {
  const std::vector<Material> dyes = {p.foam, Dyed(p.foam, 0.35f, 0.5f, 0.9f),
                                      Dyed(p.foam, 0.9f, 0.45f, 0.35f)};
  for (size_t i = 0; i < places.size(); ++i) {
    const auto& [place, size, yaw_deg] = places[i];
    scene.Add(fmt::format("foam block {}", i + 1),
              Put(RoundedBox(size.x(), size.y(), size.z(), 0.025f), place, yaw_deg), dyes[i % 3]);
  }
}

struct Stack {
  Vector3f place;
  float yaw_deg;
  int count;
};

void AddCrates(Scene& scene, const Palette& p, const std::vector<Stack>& stacks) {
  const std::vector<Material> plastics = {p.blue, p.red, p.grey, p.yellow, p.green};
  int number = 0;
  for (const Stack& stack : stacks)
    for (int i = 0; i < stack.count; ++i, ++number)
      scene.Add(fmt::format("crate {}", number + 1),
                Put(Crate(plastics[number % plastics.size()]),
                    stack.place + Vector3f(0, 0, 0.31f * i), stack.yaw_deg + 5 * (i % 3)));
}

struct WallPicture {
  std::string name;
  Vector3f place;  // middle of its lower edge
  float width, height, yaw_deg;
  Material picture;
};

void AddPictures(Scene& scene, const Palette& p, const std::vector<WallPicture>& pictures) {
  for (const WallPicture& w : pictures)
    scene.Add(w.name, Put(Picture(w.width, w.height, p.black, w.picture), w.place, w.yaw_deg));
}

// A shelf whose boards hold books and small boxes.
Parts FilledShelf(const Palette& p) {
  const std::vector<Material> cloths = {p.red, p.blue, p.green, p.grey, p.yellow, p.black};
  const float height = 1.9f, row = height / 5;
  Parts shelf = Shelf(1.1f, height, 0.32f, 5, p.wood);
  for (int i = 0; i < 5; ++i) {
    const float z = row * i + 0.035f;
    if (i % 2 == 1)
      shelf = shelf + Put(BookRow(0.95f, 0.27f, cloths, p.label, 7 + i), 0, -0.29f, z);
    else
      shelf = shelf + Put(Carton({0.4f, 0.26f, 0.24f}, p.cardboard, p.tape), -0.25f, -0.16f, z) +
              Put(Parts{{Box(0.3f, 0.24f, 0.18f), i == 2 ? p.blue : p.green}}, 0.25f, -0.16f, z);
  }
  return shelf;
}

void AddFloorThings1(Scene& scene, const Palette& p) {
  const Material tape = Plain(0.75f, 0.75f, 0.72f);
  scene.Add("rug", Put(Box(2.2f, 1.5f, 0.012f), 0.9f, 0.9f, 0, 20), p.carpet);
  scene.Add("landing mark",
            FloorSheet(-1.5f, -0.5f, -0.79f, -0.71f, 0.004f) +
                FloorSheet(-1.04f, -0.96f, -1.25f, -0.25f, 0.004f),
            tape);
  scene.Add("thin mat 1", Put(RoundedBox(1.9f, 0.95f, 0.06f, 0.02f), -1.3f, 1.5f, 0, 8), p.blue);
  scene.Add("thin mat 2", Put(RoundedBox(1.9f, 0.95f, 0.06f, 0.02f), 1.4f, -1.5f, 0, -14),
            p.ticking);
  scene.Add("power lead",
            Cable({{3.9f, 2.6f, 0.015f},
                   {2.6f, 2.2f, 0.015f},
                   {2.0f, 0.4f, 0.015f},
                   {0.6f, -0.6f, 0.015f},
                   {-0.4f, -2.4f, 0.015f},
                   {-2.0f, -2.9f, 0.015f}},
                  0.014f),
            p.yellow);
}

void AddSoftThings1(Scene& scene, const Palette& p) {
  const Material rose = Dyed(p.ticking, 0.95f, 0.6f, 0.55f),
                 sky = Dyed(p.ticking, 0.6f, 0.75f, 1.0f);
  AddLeaningMattresses(scene, p,
                       {{{-2.9f, 4.2f, 0}, 0, 0.95f, 1.95f, 9, p.ticking},
                        {{-1.75f, 4.2f, 0}, 0, 0.95f, 1.95f, 11, sky},
                        {{0.15f, 4.2f, 0}, 0, 1.95f, 0.95f, 14, rose},
                        {{-3.95f, 1.9f, 0}, kFaceEast, 1.95f, 0.95f, 12, p.stripes},
                        {{-3.95f, -0.4f, 0}, kFaceEast, 0.95f, 1.95f, 10, p.ticking},
                        {{-0.9f, -4.2f, 0}, kFaceNorth, 1.4f, 1.95f, 10, sky}});
  const float h = 1.95f;
  scene.Add("lying mattress 1",
            Put(Lying(Mattress(p.ticking, p.piping, 0.95f, h), h), -3.35f, -2.9f, 0, 4));
  scene.Add("lying mattress 2",
            Put(Lying(Mattress(rose, p.piping, 0.95f, h), h), -3.32f, -2.95f, 0.2f, -3));
  scene.Add("cushion 1", Put(Cushion(0.5f, 0.5f, 0.15f, 0.05f), -3.4f, -3.4f, 0.43f, 25),
            p.stripes);
  AddFoamBlocks(scene, p,
                {{{-3.4f, 3.3f, 0}, {0.6f, 0.6f, 0.6f}, 10},
                 {{-3.35f, 3.25f, 0.6f}, {0.5f, 0.5f, 0.5f}, -12},
                 {{-3.3f, 0.65f, 0}, {0.7f, 0.5f, 0.4f}, 5}});
  scene.Add("black curtain", Put(CurtainOnRail(Plain(0.04f, 0.04f, 0.045f), p, 2.3f, 3.0f), -2.85f,
                                 -4.22f, 0, kFaceNorth));
  scene.Add("window curtain 1",
            Put(CurtainOnRail(p.cloth, p, 0.7f, 2.95f), 3.97f, 1.75f, 0, kFaceWest));
  scene.Add("window curtain 2",
            Put(CurtainOnRail(p.cloth, p, 0.7f, 2.95f), 3.97f, -1.75f, 0, kFaceWest));
  scene.Add("carpet roll", Put(AlongX(Cylinder(0.16f, 2.3f)), -1.9f, -3.2f, 0.16f, 3), p.carpet);
}

void AddHardThings1(Scene& scene, const Palette& p) {
  AddCartons(scene, p,
             {{{3.5f, 3.7f, 0}, {0.7f, 0.6f, 0.6f}, 5},
              {{3.45f, 3.75f, 0.6f}, {0.6f, 0.5f, 0.5f}, -10},
              {{3.5f, 3.7f, 1.1f}, {0.45f, 0.4f, 0.35f}, 15},
              {{2.6f, 3.8f, 0}, {0.55f, 0.5f, 0.45f}, -6},
              {{3.3f, 2.85f, 0}, {0.5f, 0.4f, 0.35f}, 70},
              {{-3.55f, -1.4f, 0}, {0.5f, 0.5f, 0.5f}, 80}});
  AddCrates(scene, p,
            {{{1.75f, 3.85f, 0}, 0, 4}, {{3.5f, -2.65f, 0}, 90, 3}, {{-2.15f, -3.75f, 0}, 180, 2}});
  scene.Add("desk", Put(Desk(p), 1.3f, -3.65f, 0, kFaceNorth));
  scene.Add("office chair", Put(OfficeChair(p.leather, p.steel), 1.25f, -3.1f, 0, 25));
  scene.Add("flight case 1", Put(FlightCase(p, {0.9f, 0.55f, 0.6f}), 3.4f, 0.4f, 0, kFaceWest));
  scene.Add("flight case 2",
            Put(FlightCase(p, {0.7f, 0.5f, 0.4f}), 3.4f, 0.4f, 0.6f, kFaceWest + 8));
  scene.Add("flight case 3", Put(FlightCase(p, {0.8f, 0.5f, 0.5f}), 3.4f, -0.8f, 0, kFaceWest - 4));
  scene.Add("step ladder", Put(StepLadder(p), -3.3f, -1.9f, 0, 75));
  scene.Add("floor fan", Put(FloorFan(p), 2.95f, -3.3f, 0, -140));
  scene.Add("shelf", Put(FilledShelf(p), 3.97f, -3.45f, 0, kFaceWest));
  scene.Add("planks", Put(Leaning(LoosePlanks(p), 2.4f, 8), -3.95f, 3.0f, 0, kFaceEast));
  AddPictures(scene, p,
              {{"tracking poster", {1.9f, 4.24f, 1.5f}, 0.8f, 1.1f, 0, p.diagram},
               {"notice", {-0.4f, 4.24f, 1.7f}, 0.6f, 0.8f, 0, p.text},
               {"site map", {0.7f, -4.24f, 1.6f}, 1.3f, 0.9f, kFaceNorth, p.map},
               {"picture", {-3.98f, 0.75f, 1.5f}, 1.2f, 0.8f, kFaceEast, p.abstract},
               {"calendar", {-3.98f, -1.5f, 1.5f}, 0.4f, 0.6f, kFaceEast, p.calendar},
               {"pin board", {3.98f, 2.9f, 1.5f}, 1.1f, 0.8f, kFaceWest, p.cork},
               {"pinned note", {3.95f, 2.7f, 1.75f}, 0.2f, 0.28f, kFaceWest, p.text}});
  AddSpot(scene, p, "spot 1", {3.2f, 1.9f, 2.3f}, {-2.5f, 3.0f, 0.8f});
  AddSpot(scene, p, "spot 2", {-2.55f, -3.05f, 2.5f}, {1.5f, 0.5f, 0.2f});
}

void AddFloorThings2(Scene& scene, const Palette& p) {
  scene.Add("rug", Put(Parts{{Box(2.4f, 1.6f, 0.01f), p.grey},
                             {FloorSheet(-1.19f, 1.19f, -0.79f, 0.79f, 0.012f), p.rug}},
                       -0.9f, -0.7f, 0, -25));
  for (int i = 0; i < 3; ++i)
    scene.Add(fmt::format("thin mat {}", i + 1),
              Put(RoundedBox(1.9f, 0.62f, 0.05f, 0.02f), 1.0f + 0.15f * i, 0.55f + 0.68f * i, 0,
                  4.0f * i),
              i == 1 ? p.red : p.blue);
  scene.Add("floor board", Put(Box(1.2f, 0.8f, 0.02f), 1.2f, -1.7f, 0, 35), p.planks);
  scene.Add("floor plate", Put(Box(0.8f, 0.8f, 0.006f), -1.6f, 1.6f, 0, 12), p.plate);
  scene.Add("power lead",
            Cable({{-3.9f, -1.0f, 0.015f},
                   {-2.6f, 0.6f, 0.015f},
                   {-0.6f, 0.5f, 0.015f},
                   {0.3f, 2.2f, 0.015f},
                   {1.0f, 3.2f, 0.015f}},
                  0.014f),
            p.red);
}

void AddSoftThings2(Scene& scene, const Palette& p) {
  const Material mint = Dyed(p.ticking, 0.6f, 0.9f, 0.7f),
                 sand = Dyed(p.ticking, 0.95f, 0.85f, 0.6f);
  AddLeaningMattresses(scene, p,
                       {{{-3.95f, 3.0f, 0}, kFaceEast, 0.95f, 1.95f, 8, mint},
                        {{-3.95f, 1.95f, 0}, kFaceEast, 0.95f, 1.95f, 11, p.stripes},
                        {{-3.95f, 0.9f, 0}, kFaceEast, 0.95f, 1.95f, 9, sand},
                        {{-3.95f, -2.2f, 0}, kFaceEast, 1.95f, 0.95f, 13, p.ticking},
                        {{2.75f, 4.2f, 0}, 0, 1.95f, 0.95f, 12, sand},
                        {{-0.3f, -4.2f, 0}, kFaceNorth, 1.95f, 1.4f, 10, mint},
                        {{3.95f, 2.75f, 0}, kFaceWest, 1.4f, 1.95f, 9, p.ticking}});
  AddFoamBlocks(scene, p,
                {{{1.5f, -3.7f, 0}, {0.7f, 0.6f, 0.5f}, 5},
                 {{2.2f, -3.75f, 0}, {0.5f, 0.5f, 0.5f}, -10},
                 {{1.75f, -3.7f, 0.5f}, {0.8f, 0.5f, 0.3f}, 12},
                 {{1.6f, -3.7f, 0.8f}, {0.4f, 0.4f, 0.4f}, 30},
                 {{-3.3f, -0.55f, 0}, {0.5f, 0.7f, 0.45f}, 0},
                 {{-3.3f, -0.6f, 0.45f}, {0.4f, 0.5f, 0.35f}, 20}});
  scene.Add("camouflage curtain",
            Put(CurtainOnRail(p.camouflage, p, 2.6f, 3.05f), -2.7f, -4.22f, 0, kFaceNorth));
  scene.Add("striped curtain", Put(CurtainOnRail(p.stripes, p, 2.2f, 3.05f), -2.6f, 4.22f));
  scene.Add("window curtain",
            Put(CurtainOnRail(p.cloth, p, 0.8f, 2.95f), 3.97f, -1.65f, 0, kFaceWest));
  scene.Add("sofa", Put(Sofa(2, p.leather, p.stripes, p.wood), -1.2f, 3.95f));
  for (int i = 0; i < 3; ++i)
    scene.Add(fmt::format("blanket {}", i + 1),
              Put(RoundedBox(0.8f - 0.08f * i, 0.6f, 0.1f, 0.04f), 3.35f, -2.35f, 0.5f + 0.1f * i,
                  10.0f * i),
              i == 1 ? p.cloth : p.carpet);
}

void AddHardThings2(Scene& scene, const Palette& p) {
  AddCartons(scene, p,
             {{{-3.4f, -3.6f, 0}, {0.8f, 0.6f, 0.6f}, 10},
              {{-3.4f, -3.6f, 0.6f}, {0.7f, 0.6f, 0.5f}, -4},
              {{-3.35f, -3.6f, 1.1f}, {0.5f, 0.5f, 0.45f}, 20},
              {{-2.45f, -3.65f, 0}, {0.6f, 0.6f, 0.4f}, -8},
              {{-2.4f, -3.6f, 0.4f}, {0.4f, 0.4f, 0.35f}, 15},
              {{1.15f, 3.85f, 0.74f}, {0.4f, 0.35f, 0.3f}, 12}});
  AddCrates(scene, p, {{{3.45f, -3.75f, 0}, 0, 5}, {{0.4f, 3.8f, 0.0f}, 3, 2}});
  scene.Add("table", Put(Table(1.5f, 0.75f, 0.74f, p.wood, p.grey), 0.75f, 3.8f));
  scene.Add("screen", Put(Screen(0.9f, 0.52f, p.black, p.screen), 0.5f, 3.9f, 0.74f, -6));
  scene.Add("chair 1", Put(Chair(p.wood, p.cloth), 0.3f, 3.15f, 0, 160));
  scene.Add("chair 2", Put(Chair(p.wood, p.cloth), -3.2f, 3.75f, 0, 50));
  scene.Add("whiteboard", Put(Whiteboard(p, 1.8f, 1.1f), 0.75f, 4.24f, 1.55f));
  scene.Add("bench", Put(Table(0.7f, 1.0f, 0.5f, p.planks, p.steel), 3.35f, -2.35f));
  scene.Add("flight case 1", Put(FlightCase(p, {1.0f, 0.6f, 0.7f}), 3.4f, -0.9f, 0, kFaceWest));
  scene.Add("flight case 2",
            Put(FlightCase(p, {0.7f, 0.5f, 0.5f}), 3.4f, 0.45f, 0, kFaceWest + 10));
  scene.Add("flight case 3",
            Put(FlightCase(p, {0.6f, 0.45f, 0.4f}), 3.4f, -1.0f, 0.7f, kFaceWest - 12));
  scene.Add("tyres 1", Put(TyreStack(5), 3.35f, 1.5f));
  scene.Add("tyres 2", Put(TyreStack(2), -1.7f, -3.7f));
  scene.Add("step ladder", Put(StepLadder(p), 3.2f, 3.35f, 0, -60));
  scene.Add("floor fan", Put(FloorFan(p), -3.2f, -1.1f, 0, 110));
  scene.Add("shelf", Put(FilledShelf(p), 0.95f, -4.23f, 0, kFaceNorth));
  scene.Add("planks", Put(Leaning(LoosePlanks(p), 2.4f, 8), 2.35f, 4.24f));
  scene.Add("plant", Put(Plant(1.3f, 14, p.red, p.green, 3), -3.5f, 0.1f));
  AddPictures(scene, p,
              {{"landscape", {-3.98f, -1.4f, 1.5f}, 1.4f, 0.95f, kFaceEast, p.landscape},
               {"picture", {-0.95f, 4.24f, 1.5f}, 1.0f, 0.75f, 0, p.abstract},
               {"tracking poster", {3.2f, 4.24f, 1.4f}, 0.8f, 1.1f, 0, p.diagram},
               {"notice", {-0.35f, -4.24f, 1.65f}, 0.6f, 0.8f, kFaceNorth, p.text},
               {"site map", {3.98f, -3.0f, 1.5f}, 1.3f, 0.9f, kFaceWest, p.map}});
  AddSpot(scene, p, "spot 1", {-2.8f, 3.2f, 2.4f}, {1.5f, -3.5f, 0.5f});
  AddSpot(scene, p, "spot 2", {2.9f, -3.1f, 2.3f}, {-2.5f, -1.0f, 0.3f});
}

// The room with its tracking cameras and lamps.
void AddRoom(Scene& scene, const Palette& p) {
  AddShell(scene, p);
  AddTracking(scene, p);
  AddCeilingLamps(scene, p);
  AddWindow(scene, p);
}

}  // namespace

Scene MocapRoom1() {
  Scene scene;
  scene.name = "mocap_room_1";
  const Palette palette = MakePalette(scene);
  AddRoom(scene, palette);
  AddFloorThings1(scene, palette);
  AddSoftThings1(scene, palette);
  AddHardThings1(scene, palette);
  scene.views = {{"north_west", {1.9f, -1.9f, 1.6f}, {-2.2f, 3.2f, 1.0f}},
                 {"window", {-2.0f, -1.2f, 1.5f}, {3.6f, 0.6f, 1.2f}},
                 {"desk", {-1.2f, 1.9f, 1.7f}, {1.2f, -4.0f, 1.0f}},
                 {"curtain", {1.6f, 1.6f, 1.4f}, {-3.4f, -3.0f, 0.9f}},
                 {"from_above", {-2.0f, -2.0f, 2.4f}, {2.4f, 3.0f, 0.3f}}};
  return scene;
}

Scene MocapRoom2() {
  Scene scene;
  scene.name = "mocap_room_2";
  const Palette palette = MakePalette(scene);
  AddRoom(scene, palette);
  AddFloorThings2(scene, palette);
  AddSoftThings2(scene, palette);
  AddHardThings2(scene, palette);
  scene.views = {{"north", {-0.4f, -2.0f, 1.6f}, {0.2f, 4.0f, 1.1f}},
                 {"west", {2.0f, -0.8f, 1.5f}, {-3.8f, 1.2f, 1.0f}},
                 {"south", {-0.6f, 2.0f, 1.7f}, {0.4f, -4.0f, 0.9f}},
                 {"east", {-2.0f, 0.9f, 1.5f}, {3.7f, -0.6f, 1.0f}},
                 {"from_above", {2.1f, 2.1f, 2.4f}, {-2.6f, -3.0f, 0.3f}}};
  return scene;
}

}  // namespace sgf::synth
