#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include <sgf/synth/scenes/furniture.h>

namespace sgf::synth {
namespace {

using Eigen::Vector3f;

// The road runs along x with its middle at y = 0; left is +y. Heights above the road.
constexpr float kRoadStart = -16, kRoadEnd = 80;
constexpr float kKerbY = 4.5F, kFrontY = 7.4F, kLotEndY = 19;
constexpr float kPavement = 0.12F, kStorey = 3.1F, kPlinth = 0.45F;

struct Palette {
  Material asphalt, paving, kerb, grass, marking, hedge, bark;
  Material brick, red_brick, cream, yellow_render, grey_concrete, dirty_render, blue_render;
  Material roof_tiles, dark_tiles, stone, white_paint, green_paint, glass, blind, shutters;
  Material door, shop_sign, shop_sign_2, goods, goods_2, awning, awning_2, facade_glass;
  Material steel, iron, rubber, rust, hazard, orange, red, blue, yellow, black, headlight, hub;
  Material poster, poster_2, plate, labels, wood, grating, leaves_2, terracotta;
};

void MixPaints(Palette& p) {
  p.kerb = Plain(0.42F, 0.41F, 0.39F);
  p.marking = Plain(0.68F, 0.68F, 0.65F);
  p.stone = Plain(0.5F, 0.47F, 0.42F);
  p.white_paint = Plain(0.72F, 0.72F, 0.7F);
  p.green_paint = Plain(0.06F, 0.16F, 0.1F);
  p.glass = Glossy(Plain(0.07F, 0.08F, 0.085F), 0.001F, 200, 0.12F);
  p.blind = Plain(0.6F, 0.57F, 0.5F);
  p.iron = Plain(0.07F, 0.075F, 0.08F);
  p.rubber = Plain(0.05F, 0.05F, 0.05F);
  p.orange = Plain(0.75F, 0.2F, 0.03F);
  p.red = Plain(0.55F, 0.04F, 0.03F);
  p.blue = Plain(0.03F, 0.1F, 0.42F);
  p.yellow = Plain(0.7F, 0.52F, 0.05F);
  p.black = Plain(0.05F, 0.05F, 0.05F);
  p.headlight = Glossy(Plain(0.7F, 0.7F, 0.72F), 0.002F, 100);
  p.hub = Glossy(Plain(0.25F, 0.25F, 0.26F), 0.003F, 40);
  p.terracotta = Plain(0.42F, 0.17F, 0.08F);
}

void LayGround(Scene& scene, Palette& p) {
  p.asphalt = Tiled(scene.AddTexture("asphalt"), 5);
  p.paving = Tiled(scene.AddTexture("paving"), 2);
  p.grass = Tiled(scene.AddTexture("grass"), 2);
  const int leaves = scene.AddTexture("hedge_leaves");
  p.hedge = Tiled(leaves, 1);
  p.leaves_2 = Tiled(leaves, 1.6F, {1.3F, 1.15F, 0.7F});
  p.bark = Tiled(scene.AddTexture("cork"), 0.5F, {0.5F, 0.4F, 0.32F});
}

void BuildWalls(Scene& scene, Palette& p) {
  const int brick = scene.AddTexture("brick");
  const int render = scene.AddTexture("render_dirty");
  p.brick = Tiled(brick, 1.2F, {1.1F, 1, 0.9F});
  p.red_brick = Tiled(brick, 1.2F, {0.9F, 0.6F, 0.5F});
  p.cream = Tiled(scene.AddTexture("plaster"), 3, {0.95F, 0.88F, 0.7F});
  p.yellow_render = Tiled(render, 4, {1, 0.8F, 0.5F});
  p.dirty_render = Tiled(render, 4);
  p.blue_render = Tiled(render, 4, {0.62F, 0.75F, 0.85F});
  p.grey_concrete = Tiled(scene.AddTexture("concrete"), 3);
  const int tiles = scene.AddTexture("roof_tiles");
  p.roof_tiles = Tiled(tiles, 2);
  p.dark_tiles = Tiled(tiles, 2, {0.45F, 0.45F, 0.5F});
  p.facade_glass = Glossy(Tiled(scene.AddTexture("window_facade"), 2.9F), 0.001F, 200, 0.03F);
}

void FitOut(Scene& scene, Palette& p) {
  const auto behind_glass = [&](std::string_view name, uint32_t seed) {
    return Glossy(Fitted(scene.AddTexture(name, 512, seed)), 0.001F, 200, 0.1F);
  };
  p.shutters = Fitted(scene.AddTexture("shutter_slats", 256));
  p.shutters.tint = {0.4F, 0.6F, 0.5F};
  p.door = Fitted(scene.AddTexture("door_panel"));
  p.shop_sign = Fitted(scene.AddTexture("shop_sign", 512, 1));
  p.shop_sign_2 = Fitted(scene.AddTexture("shop_sign", 512, 2));
  p.goods = behind_glass("books", 3);
  p.goods_2 = behind_glass("painting_abstract", 4);
  p.awning = Tiled(scene.AddTexture("fabric_stripes", 512, 3), 0.8F);
  p.awning_2 = Tiled(scene.AddTexture("fabric_stripes", 512, 6), 0.8F);
  p.steel = Glossy(Tiled(scene.AddTexture("metal_brushed"), 0.5F), 0.002F, 40, 0.05F);
  p.rust = Tiled(scene.AddTexture("rust"), 0.8F);
  p.hazard = Tiled(scene.AddTexture("hazard_stripes", 256), 0.5F);
  p.poster = Fitted(scene.AddTexture("poster_text", 512, 1));
  p.poster_2 = Fitted(scene.AddTexture("poster_diagram", 512, 2));
  p.plate = Fitted(scene.AddTexture("license_plate", 256));
  p.labels = Fitted(scene.AddTexture("label_sheet"));
  p.wood = Tiled(scene.AddTexture("wood_planks"), 0.8F);
  p.grating = Fitted(scene.AddTexture("grating", 256));
}

Palette MakePalette(Scene& scene) {
  Palette p;
  MixPaints(p);
  LayGround(scene, p);
  BuildWalls(scene, p);
  FitOut(scene, p);
  return p;
}

// Adds a strip along the road to both sides of it, from y0 to y1 (m from the middle).
Patches BothSides(float x0, float x1, float y0, float y1, float z) {
  return FloorSheet(x0, x1, y0, y1, z) + FloorSheet(x0, x1, -y1, -y0, z);
}

void AddGround(Scene& scene, const Palette& p) {
  const float x0 = kRoadStart, x1 = kRoadEnd;
  scene.Add("road", FloorSheet(x0 - 4, x1 + 4, -kKerbY - 0.1F, kKerbY + 0.1F, 0), p.asphalt);
  scene.Add("cross streets",
            BothSides(x0 - 8, x0 + 4, kKerbY + 0.1F, kLotEndY, 0) +
                BothSides(x1 - 4, x1 + 8, kKerbY + 0.1F, kLotEndY, 0) +
                FloorSheet(x0 - 8, x0 - 4, -kKerbY - 0.1F, kKerbY + 0.1F, 0) +
                FloorSheet(x1 + 4, x1 + 8, -kKerbY - 0.1F, kKerbY + 0.1F, 0),
            p.asphalt);
  scene.Add("pavements", BothSides(x0 + 4, x1 - 4, kKerbY, kFrontY, kPavement), p.paving);
  scene.Add("gardens", BothSides(x0 + 4, x1 - 4, kFrontY, kLotEndY, kPavement - 0.01F), p.grass);
  Patches kerbs;
  for (float x = x0 + 4; x < x1 - 5; x += 4)
    for (const float side : {-1.F, 1.F})
      kerbs = kerbs + Put(Box(3.98F, 0.18F, kPavement + 0.02F), x + 2, side * kKerbY);
  for (const float x : {x0 + 4, x1 - 4})
    for (const float side : {-1.F, 1.F})
      kerbs = kerbs + Put(Box(0.18F, kLotEndY - kKerbY, kPavement + 0.02F), x,
                          side * (kLotEndY + kKerbY) / 2);
  scene.Add("kerbs", kerbs, p.kerb);
}

void AddRoadMarkings(Scene& scene, const Palette& p) {
  const float thickness = 0.006F;
  Patches dashes, zebra, edges;
  for (float x = kRoadStart + 6; x < kRoadEnd - 8; x += 5)
    if (std::abs(x - 33) > 4) dashes = dashes + Put(Box(2.4F, 0.13F, thickness), x, 0.4F);
  for (float y = -3.9F; y < 4; y += 1) zebra = zebra + Put(Box(3.2F, 0.5F, thickness), 33, y);
  for (float x = kRoadStart + 8; x < kRoadEnd - 8; x += 6)
    for (const float side : {-1.F, 1.F})
      edges = edges + Put(Box(0.1F, 1.8F, thickness), x, side * 3.5F);
  scene.Add("lane marking", dashes, p.marking);
  scene.Add("zebra crossing", zebra, p.marking);
  scene.Add("parking marks", edges, p.marking);
  scene.Add("stop line", Put(Box(0.4F, 4, thickness), kRoadEnd - 8, -2), p.marking);
  scene.Add("manhole covers",
            Put(Disc(0.33F), 9, -0.6F, 0.008F) + Put(Disc(0.33F), 45, 0.8F, 0.008F) +
                Put(Disc(0.33F), 24, -1.8F, 0.008F),
            p.rust);
  scene.Add("drains",
            Put(Box(0.5F, 0.35F, 0.008F), 14, -4.2F) + Put(Box(0.5F, 0.35F, 0.008F), 39, -4.2F) +
                Put(Box(0.5F, 0.35F, 0.008F), 27, 4.2F),
            p.grating);
  scene.Add("road patch", Put(Box(3, 1.6F, 0.004F), 18.5F, -1.2F, 0, 4),
            Tiled(p.asphalt.texture, 3, {0.6F, 0.6F, 0.62F}));
}

enum class Roof { kGable, kFlat };
enum class Front { kHouse, kShutters, kShop, kShop2 };

struct House {
  const char* name;
  float x, y, yaw_deg, width;
  int storeys;
  Material Palette::*wall;
  Roof roof;
  Front front;
};

constexpr float kDepth = 8;

bool IsShop(const House& house) {
  return house.front == Front::kShop || house.front == Front::kShop2;
}

float WallHeight(const House& house) { return kPlinth + kStorey * house.storeys; }

Eigen::Affine3f PlaceOf(const House& house) { return At(house.x, house.y, 0, house.yaw_deg); }

// One window of a facade, its lower left corner of the glass at the origin.
struct WindowParts {
  Patches frame, glass, blind, sill, shutters;
};

void AppendWindow(WindowParts& parts, float x, float z, float blind_length) {
  const float w = 1.1F, h = 1.45F;
  // The bars are flat: a face that others lie upon would be baked dark.
  const auto bar = [&](float x0, float x1, float z0, float z1) {
    return Put(Panel(x1 - x0, z1 - z0), x + (x0 + x1) / 2, -0.03F, z + z0);
  };
  const float edge = w / 2 + 0.08F, cross = 0.65F * h;
  parts.frame = parts.frame + bar(-edge, -w / 2, -0.08F, h + 0.08F) +
                bar(w / 2, edge, -0.08F, h + 0.08F) + bar(-w / 2, w / 2, -0.08F, 0) +
                bar(-w / 2, w / 2, h, h + 0.08F) + bar(-0.025F, 0.025F, 0, h) +
                bar(-w / 2, w / 2, cross, cross + 0.045F);
  parts.glass = parts.glass + Put(Panel(w, h), x, -0.01F, z);
  if (blind_length > 0.15F)
    parts.blind = parts.blind + Put(Panel(w, blind_length), x, -0.018F, z + h - blind_length);
  parts.sill = parts.sill + Put(Box(w + 0.3F, 0.16F, 0.06F), x, -0.07F, z - 0.14F) +
               Put(Box(w + 0.3F, 0.06F, 0.16F), x, -0.02F, z + h + 0.08F);
  for (const float side : {-1.F, 1.F})
    parts.shutters = parts.shutters +
                     Put(Box(0.5F, 0.04F, h + 0.1F), x + side * (w / 2 + 0.36F), -0.03F, z - 0.05F);
}

void AddWindows(Scene& scene, const Palette& p, const House& house, uint32_t seed) {
  const int columns = static_cast<int>(std::lround(house.width / 2.9F));
  WindowParts parts;
  for (int row = IsShop(house) ? 1 : 0; row < house.storeys; ++row)
    for (int column = 0; column < columns; ++column) {
      if (row == 0 && column == columns / 2) continue;  // the door
      const float x = (column + 0.5F) * house.width / columns - house.width / 2;
      const float blind = Vary(seed, static_cast<uint32_t>(16 * row + column), -0.8F, 1);
      AppendWindow(parts, x, kPlinth + row * kStorey + 0.75F, blind);
    }
  Parts all{{parts.frame, p.white_paint}, {parts.glass, p.glass}, {parts.sill, p.stone}};
  if (!parts.blind.empty()) all.push_back({parts.blind, p.blind});
  if (house.front == Front::kShutters) all.push_back({parts.shutters, p.shutters});
  scene.Add(std::string(house.name) + ", windows", Transformed(std::move(all), PlaceOf(house)));
}

Patches Walls(const House& house) {
  const float half = house.width / 2, height = WallHeight(house);
  return Panel(house.width, height) + Put(Panel(kDepth, height), -half, kDepth / 2, 0, -90) +
         Put(Panel(kDepth, height), half, kDepth / 2, 0, 90);
}

Patches Bands(const House& house) {
  const float half = house.width / 2 + 0.02F;
  Patches bands = Block(-half, half, -0.05F, 0.2F, 0, kPlinth);
  for (int storey = 1; storey <= house.storeys; ++storey) {
    const float z = kPlinth + storey * kStorey - 0.16F;
    bands = bands + Block(-half, half, -0.07F, 0.05F, z, z + 0.14F);
  }
  return bands;
}

// Upper parts of the side walls, in halves that rise to the ridge.
Patches Gables(float width, float height, float rise) {
  const float half = kDepth / 2;
  const Patches rising = {MakePatch(1, 1, [&](float s, float t) -> Vector3f {
    return {0, half * s, height - 0.02F + t * (0.02F + rise * s)};
  })};
  const Patches falling = {MakePatch(1, 1, [&](float s, float t) -> Vector3f {
    return {0, half * (1 + s), height - 0.02F + t * (0.02F + rise * (1 - s))};
  })};
  const Patches right = rising + falling;
  return Put(right, width / 2, 0) + Put(right, -width / 2, kDepth, 0, 180);
}

// The front slope, the gables under it, soffit, gutter, drain pipe and chimney. The back slope lies
// out of sight.
Parts GableRoof(const House& house, const Palette& p) {
  const float half = house.width / 2, height = WallHeight(house);
  const float eaves = 0.45F, rise = 3.2F, low = height - 0.2F;
  const Patches slope =
      Quad({-half - 0.15F, -eaves, low}, {house.width + 0.3F, 0, 0}, {0, kDepth / 2 + eaves, rise});
  const Patches soffit =
      Block(-half - 0.15F, half + 0.15F, -eaves + 0.02F, 0, low - 0.14F, low - 0.02F);
  const Patches gutter = Tube({{-half, -eaves, low}, {half, -eaves, low}}, 0.07F) +
                         Tube({{half - 0.3F, -eaves, low - 0.02F},
                               {half - 0.3F, -0.08F, low - 0.5F},
                               {half - 0.3F, -0.08F, 0.1F}},
                              0.045F);
  const Patches chimney =
      Put(Box(0.7F, 0.5F, 2), -0.3F * house.width, kDepth / 2 - 0.8F, low + rise - 1.3F);
  return {{slope, house.storeys % 2 ? p.roof_tiles : p.dark_tiles},
          {soffit, p.white_paint},
          {Gables(house.width, height, rise - 0.3F), p.*house.wall},
          {gutter, p.steel},
          {chimney, p.red_brick}};
}

Parts FlatRoof(const House& house, const Palette& p) {
  const float half = house.width / 2, z = WallHeight(house);
  return {{Block(-half - 0.15F, half + 0.15F, -0.2F, kDepth, z - 0.02F, z + 0.35F), p.stone},
          {Block(-half + 1, -half + 3, 2, 4, z + 0.35F, z + 1.9F) +
               Block(half - 4, half - 1.5F, 1.5F, 3, z + 0.35F, z + 1.3F),
           p.grey_concrete},
          {Put(Cylinder(0.05F, 2.5F), 0.5F, 2, z + 0.35F), p.steel}};
}

void AddEntrance(Scene& scene, const Palette& p, const House& house) {
  const int columns = static_cast<int>(std::lround(house.width / 2.9F));
  const float x = (columns / 2 + 0.5F) * house.width / columns - house.width / 2;
  Parts parts = Put(Door(1, 2.2F, p.stone, p.door, p.steel), x, -0.05F, kPlinth);
  parts.push_back({Put(Box(1.7F, 0.9F, 0.2F), x, -0.3F) + Put(Box(1.7F, 0.6F, 0.36F), x, -0.2F) +
                       Put(Box(1.7F, 0.4F, kPlinth), x, -0.15F),
                   p.stone});
  parts.push_back({Put(Box(1.7F, 0.8F, 0.09F), x, -0.4F, kPlinth + 2.45F), p.grey_concrete});
  parts.push_back({Put(Panel(0.3F, 0.35F), x + 0.85F, -0.06F, 1.5F), p.labels});
  scene.Add(std::string(house.name) + ", entrance", Transformed(std::move(parts), PlaceOf(house)));
}

constexpr float kShopTop = 2.75F;  // upper edge of the shop windows

float ShopHalfWidth(const House& house) { return house.width / 2 - 0.5F; }

// Windows full of goods and a door between them.
void AddShopFront(Scene& scene, const Palette& p, const House& house) {
  const float half = ShopHalfWidth(house), pane = half - 0.8F, low = 0.6F, tall = kShopTop - low;
  const std::string name = house.name;
  Patches panes, frame = Put(Box(2 * half + 0.3F, 0.12F, 0.5F), 0, -0.03F);
  for (const float side : {-1.F, 1.F}) {
    const float x = side * (0.75F + pane / 2);
    panes = panes + Put(Panel(pane, tall), x, -0.06F, low);
    frame = frame + Put(BarFrame(pane, tall, 0.07F, 0.1F), x, -0.03F, low) +
            Put(Box(0.05F, 0.08F, tall), x, -0.07F, low);
  }
  const Material& goods = house.front == Front::kShop2 ? p.goods_2 : p.goods;
  scene.Add(name + ", shop window",
            Transformed(Parts{{panes, goods}, {frame, p.green_paint}}, PlaceOf(house)));
  const Parts door = Door(0.95F, 2.25F, p.green_paint, p.glass, p.steel);
  scene.Add(name + ", shop door", Transformed(Put(door, 0, -0.06F, 0.12F), PlaceOf(house)));
}

// The sign, a lit strip under it, and an awning.
void AddShopSign(Scene& scene, const Palette& p, const House& house) {
  const bool second = house.front == Front::kShop2;
  const float half = ShopHalfWidth(house), z = kShopTop + 0.05F;
  const std::string name = house.name;
  const Eigen::Affine3f T = PlaceOf(house);
  const Patches board = Put(Panel(2 * half - 1.2F, 0.75F), 0, -0.16F, z + 0.05F);
  const Patches box = Put(Box(2 * half - 1, 0.14F, 0.85F), 0, -0.075F, z);
  scene.Add(
      name + ", sign",
      Transformed(Parts{{board, second ? p.shop_sign_2 : p.shop_sign}, {box, p.green_paint}}, T));
  const Patches cloth = Put(Tilted(Put(Box(2 * half, 1.3F, 0.02F), 0, -0.65F), 22), 0, -0.17F, z) +
                        Put(Panel(2 * half, 0.22F), 0, -1.38F, z - 0.7F);
  scene.Add(name + ", awning", Transformed(cloth, T), second ? p.awning_2 : p.awning);
  const Vector3f corner(-half + 0.5F, -0.1F, z - 0.07F);
  scene.lights.push_back({"lamps",
                          T * corner,
                          T.linear() * Vector3f(0, -0.12F, 0),
                          T.linear() * Vector3f(2 * half - 1, 0, 0),
                          {3, 2.7F, 2.2F}});
}

void AddHouse(Scene& scene, const Palette& p, const House& house, uint32_t seed) {
  const std::string name = house.name;
  const Parts walls{{Walls(house), p.*house.wall}, {Bands(house), p.stone}};
  scene.Add(name + ", walls", Transformed(walls, PlaceOf(house)));
  scene.Add(name + ", roof",
            Transformed(house.roof == Roof::kGable ? GableRoof(house, p) : FlatRoof(house, p),
                        PlaceOf(house)));
  AddWindows(scene, p, house, seed);
  if (!IsShop(house)) return AddEntrance(scene, p, house);
  AddShopFront(scene, p, house);
  AddShopSign(scene, p, house);
}

void AddHouses(Scene& scene, const Palette& p) {
  using P = Palette;
  const float front = kFrontY;
  const std::array<House, 17> houses{{
      {"corner house", -6, front, 0, 12, 3, &P::brick, Roof::kGable, Front::kHouse},
      {"bakery", 6, front, 0, 11.9F, 3, &P::cream, Roof::kGable, Front::kShop},
      {"cottage", 18, front + 4, 0, 10, 2, &P::dirty_render, Roof::kGable, Front::kShutters},
      {"bookshop", 42, front, 0, 11, 3, &P::red_brick, Roof::kGable, Front::kShop2},
      {"oblique house", 54.5F, front + 4.5F, 24, 10, 2, &P::yellow_render, Roof::kGable,
       Front::kShutters},
      {"last house left", 68.5F, front, 0, 13, 3, &P::brick, Roof::kFlat, Front::kHouse},
      {"first house right", -5, -front, 180, 13, 3, &P::blue_render, Roof::kGable, Front::kHouse},
      {"villa", 8.5F, -front - 4, 180, 11, 2, &P::cream, Roof::kGable, Front::kShutters},
      {"corner shop", 21, -front, 180, 10, 2, &P::red_brick, Roof::kGable, Front::kShop2},
      {"turned house", 45, -front - 3.5F, 160, 10.5F, 2, &P::brick, Roof::kGable, Front::kHouse},
      {"tall house", 57.5F, -front, 180, 11, 4, &P::yellow_render, Roof::kFlat, Front::kHouse},
      {"last house right", 70, -front, 180, 11, 3, &P::dirty_render, Roof::kGable, Front::kShop},
      {"end house left", kRoadEnd + 8, 13, -90, 13, 3, &P::brick, Roof::kGable, Front::kHouse},
      {"end house", kRoadEnd + 8, 0, -90, 13, 3, &P::cream, Roof::kGable, Front::kShutters},
      {"end house right", kRoadEnd + 8, -13, -90, 13, 3, &P::red_brick, Roof::kGable,
       Front::kHouse},
      {"start house left", kRoadStart - 8, 8, 90, 16, 3, &P::dirty_render, Roof::kGable,
       Front::kHouse},
      {"start house right", kRoadStart - 8, -8, 90, 16, 3, &P::red_brick, Roof::kGable,
       Front::kHouse},
  }};
  for (size_t i = 0; i < houses.size(); ++i)
    AddHouse(scene, p, houses[i], static_cast<uint32_t>(i) + 1);
}

// The block of offices: one large picture of a facade between concrete piers.
void AddOffices(Scene& scene, const Palette& p) {
  const float width = 11.6F, height = 14, x = 30.3F;
  const auto at = [&](Patches patches) { return Put(std::move(patches), x, kFrontY); };
  scene.Add("offices, glass front", at(Put(Panel(width, height - 3.4F), 0, 0, 3.4F)),
            p.facade_glass);
  Patches piers = Block(-width / 2, width / 2, -0.3F, kDepth, height, height + 0.5F) +
                  Block(-width / 2, width / 2, -0.5F, 0.2F, 3.1F, 3.5F) +
                  Put(Panel(kDepth, height), -width / 2, kDepth / 2, 0, -90) +
                  Put(Panel(kDepth, height), width / 2, kDepth / 2, 0, 90);
  for (int i = 0; i <= 4; ++i)
    piers = piers + Put(Box(0.45F, 0.4F, i % 4 ? 3.2F : height),
                        -width / 2 + 0.2F + i * (width - 0.4F) / 4, -0.1F);
  scene.Add("offices, piers", at(piers), p.grey_concrete);
  scene.Add("offices, lobby", at(Put(Panel(width, 3.2F), 0, 0.8F)), p.glass);
  scene.Add("offices, lobby floor", at(Block(-width / 2, width / 2, -0.1F, 0.8F, 0, 0.16F)),
            p.stone);
  scene.Add("offices, doors",
            at(Put(BarFrame(1.8F, 2.3F, 0.08F, 0.06F), -0.2F, 0.78F, 0.2F) +
               Put(Box(0.06F, 0.06F, 2.3F), -0.2F, 0.76F, 0.2F)),
            p.steel);
}

// Station of a lofted body: the cross-section at x, from `low` to `high`.
struct Station {
  float x, half_width, low, high;
};

// Hull through cross-sections like rounded boxes; `lean` narrows them towards their tops.
Patches Loft(const std::vector<Station>& stations, float lean) {
  const auto rounded = [](float c) { return std::copysign(std::sqrt(std::abs(c)), c); };
  const int around = 24, along = static_cast<int>(stations.size()) - 1;
  return {MakePatch(around, along, [&](float s, float t) -> Vector3f {
    const Station& at = stations[static_cast<size_t>(std::lround(t * along))];
    const float angle = 2 * std::numbers::pi_v<float> * s;
    const float up = rounded(std::sin(angle)), side = rounded(std::cos(angle));
    return {at.x, at.half_width * side * (1 - lean * (0.5F + 0.5F * up)),
            0.5F * (at.low + at.high) + 0.5F * (at.high - at.low) * up};
  })};
}

Parts Wheels(const Palette& p) {
  Patches arches, tyres, hubs;
  for (const float x : {-1.3F, 1.28F})
    for (const float side : {-1.F, 1.F}) {
      const Eigen::Affine3f T = At(x, side * 0.67F, 0.3F, side > 0 ? 180 : 0);
      const auto turned = [&](const std::vector<Eigen::Vector2f>& profile) {
        return Transformed(Tilted(Lathe(profile), 90), T);
      };
      arches = arches + turned({{0.37F, 0.202F}, {0.3F, 0.202F}});
      tyres = tyres + turned({{0.3F, 0}, {0.3F, 0.205F}, {0.18F, 0.215F}});
      hubs = hubs + turned({{0.19F, 0.213F}, {0, 0.205F}});
    }
  return {{arches, p.black}, {tyres, p.rubber}, {hubs, p.hub}};
}

// A flat pane between four corners, lower left, lower right, upper left, upper right as seen from
// outside.
Patch Pane(const std::array<Vector3f, 4>& c) {
  return PatchFromPoints(1, 1, {c[0], c[1], c[2], c[3]});
}

// The panes of a car: windscreen, rear window, and two on either side.
Patches Glazing() {
  const float belt = 0.92F, top = 1.4F, out = 0.78F, in = 0.61F;
  Patches panes = {
      Pane({{{1.2F, -out, belt}, {1.2F, out, belt}, {0.42F, -in, top}, {0.42F, in, top}}}),
      Pane({{{-1.75F, out, belt}, {-1.75F, -out, belt}, {-1.05F, in, top}, {-1.05F, -in, top}}})};
  for (const float side : {-1.F, 1.F}) {
    const auto pane = [&](float low_0, float low_1, float top_0, float top_1) {
      const Vector3f a(low_0, side * out, belt), b(low_1, side * out, belt);
      const Vector3f c(top_0, side * in, top), d(top_1, side * in, top);
      panes.push_back(side < 0 ? Pane({a, b, c, d}) : Pane({b, a, d, c}));
    };
    pane(-1.75F, -0.3F, -1.05F, -0.3F);
    pane(-0.3F, 1.2F, -0.3F, 0.42F);
  }
  return panes;
}

Patches Pillars() {
  Patches pillars;
  for (const float side : {-1.F, 1.F})
    pillars = pillars + Tube({{1.22F, side * 0.78F, 0.9F}, {0.42F, side * 0.61F, 1.41F}}, 0.035F) +
              Tube({{-0.3F, side * 0.78F, 0.9F}, {-0.3F, side * 0.61F, 1.41F}}, 0.035F) +
              Tube({{-1.77F, side * 0.78F, 0.9F}, {-1.05F, side * 0.61F, 1.41F}}, 0.06F);
  return pillars;
}

// Painted sheet metal of a hatchback with its nose along +x, centred on the origin.
Patches CarBody() {
  const Patches body = Loft({{-2.08F, 0.01F, 0.55F, 0.57F},
                             {-2.08F, 0.74F, 0.34F, 0.8F},
                             {-1.98F, 0.82F, 0.27F, 0.92F},
                             {-1.5F, 0.86F, 0.22F, 0.95F},
                             {-0.6F, 0.87F, 0.2F, 0.95F},
                             {0.6F, 0.87F, 0.2F, 0.93F},
                             {1.15F, 0.86F, 0.2F, 0.9F},
                             {1.7F, 0.83F, 0.22F, 0.8F},
                             {2.02F, 0.75F, 0.28F, 0.68F},
                             {2.1F, 0.62F, 0.36F, 0.58F},
                             {2.1F, 0.01F, 0.46F, 0.48F}},
                            0.03F);
  const Patches roof = Loft({{-1.15F, 0.01F, 1.36F, 1.37F},
                             {-1.12F, 0.6F, 1.34F, 1.4F},
                             {-0.95F, 0.64F, 1.35F, 1.44F},
                             {-0.5F, 0.66F, 1.36F, 1.47F},
                             {0.1F, 0.66F, 1.36F, 1.46F},
                             {0.47F, 0.6F, 1.36F, 1.41F},
                             {0.5F, 0.01F, 1.38F, 1.39F}},
                            0.08F);
  return body + roof + Pillars();
}

Parts Car(const Palette& p, const Material& paint) {
  Patches trim, tail, head;
  for (const float side : {-1.F, 1.F}) {
    trim = trim + Put(Box(2.6F, 0.02F, 0.05F), 0, side * 0.87F, 0.5F) +
           Put(Box(0.16F, 0.03F, 0.03F), -0.15F, side * 0.86F, 0.76F) +
           Put(Box(0.12F, 0.16F, 0.1F), 0.85F, side * 0.9F, 0.9F);
    tail = tail + Put(Panel(0.24F, 0.13F), -2.092F, side * 0.5F, 0.6F, -90);
    head = head + Put(Panel(0.32F, 0.1F), 2.108F, side * 0.42F, 0.45F, 90);
  }
  trim = trim + Put(Box(0.1F, 1.5F, 0.12F), -2.08F, 0, 0.36F) +
         Put(Box(0.1F, 1.2F, 0.1F), 2.08F, 0, 0.34F);
  const Patches plates = Put(Panel(0.52F, 0.11F), -2.135F, 0, 0.52F, -90) +
                         Put(Panel(0.52F, 0.11F), 2.14F, 0, 0.36F, 90);
  return Parts{{CarBody(), paint}, {Glazing(), p.glass}, {trim, p.black},
               {tail, p.red},      {head, p.headlight},  {plates, p.plate}} +
         Wheels(p);
}

// A delivery van: a tall lofted box with a short nose.
Parts Van(const Palette& p, const Material& paint) {
  const Patches body = Loft({{-2.4F, 0.01F, 1, 1.02F},
                             {-2.4F, 0.84F, 0.3F, 1.98F},
                             {-2.3F, 0.88F, 0.25F, 2.05F},
                             {0.9F, 0.88F, 0.22F, 2.05F},
                             {1.2F, 0.87F, 0.22F, 1.95F},
                             {1.75F, 0.86F, 0.22F, 1.12F},
                             {2.3F, 0.8F, 0.26F, 0.95F},
                             {2.42F, 0.7F, 0.34F, 0.75F},
                             {2.42F, 0.01F, 0.5F, 0.52F}},
                            0.06F);
  const Patches screen = Put(Tilted(Panel(1.3F, 0.78F), -33.5F), 1.77F, 0, 1.2F, 90);
  Patches windows = screen, tail;
  for (const float side : {-1.F, 1.F}) {
    windows = windows +
              Put(Tilted(Panel(0.75F, 0.5F), -3), 0.85F, side * 0.872F, 1.25F, side > 0 ? 180 : 0) +
              Put(Panel(0.55F, 0.5F), -2.412F, side * 0.36F, 1.3F, -90);
    tail = tail + Put(Box(0.06F, 0.12F, 0.3F), -2.4F, side * 0.72F, 0.8F);
  }
  const Patches plate = Put(Panel(0.52F, 0.11F), -2.42F, 0, 0.6F, -90);
  const Patches lettering = Put(Panel(1.9F, 0.8F), -1.1F, -0.89F, 0.95F) +
                            Put(Panel(1.9F, 0.8F), -1.1F, 0.89F, 0.95F, 180);
  return Parts{{body, paint},
               {windows, p.glass},
               {tail, p.red},
               {plate, p.plate},
               {lettering, p.shop_sign}} +
         Wheels(p);
}

struct ParkedCar {
  float x, y, yaw_deg;
  Vector3f paint;
};

void AddCars(Scene& scene, const Palette& p) {
  const std::array<ParkedCar, 8> cars{{{3.5F, -3.45F, 0, {0.35F, 0.03F, 0.03F}},
                                       {27.5F, -3.5F, -1, {0.04F, 0.1F, 0.28F}},
                                       {39.5F, -3.35F, -9, {0.7F, 0.7F, 0.68F}},
                                       {53.5F, -3.45F, 1, {0.09F, 0.09F, 0.1F}},
                                       {10.5F, 3.45F, 180, {0.08F, 0.2F, 0.14F}},
                                       {22.5F, 3.4F, 171, {0.55F, 0.4F, 0.08F}},
                                       {41, 3.5F, 181, {0.4F, 0.41F, 0.44F}},
                                       {57, 2, 180, {0.5F, 0.06F, 0.05F}}}};
  for (size_t i = 0; i < cars.size(); ++i) {
    const ParkedCar& car = cars[i];
    const Material paint = Glossy(Plain(car.paint.x(), car.paint.y(), car.paint.z()), 0.004F, 120);
    scene.Add("car " + std::to_string(i + 1), Put(Car(p, paint), car.x, car.y, 0, car.yaw_deg));
  }
  const Material white = Glossy(Plain(0.7F, 0.7F, 0.7F), 0.003F, 100);
  scene.Add("van", Put(Van(p, white), 17, -3.4F, 0, 1));
  scene.Add("second van",
            Put(Van(p, Glossy(Plain(0.1F, 0.22F, 0.4F), 0.003F, 100)), 47.5F, 3.4F, 0, 180));
}

// A clump of leaves: a bumpy ball.
Patches Clump(float radius, uint32_t seed) {
  const float a = Vary(seed, 0, 0, 6), b = Vary(seed, 1, 0, 6);
  return {MakePatch(12, 8, [&](float s, float t) -> Vector3f {
    const float turn = 2 * std::numbers::pi_v<float> * s,
                rise = std::numbers::pi_v<float> * (t - 0.5F);
    const float bump = 1 + std::cos(rise) * (0.1F * std::sin(3 * turn + a) +
                                             0.08F * std::sin(5 * turn + 7 * rise + b));
    const float r = radius * bump;
    return {r * std::cos(rise) * std::cos(turn), r * std::cos(rise) * std::sin(turn),
            0.85F * r * std::sin(rise)};
  })};
}

Parts Tree(const Palette& p, float height, bool light_green, uint32_t seed) {
  const float fork = 0.42F * height, crown = 0.24F * height;
  Patches wood = Lathe({{0.03F * height, 0}, {0.02F * height, fork + 0.1F}}),
          leaves = Put(Clump(crown, seed), 0, 0, height - crown);
  for (uint32_t i = 0; i < 6; ++i) {
    const float turn = 1.05F * i + Vary(seed, 3 * i, 0, 0.6F);
    const float x = 0.85F * crown * std::cos(turn), y = 0.85F * crown * std::sin(turn);
    const float z = height * Vary(seed, 3 * i + 1, 0.5F, 0.72F);
    leaves =
        leaves + Put(Clump(crown * Vary(seed, 3 * i + 2, 0.62F, 0.85F), seed + 31 * i), x, y, z);
    wood = wood + Tube({{0, 0, fork}, {x, y, z}}, 0.019F);
  }
  return {{wood, p.bark}, {leaves, light_green ? p.leaves_2 : p.hedge}};
}

void AddTrees(Scene& scene, const Palette& p) {
  struct Place {
    float x, y, height;
  };
  const std::array<Place, 8> places{{{-2, 5.3F, 6},
                                     {13, 5.4F, 5.6F},
                                     {25.5F, 5.3F, 6.3F},
                                     {37, 5.4F, 5.5F},
                                     {50, 5.5F, 6.4F},
                                     {32, -9.5F, 8},
                                     {51.5F, -5.4F, 5.8F},

                                     {13.5F, -5.5F, 5.5F}}};
  for (size_t i = 0; i < places.size(); ++i)
    scene.Add("tree " + std::to_string(i + 1),
              Put(Tree(p, places[i].height, i % 3 == 1, 100 + 7 * static_cast<uint32_t>(i)),
                  places[i].x, places[i].y, kPavement - 0.02F));
  Patches backdrop;
  const std::array<Vector3f, 6> clumps{{{27, -18, 3},
                                        {31.5F, -18.5F, 3.4F},
                                        {36, -18, 3.2F},
                                        {14, 17, 2.6F},
                                        {50, 18, 3},
                                        {60, 18, 3}}};
  for (const Vector3f& c : clumps)
    backdrop =
        backdrop + Put(Clump(c.z(), static_cast<uint32_t>(c.x())), c.x(), c.y(), 0.7F * c.z());
  scene.Add("wood behind the houses", backdrop, Tiled(p.hedge.texture, 2, {0.7F, 0.75F, 0.6F}));
}

// Fence of pickets along x, from -length / 2 to length / 2.
Patches PicketFence(float length) {
  Patches fence =
      Put(Box(length, 0.03F, 0.07F), 0, 0, 0.25F) + Put(Box(length, 0.03F, 0.07F), 0, 0, 0.75F);
  for (float x = -length / 2; x <= length / 2; x += 0.16F)
    fence = fence + Put(Box(0.08F, 0.025F, 0.98F), x, -0.028F, 0.04F);
  return fence;
}

Patches IronFence(float length) {
  Patches fence =
      Put(Box(length, 0.04F, 0.03F), 0, 0, 0.15F) + Put(Box(length, 0.04F, 0.03F), 0, 0, 1.1F);
  for (float x = -length / 2; x <= length / 2; x += 0.14F)
    fence = fence + Put(Box(0.018F, 0.018F, 1.3F), x, 0);
  return fence;
}

void AddGardens(Scene& scene, const Palette& p) {
  const float y = kFrontY + 0.1F, z = kPavement - 0.02F;
  scene.Add("picket fence", Put(PicketFence(10), 18, y, z), p.white_paint);
  scene.Add("cottage hedge", Put(RoundedBox(0.7F, 3.8F, 1.2F, 0.15F), 23.7F, y + 2, z), p.hedge);
  scene.Add("cottage shrubs",
            Put(Clump(0.6F, 5), 14.5F, y + 2.7F, 0.5F) + Put(Clump(0.45F, 6), 21.3F, y + 3, 0.4F),
            p.leaves_2);
  scene.Add("hedge of the oblique house", Put(RoundedBox(9.5F, 0.7F, 1.1F, 0.15F), 55, y + 0.3F, z),
            p.hedge);
  scene.Add("villa hedge",
            Put(RoundedBox(4.2F, 0.7F, 1.3F, 0.15F), 5.4F, -y - 0.3F, z) +
                Put(RoundedBox(4.6F, 0.7F, 1.3F, 0.15F), 11.3F, -y - 0.3F, z),
            p.hedge);
  scene.Add("garden gate", Put(IronFence(1.4F), 8.2F, -y - 0.2F, z), p.iron);
  scene.Add("park fence", Put(IronFence(13), 32.8F, -y, z), p.iron);
  scene.Add("garden wall", Put(Box(11, 0.3F, 0.7F), 45, -y - 0.1F, z), p.red_brick);
  scene.Add("wall coping", Put(Box(11.1F, 0.4F, 0.07F), 45, -y - 0.1F, z + 0.7F), p.stone);
}

void AddParkBenchAndFences(Scene& scene, const Palette& p) {
  const float y = kFrontY + 0.1F;
  scene.Add("park bench",
            Put(Box(1.7F, 0.45F, 0.05F), 30, -y - 1.2F, 0.5F) +
                Put(Tilted(Box(1.7F, 0.04F, 0.45F), 10), 30, -y - 1.45F, 0.6F) +
                Put(Legs(1.5F, 0.4F, 0.5F, 0.06F), 30, -y - 1.2F),
            p.wood);
  const float back = kLotEndY - 0.4F, middle = (kRoadStart + kRoadEnd) / 2;
  const Patches back_fence = Put(Box(kRoadEnd - kRoadStart - 8, 0.06F, 2.2F), middle, 0);
  scene.Add("back fences", Put(back_fence, 0, back) + Put(back_fence, 0, -back), p.wood);
  scene.Add("side fences",
            Put(Box(0.06F, 8, 1.7F), 36.3F, kFrontY + 4.5F) +
                Put(Box(0.06F, 8, 1.7F), 61.5F, kFrontY + 4.5F) +
                Put(Box(0.06F, 8, 1.7F), 26.2F, -kFrontY - 4.5F) +
                Put(Box(0.06F, 8, 1.7F), 39.4F, -kFrontY - 4.5F),
            p.wood);
}

// Street lamp whose arm reaches towards +y.
void AddStreetLamp(Scene& scene, const Palette& p, float x, float y, int number) {
  const float reach = y > 0 ? -1.4F : 1.4F, top = 5.6F;
  const Patches post = Lathe({{0.09F, 0}, {0.05F, top - 0.6F}}) +
                       Tube({{0, 0, top - 0.7F}, {0, 0, top}, {0, reach, top}}, 0.045F) +
                       Put(Box(0.3F, 0.7F, 0.12F), 0, reach, top - 0.04F);
  scene.Add("street lamp " + std::to_string(number), Put(post, x, y, 0.1F), p.green_paint);
  scene.lights.push_back({"lamps",
                          {x - 0.12F, y + reach + 0.3F, top + 0.04F},
                          {0.24F, 0, 0},
                          {0, -0.6F, 0},
                          {60, 50, 34}});
}

// Post with a plate; the plate faces -x, towards those who drive along the road.
Parts Sign(const Palette& p, Parts plate, float height) {
  Parts sign = Put(std::move(plate), -0.04F, 0, height, -90);
  sign.push_back({Cylinder(0.03F, height + 0.35F), p.steel});
  return sign;
}

Patches SignDisc(float radius) { return Tilted(Cylinder(radius, 0.01F), 90); }

// Upright bar or board centred on (x, z), its face at y = -front.
Patches SignBar(float width, float height, float front, float x = 0, float z = 0) {
  return Put(Box(width, 0.012F, height), x, 0.006F - front, z - height / 2);
}

Parts NoEntry(const Palette& p) {
  return {{SignDisc(0.32F), p.red}, {SignBar(0.46F, 0.12F, 0.024F), p.white_paint}};
}

Parts SpeedLimit(const Palette& p) {
  const Patches ring = Tilted(Lathe({{0.32F, 0}, {0.32F, 0.012F}, {0.24F, 0.012F}}), 90);
  const Patches digits = SignBar(0.09F, 0.22F, 0.03F, -0.08F) + SignBar(0.09F, 0.22F, 0.03F, 0.08F);
  return {{ring, p.red}, {SignDisc(0.245F), p.white_paint}, {digits, p.black}};
}

Parts Parking(const Palette& p) {
  const float front = 0.02F;
  const Patches letter =
      SignBar(0.07F, 0.36F, front, -0.09F) + SignBar(0.2F, 0.06F, front, 0, 0.15F) +
      SignBar(0.2F, 0.06F, front, 0, 0.01F) + SignBar(0.06F, 0.2F, front, 0.1F, 0.08F);
  return {{SignBar(0.5F, 0.6F, 0.006F), p.blue}, {letter, p.white_paint}};
}

Parts GiveWay(const Palette& p) {
  const Patches outer = Extrude({{-0.4F, 0.32F}, {0, -0.38F}, {0.4F, 0.32F}}, 0.012F);
  const Patches inner = Extrude({{-0.26F, 0.24F}, {0, -0.22F}, {0.26F, 0.24F}}, 0.012F);
  return {{outer, p.red}, {Put(inner, 0, -0.01F), p.white_paint}};
}

Parts Crossing(const Palette& p) {
  const Patches triangle = Extrude({{-0.24F, -0.2F}, {0.24F, -0.2F}, {0, 0.22F}}, 0.012F);
  return {{SignBar(0.6F, 0.6F, 0.006F), p.blue}, {Put(triangle, 0, -0.01F), p.white_paint}};
}

void AddSigns(Scene& scene, const Palette& p) {
  const float y = -4.9F, z = kPavement;
  scene.Add("speed limit", Put(Sign(p, SpeedLimit(p), 2.3F), 6.5F, y, z));
  scene.Add("parking sign", Put(Sign(p, Parking(p), 2.4F), 20.5F, y, z));
  scene.Add("crossing sign", Put(Sign(p, Crossing(p), 2.3F), 30.9F, y, z));
  scene.Add("no entry sign", Put(Sign(p, NoEntry(p), 2.4F), 47, y, z));
  scene.Add("give way sign", Put(Sign(p, GiveWay(p), 2.3F), 73, y, z));
  const Parts name{{SignBar(0.9F, 0.22F, 0.006F), p.shop_sign}};
  scene.Add("street name", Put(Sign(p, name, 2.6F), 75, -y, z));
}

Parts BusShelter(const Palette& p) {
  const Patches panes = Put(Panel(3.4F, 1.9F), 0, 0.55F, 0.3F);
  const Patches posts = Legs(3.46F, 1.2F, 2.4F, 0.06F) +
                        Put(Box(3.8F, 1.6F, 0.1F), 0, -0.1F, 2.4F) +
                        Put(Box(3.4F, 0.05F, 0.06F), 0, 0.57F, 0.25F);
  const Patches bench = Put(Box(2.2F, 0.35F, 0.05F), -0.3F, 0.3F, 0.48F) +
                        Put(Legs(2, 0.25F, 0.48F, 0.05F), -0.3F, 0.3F);
  const Patches advert = Put(Box(0.08F, 1.2F, 1.8F), 1.7F, 0, 0.35F);
  return {{posts, p.steel}, {panes, p.glass}, {bench, p.wood}, {advert, p.poster}};
}

// Things on the pavement.
void AddStreetFurniture(Scene& scene, const Palette& p) {
  const float z = kPavement;
  const auto bin = [] {
    return Lathe({{0, 0}, {0.2F, 0}, {0.24F, 0.8F}, {0.27F, 0.8F}, {0.2F, 0.95F}, {0, 0.98F}});
  };
  scene.Add("bus shelter", Put(BusShelter(p), 36, -6.2F, z, 180));
  const Patches drum = Lathe({{0.5F, 0}, {0.5F, 2.9F}});
  scene.Add("advertising column",
            Put(Parts{{drum, Tiled(p.poster_2.texture, 1.05F)},
                      {Put(Lathe({{0.59F, 0}, {0.59F, 0.12F}, {0, 0.5F}}), 0, 0, 2.9F) +
                           Lathe({{0.56F, 0}, {0.56F, 0.25F}, {0.5F, 0.25F}}),
                       p.green_paint}},
                26.8F, -5.8F, z, 40));
  scene.Add("litter bins",
            Put(bin(), 2, 5.1F, z) + Put(bin(), 33.5F, 5.2F, z) + Put(bin(), 24.4F, -5.1F, z),
            p.green_paint);
  scene.Add("letter box", Put(RoundedBox(0.5F, 0.4F, 1.1F, 0.05F), 15.6F, -6.2F, z), p.yellow);
  scene.Add("switch cabinet", Put(Parts{{Box(1.2F, 0.4F, 1.2F), p.grey_concrete},
                                        {Put(Panel(0.4F, 0.4F), 0.2F, -0.205F, 0.6F), p.labels}},
                                  49, -6.9F, z, 180));
  Patches bollards;
  for (int i = 0; i < 9; ++i)
    bollards =
        bollards + Put(Lathe({{0.06F, 0}, {0.06F, 0.86F}, {0, 0.9F}}), 27 + 1.35F * i, 4.85F, z);
  scene.Add("bollards", bollards, p.iron);
}

void AddSeats(Scene& scene, const Palette& p) {
  const float z = kPavement;
  scene.Add("bench", Put(Parts{{Put(Box(1.7F, 0.45F, 0.05F), 0, -0.25F, 0.42F) +
                                    Put(Tilted(Box(1.7F, 0.04F, 0.4F), -10), 0, 0, 0.52F),
                                p.wood},
                               {Put(Legs(1.5F, 0.4F, 0.42F, 0.06F), 0, -0.25F), p.iron}},
                         40, kFrontY - 0.4F, z));
  for (const float x : {3.6F, 8.2F}) {
    const std::string where = x < 5 ? "first" : "second";
    scene.Add(where + " cafe table",
              Put(RoundTable(0.38F, 0.74F, p.white_paint, p.iron), x, 6.2F, z));
    scene.Add(where + " cafe chairs", Put(Chair(p.wood, p.awning), x - 0.75F, 6.25F, z, 80) +
                                          Put(Chair(p.wood, p.awning), x + 0.75F, 6.15F, z, -100));
  }
  for (const float x : {38.2F, 45.8F})
    scene.Add(x < 40 ? "left planter" : "right planter",
              Put(Plant(1.5F, 22, p.terracotta, p.hedge, static_cast<uint32_t>(x)), x,
                  kFrontY - 0.5F, z));
}

// A heap of sand on the road, fenced off.
void AddRoadworks(Scene& scene, const Palette& p) {
  const Parts barrier{
      {Put(Box(2.2F, 0.04F, 0.25F), 0, 0, 0.85F) + Put(Box(2.2F, 0.04F, 0.2F), 0, 0, 0.35F),
       p.hazard},
      {Put(Legs(2, 0.2F, 1.05F, 0.05F), 0, 0.1F), p.steel}};
  scene.Add("barrier", Put(barrier, 62.5F, -3.3F, 0, -78));
  scene.Add("second barrier", Put(barrier, 64, -2.3F, 0, 4));
  scene.Add("heap of sand", Put(Clump(0.75F, 3), 64.5F, -3.4F),
            Tiled(p.dirty_render.texture, 1, {0.8F, 0.6F, 0.35F}));
  const std::array<Eigen::Vector2f, 4> places{
      {{60.8F, -2.6F}, {61.3F, -2}, {66.3F, -2.1F}, {67, -3}}};
  Patches cones, bands;
  for (const Eigen::Vector2f& at : places) {
    cones = cones + Put(Lathe({{0.15F, 0}, {0.04F, 0.5F}, {0, 0.5F}}), at.x(), at.y(), 0.03F) +
            Put(Box(0.36F, 0.36F, 0.03F), at.x(), at.y());
    bands = bands + Put(Lathe({{0.112F, 0}, {0.083F, 0.13F}}), at.x(), at.y(), 0.23F);
  }
  scene.Add("traffic cones", Parts{{cones, p.orange}, {bands, p.white_paint}});
}

// The sun is a large square far away, so that shadows have soft edges. It stands on the right
// behind those who drive along the road, high enough to reach most of it.
void AddLight(Scene& scene) {
  const Vector3f middle(32, 0, 4), towards = Vector3f(-0.55F, -0.4F, 0.95F).normalized();
  const float distance = 220, side = 24;
  const Vector3f s = Vector3f(-towards.y(), towards.x(), 0).normalized() * side;
  const Vector3f t = s.normalized().cross(towards) * side;  // s x t points along -towards
  scene.lights.push_back({.group = "sun",
                          .corner = middle + distance * towards - (s + t) / 2,
                          .edge_s = s,
                          .edge_t = t,
                          .radiance = {330, 300, 255},
                          .hidden = true});
  scene.sky = Sky{"sky", {0.28F, 0.4F, 0.68F}, {0.74F, 0.79F, 0.84F}};
}

}  // namespace

Scene Street() {
  Scene scene;
  scene.name = "street";
  const Palette p = MakePalette(scene);
  AddGround(scene, p);
  AddRoadMarkings(scene, p);
  AddLight(scene);
  AddHouses(scene, p);
  AddOffices(scene, p);
  AddCars(scene, p);
  AddTrees(scene, p);
  AddGardens(scene, p);
  AddParkBenchAndFences(scene, p);
  const std::array<Eigen::Vector2f, 5> lamps{
      {{1, -4.95F}, {18.5F, 4.95F}, {34.8F, -4.95F}, {47, 4.95F}, {60, -4.95F}}};
  for (size_t i = 0; i < lamps.size(); ++i)
    AddStreetLamp(scene, p, lamps[i].x(), lamps[i].y(), static_cast<int>(i) + 1);
  AddSigns(scene, p);
  AddStreetFurniture(scene, p);
  AddSeats(scene, p);
  AddRoadworks(scene, p);
  scene.views = {{"street", {0, -1.2F, 1.65F}, {20, -0.9F, 1.75F}},
                 {"shops", {-1, -1.2F, 1.65F}, {9, 7, 2.4F}},
                 {"crossing", {25, -1.2F, 1.65F}, {40, -1.8F, 1.9F}},
                 {"bookshop", {36, -1.2F, 1.65F}, {45.5F, 6.5F, 2.3F}},
                 {"roadworks", {52, -1.2F, 1.65F}, {68, -1.6F, 1.9F}},
                 {"offices", {17, -1.2F, 1.65F}, {29.5F, 7.5F, 4.2F}},
                 {"looking_back", {30, -1.2F, 1.65F}, {12, -2.2F, 1.9F}}};
  return scene;
}

}  // namespace sgf::synth
