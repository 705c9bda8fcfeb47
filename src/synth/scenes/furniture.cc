#include <cmath>

#include <sgf/synth/arithmetic.h>
#include <sgf/synth/scenes/furniture.h>

namespace sgf::synth {
namespace {

// One leaf: rises, arches outwards along `direction` and narrows to its tip.
Patches Leaf(float reach, float rise, float width, float direction) {
  const Eigen::Vector3f out(std::cos(direction), std::sin(direction), 0);
  const Eigen::Vector3f side(std::sin(direction), -std::cos(direction), 0);
  return {MakePatch(2, 6, [&](float s, float t) -> Eigen::Vector3f {
    const float half_width = width * std::sqrt(t) * (1.04F - t);
    const float keel = 0.3F * half_width * std::abs(2 * s - 1);
    const float height = rise * (1.6F * t - 0.75F * t * t) + keel;
    return reach * t * t * out + half_width * (2 * s - 1) * side + Eigen::Vector3f(0, 0, height);
  })};
}

}  // namespace

Eigen::Affine3f At(float x, float y, float z, float yaw_deg) {
  return Eigen::Translation3f(x, y, z) *
         Eigen::AngleAxisf(Radians(yaw_deg), Eigen::Vector3f::UnitZ());
}

Patches Put(Patches patches, float x, float y, float z, float yaw_deg) {
  return Transformed(std::move(patches), At(x, y, z, yaw_deg));
}

Parts Put(Parts parts, float x, float y, float z, float yaw_deg) {
  return Transformed(std::move(parts), At(x, y, z, yaw_deg));
}

Parts Transformed(Parts parts, const Eigen::Affine3f& T) {
  for (Part& part : parts) part.patches = Transformed(std::move(part.patches), T);
  return parts;
}

Patches Tilted(Patches patches, float angle_deg) {
  const Eigen::Affine3f T(Eigen::AngleAxisf(Radians(angle_deg), Eigen::Vector3f::UnitX()));
  return Transformed(std::move(patches), T);
}

Parts Tilted(Parts parts, float angle_deg) {
  for (Part& part : parts) part.patches = Tilted(std::move(part.patches), angle_deg);
  return parts;
}

Parts operator+(Parts a, const Parts& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

float Vary(uint32_t seed, uint32_t index, float low, float high) {
  uint32_t h = seed * 0x9E3779B9U ^ (index + 1) * 0x85EBCA6BU;
  h = (h ^ (h >> 16)) * 0x7FEB352DU;
  h = (h ^ (h >> 15)) * 0x846CA68BU;
  h ^= h >> 16;
  return low + (high - low) * static_cast<float>(h >> 8) * 0x1p-24F;
}

Material Plain(float red, float green, float blue) {
  Material material;
  material.tint = {red, green, blue};
  return material;
}

Material Tiled(int texture, float tile_m, const Eigen::Vector3f& tint) {
  Material material;
  material.texture = texture;
  material.tile_m = tile_m;
  material.tint = tint;
  return material;
}

Material Fitted(int texture) {
  Material material;
  material.texture = texture;
  material.fit = true;
  return material;
}

Material Glossy(Material material, float specular, float shininess, float mirror) {
  material.specular = specular;
  material.shininess = shininess;
  material.mirror = mirror;
  return material;
}

Patches Block(float x0, float x1, float y0, float y1, float z0, float z1) {
  return Put(Box(x1 - x0, y1 - y0, z1 - z0), (x0 + x1) / 2, (y0 + y1) / 2, z0);
}

Patches Panel(float width, float height) {
  return Quad({-width / 2, 0, 0}, {width, 0, 0}, {0, 0, height});
}

Patches FloorSheet(float x0, float x1, float y0, float y1, float z) {
  return Quad({x0, y0, z}, {x1 - x0, 0, 0}, {0, y1 - y0, 0});
}

Patches CeilingSheet(float x0, float x1, float y0, float y1, float z) {
  return Quad({x0, y1, z}, {x1 - x0, 0, 0}, {0, y0 - y1, 0});
}

Patches Legs(float x, float y, float height, float thickness) {
  const float dx = (x - thickness) / 2, dy = (y - thickness) / 2;
  Patches legs;
  for (const auto& [sx, sy] : {std::pair{-1, -1}, {1, -1}, {-1, 1}, {1, 1}})
    legs = legs + Put(Box(thickness, thickness, height), sx * dx, sy * dy);
  return legs;
}

Patches BarFrame(float width, float height, float bar, float depth) {
  const float half = width / 2;
  return Block(-half - bar, -half, -depth, 0, -bar, height + bar) +
         Block(half, half + bar, -depth, 0, -bar, height + bar) +
         Block(-half, half, -depth, 0, -bar, 0) +
         Block(-half, half, -depth, 0, height, height + bar);
}

Patches WallAround(float width, float height, const Opening& o) {
  const auto sheet = [](float x0, float x1, float z0, float z1) {
    return Quad({x0, 0, z0}, {x1 - x0, 0, 0}, {0, 0, z1 - z0});
  };
  // The sheets overlap a little, so that no ray slips through between them.
  const float half = width / 2, overlap = 0.001F;
  return sheet(-half, o.left, 0, height) + sheet(o.right, half, 0, height) +
         sheet(o.left - overlap, o.right + overlap, 0, o.bottom) +
         sheet(o.left - overlap, o.right + overlap, o.top, height);
}

Patches Reveal(const Opening& o, float depth) {
  const float w = o.right - o.left, h = o.top - o.bottom;
  return Quad({o.left, 0, o.bottom}, {0, depth, 0}, {0, 0, h}) +
         Quad({o.right, depth, o.bottom}, {0, -depth, 0}, {0, 0, h}) +
         Quad({o.left, 0, o.bottom}, {w, 0, 0}, {0, depth, 0}) +
         Quad({o.left, depth, o.top}, {w, 0, 0}, {0, -depth, 0});
}

Parts Table(float x, float y, float height, const Material& top, const Material& legs) {
  const float inset_x = x - 0.08F, inset_y = y - 0.08F;
  Patches frame = Legs(inset_x, inset_y, height - 0.03F, 0.055F);
  for (const int side : {-1, 1}) {
    const float ax = side * (inset_x / 2 - 0.025F), ay = side * (inset_y / 2 - 0.025F);
    frame = frame + Put(Box(0.02F, inset_y - 0.11F, 0.08F), ax, 0, height - 0.11F) +
            Put(Box(inset_x - 0.11F, 0.02F, 0.08F), 0, ay, height - 0.11F);
  }
  return {{Put(Box(x, y, 0.03F), 0, 0, height - 0.03F), top}, {frame, legs}};
}

Parts RoundTable(float radius, float height, const Material& top, const Material& foot) {
  const float r = radius;
  return {{Lathe({{0, height - 0.03F},
                  {r - 0.01F, height - 0.03F},
                  {r, height - 0.015F},
                  {r - 0.01F, height},
                  {0, height}}),
           top},
          {Lathe({{0.28F, 0},
                  {0.28F, 0.02F},
                  {0.08F, 0.05F},
                  {0.04F, 0.12F},
                  {0.035F, height - 0.1F},
                  {0.12F, height - 0.03F}}),
           foot}};
}

Parts Chair(const Material& wood, const Material& seat) {
  Patches frame = Legs(0.42F, 0.42F, 0.44F, 0.04F);
  for (const float x : {-0.19F, 0.19F})
    frame = frame + Block(x - 0.02F, x + 0.02F, 0.17F, 0.21F, 0.44F, 0.94F) +
            Block(x - 0.012F, x + 0.012F, -0.17F, 0.17F, 0.16F, 0.19F) +
            Block(x - 0.012F, x + 0.012F, -0.17F, 0.17F, 0.38F, 0.43F);
  for (const float z : {0.56F, 0.70F, 0.84F})
    frame = frame + Block(-0.17F, 0.17F, 0.18F, 0.2F, z, z + 0.07F);
  frame = frame + Block(-0.17F, 0.17F, -0.2F, -0.18F, 0.38F, 0.43F) +
          Block(-0.17F, 0.17F, 0.18F, 0.2F, 0.38F, 0.43F);
  return {{frame, wood}, {Put(RoundedBox(0.43F, 0.4F, 0.045F, 0.018F), 0, -0.02F, 0.435F), seat}};
}

Parts OfficeChair(const Material& cloth, const Material& metal) {
  Patches frame = Put(Cylinder(0.025F, 0.36F), 0, 0, 0.08F);
  for (int i = 0; i < 5; ++i) {
    const float yaw = 72.F * i;
    const float x = 0.28F * std::cos(Radians(yaw)), y = 0.28F * std::sin(Radians(yaw));
    frame = frame + Put(Block(0, 0.3F, -0.02F, 0.02F, 0.07F, 0.1F), 0, 0, 0, yaw) +
            Put(Cylinder(0.035F, 0.07F), x, y);
  }
  frame = frame + Block(-0.03F, 0.03F, 0.2F, 0.24F, 0.45F, 0.75F);
  const Patches pads = Put(RoundedBox(0.48F, 0.46F, 0.08F, 0.03F), 0, 0, 0.42F) +
                       Put(RoundedBox(0.44F, 0.06F, 0.5F, 0.028F), 0, 0.21F, 0.55F);
  return {{pads, cloth}, {frame, metal}};
}

Parts Sofa(int seats, const Material& cloth, const Material& cushion, const Material& feet) {
  const float seat = 0.62F, arm = 0.17F, inner = seats * seat, half = inner / 2 + arm;
  Patches body = Put(RoundedBox(2 * half, 0.84F, 0.2F, 0.03F), 0, -0.42F, 0.1F) +
                 Put(RoundedBox(inner + 0.04F, 0.2F, 0.72F, 0.06F), 0, -0.1F, 0.1F);
  for (const int side : {-1, 1})
    body = body + Put(RoundedBox(arm, 0.84F, 0.5F, 0.06F), side * (half - arm / 2), -0.42F, 0.1F);
  Patches cushions;
  for (int i = 0; i < seats; ++i) {
    const float x = (i + 0.5F) * seat - inner / 2;
    cushions = cushions + Put(RoundedBox(seat - 0.01F, 0.64F, 0.13F, 0.05F), x, -0.52F, 0.3F) +
               Put(Tilted(Cushion(seat - 0.02F, 0.14F, 0.42F, 0.03F), -14), x, -0.34F, 0.43F);
  }
  return {{body, cloth},
          {cushions, cushion},
          {Put(Legs(2 * half - 0.06F, 0.74F, 0.11F, 0.05F), 0, -0.42F), feet}};
}

Parts Shelf(float width, float height, float depth, int rows, const Material& wood) {
  const float board = 0.022F, half = width / 2;
  Patches body = Block(-half, -half + board, -depth, 0, 0, height) +
                 Block(half - board, half, -depth, 0, 0, height) +
                 Block(-half + board, half - board, -0.012F, 0, 0, height);
  for (int i = 0; i <= rows; ++i) {
    const float z = (height - board) * i / rows;
    body = body + Block(-half + board, half - board, -depth + 0.004F, -0.012F, z, z + board);
  }
  return {{body, wood}};
}

Parts BookRow(float width, float height, const std::vector<Material>& cloths,
              const Material& lettering, uint32_t seed) {
  std::vector<Patches> covers(cloths.size());
  Patches letters;
  float x = -width / 2;
  for (uint32_t i = 0; x < width / 2 - 0.015F; ++i) {
    const float thickness = std::min(Vary(seed, 8 * i, 0.016F, 0.055F), width / 2 - x);
    const float tall = height * Vary(seed, 8 * i + 1, 0.7F, 1);
    const float back = Vary(seed, 8 * i + 2, 0, 0.025F);
    const auto cloth = static_cast<size_t>(Vary(seed, 8 * i + 3, 0, cloths.size() - 0.01F));
    const float centre = x + thickness / 2;
    const Patches cover = Put(Box(thickness - 0.001F, 0.17F, tall), centre, 0.085F + back);
    covers[cloth] = covers[cloth] + cover;
    for (const uint32_t band : {5U, 6U, 7U})
      if (Vary(seed, 8 * i + band, 0, 1) < 0.5F)
        letters = letters + Put(Panel(thickness - 0.01F, 0.055F * tall), centre, back - 0.003F,
                                (0.14F * band - 0.15F) * tall);
    x += thickness;
  }
  Parts row;
  for (size_t i = 0; i < cloths.size(); ++i)
    if (!covers[i].empty()) row.push_back({covers[i], cloths[i]});
  row.push_back({letters, lettering});
  return row;
}

Parts Cabinet(const Eigen::Vector3f& size, int columns, int rows, const Material& body,
              const Material& front, const Material& knob) {
  const float plinth = 0.06F, gap = 0.006F;
  const float w = size.x() / columns, h = (size.z() - plinth - 0.03F) / rows;
  Patches fronts, knobs;
  for (int c = 0; c < columns; ++c)
    for (int r = 0; r < rows; ++r) {
      const float x = (c + 0.5F) * w - size.x() / 2, z = plinth + r * h + gap;
      fronts = fronts + Put(Box(w - 2 * gap, 0.018F, h - 2 * gap), x, -size.y() - 0.009F, z);
      const float side = rows > 1 ? 0 : (c % 2 ? -1 : 1) * (w / 2 - 0.05F);
      knobs = knobs +
              Put(Tilted(Cylinder(0.013F, 0.025F), 90), x + side, -size.y() - 0.018F, z + h / 2);
    }
  const float half = size.x() / 2;
  const Patches box =
      Block(-half, half, -size.y(), 0, plinth, size.z() - 0.025F) +
      Block(-half + 0.02F, half - 0.02F, -size.y() + 0.04F, 0, 0, plinth) +
      Block(-half - 0.01F, half + 0.01F, -size.y() - 0.025F, 0, size.z() - 0.025F, size.z());
  return {{box, body}, {fronts, front}, {knobs, knob}};
}

Parts Picture(float width, float height, const Material& frame, const Material& picture) {
  const float bar = 0.035F;
  return {{Put(BarFrame(width - 2 * bar, height - 2 * bar, bar, 0.03F), 0, 0, bar), frame},
          {Put(Panel(width - 2 * bar, height - 2 * bar), 0, -0.012F, bar), picture}};
}

Parts Door(float width, float height, const Material& frame, const Material& leaf,
           const Material& handle) {
  const float half = width / 2, bar = 0.07F;
  const Patches casing = Block(-half - bar, -half, -0.025F, 0, 0, height + bar) +
                         Block(half, half + bar, -0.025F, 0, 0, height + bar) +
                         Block(-half, half, -0.025F, 0, height, height + bar);
  const float x = half - 0.07F;
  const Patches fitting =
      Block(x - 0.02F, x + 0.02F, -0.02F, -0.01F, 0.93F, 1.13F) +
      Tube({{x, -0.015F, 1.05F}, {x, -0.07F, 1.05F}, {x - 0.13F, -0.07F, 1.05F}}, 0.009F);
  return {{casing, frame}, {Put(Panel(width, height), 0, -0.01F), leaf}, {fitting, handle}};
}

Patches WindowFrame(const Opening& o, int columns) {
  const float bar = 0.05F, w = (o.right - o.left) / columns, h = o.top - o.bottom;
  Patches frame;
  for (int i = 0; i < columns; ++i) {
    const float x = o.left + (i + 0.5F) * w;
    frame = frame + Put(BarFrame(w - 2 * bar, h - 2 * bar, bar, 0.05F), x, 0.025F, o.bottom + bar);
  }
  return frame + Block(o.left, o.right, -0.02F, 0.02F, o.bottom + 0.68F * h, o.bottom + 0.71F * h);
}

Patches Radiator(float width, float height) {
  const int ribs = static_cast<int>(std::round(width / 0.06F));
  Patches all;
  for (int i = 0; i < ribs; ++i) {
    const float x = (i + 0.5F) * width / ribs - width / 2;
    all = all + Put(Box(0.042F, 0.09F, height - 0.12F), x, -0.08F, 0.12F);
  }
  all = all + Block(-width / 2, width / 2, -0.095F, -0.065F, 0.15F, 0.19F) +
        Block(-width / 2, width / 2, -0.095F, -0.065F, height - 0.07F, height - 0.03F);
  const float x = width / 2;
  return all +
         Tube({{x, -0.08F, 0.17F}, {x + 0.06F, -0.08F, 0.17F}, {x + 0.06F, -0.08F, 0}}, 0.01F);
}

Parts Screen(float width, float height, const Material& body, const Material& picture) {
  const float foot = 0.08F;
  const Patches stand = Put(RoundedBox(0.45F * width, 0.2F, 0.015F, 0.006F), 0, -0.1F) +
                        Block(-0.04F, 0.04F, -0.09F, -0.06F, 0.01F, foot + 0.05F);
  const Patches shell = Put(RoundedBox(width, 0.045F, height, 0.01F), 0, -0.1F, foot);
  const Patches panel = Put(Panel(width - 0.03F, height - 0.03F), 0, -0.1265F, foot + 0.015F);
  return {{stand + shell, body}, {panel, picture}};
}

Parts Plant(float height, int leaves, const Material& pot, const Material& leaf, uint32_t seed) {
  const float pot_height = 0.3F * height, r = 0.16F * height;
  Patches foliage;
  for (int i = 0; i < leaves; ++i) {
    const uint32_t n = 4 * static_cast<uint32_t>(i);
    const float turn = 2.4F * i + Vary(seed, n, -0.3F, 0.3F);
    const float reach = height * Vary(seed, n + 1, 0.12F, 0.5F);
    const float rise = height * Vary(seed, n + 2, 0.35F, 0.82F);
    const float width = height * Vary(seed, n + 3, 0.045F, 0.075F);
    foliage = foliage + Put(Leaf(reach, rise, width, turn), 0, 0, pot_height - 0.02F);
  }
  const Patches vessel = Lathe({{0.7F * r, 0},
                                {r, pot_height},
                                {0.9F * r, pot_height},
                                {0.85F * r, pot_height - 0.02F},
                                {0, pot_height - 0.02F}});
  return {{vessel, pot}, {foliage, leaf}};
}

Patches Cup(float scale) {
  const float r = 0.04F * scale, h = 0.09F * scale;
  const Patches ear = Tube({{r, 0, 0.8F * h},
                            {1.6F * r, 0, 0.75F * h},
                            {1.6F * r, 0, 0.3F * h},
                            {0.95F * r, 0, 0.25F * h}},
                           0.1F * r);
  return ear + Lathe({{0, 0},
                      {0.8F * r, 0},
                      {r, 0.2F * h},
                      {r, h},
                      {0.92F * r, h},
                      {0.9F * r, 0.1F * h},
                      {0, 0.08F * h}});
}

Patches Plate(float radius) {
  return Lathe({{0, 0},
                {0.6F * radius, 0},
                {radius, 0.02F},
                {radius, 0.024F},
                {0.6F * radius, 0.006F},
                {0, 0.006F}});
}

Patches Bowl(float radius) {
  const float r = radius;
  return Lathe({{0, 0},
                {0.4F * r, 0},
                {0.45F * r, 0.05F * r},
                {0.85F * r, 0.35F * r},
                {r, 0.65F * r},
                {0.95F * r, 0.65F * r},
                {0.8F * r, 0.38F * r},
                {0.4F * r, 0.12F * r},
                {0, 0.1F * r}});
}

Patches Vase(float height) {
  const float h = height;
  return Lathe({{0, 0},
                {0.14F * h, 0},
                {0.2F * h, 0.15F * h},
                {0.22F * h, 0.4F * h},
                {0.15F * h, 0.65F * h},
                {0.09F * h, 0.82F * h},
                {0.13F * h, h},
                {0.12F * h, h},
                {0.08F * h, 0.82F * h},
                {0, 0.7F * h}});
}

Patches Bottle(float height) {
  const float h = height, r = 0.13F * height;
  return Lathe({{0, 0},
                {r, 0},
                {r, 0.6F * h},
                {0.75F * r, 0.68F * h},
                {0.35F * r, 0.76F * h},
                {0.32F * r, 0.95F * h},
                {0.38F * r, 0.95F * h},
                {0.38F * r, h},
                {0, h}});
}

Parts Carton(const Eigen::Vector3f& size, const Material& board, const Material& tape) {
  const float w = 0.06F;
  const Patches strip = Put(Box(w, size.y() + 0.004F, 0.002F), 0, 0, size.z()) +
                        Put(Box(w, 0.002F, 0.09F), 0, -size.y() / 2 - 0.001F, size.z() - 0.09F) +
                        Put(Box(w, 0.002F, 0.09F), 0, size.y() / 2 + 0.001F, size.z() - 0.09F);
  return {{Box(size.x(), size.y(), size.z()), board}, {strip, tape}};
}

}  // namespace sgf::synth
