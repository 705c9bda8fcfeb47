#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include <sgf/synth/scenes/furniture.h>

namespace sgf::synth {
namespace {

using Eigen::Vector3f;

// The room: x to the east, y to the north, the origin in its middle on the floor.
constexpr float kEastX = 3, kNorthY = 2.5F, kHeight = 2.7F;
// The window in the east wall, along the wall's own x axis, which runs from north to south.
constexpr Opening kWindow{-1.9F, 0, 0.9F, 2.3F};
constexpr float kWindowY = 0.95F, kRevealDepth = 0.2F;

enum class Wall { kNorth, kEast, kSouth, kWest };

// Placement of what stands with its back `gap` off a wall; `along` is the world's x or y.
Eigen::Affine3f AtWall(Wall wall, float along, float z = 0, float gap = 0.002F) {
  switch (wall) {
    case Wall::kNorth:
      return At(along, kNorthY - gap, z);
    case Wall::kEast:
      return At(kEastX - gap, along, z, -90);
    case Wall::kSouth:
      return At(along, gap - kNorthY, z, 180);
    default:
      return At(gap - kEastX, along, z, 90);
  }
}

struct Palette {
  Material plaster, ceiling, wallpaper, parquet, brick, marble, rug;
  Material oak, walnut, lacquer, white_paint, steel, brass, black, screen_off, mirror, glass;
  Material sofa, sofa_cushion, leather, stripes, red_cloth, office_cloth, curtain;
  Material china, blue_glaze, terracotta, paper, leaf, dark_leaf, soot;
  Material landscape, abstract, abstract_2, poster, map, calendar, desktop, door, labels;
  std::vector<Material> book_cloths;
};

void MixPaints(Palette& p) {
  p.plaster = Plain(0.72F, 0.69F, 0.62F);
  p.ceiling = Plain(0.8F, 0.8F, 0.78F);
  p.lacquer = Glossy(Plain(0.7F, 0.7F, 0.68F), 0.04F, 120, 0.03F);
  p.white_paint = Glossy(Plain(0.75F, 0.75F, 0.73F), 0.03F, 40);
  p.brass = Glossy(Plain(0.55F, 0.4F, 0.15F), 0.06F, 80, 0.2F);
  p.black = Glossy(Plain(0.05F, 0.05F, 0.052F), 0.03F, 60);
  p.screen_off = Glossy(Plain(0.03F, 0.03F, 0.033F), 0.05F, 200, 0.06F);
  p.mirror = Glossy(Plain(0.05F, 0.05F, 0.05F), 0, 200, 0.85F);
  p.glass = Glossy(Plain(0.12F, 0.2F, 0.16F), 0.1F, 200, 0.12F);
  p.china = Glossy(Plain(0.78F, 0.77F, 0.74F), 0.06F, 120, 0.03F);
  p.blue_glaze = Glossy(Plain(0.05F, 0.1F, 0.3F), 0.08F, 150, 0.05F);
  p.terracotta = Plain(0.42F, 0.17F, 0.08F);
  p.paper = Plain(0.75F, 0.74F, 0.7F);
  p.leaf = Glossy(Plain(0.1F, 0.26F, 0.06F), 0.03F, 30);
  p.dark_leaf = Glossy(Plain(0.04F, 0.14F, 0.05F), 0.04F, 50);
  p.soot = Plain(0.06F, 0.052F, 0.046F);
}

void HangTextures(Scene& scene, Palette& p) {
  p.wallpaper = Tiled(scene.AddTexture("wallpaper"), 0.6F);
  p.parquet = Glossy(Tiled(scene.AddTexture("parquet"), 1.2F), 0.03F, 120, 0.03F);
  p.brick = Tiled(scene.AddTexture("brick"), 0.8F);
  p.marble = Glossy(Tiled(scene.AddTexture("marble"), 0.9F), 0.05F, 150, 0.04F);
  p.rug = Fitted(scene.AddTexture("rug"));
  const int grain = scene.AddTexture("wood_grain");
  p.oak = Glossy(Tiled(grain, 0.7F), 0.03F, 40);
  p.walnut = Glossy(Tiled(grain, 0.6F, {0.5F, 0.36F, 0.27F}), 0.025F, 120, 0.05F);
  p.steel = Glossy(Tiled(scene.AddTexture("metal_brushed"), 0.3F), 0.05F, 60, 0.1F);
  const int weave = scene.AddTexture("fabric_weave");
  p.sofa = Tiled(weave, 0.25F, {0.45F, 0.5F, 0.58F});
  p.sofa_cushion = Tiled(weave, 0.25F, {0.55F, 0.6F, 0.68F});
  p.red_cloth = Tiled(weave, 0.2F, {0.6F, 0.12F, 0.08F});
  p.office_cloth = Tiled(weave, 0.15F, {0.12F, 0.13F, 0.15F});
  p.curtain = Tiled(scene.AddTexture("fabric_stripes", 512, 4), 0.7F, {0.9F, 0.85F, 0.75F});
  p.stripes = Tiled(scene.AddTexture("fabric_stripes", 512, 2), 0.3F);
  p.leather = Glossy(Tiled(scene.AddTexture("leather"), 0.4F), 0.04F, 30);
}

void FramePictures(Scene& scene, Palette& p) {
  const auto picture = [&](std::string_view name, uint32_t seed) {
    return Glossy(Fitted(scene.AddTexture(name, 512, seed)), 0.03F, 200, 0.02F);
  };
  p.landscape = picture("painting_landscape", 1);
  p.abstract = picture("painting_abstract", 1);
  p.abstract_2 = picture("painting_abstract", 5);
  p.poster = picture("poster_text", 1);
  p.map = Fitted(scene.AddTexture("map"));
  p.calendar = Fitted(scene.AddTexture("calendar"));
  p.desktop = picture("screen_desktop", 1);
  p.door = Fitted(scene.AddTexture("door_panel"));
  p.labels = Fitted(scene.AddTexture("label_sheet"));
}

void DyeBookCloths(Scene& scene, Palette& p) {
  const int cloth = scene.AddTexture("fabric_weave", 256, 3);
  for (const Vector3f& dye :
       {Vector3f(0.5F, 0.08F, 0.06F), Vector3f(0.06F, 0.12F, 0.35F), Vector3f(0.05F, 0.22F, 0.12F),
        Vector3f(0.75F, 0.68F, 0.5F), Vector3f(0.07F, 0.07F, 0.08F), Vector3f(0.7F, 0.4F, 0.08F),
        Vector3f(0.35F, 0.18F, 0.28F), Vector3f(0.7F, 0.7F, 0.72F)})
    p.book_cloths.push_back(Tiled(cloth, 0.25F, dye / 0.5F));
}

Palette MakePalette(Scene& scene) {
  Palette p;
  MixPaints(p);
  HangTextures(scene, p);
  FramePictures(scene, p);
  DyeBookCloths(scene, p);
  return p;
}

// Walls reach a little beyond the corners, so that the room is tight.
void AddShell(Scene& scene, const Palette& p) {
  const float x = kEastX + 0.05F, y = kNorthY + 0.05F, z = kHeight + 0.05F;
  scene.Add("floor", FloorSheet(-x, x, -y, y, 0), p.parquet);
  scene.Add("ceiling", CeilingSheet(-x, x, -y, y, kHeight), p.ceiling);
  scene.Add("north wall", Transformed(Panel(2 * x, z), AtWall(Wall::kNorth, 0, -0.02F, 0)),
            p.plaster);
  scene.Add("south wall", Transformed(Panel(2 * x, z), AtWall(Wall::kSouth, 0, -0.02F, 0)),
            p.plaster);
  scene.Add("west wall", Transformed(Panel(2 * y, z), AtWall(Wall::kWest, 0, -0.02F, 0)),
            p.wallpaper);
  scene.Add("east wall",
            Transformed(WallAround(2 * y, z, kWindow) + Reveal(kWindow, kRevealDepth + 0.05F),
                        AtWall(Wall::kEast, 0, 0, 0)),
            p.plaster);
}

void AddMouldings(Scene& scene, const Palette& p) {
  Patches skirting, cornice;
  const auto strip = [&](Wall wall, float from, float to) {
    const float half = (to - from) / 2;
    const Eigen::Affine3f T = AtWall(wall, (from + to) / 2, 0, 0);
    skirting = skirting + Transformed(Block(-half, half, -0.015F, 0, 0, 0.09F), T);
  };
  strip(Wall::kNorth, -kEastX, kEastX);
  strip(Wall::kEast, -kNorthY, kNorthY);
  strip(Wall::kWest, -kNorthY, kNorthY);
  strip(Wall::kSouth, -kEastX, 1.7F);
  strip(Wall::kSouth, 2.7F, kEastX);
  for (const Wall wall : {Wall::kNorth, Wall::kEast, Wall::kSouth, Wall::kWest}) {
    const Patches bar = Block(-kEastX, kEastX, -0.06F, 0.01F, -0.06F, 0.01F);
    cornice = cornice + Transformed(bar, AtWall(wall, 0, kHeight, 0));
  }
  scene.Add("skirting board", skirting, p.white_paint);
  scene.Add("cornice", cornice, p.white_paint);
}

void AddDoorAndSwitches(Scene& scene, const Palette& p) {
  scene.Add("door", Transformed(Door(0.86F, 2.05F, p.white_paint, p.door, p.steel),
                                AtWall(Wall::kSouth, 2.2F)));
  const Patches plate = Put(RoundedBox(0.08F, 0.012F, 0.08F, 0.005F), 0, -0.006F);
  const Patches rocker = Put(Box(0.045F, 0.008F, 0.045F), 0, -0.014F, 0.0175F);
  scene.Add("light switch", Transformed(plate + rocker, AtWall(Wall::kSouth, 1.55F, 1.05F)),
            p.lacquer);
  scene.Add("sockets",
            Transformed(plate + Put(plate, 0.1F, 0), AtWall(Wall::kSouth, 1.4F, 0.25F)) +
                Transformed(plate, AtWall(Wall::kNorth, 1.45F, 0.25F)),
            p.lacquer);
}

// Half a cylinder around the window with a landscape on it, grass and sky: all that can be seen
// through the window.
void AddGarden(Scene& scene) {
  const float radius = 2.4F, low = -0.6F, high = 3.9F;
  const Patches backdrop = {MakePatch(32, 1, [&](float s, float t) -> Vector3f {
    const float angle = (0.5F - s) * std::numbers::pi_v<float>;
    return {kEastX + 0.2F + radius * std::cos(angle), kWindowY + radius * std::sin(angle),
            low + t * (high - low)};
  })};
  scene.Add("view of the garden", backdrop, Fitted(scene.AddTexture("painting_landscape", 512, 3)));
  const float y0 = kWindowY - radius - 0.1F, y1 = kWindowY + radius + 0.1F,
              x1 = kEastX + radius + 0.4F;
  scene.Add("lawn", FloorSheet(kEastX + 0.2F, x1, y0, y1, 0.1F),
            Tiled(scene.AddTexture("grass"), 1));
  scene.Add("sky sheet", CeilingSheet(kEastX + 0.2F, x1, y0, y1, high - 0.05F),
            Plain(0.55F, 0.65F, 0.8F));
  scene.Add("garden hedge", Put(RoundedBox(0.6F, 4, 1.1F, 0.12F), kEastX + 2, kWindowY, 0.1F),
            Tiled(scene.AddTexture("hedge_leaves"), 0.8F));
}

void AddWindow(Scene& scene, const Palette& p) {
  const Eigen::Affine3f at_wall = AtWall(Wall::kEast, 0, 0, 0);
  scene.Add("window frame", Transformed(Put(WindowFrame(kWindow, 2), 0, 0.12F), at_wall),
            p.white_paint);
  const Patches sill =
      Block(kWindow.left - 0.05F, kWindow.right + 0.05F, -0.12F, 0.1F, 0.87F, 0.9F);
  scene.Add("window sill", Transformed(sill, at_wall), p.marble);
  scene.Add("curtains",
            Transformed(Put(Curtain(0.5F, 2.3F, 5, 0.1F), -2.12F, -0.1F, 0.12F) +
                            Put(Curtain(0.4F, 2.3F, 4, 0.1F), 0.18F, -0.1F, 0.12F),
                        at_wall),
            p.curtain);
  scene.Add("curtain rail",
            Transformed(Tube({{-2.45F, -0.1F, 2.45F}, {0.45F, -0.1F, 2.45F}}, 0.014F) +
                            Put(Box(0.05F, 0.05F, 0.05F), -2.46F, -0.1F, 2.425F) +
                            Put(Box(0.05F, 0.05F, 0.05F), 0.46F, -0.1F, 2.425F),
                        at_wall),
            p.brass);
  scene.Add("radiator", Transformed(Radiator(1.2F, 0.6F), AtWall(Wall::kEast, kWindowY, 0.1F)),
            p.white_paint);
  scene.Add("sill plant",
            Put(Plant(0.4F, 16, p.blue_glaze, p.leaf, 11), kEastX - 0.02F, 1.6F, 0.9F));
  scene.Add("sill candlestick", Put(Bottle(0.24F), kEastX - 0.03F, 0.3F, 0.9F), p.brass);
}

constexpr std::array<float, 2> kBookcaseX{-2.48F, -1.5F};
constexpr int kBookcaseRows = 6;
constexpr float kBookcaseHeight = 2.1F;

// Height of the board that a row of a bookcase stands on.
float BoardHeight(int row) { return row * (kBookcaseHeight - 0.022F) / kBookcaseRows + 0.023F; }

void AddBookcases(Scene& scene, const Palette& p) {
  struct Place {
    int bookcase, row;
    float x, width;
  };
  constexpr std::array<Place, 10> kPlaces{{{0, 1, 0, 0.88F},
                                           {0, 2, -0.1F, 0.66F},
                                           {0, 3, 0, 0.88F},
                                           {0, 4, 0.12F, 0.6F},
                                           {0, 5, 0, 0.88F},
                                           {1, 0, -0.15F, 0.55F},
                                           {1, 1, 0, 0.88F},
                                           {1, 2, 0.08F, 0.7F},
                                           {1, 4, 0, 0.88F},
                                           {1, 5, -0.2F, 0.44F}}};
  const Parts bookcase = Shelf(0.94F, kBookcaseHeight, 0.3F, kBookcaseRows, p.oak);
  for (size_t i = 0; i < kBookcaseX.size(); ++i)
    scene.Add("bookcase " + std::to_string(i + 1),
              Transformed(bookcase, AtWall(Wall::kNorth, kBookcaseX[i])));
  for (size_t i = 0; i < kPlaces.size(); ++i) {
    const Place& place = kPlaces[i];
    const Parts books =
        BookRow(place.width, 0.3F, p.book_cloths, p.paper, 20 + static_cast<uint32_t>(i));
    scene.Add("book row " + std::to_string(i + 1), Put(books, kBookcaseX[place.bookcase] + place.x,
                                                       kNorthY - 0.27F, BoardHeight(place.row)));
  }
}

void AddThingsOnShelves(Scene& scene, const Palette& p) {
  const float y = kNorthY - 0.17F, left = kBookcaseX[0], right = kBookcaseX[1];
  scene.Add("blue vase", Put(Vase(0.27F), right - 0.2F, y, BoardHeight(3)), p.blue_glaze);
  scene.Add("shelf bowl", Put(Bowl(0.13F), right + 0.22F, y, BoardHeight(3)), p.china);
  scene.Add("photograph", Put(Tilted(Picture(0.18F, 0.23F, p.brass, p.abstract_2), -8),
                              right + 0.22F, y, BoardHeight(5)));
  scene.Add("storage box", Put(Carton({0.4F, 0.24F, 0.22F}, p.stripes, p.paper), left - 0.2F,
                               y - 0.02F, BoardHeight(0)));
}

// A floor-standing loudspeaker: case, two cones and a tweeter.
Parts Loudspeaker(const Palette& p) {
  Patches cones;
  for (const float z : {0.3F, 0.55F})
    cones =
        cones + Put(Tilted(Lathe({{0.08F, 0}, {0.085F, 0.012F}, {0.07F, 0.012F}, {0, -0.03F}}), 90),
                    0, -0.261F, z);
  cones = cones + Put(Tilted(Cylinder(0.03F, 0.008F), 90), 0, -0.26F, 0.75F);
  return {{Put(RoundedBox(0.22F, 0.26F, 0.9F, 0.008F), 0, -0.13F), p.walnut}, {cones, p.black}};
}

void AddMediaWall(Scene& scene, const Palette& p) {
  const float x = 0.2F, top = 0.5F;
  scene.Add("media cabinet",
            Transformed(Cabinet({1.8F, 0.42F, top}, 3, 1, p.lacquer, p.walnut, p.brass),
                        AtWall(Wall::kNorth, x)));
  scene.Add("television", Put(Screen(1.22F, 0.7F, p.black, p.screen_off), x, kNorthY - 0.08F, top));
  for (const float side : {-1.F, 1.F})
    scene.Add(side < 0 ? "left loudspeaker" : "right loudspeaker",
              Put(Loudspeaker(p), x + side * 1.06F, kNorthY - 0.1F));
  scene.Add("disc player",
            Put(RoundedBox(0.3F, 0.25F, 0.05F, 0.006F), x - 0.72F, kNorthY - 0.2F, top), p.steel);
  scene.Add("remote control",
            Put(RoundedBox(0.05F, 0.16F, 0.02F, 0.006F), x + 0.75F, kNorthY - 0.25F, top, 25),
            p.black);
}

void AddNorthWallThings(Scene& scene, const Palette& p) {
  scene.Add("poster", Transformed(Picture(0.5F, 0.7F, p.black, p.poster),
                                  AtWall(Wall::kNorth, -0.35F, 1.55F)));
  scene.Add("abstract painting", Transformed(Picture(0.75F, 0.6F, p.oak, p.abstract),
                                             AtWall(Wall::kNorth, 0.55F, 1.6F)));
  const Patches board = Block(-0.4F, 0.4F, -0.2F, 0, 0, 0.025F);
  scene.Add("wall shelf", Transformed(board, AtWall(Wall::kNorth, 1.95F, 1.5F)), p.oak);
  scene.Add("shelf cups",
            Put(Cup(), 1.7F, 2.4F, 1.525F, 40) + Put(Cup(), 1.83F, 2.38F, 1.525F, 110), p.china);
  scene.Add("bottle", Put(Bottle(0.3F), 2.05F, 2.4F, 1.525F), p.glass);
  scene.Add("wall shelf books",
            Put(BookRow(0.22F, 0.22F, p.book_cloths, p.paper, 77), 2.22F, kNorthY - 0.19F, 1.525F));
  scene.Add("large plant", Put(Plant(1.45F, 34, p.terracotta, p.dark_leaf, 5), 2.45F, 1.98F));
}

constexpr float kBreastDepth = 0.36F;

Eigen::Affine3f AtFireplace(float z = 0) { return AtWall(Wall::kWest, 0.35F, z); }

// The mantelpiece stands on two marble jambs before the chimney breast; x along the west wall.
void AddFireplace(Scene& scene, const Palette& p) {
  const float depth = kBreastDepth;
  const Opening hearth{-0.36F, 0.36F, 0.1F, 0.8F};
  const Patches breast = Put(WallAround(1.4F, kHeight, hearth), 0, -depth) +
                         Put(Panel(depth, kHeight), -0.7F, -depth / 2, 0, -90) +
                         Put(Panel(depth, kHeight), 0.7F, -depth / 2, 0, 90);
  scene.Add("chimney breast", Transformed(breast, AtFireplace()), p.brick);
  const Patches chamber =
      Put(Reveal(hearth, depth - 0.02F), 0, -depth) + Put(Panel(0.8F, 0.8F), 0, -0.02F, 0.05F);
  scene.Add("fire chamber", Transformed(chamber, AtFireplace()), p.soot);
  const Patches mantel = Block(-0.62F, 0.62F, -depth - 0.16F, -depth + 0.01F, 1, 1.06F) +
                         Block(-0.54F, 0.54F, -depth - 0.07F, -depth + 0.01F, 0.8F, 1) +
                         Block(-0.54F, -0.36F, -depth - 0.06F, -depth + 0.01F, 0, 0.8F) +
                         Block(0.36F, 0.54F, -depth - 0.06F, -depth + 0.01F, 0, 0.8F) +
                         Block(-0.7F, 0.7F, -depth - 0.35F, -depth + 0.01F, 0, 0.05F);
  scene.Add("mantelpiece", Transformed(mantel, AtFireplace()), p.marble);
  Patches logs;
  for (int i = 0; i < 5; ++i)
    logs = logs + Put(Tilted(Cylinder(0.045F, 0.4F), 90), -0.14F + 0.07F * i, -0.02F,
                      0.16F + 0.08F * (i % 2), 78 + 6.F * i);
  scene.Add("logs", Transformed(Put(logs, 0, -0.15F), AtFireplace()),
            Tiled(scene.AddTexture("cork"), 0.3F, {0.5F, 0.36F, 0.25F}));
}

void AddThingsOnMantelpiece(Scene& scene, const Palette& p) {
  const float depth = kBreastDepth, ledge = 1.06F, front = -depth - 0.08F;
  const Patches disc = Put(Tilted(Disc(0.3F), 90), 0, -depth - 0.012F, 1.65F);
  const Patches rim =
      Put(Tilted(Lathe({{0.34F, 0}, {0.33F, 0.03F}, {0.29F, 0.03F}, {0.28F, 0.008F}}), 90), 0,
          -depth - 0.004F, 1.65F);
  scene.Add("round mirror", Transformed(Parts{{disc, p.mirror}, {rim, p.brass}}, AtFireplace()));
  scene.Add("candles",
            Transformed(Put(Cylinder(0.03F, 0.2F), -0.5F, front) +
                            Put(Cylinder(0.03F, 0.14F), -0.41F, front - 0.02F),
                        AtFireplace(ledge)),
            p.paper);
  scene.Add(
      "mantel clock",
      Transformed(Put(RoundedBox(0.2F, 0.1F, 0.16F, 0.03F), 0.02F, front), AtFireplace(ledge)),
      p.walnut);
  scene.Add("mantel vase", Transformed(Put(Vase(0.28F), 0.44F, front), AtFireplace(ledge)),
            p.terracotta);
  scene.Add("log basket", Put(Carton({0.36F, 0.3F, 0.34F},
                                     Tiled(scene.AddTexture("wood_planks"), 0.5F), p.leather),
                              -2.75F, 1.4F, 0, 82));
}

void AddSofaGroup(Scene& scene, const Palette& p) {
  scene.Add("sofa", Transformed(Sofa(3, p.sofa, p.sofa_cushion, p.walnut),
                                AtWall(Wall::kSouth, -0.45F, 0, 0.06F)));
  const auto pillow = [](float tilt, float yaw) {
    return Put(Tilted(Cushion(0.42F, 0.13F, 0.4F, 0.04F), tilt), 0, 0, 0, yaw);
  };
  scene.Add("striped pillow", Put(pillow(-24, 165), -1.15F, -1.98F, 0.44F), p.stripes);
  scene.Add("red pillow", Put(pillow(-28, 200), 0.22F, -1.97F, 0.44F), p.red_cloth);
  scene.Add("armchair", Put(Sofa(1, p.leather, p.leather, p.walnut), -2.45F, -1.95F, 0, 135));
  scene.Add("armchair pillow", Put(pillow(-26, 140), -2.1F, -1.62F, 0.44F), p.stripes);
  scene.Add("landscape painting", Transformed(Picture(1.25F, 0.75F, p.brass, p.landscape),
                                              AtWall(Wall::kSouth, -0.7F, 1.35F)));
  scene.Add("small painting", Transformed(Picture(0.4F, 0.5F, p.black, p.abstract_2),
                                          AtWall(Wall::kSouth, 0.45F, 1.45F)));
}

void AddLowTables(Scene& scene, const Palette& p) {
  scene.Add("rug", Put(Box(2.3F, 1.6F, 0.012F), -0.35F, 0.25F), p.rug);
  scene.Add("coffee table", Put(Table(1.05F, 0.55F, 0.42F, p.walnut, p.walnut), -0.5F, -1.06F));
  scene.Add("magazines",
            Put(Box(0.22F, 0.3F, 0.012F), -0.78F, -1.05F, 0.42F, 12) +
                Put(Box(0.22F, 0.3F, 0.01F), -0.77F, -1.06F, 0.4325F, -9),
            p.abstract_2);
  scene.Add("coffee cups",
            Put(Cup(), -0.4F, -0.95F, 0.43F, 30) + Put(Plate(0.075F), -0.4F, -0.95F, 0.42F) +
                Put(Cup(), -0.15F, -1.17F, 0.43F, 200) + Put(Plate(0.075F), -0.15F, -1.17F, 0.42F),
            p.china);
  scene.Add("side table", Put(Table(0.46F, 0.46F, 0.55F, p.oak, p.oak), 1, -2.2F));
  scene.Add(
      "reading lamp",
      Put(Parts{{Vase(0.26F), p.blue_glaze},
                {Put(Lathe({{0.16F, 0}, {0.1F, 0.2F}, {0.098F, 0.2F}, {0.158F, 0}}), 0, 0, 0.27F),
                 p.paper}},
          1, -2.24F, 0.55F));
}

void AddDiningCorner(Scene& scene, const Palette& p) {
  const float x = 2, y = kWindowY, top = 0.75F;
  scene.Add("dining table", Put(RoundTable(0.5F, top, p.walnut, p.walnut), x, y));
  scene.Add("north chair", Put(Chair(p.oak, p.red_cloth), x - 0.05F, y + 0.62F, 0, -8));
  scene.Add("south chair", Put(Chair(p.oak, p.red_cloth), x + 0.06F, y - 0.66F, 0, 188));
  scene.Add(
      "plates",
      Put(Plate(0.13F), x - 0.05F, y + 0.27F, top) + Put(Plate(0.13F), x + 0.03F, y - 0.27F, top),
      p.china);
  scene.Add("cups",
            Put(Cup(), x - 0.26F, y + 0.2F, top, 70) + Put(Cup(), x + 0.25F, y - 0.2F, top, 250),
            p.china);
  scene.Add("fruit bowl", Put(Bowl(0.15F), x, y, top), p.blue_glaze);
  Patches fruit;
  for (int i = 0; i < 3; ++i)
    fruit = fruit + Put(Sphere(0.04F), x + 0.05F * (i % 2 ? 1 : -1), y + 0.05F * (i / 2 ? 1 : -1),
                        top + 0.085F);
  scene.Add("oranges", fruit, Plain(0.7F, 0.25F, 0.03F));
  const Parts pendant{{Lathe({{0.2F, 0}, {0.16F, 0.12F}, {0.05F, 0.2F}, {0.02F, 0.24F}}), p.black},
                      {Tube({{0, 0, 0.23F}, {0, 0, 1}}, 0.006F), p.black}};
  scene.Add("pendant lamp", Put(pendant, x, y, 1.72F));
}

constexpr float kDeskY = -1.02F, kDeskHeight = 0.74F;

void AddDesk(Scene& scene, const Palette& p) {
  const float y = kDeskY, top = kDeskHeight;
  const auto at = [](float along, float z) { return AtWall(Wall::kEast, along, z, 0.02F); };
  scene.Add("desk", Put(Table(1.3F, 0.65F, top, p.lacquer, p.steel), kEastX - 0.345F, y, 0, -90));
  scene.Add("drawer unit",
            Transformed(Cabinet({0.4F, 0.5F, 0.56F}, 1, 3, p.lacquer, p.lacquer, p.steel),
                        at(y - 0.38F, 0)));
  scene.Add("monitor", Transformed(Put(Screen(0.58F, 0.35F, p.black, p.desktop), 0, -0.08F),
                                   at(y + 0.05F, top)));
  scene.Add("office chair", Put(OfficeChair(p.office_cloth, p.steel), 1.98F, y + 0.04F, 0, 75));
  scene.Add("map", Transformed(Picture(1.1F, 0.75F, p.oak, p.map), at(y - 0.15F, 1.5F)));
  scene.Add("calendar", Transformed(Put(Panel(0.3F, 0.42F), 0, -0.004F), at(-2.05F, 1.5F)),
            p.calendar);
  scene.Add("desk cable",
            Tube({{2.9F, y + 0.05F, top},
                  {2.96F, y + 0.1F, 0.5F},
                  {2.95F, y + 0.3F, 0.1F},
                  {2.97F, y + 0.45F, 0.02F}},
                 0.005F),
            p.black);
  scene.Add(
      "waste bin",
      Put(Lathe({{0, 0}, {0.11F, 0}, {0.15F, 0.3F}, {0.145F, 0.3F}, {0.105F, 0.01F}, {0, 0.01F}}),
          2.55F, -1.95F),
      p.steel);
}

void AddThingsOnDesk(Scene& scene, const Palette& p) {
  const float y = kDeskY, top = kDeskHeight;
  scene.Add("keyboard", Put(RoundedBox(0.15F, 0.44F, 0.022F, 0.006F), 2.52F, y + 0.05F, top, 2),
            p.labels);
  scene.Add("papers",
            Put(Box(0.21F, 0.3F, 0.004F), 2.6F, y - 0.42F, top, 70) +
                Put(Box(0.21F, 0.3F, 0.004F), 2.64F, y - 0.4F, top + 0.0042F, 95),
            p.labels);
  scene.Add("pencil pot", Put(Cone(0.035F, 0.04F, 0.1F), 2.87F, y + 0.42F, top), p.red_cloth);
  const Parts lamp{{Put(Cylinder(0.09F, 0.02F), 0, 0) +
                        Tube({{0, 0, 0.01F}, {-0.05F, 0, 0.35F}, {0.2F, 0, 0.52F}}, 0.01F),
                    p.steel},
                   {Put(Lathe({{0.08F, 0}, {0.03F, 0.1F}, {0, 0.11F}}), 0.22F, 0, 0.42F), p.black}};
  scene.Add("desk lamp", Put(lamp, 2.85F, y - 0.5F, top, 130));
}

// A lantern of four glowing sides in a wooden frame.
void AddStandingLamp(Scene& scene, const Palette& p) {
  const float x = -1.83F, y = -2.2F, low = 1.25F, height = 0.42F, half = 0.15F;
  scene.Add("standing lamp",
            Put(Legs(0.34F, 0.34F, low + height + 0.02F, 0.022F), x, y) +
                Put(Box(0.36F, 0.36F, 0.02F), x, y, low + height) +
                Put(Box(0.3F, 0.3F, 0.02F), x, y, low - 0.02F) +
                Put(Box(0.34F, 0.34F, 0.02F), x, y, 0.3F),
            p.oak);
  const Vector3f glow(8.5F, 6.8F, 4.6F), up(0, 0, height);
  for (int i = 0; i < 4; ++i) {
    const Eigen::Affine3f turn = At(x, y, low, 90.F * i);
    scene.lights.push_back({"standing_lamp", turn * Vector3f(-half, -half, 0),
                            turn.linear() * Vector3f(2 * half, 0, 0), up, glow});
  }
}

void AddCeilingLamps(Scene& scene, const Palette& p) {
  for (const float x : {-1.2F, 1.2F}) {
    const float y = 0.3F, half_x = 0.6F, half_y = 0.25F, z = kHeight - 0.06F;
    scene.Add(
        x < 0 ? "west ceiling lamp" : "east ceiling lamp",
        Put(Tilted(BarFrame(2 * half_x, 2 * half_y, 0.03F, 0.07F), 90), x, y + half_y, kHeight),
        p.steel);
    scene.lights.push_back({"ceiling",
                            {x - half_x, y + half_y, z},
                            {2 * half_x, 0, 0},
                            {0, -2 * half_y, 0},
                            {21, 19.6F, 17}});
  }
}

// Daylight comes in through the whole window; a second sheet lights what is seen outside.
void AddDaylight(Scene& scene) {
  const float x = kEastX + kRevealDepth + 0.02F, height = kWindow.top - kWindow.bottom;
  scene.lights.push_back({.group = "window",
                          .corner = {x, 1.9F, kWindow.bottom},
                          .edge_s = {0, -1.9F, 0},
                          .edge_t = {0, 0, height},
                          .radiance = {8.5F, 9.2F, 10.2F},
                          .hidden = true});
  scene.lights.push_back({.group = "window",
                          .corner = {x + 0.02F, -0.8F, 0.2F},
                          .edge_s = {0, 3.5F, 0},
                          .edge_t = {0, 0, 3.4F},
                          .radiance = {4, 4.1F, 4.3F},
                          .hidden = true});
}

}  // namespace

Scene LivingRoom() {
  Scene scene;
  scene.name = "living_room";
  const Palette p = MakePalette(scene);
  AddShell(scene, p);
  AddMouldings(scene, p);
  AddDoorAndSwitches(scene, p);
  AddGarden(scene);
  AddWindow(scene, p);
  AddBookcases(scene, p);
  AddThingsOnShelves(scene, p);
  AddMediaWall(scene, p);
  AddNorthWallThings(scene, p);
  AddFireplace(scene, p);
  AddThingsOnMantelpiece(scene, p);
  AddSofaGroup(scene, p);
  AddLowTables(scene, p);
  AddDiningCorner(scene, p);
  AddDesk(scene, p);
  AddThingsOnDesk(scene, p);
  AddStandingLamp(scene, p);
  AddCeilingLamps(scene, p);
  AddDaylight(scene);
  scene.views = {{"bookcases", {1.02F, -0.42F, 1.45F}, {-1.75F, 2.2F, 1.1F}},
                 {"sofa", {0.64F, 1.05F, 1.4F}, {-1.35F, -2.3F, 0.95F}},
                 {"window", {-1.1F, -0.4F, 1.5F}, {2.8F, 0.8F, 1.15F}},
                 {"desk", {-0.9F, 1.3F, 1.5F}, {2.5F, -1.9F, 1}},
                 {"fireplace", {0.9F, 0.7F, 1.35F}, {-3, 0.3F, 1.15F}},
                 {"television", {-0.2F, -0.5F, 1.2F}, {0.5F, 2.5F, 1.05F}}};
  return scene;
}

}  // namespace sgf::synth
