#include <cmath>

#include <sgf/synth/arithmetic.h>
#include <sgf/synth/texture_painter.h>

// Surfaces that repeat without a seam. The text of each names the length in metres that one image
// is meant to cover. Everything that depends on (u, v) has period 1 in both.
namespace sgf::synth {
namespace {

float Px(int size) { return 1.0f / static_cast<float>(size); }

Rgb Grey(float tone) { return {tone, tone, tone}; }

// A place in a pattern of equal stones laid in rows.
struct Bond {
  int i, j;    // column and row of the stone
  float x, y;  // in the stone, each in [0, 1)
  float edge;  // distance to the stone's border, in units of the image
};

// Rows of `columns` stones, each row shifted by shift(row) stones.
template <class S>
Bond RowsOfStones(float u, float v, int columns, int rows, S&& shift) {
  Bond bond;
  const float y = v * static_cast<float>(rows);
  const int row = Floor(y);
  bond.j = Wrap(row, rows);
  bond.y = y - static_cast<float>(row);
  const float x = u * static_cast<float>(columns) + shift(bond.j);
  bond.i = Wrap(Floor(x), columns);
  bond.x = Fraction(x);
  bond.edge = std::min(std::min(bond.x, 1 - bond.x) / static_cast<float>(columns),
                       std::min(bond.y, 1 - bond.y) / static_cast<float>(rows));
  return bond;
}

Bond RunningBond(float u, float v, int columns, int rows) {
  return RowsOfStones(u, v, columns, rows, [](int row) { return row % 2 == 0 ? 0.0f : 0.5f; });
}

Bond Grid(float u, float v, int n) {
  return RowsOfStones(u, v, n, n, [](int) { return 0.0f; });
}

// Wood with its fibres along u: year rings cut at a slant, and fine fibres.
class Wood {
 public:
  Wood(int rings, uint64_t seed)
      : rings_(static_cast<float>(rings)), bend_(1, 4, 3, seed), fibres_(5, 110, 3, seed + 1) {}

  // 0 light early wood to 1 dark late wood.
  float operator()(float u, float v) const {
    const float ring = Fraction(rings_ * v + 1.8f * bend_(u, v));
    const float late = SmoothStep(0.3f, 0.9f, ring) * (1 - SmoothStep(0.93f, 1, ring));
    return Clamp01(0.2f + 0.45f * late + 0.2f * fibres_(u, v));
  }

 private:
  float rings_;
  Fractal bend_, fibres_;
};

// 1 along thin, winding, branching lines.
float Crack(const Fractal& field, float u, float v, float width) {
  return 1 - SmoothStep(0, width, std::abs(field(u, v)));
}

cv::Mat3f Plaster(int size, uint64_t seed) {
  const Fractal trowel(5, 5, seed), grain(48, 48, 3, seed + 1, 0.8f);
  return Shade(size, [&](float u, float v) {
    return Srgb(0xebe6da) * (1 + 0.012f * trowel(u, v) + 0.008f * grain(u, v));
  });
}

cv::Mat3f PlainNoiseWeak(int size, uint64_t seed) {
  const Fractal clouds(4, 7, seed);
  return Shade(size, [&](float u, float v) { return Grey(0.55f + 0.012f * clouds(u, v)); });
}

cv::Mat3f Brick(int size, uint64_t seed) {
  static const Rgb kReds[] = {Srgb(0x9c4a36), Srgb(0x8a3f30), Srgb(0xab5b41), Srgb(0x7a3a31),
                              Srgb(0xb4694a), Srgb(0x933f2b), Srgb(0x5e3531)};
  const Fractal warp(24, 3, seed), grain(40, 4, seed + 1), blotch(4, 4, seed + 2);
  const Rgb mortar = Srgb(0xb9b1a2);
  return Shade(size, [&](float u, float v) {
    const float ragged = 0.0012f * warp(u, v);
    const Bond b = RunningBond(u + ragged, v + ragged, 4, 12);
    const float g = grain(u, v), tone = RandomIn(0.8f, 1.15f, seed + 3, b.i, b.j);
    const Rgb face = Pick(kReds, seed, b.i, b.j) * (tone * (1 + 0.13f * g + 0.08f * blotch(u, v)));
    const float inside = SmoothStep(0.004f, 0.0075f, b.edge + 0.001f * g);
    // The upper edge of a brick catches light, the joint below lies in shade.
    const float lit = 1 + 0.12f * SmoothStep(0.25f, 0.05f, b.y) - 0.2f * SmoothStep(0.85f, 1, b.y);
    return Mix(mortar * (0.75f + 0.12f * g), face * lit, inside);
  });
}

cv::Mat3f Concrete(int size, uint64_t seed) {
  const Fractal clouds(3, 6, seed), grain(64, 64, 3, seed + 1, 0.8f), edge(2, 4, seed + 2);
  const Cells pores(34, seed + 3);
  return Shade(size, [&](float u, float v) {
    const auto pore = pores(u, v);
    const float radius = 0.22f * std::max(0.0f, Random(seed + 4, pore.id) - 0.62f);
    const float hole =
        SmoothStep(radius + 0.05f, radius, pore.nearest) * (radius > 0 ? 1.0f : 0.0f);
    const float stain = SmoothStep(0.25f, 0.4f, edge(u, v) + 0.15f * clouds(u, v));
    // Two lifts of formwork boards leave a fine seam.
    const float board = Fraction(v * 4);
    const float seam = 1 - SmoothStep(0, 0.025f, std::min(board, 1 - board));
    const float tone = 0.42f + 0.06f * clouds(u, v) + 0.025f * grain(u, v) - 0.06f * stain -
                       0.07f * seam + 0.03f * (Random(seed + 5, static_cast<int>(v * 4)) - 0.5f);
    return Srgb(0xfffaf0) * (tone * (1 - 0.6f * hole));
  });
}

cv::Mat3f Parquet(int size, uint64_t seed) {
  constexpr int kBlocks = 4, kStrips = 5;
  const Wood wood(14, seed);
  const Rgb light = Srgb(0xcf9f66), dark = Srgb(0x7d4e27), gap = Srgb(0x38220f);
  return Shade(size, [&](float u, float v) {
    const Bond block = Grid(u, v, kBlocks);
    const bool turned = (block.i + block.j) % 2 == 1;
    const float along = turned ? block.y : block.x, across = turned ? block.x : block.y;
    const int strip = static_cast<int>(across * kStrips);
    const float y = Fraction(across * kStrips);
    const int id = (block.j * kBlocks + block.i) * kStrips + strip;
    const float tone = wood(0.25f * along + Random(seed + 1, id), 0.2f * y + Random(seed + 2, id));
    const float edge = std::min(std::min(along, 1 - along), std::min(y, 1 - y) / kStrips) / kBlocks;
    const Rgb face =
        Mix(light, dark, Clamp01(0.75f * tone + RandomIn(-0.15f, 0.35f, seed + 3, id)));
    return Mix(gap, face, SmoothStep(0, 0.0022f, edge));
  });
}

cv::Mat3f WoodPlanks(int size, uint64_t seed) {
  const Wood wood(16, seed);
  const Fractal dirt(4, 5, seed + 1);
  const Rgb light = Srgb(0xc7a178), dark = Srgb(0x6b4527), gap = Srgb(0x24170d);
  return Shade(size, [&](float u, float v) {
    const Bond b = RowsOfStones(u, v, 2, 7, [&](int row) { return Random(seed + 2, row); });
    const int id = b.j * 2 + b.i;
    const float tone = wood(0.5f * b.x + Random(seed + 3, id), 0.3f * b.y + Random(seed + 4, id));
    const float age = RandomIn(-0.2f, 0.3f, seed + 5, id) + 0.08f * dirt(u, v);
    const Rgb face = Mix(light, dark, Clamp01(tone * 0.8f + age));
    const float nail = std::hypot((std::min(b.x, 1 - b.x) - 0.03f) / 2, (b.y - 0.5f) / 7);
    return Mix(gap, face, SmoothStep(0.0005f, 0.003f, b.edge) * SmoothStep(0.0025f, 0.004f, nail));
  });
}

cv::Mat3f WoodGrain(int size, uint64_t seed) {
  const Wood wood(24, seed);
  const Fractal tint(2, 3, seed + 1), pores(20, 160, 2, seed + 2);
  const Rgb light = Srgb(0xb98655), dark = Srgb(0x5d3719);
  return Shade(size, [&](float u, float v) {
    const float pore = SmoothStep(0.75f, 1.1f, pores(u, v));
    return Mix(light, dark, Clamp01(wood(u, v) + 0.08f * tint(u, v) + 0.35f * pore));
  });
}

cv::Mat3f Carpet(int size, uint64_t seed) {
  const Cells tufts(88, seed);
  const Fractal worn(3, 5, seed + 1);
  static const Rgb kYarns[] = {Srgb(0x5b6270), Srgb(0x4a5262), Srgb(0x6d7380), Srgb(0x596479),
                               Srgb(0x8b8d92)};
  return Shade(size, [&](float u, float v) {
    const auto tuft = tufts(u, v);
    const float round = 1.1f - 0.75f * tuft.nearest;
    return Pick(kYarns, seed + 2, tuft.id) * (round * (1 + 0.12f * worn(u, v)));
  });
}

// Height of a thread across its width, 0 at its borders.
float Thread(float x) { return std::sqrt(std::max(0.0f, 1 - (2 * x - 1) * (2 * x - 1))); }

// Shade of a plain weave with n threads each way, and whether the warp (along v) lies on top.
struct Weave {
  float shade;
  bool warp_on_top;
  int warp, weft;
};

Weave PlainWeave(float u, float v, int n) {
  const float x = u * static_cast<float>(n), y = v * static_cast<float>(n);
  const int i = Floor(x), j = Floor(y);
  const bool warp = Wrap(i + j, 2) == 0;
  const float across = warp ? Fraction(x) : Fraction(y), along = warp ? Fraction(y) : Fraction(x);
  const float shade = 0.45f + 0.55f * Thread(across) * (0.6f + 0.4f * Thread(along));
  return {shade, warp, Wrap(i, n), Wrap(j, n)};
}

cv::Mat3f FabricWeave(int size, uint64_t seed) {
  constexpr int kThreads = 64;
  const Fractal slub(6, 5, seed);
  const Rgb warp = Srgb(0x9a8f7c), weft = Srgb(0x51606e);
  return Shade(size, [&](float u, float v) {
    const Weave w = PlainWeave(u, v, kThreads);
    const float yarn = w.warp_on_top ? Random(seed + 1, w.warp) : Random(seed + 2, w.weft);
    const Rgb color = w.warp_on_top ? warp : weft;
    return color * (w.shade * (0.8f + 0.4f * yarn) * (1 + 0.1f * slub(u, v)));
  });
}

// Which of `count` stripes of random width v lies in, and the distance to its border.
struct Stripe {
  int index;
  float edge;
};

Stripe StripeAt(float v, int count, uint64_t seed) {
  float total = 0;
  for (int k = 0; k < count; ++k) total += 0.25f + Random(seed, k);
  float start = 0;
  for (int k = 0; k < count; ++k) {
    const float end = start + (0.25f + Random(seed, k)) / total;
    if (v < end || k + 1 == count) return {k, std::min(v - start, end - v)};
    start = end;
  }
  return {0, 0};
}

cv::Mat3f FabricStripes(int size, uint64_t seed) {
  static const Rgb kDyes[] = {Srgb(0xe8dfc8), Srgb(0x29465b), Srgb(0xa63d2f), Srgb(0xd9a441),
                              Srgb(0x5f7f6e), Srgb(0xf0e9dc), Srgb(0x7d5a50)};
  const Fractal slub(8, 4, seed + 1);
  return Shade(size, [&](float u, float v) {
    const Stripe stripe = StripeAt(u, 14, seed);
    const Weave w = PlainWeave(u, v, 96);
    const Rgb& dye = kDyes[(static_cast<size_t>(stripe.index) + Hash64(seed, 9) % 7) % 7];
    return dye * ((0.6f + 0.4f * w.shade) * (1 + 0.07f * slub(u, v)));
  });
}

cv::Mat3f MattressTicking(int size, uint64_t seed) {
  const Fractal soil(3, 5, seed);
  const Rgb cream = Srgb(0xe6dfce), blue = Srgb(0x33496b);
  const float px = Px(size);
  return Shade(size, [&](float u, float v) {
    // Groups of one broad and two thin stripes.
    const float x = Fraction(u * 6) / 6;
    float stripe = Cover(std::abs(x - 0.045f) - 0.016f, px);
    for (float thin : {0.076f, 0.014f})
      stripe = std::max(stripe, Cover(std::abs(x - thin) - 0.003f, px));
    // Quilting: seams along both diagonals pull the cloth down, tufts where they cross.
    const float a = Fraction((u + v) * 4), b = Fraction((u - v) * 4);
    const float seam = std::min(std::min(a, 1 - a), std::min(b, 1 - b));
    const float tuft = std::hypot(std::min(a, 1 - a), std::min(b, 1 - b));
    const float puff = 0.72f + 0.28f * SmoothStep(0, 0.16f, seam);
    const float weave = 0.85f + 0.15f * PlainWeave(u, v, 128).shade;
    const Rgb cloth = Mix(cream, blue, 0.85f * stripe) * (puff * weave * (1 + 0.05f * soil(u, v)));
    return Mix(cloth, Srgb(0x8c8577), SmoothStep(0.06f, 0.045f, tuft));
  });
}

cv::Mat3f Leather(int size, uint64_t seed) {
  const Cells grain(56, seed), folds(9, seed + 1);
  const Fractal worn(3, 5, seed + 2);
  return Shade(size, [&](float u, float v) {
    const float wobble = 0.004f * worn(v, u);
    const auto g = grain(u + wobble, v - wobble), f = folds(u + wobble, v + wobble);
    const float pebble = SmoothStep(0.02f, 0.3f, g.second - g.nearest);
    const float fold = SmoothStep(0, 0.05f, f.second - f.nearest);
    const float tone = (0.62f + 0.38f * pebble) * (0.8f + 0.2f * fold) * (1 + 0.12f * worn(u, v));
    return Mix(Srgb(0x5b3420), Srgb(0x8a5433), Clamp01(0.5f + 0.35f * worn(u, v))) * tone;
  });
}

cv::Mat3f FloorTiles(int size, uint64_t seed) {
  constexpr int kTiles = 4;
  const Fractal veins(5, 5, seed), grain(50, 3, seed + 1);
  const Rgb pale = Srgb(0xd9cfbd), dark = Srgb(0x8b6f5a), grout = Srgb(0x6f6a62);
  const Rgb insert = Srgb(0x3a4650);
  return Shade(size, [&](float u, float v) {
    const Bond b = Grid(u, v, kTiles);
    const bool odd = (b.i + b.j) % 2 == 1;
    const float du = 0.37f * Random(seed + 2, b.i, b.j);
    const float vein = Crack(veins, u + du, v, 0.12f), speck = grain(u, v);
    const float tone = RandomIn(0.9f, 1.06f, seed + 3, b.i, b.j) - 0.12f * vein + 0.04f * speck;
    const float corner = std::min(b.x, 1 - b.x) + std::min(b.y, 1 - b.y);
    const Rgb face = Mix(insert * (1 + 0.1f * speck), (odd ? dark : pale) * tone,
                         SmoothStep(0.19f, 0.21f, corner));
    const float joint = std::min(b.edge, std::abs(corner - 0.2f) / kTiles * 0.7f);
    return Mix(grout * (1 + 0.1f * speck), face, SmoothStep(0.0025f, 0.005f, joint));
  });
}

cv::Mat3f Marble(int size, uint64_t seed) {
  const Fractal warp(2, 5, seed), bold(2, 5, seed + 1), fine(5, 5, seed + 2),
      clouds(2, 5, seed + 3);
  return Shade(size, [&](float u, float v) {
    const float w = 0.08f * warp(u, v);
    const float vein =
        std::max(0.9f * Crack(bold, u + w, v - w, 0.10f), 0.45f * Crack(fine, u - w, v + w, 0.09f));
    const Rgb stone = Srgb(0xe9e5df) * (0.92f + 0.07f * clouds(u, v));
    return Mix(stone, Srgb(0x6c6a70), Clamp01(vein * (0.6f + 0.4f * clouds(v, u))));
  });
}

// A chip of stone per cell, angular, of random size; `chip` gets its id. Returns 1 inside.
float Chip(const Cells& cells, float u, float v, uint64_t seed, int& chip) {
  const auto hit = cells(u, v);
  chip = hit.id;
  return SmoothStep(0.02f, 0.08f, hit.second - hit.nearest - RandomIn(0.02f, 0.4f, seed, hit.id));
}

cv::Mat3f Terrazzo(int size, uint64_t seed) {
  static const Rgb kStones[] = {Srgb(0xf2eee6), Srgb(0x3c3a3c), Srgb(0xa9825e), Srgb(0x7c7f84),
                                Srgb(0x8c4f3f), Srgb(0x57655c), Srgb(0xcdbfa6)};
  const Cells large(20, seed), small(60, seed + 1);
  const Fractal cement(24, 4, seed + 2), warp(30, 3, seed + 6);
  return Shade(size, [&](float u, float v) {
    const float w = 0.004f * warp(u, v), grain = cement(u, v);
    Rgb color = Srgb(0xb8b3a8) * (1 + 0.05f * grain);
    int chip;
    const float fine = Chip(small, u - w, v + w, seed + 3, chip);
    color = Mix(color, Pick(kStones, seed + 4, chip), 0.8f * fine);
    const float coarse = Chip(large, u + w, v + w, seed + 5, chip);
    return Mix(color, Pick(kStones, seed + 6, chip) * (1 + 0.06f * grain), coarse);
  });
}

cv::Mat3f MetalBrushed(int size, uint64_t seed) {
  const Fractal streaks(2, 100, 3, seed, 0.8f), sheen(1, 3, 3, seed + 1);
  const Fractal scratches(3, 40, 2, seed + 2);
  return Shade(size, [&](float u, float v) {
    const float scratch = SmoothStep(1.1f, 1.5f, scratches(u, v));
    const float tone = 0.46f + 0.045f * streaks(u, v) + 0.03f * sheen(u, v) + 0.12f * scratch;
    return Srgb(0xf6f8ff) * tone;
  });
}

cv::Mat3f MetalPlate(int size, uint64_t seed) {
  const Fractal wear(4, 6, seed), scratches(8, 5, seed + 1);
  return Shade(size, [&](float u, float v) {
    const Bond b = Grid(u, v, 8);
    const float sign = (b.i + b.j) % 2 == 0 ? 1.0f : -1.0f;
    const float x = ((b.x - 0.5f) + sign * (b.y - 0.5f)) * 0.7071f;
    const float y = ((b.y - 0.5f) - sign * (b.x - 0.5f)) * 0.7071f;
    // Raised lens: |y| below a parabola over its length; lit from above, in shade below.
    const float height = 0.13f * (1 - (x / 0.48f) * (x / 0.48f)) - std::abs(y);
    const float raised = SmoothStep(-0.02f, 0.03f, height);
    const float rim = SmoothStep(0.06f, 0, std::abs(height)) * (b.y > 0.5f ? -1.0f : 1.0f);
    const float w = wear(u, v);
    const float tone = 0.30f + 0.05f * w + 0.03f * scratches(u, v) + raised * 0.10f + 0.12f * rim;
    return Mix(Srgb(0xffffff), Srgb(0xe8d8c4), Clamp01(0.5f + w)) * tone;
  });
}

cv::Mat3f Rust(int size, uint64_t seed) {
  const Fractal spread(3, 6, seed), tint(6, 6, seed + 1), grain(50, 3, seed + 2);
  const Rgb paint = Srgb(0x4f7079), deep = Srgb(0x4a2414), bright = Srgb(0xb5622c);
  return Shade(size, [&](float u, float v) {
    const float s = spread(u, v) + 0.06f * grain(u, v), t = tint(u, v);
    const float rusty = SmoothStep(0.02f, 0.07f, s), halo = SmoothStep(-0.25f, 0.02f, s);
    const Rgb coat = Mix(paint * (1 + 0.05f * t), bright * 0.6f, 0.35f * halo);
    const Rgb rust = Mix(deep, bright, Clamp01(0.45f + 0.4f * t)) * (1 + 0.15f * grain(u, v));
    return Mix(coat, rust, rusty);
  });
}

cv::Mat3f HazardStripes(int size, uint64_t seed) {
  const Fractal chips(6, 6, seed), grime(3, 5, seed + 1);
  const float px = Px(size);
  return Shade(size, [&](float u, float v) {
    const float s = Fraction((u + v) * 4);
    const float black = Cover((std::abs(s - 0.5f) - 0.25f) / 4 * 0.7071f, px);
    const float worn = SmoothStep(0.55f, 0.62f, chips(u, v));
    const Rgb paint = Mix(Srgb(0xf0bb22), Srgb(0x1e1d1c), black) * (0.92f + 0.1f * grime(u, v));
    return Mix(paint, Srgb(0x8e8b86) * (0.8f + 0.2f * grime(v, u)), 0.85f * worn);
  });
}

cv::Mat3f Perforated(int size, uint64_t seed) {
  const Fractal stain(4, 5, seed), streaks(3, 90, 2, seed + 1);
  return Shade(size, [&](float u, float v) {
    const Bond b = RunningBond(u, v, 12, 12);
    const float r = std::hypot(b.x - 0.5f, b.y - 0.5f);
    const float rim = SmoothStep(0.37f, 0.30f, r) * (b.y - 0.5f);
    const float tone = 0.5f + 0.04f * stain(u, v) + 0.02f * streaks(u, v) + 0.5f * rim;
    return Mix(Srgb(0x151617), Grey(tone), SmoothStep(0.26f, 0.31f, r));
  });
}

cv::Mat3f Grating(int size, uint64_t seed) {
  const Fractal rust(5, 5, seed);
  return Shade(size, [&](float u, float v) {
    const float bar = std::abs(Fraction(u * 16) - 0.5f), rod = std::abs(Fraction(v * 5) - 0.5f);
    const float on_bar = SmoothStep(0.2f, 0.14f, bar), on_rod = SmoothStep(0.09f, 0.06f, rod);
    const float r = rust(u, v);
    const Rgb steel = Mix(Srgb(0x9a9c9e), Srgb(0x7d6350), Clamp01(0.3f + 0.5f * r));
    const float depth = 0.25f + 0.75f * on_bar;  // the rods lie deeper than the bars
    const Rgb pit = Srgb(0x191a1b) * (1 + 0.5f * r);
    return Mix(pit, steel * (depth * (0.85f + 0.3f * on_rod * on_bar)), std::max(on_bar, on_rod));
  });
}

cv::Mat3f Cardboard(int size, uint64_t seed) {
  const Fractal clouds(3, 5, seed), fibres(12, 80, 3, seed + 1), dents(2, 6, seed + 2);
  const Rgb brown = Srgb(0xb58c61);
  return Shade(size, [&](float u, float v) {
    const float flute = std::sin(2 * kPi * 48 * u);
    const float dent = Crack(dents, u, v, 0.03f) * SmoothStep(0.1f, 0.5f, clouds(u, v));
    const float speck = SmoothStep(1.2f, 1.5f, fibres(u, v));
    const float tone = 1 + 0.025f * flute + 0.06f * clouds(u, v) + 0.05f * fibres(u, v);
    return Mix(brown * tone, Srgb(0x6b4c30), 0.35f * dent + 0.4f * speck);
  });
}

cv::Mat3f Foam(int size, uint64_t seed) {
  const Cells pores(44, seed), fine(90, seed + 1);
  const Fractal age(3, 5, seed + 2);
  return Shade(size, [&](float u, float v) {
    const auto p = pores(u, v), f = fine(u, v);
    const float large = SmoothStep(0.1f, 0.45f, p.nearest + 0.5f * Random(seed + 3, p.id));
    const float small = 0.75f + 0.25f * SmoothStep(0.1f, 0.5f, f.nearest);
    const Rgb body = Mix(Srgb(0xd9c877), Srgb(0xc0a75a), Clamp01(0.5f + 0.5f * age(u, v)));
    return body * ((0.45f + 0.55f * large) * small);
  });
}

// Offset of the toothed border between two mats: dovetails, in units of the image.
float Teeth(float along, int count) {
  const float t = Fraction(along * static_cast<float>(count));
  const float rise = SmoothStep(0.2f, 0.26f, t) - SmoothStep(0.74f, 0.8f, t);
  return 0.03f * (rise - 0.5f);
}

cv::Mat3f FoamMat(int size, uint64_t seed) {
  static const Rgb kMats[] = {Srgb(0x3d6f9e), Srgb(0xb54636), Srgb(0x4f8a52), Srgb(0xcfa83c)};
  const Fractal scuffs(4, 6, seed);
  return Shade(size, [&](float u, float v) {
    const float x = u + Teeth(v, 12), y = v + Teeth(u, 12);
    const Bond b = Grid(x, y, 2);
    const Rgb& color = kMats[(2 * b.j + b.i + Hash64(seed, 1) % 4) % 4];
    const float ribs = std::sin(2 * kPi * 60 * (u + v)) * std::sin(2 * kPi * 60 * (u - v));
    const float tone = 1 + 0.06f * ribs + 0.10f * scuffs(u, v);
    return Mix(Srgb(0x1c1c1e), color * tone, SmoothStep(0.001f, 0.004f, b.edge));
  });
}

cv::Mat3f Asphalt(int size, uint64_t seed) {
  const Cells stones(110, seed), spots(9, seed + 1);
  const Fractal patches(3, 5, seed + 2), cracks(2, 6, seed + 3), grain(64, 2, seed + 4);
  const Fractal oil(4, 5, seed + 6);
  // A trench that was filled again, somewhere in the image.
  const float u0 = RandomIn(0.05f, 0.55f, seed, 0), v0 = RandomIn(0.05f, 0.6f, seed, 1);
  const float px = Px(size);
  return Shade(size, [&](float u, float v) {
    const auto stone = stones(u, v), spot = spots(u, v);
    const float light =
        SmoothStep(0.45f, 0.2f, stone.nearest) * RandomIn(-0.4f, 1, seed + 5, stone.id);
    const float crack = Crack(cracks, u, v, 0.016f) * SmoothStep(-0.1f, 0.3f, patches(v, u));
    const float trench = RectDistance(u, v, u0, v0, u0 + 0.4f, v0 + 0.22f) + 0.002f * grain(v, u);
    const float gum =
        Random(seed + 7, spot.id) < 0.25f ? SmoothStep(0.06f, 0.045f, spot.nearest) : 0.0f;
    float tone = 0.11f + 0.018f * patches(u, v) + 0.06f * light + 0.008f * grain(u, v);
    tone *= 1 - 0.3f * Cover(trench, px) - 0.45f * SmoothStep(0.9f, 1.3f, oil(u, v));
    tone = Mix(tone, 0.05f, Cover(std::abs(trench) - 0.004f, px));
    return Srgb(0xf4f5fa) * (tone * (1 - 0.75f * crack) + 0.09f * gum);
  });
}

cv::Mat3f Paving(int size, uint64_t seed) {
  static const Rgb kStones[] = {Srgb(0x8d8a84), Srgb(0x7b7872), Srgb(0xa09a8e), Srgb(0x8a7f74),
                                Srgb(0x6a6a6c)};
  const Cells stones(11, seed, 0.55f);
  const Fractal grain(24, 5, seed + 1), warp(10, 4, seed + 2);
  return Shade(size, [&](float u, float v) {
    const float w = 0.006f * warp(u, v);
    const auto s = stones(u + w, v - w);
    const float g = grain(u, v);
    const float gap = SmoothStep(0.06f, 0.17f, s.second - s.nearest);
    const float lit = 1 - 0.35f * s.dv - 0.2f * s.nearest;
    const Rgb stone = Pick(kStones, seed + 3, s.id) * (lit * (1 + 0.13f * g));
    return Mix(Srgb(0x3f3b33) * (1 + 0.25f * g), stone, gap);
  });
}

// A layer of blades: stretched noise, sheared by a whole number so that it still repeats.
cv::Mat3f Grass(int size, uint64_t seed) {
  const Noise blades(90, 14, seed), more(110, 18, seed + 1), under(60, 16, seed + 2);
  const Fractal patches(3, 5, seed + 3), sway(8, 2, seed + 4);
  const Rgb dark = Srgb(0x1f3012), mid = Srgb(0x4d7029), bright = Srgb(0x8fa84a);
  return Shade(size, [&](float u, float v) {
    const float s = 0.012f * sway(u, v), p = patches(u, v);
    const float a = blades(u + s + v, v), b = more(u + s, v), c = under(u + s - v, v);
    const float top = std::max(a, std::max(b, c - 0.2f));
    const Rgb color = Mix(dark, mid, SmoothStep(-0.3f, 0.45f, top));
    return Mix(color, bright, SmoothStep(0.35f, 1.0f, top + 0.25f * p)) * (1 + 0.15f * p);
  });
}

// A layer of leaves, one a cell, turned at random. Returns 1 on the leaf; `shade` gets its tone.
float Leaf(const Cells& cells, float u, float v, uint64_t seed, float& shade) {
  const auto hit = cells(u, v);
  const float angle = 2 * kPi * Random(seed, hit.id);
  const float x = std::cos(angle) * hit.du + std::sin(angle) * hit.dv;
  const float y = std::cos(angle) * hit.dv - std::sin(angle) * hit.du;
  const float width = 0.27f * (1 - (x / 0.55f) * (x / 0.55f));  // pointed at both ends
  const float rib = SmoothStep(0.05f, 0.02f, std::abs(y));
  shade = RandomIn(0.55f, 1.2f, seed + 1, hit.id) * (1 + 0.5f * y) + 0.25f * rib;
  return SmoothStep(0, 0.05f, width - std::abs(y));
}

cv::Mat3f HedgeLeaves(int size, uint64_t seed) {
  const Cells layers[] = {Cells(40, seed), Cells(34, seed + 1), Cells(26, seed + 2),
                          Cells(22, seed + 3)};
  const Fractal depth(4, 5, seed + 4);
  return Shade(size, [&](float u, float v) {
    const float d = depth(u, v);
    Rgb color = Srgb(0x11190b);
    for (int k = 0; k < 4; ++k) {
      float shade;
      const float leaf = Leaf(layers[k], u, v, seed + 10 + 2 * static_cast<uint64_t>(k), shade);
      const Rgb green = Mix(Srgb(0x30481c), Srgb(0x6f8f3a), 0.25f * static_cast<float>(k));
      color = Mix(color, green * (shade * (0.85f + 0.25f * d)), leaf);
    }
    return color;
  });
}

cv::Mat3f RoofTiles(int size, uint64_t seed) {
  static const Rgb kClays[] = {Srgb(0xa3523a), Srgb(0x8f4632), Srgb(0xb56447), Srgb(0x7c4234),
                               Srgb(0x9a5b45)};
  const Fractal grain(40, 4, seed), moss(4, 6, seed + 1);
  return Shade(size, [&](float u, float v) {
    const Bond b = RunningBond(u, v, 10, 8);
    const float g = grain(u, v);
    // Every tile is rounded below and throws a shadow on the row under it.
    const float bow = 0.28f * (2 * b.x - 1) * (2 * b.x - 1);
    const float below = SmoothStep(0, 0.035f, b.y - (1 - bow));
    const float shadow =
        1 - 0.6f * SmoothStep(0.28f, 0, b.y) - 0.25f * SmoothStep(0.04f, 0, b.edge * 5);
    const float gap = SmoothStep(0, 0.03f, std::min(b.x, 1 - b.x));
    const Rgb clay =
        Pick(kClays, seed + 2, b.i, b.j) * ((1 + 0.1f * g) * shadow * (0.4f + 0.6f * gap));
    const Rgb tile = Mix(clay, Srgb(0x2f1d17) * (1 + 0.1f * g), below);
    return Mix(tile, Srgb(0x5e6338) * (1 + 0.2f * g), 0.7f * SmoothStep(0.35f, 0.7f, moss(u, v)));
  });
}

cv::Mat3f RenderDirty(int size, uint64_t seed) {
  const Fractal grain(70, 2, seed), clouds(2, 6, seed + 1), runs(22, 1, 3, seed + 2);
  const Fractal peel(3, 6, seed + 3), cracks(2, 6, seed + 4);
  return Shade(size, [&](float u, float v) {
    const float c = clouds(u, v), g = grain(u, v);
    const float run = SmoothStep(0.1f, 1, runs(u, v)) * (0.6f + 0.4f * std::cos(2 * kPi * v));
    const float bare = SmoothStep(0.62f, 0.66f, peel(u, v) + 0.05f * g);
    const float crack = Crack(cracks, u, v, 0.013f) * SmoothStep(0, 0.4f, c);
    Rgb wall = Srgb(0xcdbf9f) * (1 + 0.07f * c + 0.04f * g);
    wall = Mix(wall, Srgb(0x57534a), 0.45f * run + 0.15f * Clamp01(-c));
    wall = Mix(wall, Srgb(0x94806b) * (1 + 0.15f * g), bare);
    return Mix(wall, Srgb(0x3d3830), 0.8f * crack);
  });
}

// Distance to an ornament about the origin, negative inside: a flower with leaves above and below.
float Ornament(float x, float y) {
  const float r = std::hypot(x, y), a = std::atan2(y, x);
  const float flower = r - (0.17f + 0.055f * std::cos(6 * a));
  const float stem = std::hypot(std::abs(x) - 0.16f, std::abs(y) - 0.27f);
  const float scroll = std::abs(stem - 0.11f) - 0.022f;
  const float bud = std::hypot(x, (std::abs(y) - 0.4f) * 0.6f) - 0.045f;
  return std::min(flower, std::min(scroll, bud));
}

cv::Mat3f Wallpaper(int size, uint64_t seed) {
  static const Rgb kGrounds[] = {Srgb(0xc9b99a), Srgb(0xa9b3a4), Srgb(0xb5a8b0), Srgb(0xb8c0c6)};
  const Rgb ground = kGrounds[Hash64(seed, 0) % 4];
  const Fractal paper(60, 2, seed), fade(2, 4, seed + 1);
  const float px = 4 * Px(size);
  return Shade(size, [&](float u, float v) {
    // Columns of ornaments, every other one half a repeat lower.
    const float x = Fraction(u * 4) - 0.5f;
    const bool odd = Wrap(Floor(u * 4), 2) == 1;
    const float y = Fraction(v * 4 + (odd ? 0.5f : 0.0f)) - 0.5f;
    const float pattern = Cover(Ornament(x, y), px);
    const float heart = Cover(std::hypot(x, y) - 0.06f, px);
    const Rgb color = Mix(Mix(ground, ground * 0.55f, pattern), Srgb(0x96412f), heart);
    return color * (1 + 0.02f * paper(u, v) + 0.04f * fade(u, v));
  });
}

cv::Mat3f CheckerSoft(int size, uint64_t seed) {
  const Fractal clouds(4, 6, seed);
  return Shade(size, [&](float u, float v) {
    const float wave = std::sin(2 * kPi * 4 * u) * std::sin(2 * kPi * 4 * v);
    const float tone = SmoothStep(-0.35f, 0.35f, wave);
    return Mix(Srgb(0x7f8790), Srgb(0xb5b3a8), tone) * (1 + 0.06f * clouds(u, v));
  });
}

cv::Mat3f Camouflage(int size, uint64_t seed) {
  const Fractal a(4, 3, seed), b(4, 3, seed + 1), c(5, 3, seed + 2), weave(90, 2, seed + 3);
  return Shade(size, [&](float u, float v) {
    const auto blob = [&](const Fractal& f) { return SmoothStep(0.18f, 0.2f, f(u, v)); };
    Rgb color = Srgb(0x6d6f4b);
    color = Mix(color, Srgb(0xa89e76), blob(a));
    color = Mix(color, Srgb(0x4c3b2a), blob(b));
    color = Mix(color, Srgb(0x23281f), blob(c));
    return color * (1 + 0.08f * weave(u, v));
  });
}

cv::Mat3f Cork(int size, uint64_t seed) {
  const Cells crumbs(46, seed), large(17, seed + 1);
  const Fractal tint(5, 5, seed + 2);
  return Shade(size, [&](float u, float v) {
    const float t = tint(u, v), w = 0.006f * tint(v, u);
    const auto c = crumbs(u + w, v - w), l = large(u - w, v + w);
    const float border = SmoothStep(0, 0.18f, c.second - c.nearest);
    const float dark =
        SmoothStep(0.2f, 0.12f, l.nearest) * SmoothStep(0.5f, 0.6f, Random(seed + 4, l.id));
    const float tone = RandomIn(0.72f, 1.1f, seed + 3, c.id) * (0.7f + 0.3f * border) + 0.07f * t;
    return Mix(Srgb(0xb88a5a) * tone, Srgb(0x4b2f1a), 0.8f * dark);
  });
}

constexpr TextureRecipe kSurfaces[] = {
    {{"plaster", "painted plaster, all but untextured; 2 m", true}, Plaster},
    {{"plain_noise_weak", "grey with weak clouds; 2 m", true}, PlainNoiseWeak},
    {{"brick", "brick wall; 1 m", true}, Brick},
    {{"concrete", "stained concrete with pores and seams of the formwork; 2 m", true}, Concrete},
    {{"parquet", "mosaic parquet; 0.6 m", true}, Parquet},
    {{"wood_planks", "planks along u; 1 m", true}, WoodPlanks},
    {{"wood_grain", "one wide board, grain along u; 0.5 m", true}, WoodGrain},
    {{"carpet", "tufted grey carpet; 0.5 m", true}, Carpet},
    {{"fabric_weave", "coarse two-coloured weave; 0.3 m", true}, FabricWeave},
    {{"fabric_stripes", "stripes of several colours along v; 0.8 m", true}, FabricStripes},
    {{"mattress_ticking", "striped and quilted mattress cover; 0.8 m", true}, MattressTicking},
    {{"leather", "brown leather; 0.4 m", true}, Leather},
    {{"floor_tiles", "tiles with dark corner inserts; 1.2 m", true}, FloorTiles},
    {{"marble", "white marble with grey veins; 1 m", true}, Marble},
    {{"terrazzo", "chips of stone in cement; 0.5 m", true}, Terrazzo},
    {{"metal_brushed", "steel brushed along u; 0.5 m", true}, MetalBrushed},
    {{"metal_plate", "steel plate with raised lenses; 0.4 m", true}, MetalPlate},
    {{"rust", "rust under blue paint; 1 m", true}, Rust},
    {{"hazard_stripes", "worn yellow and black diagonals; 0.6 m", true}, HazardStripes},
    {{"perforated", "sheet metal with round holes; 0.2 m", true}, Perforated},
    {{"grating", "steel grating over the dark; 0.6 m", true}, Grating},
    {{"cardboard", "brown cardboard, weak; 0.5 m", true}, Cardboard},
    {{"foam", "yellow foam rubber; 0.3 m", true}, Foam},
    {{"foam_mat", "coloured interlocking mats; 1.2 m", true}, FoamMat},
    {{"asphalt", "road with cracks and blots; 2 m", true}, Asphalt},
    {{"paving", "cobbles; 1.2 m", true}, Paving},
    {{"grass", "lawn; 0.8 m", true}, Grass},
    {{"hedge_leaves", "leaves of a hedge; 0.8 m", true}, HedgeLeaves},
    {{"roof_tiles", "clay tiles, eaves at the lower border; 1.6 m", true}, RoofTiles},
    {{"render_dirty", "stained and cracked facade; 3 m", true}, RenderDirty},
    {{"wallpaper", "repeated ornament; 1 m", true}, Wallpaper},
    {{"checker_soft", "chequers without sharp edges; 1 m", true}, CheckerSoft},
    {{"camouflage", "printed cloth in four colours; 1 m", true}, Camouflage},
    {{"cork", "cork board; 0.4 m", true}, Cork},
};

}  // namespace

std::span<const TextureRecipe> SurfaceRecipes() { return kSurfaces; }

}  // namespace sgf::synth
