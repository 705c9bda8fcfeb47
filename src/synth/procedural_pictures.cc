#include <cmath>

#include <sgf/synth/arithmetic.h>
#include <sgf/synth/texture_painter.h>

// Pictures that are shown once on a patch, or once in a repeat.
namespace sgf::synth {
namespace {

using Box = Canvas::Box;

uint64_t Child(uint64_t seed, int k) { return Hash64(seed, static_cast<uint64_t>(k)); }

// The canvas with a little unevenness, so that no area is perfectly flat.
cv::Mat3f Printed(const Canvas& canvas, uint64_t seed, float strength = 0.03f) {
  const Fractal fade(3, 6, Child(seed, 900)), grain(80, 2, Child(seed, 901));
  return canvas.Finish([&](const Rgb& color, float u, float v) {
    return color * (1 + strength * fade(u, v) + 0.6f * strength * grain(u, v));
  });
}

// A moulded frame round the whole picture.
Rgb FrameColor(float u, float v, float width, const Rgb& picture) {
  const float edge = std::min(std::min(u, 1 - u), std::min(v, 1 - v));
  if (edge > width) return picture;
  const float profile = std::sin(kPi * std::sqrt(edge / width));
  const bool upright = std::min(u, 1 - u) < std::min(v, 1 - v);
  const bool lit = upright ? u < 0.5f : v < 0.5f;
  return Srgb(0x8a6a35) * (0.35f + 0.9f * profile + (lit ? 0.15f : -0.1f));
}

// Meadows, ranges of hills one behind the other, clouds.
Rgb LandscapeColor(const Fractal& clouds, const Fractal& ridge, const Fractal& brush, float u,
                   float v) {
  const float haze = SmoothStep(0.1f, 0.75f, clouds(u, 1.6f * v));
  Rgb color = Mix(Mix(Srgb(0x4d86c0), Srgb(0xe6d3b0), v * 1.7f), Srgb(0xf4efe6), 0.9f * haze);
  static const Rgb kHills[] = {Srgb(0x8ca3b3), Srgb(0x5d7f83), Srgb(0x5b7a45), Srgb(0x8b8a3b),
                               Srgb(0x3d4f22)};
  for (int k = 0; k < 5; ++k) {
    const float depth = static_cast<float>(k);
    const float top =
        0.40f + 0.13f * depth -
        (0.10f - 0.012f * depth) * ridge(u * (0.6f + 0.25f * depth) + 0.31f * depth, 0.17f * depth);
    const float stroke = brush(u + 0.1f * depth, v * 2);
    const Rgb hill = kHills[k] * (1 + (0.08f + 0.07f * depth) * stroke);
    color = Mix(color, hill, SmoothStep(0, 0.006f, v - top));
  }
  return color;
}

void DrawTree(Canvas& canvas, float u, float v, float height, uint64_t seed) {
  canvas.Line(u, v, u, v - 0.5f * height, 0.09f * height, Srgb(0x2d2118));
  for (int leaf = 0; leaf < 60; ++leaf) {
    const float angle = 2 * kPi * Random(seed, leaf), r = std::sqrt(Random(seed, leaf, 1));
    const float du = 0.34f * height * r * std::cos(angle),
                dv = 0.36f * height * r * std::sin(angle);
    // Light comes from the upper left.
    const float light =
        0.5f - 0.4f * (du + 1.5f * dv) / height + RandomIn(-0.25f, 0.25f, seed, leaf, 2);
    const Rgb green = Mix(Srgb(0x1c2c14), Srgb(0x97a244), Clamp01(light));
    canvas.Disc(u + du, v - 0.68f * height + dv, 0.075f * height, green);
  }
}

cv::Mat3f PaintingLandscape(int size, uint64_t seed) {
  const Fractal clouds(3, 5, seed), ridge(2, 5, seed + 1), brush(26, 4, seed + 2),
      weave(120, 1, seed + 3);
  Canvas canvas(
      Shade(size, [&](float u, float v) { return LandscapeColor(clouds, ridge, brush, u, v); }));
  // The nearer a tree the lower it stands and the larger it is.
  for (int k = 0; k < 22; ++k) {
    const float v = 0.60f + 0.018f * static_cast<float>(k);
    DrawTree(canvas, Random(seed + 4, k), v, 0.65f * (v - 0.52f), Child(seed + 5, k));
  }
  return canvas.Finish([&](const Rgb& color, float u, float v) {
    return FrameColor(u, v, 0.055f, color * (1 + 0.05f * weave(u, v) + 0.05f * brush(v, u)));
  });
}

cv::Mat3f PaintingAbstract(int size, uint64_t seed) {
  static const Rgb kPaints[] = {Srgb(0xc8452f), Srgb(0x1f3f6e), Srgb(0xe0b13c), Srgb(0x22211f),
                                Srgb(0x7ba08e), Srgb(0xe8dcc6), Srgb(0x8e4a61), Srgb(0xd98b4a)};
  Canvas canvas(size, Srgb(0xe6dcc8));
  for (int k = 0; k < 30; ++k) {
    const auto r = [&](int j) { return Random(seed, k, j); };
    const Rgb& color = Pick(kPaints, seed, k);
    const float scale = 0.4f * std::pow(0.93f, static_cast<float>(k));
    if (k % 3 == 0)
      canvas.Rect({r(0) - scale / 2, r(1) - scale * r(2), r(0) + scale / 2, r(1)}, color);
    else if (k % 3 == 1)
      canvas.Disc(r(0), r(1), scale * 0.45f * (0.3f + r(2)), color);
    else
      canvas.Line(r(0), r(1), r(2), r(3), 0.004f + 0.02f * r(4), color);
    if (k % 4 == 1)
      canvas.Ring(r(5), r(6), 0.3f * scale + 0.02f, 0.008f, Pick(kPaints, seed + 1, k));
  }
  const Fractal brush(4, 40, 4, seed + 2), weave(128, 1, seed + 3);
  return canvas.Finish([&](const Rgb& color, float u, float v) {
    return FrameColor(u, v, 0.035f, color * (1 + 0.09f * brush(u, v) + 0.05f * weave(u, v)));
  });
}

cv::Mat3f PosterText(int size, uint64_t seed) {
  static const Rgb kInks[] = {Srgb(0x8c2a22), Srgb(0x1d4467), Srgb(0x2b5b3d), Srgb(0x2a2a2e)};
  const Rgb ink = Pick(kInks, seed, 0), black = Srgb(0x232326);
  Canvas canvas(size, Srgb(0xefeadd));
  canvas.Rect({0, 0, 1, 0.17f}, ink);
  canvas.Text({0.07f, 0.05f, 0.93f, 0.13f}, Srgb(0xf6f1e4), Child(seed, 1), 0.95f);
  canvas.Text({0.07f, 0.20f, 0.93f, 0.235f}, black, Child(seed, 2), 0.8f);
  canvas.Photo({0.07f, 0.27f, 0.57f, 0.60f}, ink * 0.3f, Srgb(0xf0e4c6), Child(seed, 3));
  canvas.Paragraph({0.61f, 0.27f, 0.94f, 0.60f}, 11, black, Child(seed, 4));
  canvas.Paragraph({0.07f, 0.65f, 0.48f, 0.92f}, 11, black, Child(seed, 5));
  canvas.Paragraph({0.53f, 0.65f, 0.94f, 0.84f}, 8, black, Child(seed, 6));
  canvas.Rect({0.53f, 0.865f, 0.94f, 0.925f}, ink, 0.01f);
  canvas.Text({0.56f, 0.88f, 0.92f, 0.91f}, Srgb(0xf6f1e4), Child(seed, 7), 0.9f);
  canvas.Line(0.07f, 0.955f, 0.93f, 0.955f, 0.004f, ink);
  return Printed(canvas, seed);
}

// Axes, curves and bars.
void DrawChart(Canvas& canvas, const Box& box, uint64_t seed) {
  const Rgb ink = Srgb(0x2b2f36);
  static const Rgb kCurves[] = {Srgb(0xb8402f), Srgb(0x2a6496), Srgb(0x3f8048)};
  for (int k = 1; k < 6; ++k) {
    const float v = Mix(box.v1, box.v0, static_cast<float>(k) / 6);
    canvas.Line(box.u0, v, box.u1, v, 0.0016f, Srgb(0xb9bcc0));
  }
  for (int curve = 0; curve < 3; ++curve) {
    const Fractal shape(3, 4, Child(seed, curve));
    const auto height = [&](float x) {
      return Mix(box.v1, box.v0,
                 Clamp01(0.25f + 0.2f * static_cast<float>(curve) + 0.35f * x +
                         0.15f * shape(x * 0.9f, 0.5f)));
    };
    for (int k = 0; k < 40; ++k) {
      const float a = static_cast<float>(k) / 40, b = static_cast<float>(k + 1) / 40;
      canvas.Line(Mix(box.u0, box.u1, a), height(a), Mix(box.u0, box.u1, b), height(b), 0.005f,
                  kCurves[curve]);
    }
  }
  canvas.Line(box.u0, box.v0, box.u0, box.v1, 0.004f, ink);
  canvas.Line(box.u0, box.v1, box.u1, box.v1, 0.004f, ink);
}

// Labelled boxes joined by arrows.
void DrawFlow(Canvas& canvas, const Box& box, uint64_t seed) {
  static const Rgb kFills[] = {Srgb(0xf3d9a4), Srgb(0xbfd8e6), Srgb(0xcfe3bd), Srgb(0xe9c3ba)};
  const Rgb ink = Srgb(0x33363c);
  for (int k = 0; k < 6; ++k) {
    const float i = static_cast<float>(k % 3), j = static_cast<float>(k / 3);
    const Box b = box.Part(i / 3 + 0.02f, j / 2 + 0.12f, i / 3 + 0.25f, j / 2 + 0.38f);
    canvas.Line(b.u1, (b.v0 + b.v1) / 2, b.u1 + 0.3f * b.width(), (b.v0 + b.v1) / 2, 0.005f, ink);
    if (j == 0)
      canvas.Line((b.u0 + b.u1) / 2, b.v1, (b.u0 + b.u1) / 2, b.v1 + b.height(), 0.005f, ink);
    canvas.Rect(b, ink, 0.012f);
    canvas.Rect(b.Shrunk(0.004f), Pick(kFills, seed, k), 0.009f);
    canvas.Paragraph(b.Part(0.12f, 0.2f, 0.9f, 0.9f), 2, ink, Child(seed, k));
  }
}

cv::Mat3f PosterDiagram(int size, uint64_t seed) {
  const Rgb ink = Srgb(0x24303c);
  Canvas canvas(size, Srgb(0xf1f0ea));
  canvas.Rect({0, 0, 1, 0.012f}, Srgb(0x1f5a86));
  canvas.Text({0.06f, 0.05f, 0.94f, 0.105f}, ink, Child(seed, 1), 0.9f);
  canvas.Text({0.06f, 0.13f, 0.94f, 0.155f}, Srgb(0x68737d), Child(seed, 2), 0.7f);
  DrawChart(canvas, {0.08f, 0.22f, 0.55f, 0.52f}, Child(seed, 3));
  canvas.Paragraph({0.60f, 0.22f, 0.95f, 0.40f}, 7, ink, Child(seed, 4));
  for (int k = 0; k < 9; ++k) {
    const float u = 0.62f + 0.036f * static_cast<float>(k);
    canvas.Rect({u, 0.53f - 0.1f * Random(seed, k), u + 0.025f, 0.53f}, Srgb(0x2f7f7a));
  }
  DrawFlow(canvas, {0.06f, 0.57f, 0.98f, 0.86f}, Child(seed, 5));
  canvas.Paragraph({0.06f, 0.88f, 0.94f, 0.97f}, 4, ink, Child(seed, 6));
  return Printed(canvas, seed, 0.02f);
}

// One book seen from its back.
void DrawSpine(Canvas& canvas, const Box& box, uint64_t seed) {
  static const Rgb kCovers[] = {Srgb(0x7b2d26), Srgb(0x24405c), Srgb(0x2f4a35), Srgb(0xcdb98c),
                                Srgb(0x3a3336), Srgb(0xd8d2c4), Srgb(0x8c5a2b), Srgb(0x5c6f7d),
                                Srgb(0xb5483a), Srgb(0x4b3a5c), Srgb(0xd7a33c), Srgb(0x86978b)};
  const Rgb cover = Pick(kCovers, seed, 0) * RandomIn(0.8f, 1.15f, seed, 1);
  const Rgb print = cover[1] > 0.25f ? Srgb(0x2a2522) : Srgb(0xe3cf96);
  canvas.Paint(
      box,
      [&](float u, float v) { return RectDistance(u, v, box.u0, box.v0, box.u1, box.v1, 0.002f); },
      [&](float u, float) {
        const float x = (u - box.u0) / box.width();
        return Rgb(cover * (0.45f + 0.65f * std::sqrt(std::max(0.0f, 4 * x * (1 - x)))));
      });
  const int bands = static_cast<int>(Child(seed, 2) % 4);
  for (int k = 0; k < bands; ++k) {
    const float at = RandomIn(0.05f, 0.95f, seed, 10 + k);
    canvas.Rect(box.Part(0.06f, at, 0.94f, at + 0.012f), print);
  }
  if (Random(seed, 3) < 0.4f) canvas.Rect(box.Part(0.12f, 0.12f, 0.88f, 0.3f), print);
  // The title runs upwards: a column of short marks.
  const float top = RandomIn(0.32f, 0.4f, seed, 4), bottom = RandomIn(0.6f, 0.85f, seed, 5);
  const float step = 0.42f * box.width() / box.height();
  for (int k = 0; top + step * static_cast<float>(k) < bottom; ++k) {
    if (Random(seed, 6, k) < 0.15f) continue;
    const float v = top + step * static_cast<float>(k);
    canvas.Rect(box.Part(0.3f, v, RandomIn(0.5f, 0.7f, seed, 7, k), v + 0.55f * step), print);
  }
}

cv::Mat3f Books(int size, uint64_t seed) {
  constexpr int kShelves = 3;
  Canvas canvas(size, Srgb(0x17110c));
  for (int shelf = 0; shelf < kShelves; ++shelf) {
    const float floor = static_cast<float>(shelf + 1) / kShelves - 0.018f;
    float u = 0.004f;
    for (int k = 0; u < 1; ++k) {
      const uint64_t book = Child(Child(seed, shelf), k);
      const float width = RandomIn(0.022f, 0.062f, book, 20);
      const float height = RandomIn(0.19f, 0.285f, book, 21);
      const bool gap = Random(book, 22) < 0.05f;
      if (!gap) DrawSpine(canvas, {u, floor - height, std::min(u + width, 0.998f), floor}, book);
      u += width + (gap ? 0.03f : 0.002f);
    }
    canvas.Rect({0, floor, 1, floor + 0.018f}, Srgb(0x7a5634));
    canvas.Rect({0, floor + 0.015f, 1, floor + 0.018f}, Srgb(0x3b2817));
  }
  return Printed(canvas, seed, 0.06f);
}

void DrawGauge(Canvas& canvas, float u, float v, float r, uint64_t seed) {
  canvas.Disc(u, v, r, Srgb(0x2a2c2e));
  canvas.Disc(u, v, 0.88f * r, Srgb(0xe9e6da));
  for (int k = 0; k <= 10; ++k) {
    const float a = kPi * (0.75f + 0.15f * static_cast<float>(k));
    const float inner = k % 5 == 0 ? 0.62f : 0.72f;
    canvas.Line(u + inner * r * std::cos(a), v + inner * r * std::sin(a),
                u + 0.82f * r * std::cos(a), v + 0.82f * r * std::sin(a), 0.05f * r,
                Srgb(0x303234));
  }
  const float a = kPi * RandomIn(0.8f, 2.2f, seed, 0);
  canvas.Line(u, v, u + 0.7f * r * std::cos(a), v + 0.7f * r * std::sin(a), 0.08f * r,
              Srgb(0xb3261e));
  canvas.Disc(u, v, 0.12f * r, Srgb(0x303234));
}

void DrawButtons(Canvas& canvas, const Box& box, int columns, int rows, uint64_t seed) {
  static const Rgb kCaps[] = {Srgb(0x2f3134), Srgb(0xa32a22), Srgb(0x2f7a3b),
                              Srgb(0xd8c34a), Srgb(0xd9d9d4), Srgb(0x2c5c94)};
  for (int k = 0; k < columns * rows; ++k) {
    const float i = static_cast<float>(k % columns), j = static_cast<float>(k / columns);
    const float w = 1 / static_cast<float>(columns), h = 1 / static_cast<float>(rows);
    const Box cell = box.Part(i * w, j * h, (i + 1) * w, (j + 1) * h);
    const float u = (cell.u0 + cell.u1) / 2, v = cell.v0 + 0.38f * cell.height();
    const float r = 0.26f * std::min(cell.width(), cell.height());
    const Rgb& cap = Pick(kCaps, seed, k);
    canvas.Disc(u, v, 1.25f * r, Srgb(0x55585a));
    canvas.Disc(u, v, r, cap);
    canvas.Disc(u - 0.3f * r, v - 0.35f * r, 0.3f * r, Mix(cap, Srgb(0xffffff), 0.4f));
    canvas.Text(cell.Part(0.15f, 0.76f, 0.9f, 0.88f), Srgb(0x26282a), Child(seed, 50 + k));
  }
}

cv::Mat3f ControlPanel(int size, uint64_t seed) {
  Canvas canvas(size, Srgb(0x9ba39f));
  for (const Box& plate : {Box{0.03f, 0.03f, 0.97f, 0.36f}, Box{0.03f, 0.39f, 0.60f, 0.97f},
                           Box{0.63f, 0.39f, 0.97f, 0.97f}}) {
    canvas.Rect(plate, Srgb(0x4d5356), 0.012f);
    canvas.Rect(plate.Shrunk(0.006f), Srgb(0xb8beb8), 0.009f);
    for (float u : {plate.u0 + 0.02f, plate.u1 - 0.02f})
      for (float v : {plate.v0 + 0.02f, plate.v1 - 0.02f})
        canvas.Disc(u, v, 0.007f, Srgb(0x3f4244));
  }
  for (int k = 0; k < 4; ++k)
    DrawGauge(canvas, 0.155f + 0.23f * static_cast<float>(k), 0.18f, 0.095f, Child(seed, k));
  for (int k = 0; k < 4; ++k) {
    const float u = 0.1f + 0.23f * static_cast<float>(k);
    canvas.Text({u, 0.305f, u + 0.12f, 0.325f}, Srgb(0x26282a), Child(seed, 10 + k));
  }
  DrawButtons(canvas, {0.06f, 0.43f, 0.57f, 0.95f}, 5, 5, Child(seed, 20));
  canvas.Rect({0.67f, 0.44f, 0.93f, 0.62f}, Srgb(0x0f2a1c), 0.008f);
  canvas.Paragraph({0.69f, 0.46f, 0.91f, 0.61f}, 5, Srgb(0x79d08a), Child(seed, 21));
  for (int k = 0; k < 6; ++k) {  // sliders
    const float u = 0.685f + 0.045f * static_cast<float>(k),
                v = RandomIn(0.69f, 0.9f, seed, 30 + k);
    canvas.Rect({u - 0.004f, 0.67f, u + 0.004f, 0.93f}, Srgb(0x2a2c2e), 0.003f);
    canvas.Rect({u - 0.015f, v, u + 0.015f, v + 0.025f}, Srgb(0x202224), 0.004f);
    canvas.Rect({u - 0.013f, v + 0.010f, u + 0.013f, v + 0.014f}, Srgb(0xe8e8e0));
  }
  return Printed(canvas, seed, 0.05f);
}

// What a pane shows: curtains half drawn, the room behind in the dark.
Rgb PaneColor(const Fractal& room, float u, float v, uint64_t seed) {
  const float fold = std::sin(110 * u + 2 * std::sin(9 * u));
  const float drawn = RandomIn(0.06f, 0.14f, seed, 1);
  const float curtain = SmoothStep(0, 0.01f, std::abs(u - 0.5f) - (0.22f - drawn) - 0.02f * v);
  const Rgb dark = Mix(Srgb(0x1d232b), Srgb(0x4c5a68), Clamp01(0.9f - v + 0.25f * room(u, v)));
  return Mix(dark, Srgb(0xb9b5a8) * (0.75f + 0.2f * fold), 0.8f * curtain);
}

cv::Mat3f WindowFacade(int size, uint64_t seed) {
  const Fractal wall(3, 6, seed), grain(90, 2, seed + 1), room(4, 4, seed + 2),
      runs(40, 1, 2, seed + 3);
  static const Rgb kWalls[] = {Srgb(0xc9b48c), Srgb(0xbfa9a0), Srgb(0xaab0a0), Srgb(0xc8c2b4)};
  const Box window{0.28f, 0.2f, 0.72f, 0.78f}, surround = window.Shrunk(-0.045f);
  const Rgb white = Srgb(0xe3e0d6), stone = Srgb(0xb9b2a4);
  Canvas canvas(size, Pick(kWalls, seed, 0));
  canvas.Rect(surround, stone);
  canvas.Frame(surround, 0.006f, stone * 0.6f);
  canvas.Rect(window, white);
  canvas.Paint(
      window.Shrunk(0.02f), [](float, float) { return -1.0f; },
      [&](float u, float v) { return PaneColor(room, u, v, seed); });
  canvas.Frame(window.Shrunk(0.02f), 0.008f, Srgb(0x6f6d66));
  for (float u : {0.488f, 0.5f - 0.128f, 0.5f + 0.112f})
    canvas.Rect({u, window.v0, u + (u == 0.488f ? 0.024f : 0.014f), window.v1}, white);
  for (float v : {0.36f, 0.57f}) canvas.Rect({window.u0, v, window.u1, v + 0.016f}, white);
  canvas.Rect({0.21f, 0.825f, 0.79f, 0.86f}, Srgb(0xcfc8ba));  // sill and its shadow
  canvas.Rect({0.22f, 0.86f, 0.78f, 0.875f}, Srgb(0x57524a));
  canvas.Rect({0.2f, 0.1f, 0.8f, 0.13f}, Srgb(0xcfc8ba));  // lintel
  canvas.Rect({0.21f, 0.13f, 0.79f, 0.142f}, Srgb(0x6d675d));
  return canvas.Finish([&](const Rgb& color, float u, float v) {
    const float run = SmoothStep(0.3f, 1.3f, runs(u, v)) * SmoothStep(0.86f, 0.9f, v) *
                      SmoothStep(1, 0.95f, v) * SmoothStep(0.3f, 0.25f, std::abs(u - 0.5f));
    return color * ((1 + 0.05f * wall(u, v) + 0.025f * grain(u, v)) * (1 - 0.35f * run));
  });
}

cv::Mat3f ShopSign(int size, uint64_t seed) {
  static const Rgb kGrounds[] = {Srgb(0x1f4d3a), Srgb(0x7d1f24), Srgb(0x22365f), Srgb(0x2b2a29),
                                 Srgb(0xd8a32e)};
  const Rgb ground = Pick(kGrounds, seed, 0);
  const Rgb letters = ground[1] > 0.2f ? Srgb(0x2a1b12) : Srgb(0xf0e2b8);
  Canvas canvas(size, ground, 4);
  canvas.Frame({0.06f, 0.06f, 3.94f, 0.94f}, 0.035f, letters);
  canvas.Ring(0.52f, 0.5f, 0.28f, 0.05f, letters);
  canvas.Disc(0.52f, 0.5f, 0.17f, Srgb(0xc9762f));
  canvas.Text({1.0f, 0.2f, 3.8f, 0.6f}, letters, Child(seed, 1), 0.99f);
  canvas.Text({1.0f, 0.7f, 3.8f, 0.82f}, letters, Child(seed, 2), 0.8f);
  return Printed(canvas, seed, 0.05f);
}

void DrawPanel(Canvas& canvas, const Box& box, const Rgb& face) {
  canvas.Rect(box, face * 0.45f);
  canvas.Rect({box.u0 + 0.008f, box.v0 + 0.008f, box.u1, box.v1}, face * 1.15f);
  canvas.Rect(box.Shrunk(0.012f), face * 0.92f);
  canvas.Rect(box.Shrunk(0.04f), face * 0.6f);
  canvas.Rect(box.Shrunk(0.046f), face * 1.04f);
}

cv::Mat3f DoorPanel(int size, uint64_t seed) {
  static const Rgb kPaints[] = {Srgb(0x8a5a34), Srgb(0x3d5a4c), Srgb(0x2f4868), Srgb(0xc9c3b4),
                                Srgb(0x7a2f28)};
  const Rgb face = Pick(kPaints, seed, 0);
  Canvas canvas(size, face, 0.5f);
  canvas.Frame(canvas.Whole(), 0.006f, face * 0.35f);
  for (const Box& row : {Box{0.055f, 0.05f, 0.445f, 0.29f}, Box{0.055f, 0.34f, 0.445f, 0.50f},
                         Box{0.055f, 0.60f, 0.445f, 0.95f}}) {
    DrawPanel(canvas, row.Part(0, 0, 0.46f, 1), face);
    DrawPanel(canvas, row.Part(0.54f, 0, 1, 1), face);
  }
  canvas.Rect({0.448f, 0.50f, 0.478f, 0.60f}, Srgb(0x8b7440), 0.004f);  // handle and lock
  canvas.Rect({0.405f, 0.528f, 0.468f, 0.538f}, Srgb(0xd3bd7c), 0.004f);
  canvas.Disc(0.463f, 0.575f, 0.005f, Srgb(0x1d1913));
  const Fractal grain(40, 4, 3, seed + 1), worn(3, 6, seed + 2);
  return canvas.Finish([&](const Rgb& color, float u, float v) {
    return color * (1 + 0.07f * grain(u, v) + 0.06f * worn(u, v));
  });
}

cv::Mat3f ShutterSlats(int size, uint64_t seed) {
  static const Rgb kPaints[] = {Srgb(0x4f6b58), Srgb(0x8b8f91), Srgb(0x5d6f86), Srgb(0x7c4a35)};
  const Rgb paint = Pick(kPaints, seed, 0);
  const Fractal worn(4, 6, seed + 1), streaks(60, 2, 3, seed + 2);
  return Shade(size, [&](float u, float v) {
    const float slat = Fraction(v * 24);
    const float round = 0.45f + 0.6f * std::sin(kPi * std::min(1.0f, slat * 1.15f));
    const float gap = SmoothStep(0.86f, 0.92f, slat);
    const float dirt = 1 + 0.08f * worn(u, v) + 0.06f * streaks(u, v);
    const float chip = SmoothStep(0.75f, 0.8f, worn(v, u));
    return Mix(Mix(paint, Srgb(0xb9b3a6), chip) * (round * dirt), Srgb(0x15171a), 0.9f * gap);
  });
}

cv::Mat3f LicensePlate(int size, uint64_t seed) {
  const Rgb ink = Srgb(0x202124);
  Canvas canvas(size, Srgb(0xe8e8e2), 4);
  canvas.Frame(canvas.Whole(), 0.04f, ink);
  canvas.Rect({0.04f, 0.04f, 0.42f, 0.96f}, Srgb(0x1e3f8f));
  for (int k = 0; k < 12; ++k) {
    const float a = 2 * kPi * static_cast<float>(k) / 12;
    canvas.Disc(0.23f + 0.12f * std::cos(a), 0.34f + 0.12f * std::sin(a), 0.02f, Srgb(0xf0c93a));
  }
  canvas.Text({0.14f, 0.68f, 0.4f, 0.84f}, Srgb(0xe8e8e2), Child(seed, 0));
  canvas.Text({0.58f, 0.22f, 1.5f, 0.78f}, ink, Child(seed, 1));
  canvas.Disc(1.62f, 0.5f, 0.09f, Srgb(0xb02f28));
  canvas.Text({1.85f, 0.22f, 3.9f, 0.78f}, ink, Child(seed, 2));
  return Printed(canvas, seed, 0.05f);
}

// Bars of random width.
void DrawBarcode(Canvas& canvas, const Box& box, uint64_t seed) {
  float u = box.u0;
  for (int k = 0; u < box.u1; ++k) {
    const float width = box.width() * RandomIn(0.008f, 0.035f, seed, k);
    if (k % 2 == 0) canvas.Rect({u, box.v0, std::min(u + width, box.u1), box.v1}, Srgb(0x1d1d1f));
    u += width;
  }
}

cv::Mat3f LabelSheet(int size, uint64_t seed) {
  const Rgb ink = Srgb(0x1f2022);
  Canvas canvas(size, Srgb(0xf0eee6));
  canvas.Frame({0.03f, 0.03f, 0.97f, 0.97f}, 0.006f, ink);
  canvas.Text({0.07f, 0.07f, 0.70f, 0.16f}, ink, Child(seed, 1), 0.95f);
  canvas.Rect({0.74f, 0.07f, 0.93f, 0.26f}, Srgb(0xd2691f));
  canvas.Line(0.785f, 0.23f, 0.835f, 0.10f, 0.016f, Srgb(0xf6f2e8));  // this way up
  canvas.Line(0.885f, 0.23f, 0.835f, 0.10f, 0.016f, Srgb(0xf6f2e8));
  canvas.Paragraph({0.07f, 0.21f, 0.68f, 0.38f}, 4, ink, Child(seed, 2));
  canvas.Line(0.03f, 0.42f, 0.97f, 0.42f, 0.005f, ink);
  DrawBarcode(canvas, {0.08f, 0.46f, 0.60f, 0.68f}, Child(seed, 3));
  canvas.Text({0.12f, 0.695f, 0.56f, 0.73f}, ink, Child(seed, 4), 0.9f);
  for (int k = 0; k < 17 * 17; ++k) {  // a matrix code
    const float u = 0.68f + 0.015f * static_cast<float>(k % 17);
    const float v = 0.46f + 0.015f * static_cast<float>(k / 17);
    if (Random(seed, k) < 0.5f) canvas.Rect({u, v, u + 0.015f, v + 0.015f}, ink);
  }
  canvas.Line(0.03f, 0.77f, 0.97f, 0.77f, 0.005f, ink);
  canvas.Text({0.07f, 0.81f, 0.93f, 0.92f}, ink, Child(seed, 5), 0.98f);
  return Printed(canvas, seed, 0.03f);
}

cv::Mat3f Calendar(int size, uint64_t seed) {
  const Rgb ink = Srgb(0x2b2c30), red = Srgb(0xb03a2e);
  Canvas canvas(size, Srgb(0xf3f0e7));
  canvas.Photo({0.04f, 0.04f, 0.96f, 0.48f}, Srgb(0x24424f), Srgb(0xf3dfb2), Child(seed, 1));
  canvas.Text({0.06f, 0.515f, 0.5f, 0.565f}, red, Child(seed, 2), 0.9f);
  const int first = static_cast<int>(Child(seed, 3) % 7),
            today = static_cast<int>(Child(seed, 4) % 28);
  for (int day = 0; day < 31; ++day) {
    const int cell = day + first;
    const float u = 0.05f + 0.13f * static_cast<float>(cell % 7);
    const float v = 0.60f + 0.064f * static_cast<float>(cell / 7);
    if (day == today) canvas.Disc(u + 0.05f, v + 0.022f, 0.033f, Srgb(0xf0c65a));
    canvas.Text({u + 0.03f, v + 0.006f, u + 0.09f, v + 0.036f}, cell % 7 == 6 ? red : ink,
                Child(seed, 100 + day), 1);
    canvas.Line(u, v + 0.055f, u + 0.12f, v + 0.055f, 0.0016f, Srgb(0xb6b2a8));
  }
  return Printed(canvas, seed, 0.02f);
}

void DrawAppWindow(Canvas& canvas, const Box& box, const Rgb& bar, const Rgb& page, uint64_t seed) {
  canvas.Rect(box, Srgb(0x1a1c20), 0.008f);
  canvas.Rect(box.Shrunk(0.002f), page, 0.007f);
  canvas.Rect({box.u0, box.v0, box.u1, box.v0 + 0.04f}, bar, 0.006f);
  canvas.Text({box.u0 + 0.02f, box.v0 + 0.012f, box.u1 - 0.1f, box.v0 + 0.028f}, Srgb(0xe6e8ea),
              seed, 0.5f);
  for (int k = 0; k < 3; ++k)
    canvas.Disc(box.u1 - 0.02f - 0.022f * static_cast<float>(k), box.v0 + 0.02f, 0.007f,
                Srgb(0xc8ccd0));
}

cv::Mat3f ScreenDesktop(int size, uint64_t seed) {
  static const Rgb kCode[] = {Srgb(0xd8dee6), Srgb(0x8fc27a), Srgb(0xe0b060), Srgb(0x7fb2e0)};
  Canvas canvas(size, Srgb(0x27405a));
  canvas.Photo(canvas.Whole(), Srgb(0x16283c), Srgb(0x6d93b0), Child(seed, 1));
  const Box editor{0.05f, 0.07f, 0.63f, 0.83f}, browser{0.48f, 0.24f, 0.96f, 0.88f};
  DrawAppWindow(canvas, editor, Srgb(0x33373f), Srgb(0x1c1f26), Child(seed, 2));
  for (int k = 0; k < 24; ++k) {
    const float v = 0.13f + 0.0285f * static_cast<float>(k),
                u = 0.08f + 0.025f * static_cast<float>(Child(seed, 40 + k) % 4);
    canvas.Text({u, v, 0.48f, v + 0.015f}, kCode[Child(seed, 80 + k) % 4], Child(seed, 120 + k),
                RandomIn(0.2f, 0.95f, seed, k));
  }
  DrawAppWindow(canvas, browser, Srgb(0x3f5f8a), Srgb(0xf0f1ee), Child(seed, 3));
  canvas.Text({0.51f, 0.31f, 0.93f, 0.345f}, Srgb(0x22262c), Child(seed, 4), 0.9f);
  canvas.Photo({0.51f, 0.37f, 0.71f, 0.56f}, Srgb(0x3b2f25), Srgb(0xe8c58d), Child(seed, 5));
  canvas.Paragraph({0.73f, 0.37f, 0.94f, 0.56f}, 7, Srgb(0x3a3e44), Child(seed, 6));
  DrawChart(canvas, {0.52f, 0.62f, 0.92f, 0.84f}, Child(seed, 7));
  canvas.Rect({0, 0.95f, 1, 1}, Srgb(0x15181d));
  for (int k = 0; k < 9; ++k) {
    static const Rgb kIcons[] = {Srgb(0xd95f4c), Srgb(0x4c9bd9), Srgb(0x63b567), Srgb(0xe0b84a)};
    const float u = 0.02f + 0.045f * static_cast<float>(k);
    canvas.Rect({u, 0.958f, u + 0.033f, 0.991f}, Pick(kIcons, seed, k), 0.006f);
  }
  return Printed(canvas, seed, 0.02f);
}

// Land, sea and relief of a map.
Rgb TerrainColor(const Fractal& height, float u, float v) {
  const float h = height(u * 0.8f, v * 0.8f);
  if (h < -0.05f) return Mix(Srgb(0x8fb9cc), Srgb(0x6796b3), Clamp01(-h));
  const float line = std::abs(Fraction(h * 9) - 0.5f);
  const Rgb land = Mix(Mix(Srgb(0xd9dcb2), Srgb(0xd3bd8a), SmoothStep(0, 0.5f, h)), Srgb(0xa5805c),
                       SmoothStep(0.45f, 1, h));
  return land * (1 - 0.25f * SmoothStep(0.09f, 0.03f, line)) * (h < -0.02f ? 0.7f : 1.0f);
}

// Winding roads across the whole map, every other one from top to bottom.
void DrawRoad(Canvas& canvas, int road, uint64_t seed) {
  const Fractal bend(4, 4, seed);
  const float a = Random(seed, 0), b = Random(seed, 1);
  const auto across = [&](float t) { return Mix(a, b, t) + 0.06f * bend(0.9f * t, 0.5f); };
  const Rgb color = road < 3 ? Srgb(0xb5432f) : Srgb(0x6b6358);
  const float width = road < 3 ? 0.006f : 0.003f;
  for (int k = 0; k < 60; ++k) {
    const float s = static_cast<float>(k) / 60, t = static_cast<float>(k + 1) / 60;
    if (road % 2 == 0)
      canvas.Line(s, across(s), t, across(t), width, color);
    else
      canvas.Line(across(s), s, across(t), t, width, color);
  }
}

void DrawLegend(Canvas& canvas, const Box& box, uint64_t seed) {
  canvas.Rect(box, Srgb(0xf0ecdf));
  canvas.Frame(box, 0.003f, Srgb(0x33302a));
  canvas.Paragraph(box.Shrunk(0.02f), 5, Srgb(0x33302a), seed);
}

cv::Mat3f Map(int size, uint64_t seed) {
  const Fractal height(3, 6, seed);
  Canvas canvas(Shade(size, [&](float u, float v) { return TerrainColor(height, u, v); }));
  for (int road = 0; road < 7; ++road) DrawRoad(canvas, road, Child(seed, road));
  for (int k = 0; k < 26; ++k) {  // towns
    const float u = RandomIn(0.05f, 0.85f, seed + 4, k), v = RandomIn(0.05f, 0.93f, seed + 5, k);
    const float h = RandomIn(0.012f, 0.022f, seed + 6, k);
    canvas.Disc(u, v, 0.35f * h, Srgb(0x9c2f24));
    canvas.Text({u + 0.6f * h, v - h / 2, u + 0.14f, v + h / 2}, Srgb(0x2b2925),
                Child(seed, 30 + k), 0.95f);
  }
  for (int k = 1; k < 6; ++k) {  // the grid
    const float at = static_cast<float>(k) / 6;
    canvas.Line(at, 0, at, 1, 0.0012f, Srgb(0x5b6b7a));
    canvas.Line(0, at, 1, at, 0.0012f, Srgb(0x5b6b7a));
  }
  DrawLegend(canvas, {0.70f, 0.78f, 0.95f, 0.95f}, Child(seed, 99));
  canvas.Frame(canvas.Whole(), 0.02f, Srgb(0xe9e4d6));
  canvas.Frame({0.02f, 0.02f, 0.98f, 0.98f}, 0.004f, Srgb(0x33302a));
  return Printed(canvas, seed, 0.03f);
}

// Ornament of a rug by (x, y) in [0, 1] from its middle to its border: the same in all four
// quarters.
Rgb RugField(float x, float y, float px) {
  const Rgb red = Srgb(0x8a2b26), blue = Srgb(0x23324f), cream = Srgb(0xdcc9a0),
            gold = Srgb(0xb98a3e);
  // A lattice of small eight-pointed stars.
  const float cu = Fraction(x * 5) - 0.5f, cv = Fraction(y * 5) - 0.5f;
  const float star =
      std::min(std::max(std::abs(cu), std::abs(cv)), 0.75f * (std::abs(cu) + std::abs(cv)));
  Rgb color = Mix(red, cream, Cover((std::abs(star - 0.22f) - 0.03f) / 5, px));
  color = Mix(color, blue, Cover((star - 0.11f) / 5, px));
  // The medallion: lobed rings round the middle.
  const float r = std::hypot(x, y), a = std::atan2(y, x);
  const float lobed = r - 0.06f * std::cos(8 * a);
  const Rgb rings[] = {gold, blue, cream, red, blue};
  const float ends[] = {0.58f, 0.55f, 0.40f, 0.36f, 0.18f};
  for (int k = 0; k < 5; ++k) color = Mix(color, rings[k], Cover(lobed - ends[k], px));
  const float petals = r - 0.13f - 0.05f * std::cos(6 * a);
  return Mix(color, cream, Cover(std::abs(petals) - 0.02f, px));
}

Rgb RugColor(float x, float y, float px) {
  const Rgb red = Srgb(0x8a2b26), blue = Srgb(0x23324f), cream = Srgb(0xdcc9a0),
            gold = Srgb(0xb98a3e);
  const float edge = 1 - std::max(x, y), along = std::min(x, y);
  if (edge < 0.03f)
    return Mix(cream, Srgb(0x8d7a58), Clamp01(4 * std::abs(Fraction(along * 60) - 0.5f) - 0.5f));
  Rgb color = RugField(x / 0.66f, y / 0.66f, px);
  // Borders from the inside out; the broad one carries diamonds.
  color = Mix(color, gold, Cover(edge - 0.34f, px));
  color = Mix(color, cream, Cover(edge - 0.325f, px));
  const float tooth = std::abs(Fraction(along * 24) - 0.5f) * 0.05f;
  color = Mix(color, red, Cover(edge - 0.285f - tooth, px));
  color = Mix(color, blue, Cover(edge - 0.27f, px));
  const float du = std::abs(Fraction(along * 7) - 0.5f) / 7, dv = std::abs(edge - 0.175f);
  color = Mix(color, gold, Cover(du + dv - 0.066f, px));
  color = Mix(color, red, Cover(du + dv - 0.05f, px));
  color = Mix(color, cream, Cover(du + dv - 0.022f, px));
  color = Mix(color, cream, Cover(edge - 0.085f, px));
  color = Mix(color, blue, Cover(edge - 0.075f, px));
  return color;
}

cv::Mat3f Rug(int size, uint64_t seed) {
  const Fractal worn(3, 6, seed), dyes(2, 40, 3, seed + 1);
  const Noise knots(160, 160, seed + 2);
  const float px = 2 / static_cast<float>(size);
  return Shade(size, [&](float u, float v) {
    const Rgb color = RugColor(std::abs(2 * u - 1), std::abs(2 * v - 1), px);
    const float pale = Clamp01(0.10f + 0.12f * worn(u, v));
    return Mix(color, Srgb(0x9c8b74), pale) * (1 + 0.08f * dyes(u, v) + 0.13f * knots(u, v));
  });
}

constexpr TextureRecipe kPictures[] = {
    {{"rug", "knotted rug with medallion and borders", false}, Rug},
    {{"painting_landscape", "framed painting of hills and trees", false}, PaintingLandscape},
    {{"painting_abstract", "framed painting of bold shapes", false}, PaintingAbstract},
    {{"poster_text", "headline, picture and columns of text", false}, PosterText},
    {{"poster_diagram", "charts and boxes with arrows", false}, PosterDiagram},
    {{"books", "three shelves of books", false}, Books},
    {{"control_panel", "gauges, buttons and sliders", false}, ControlPanel},
    {{"window_facade", "facade with one window; 3 m", true}, WindowFacade},
    {{"shop_sign", "shop sign, for a patch about 4 times as wide as high", false}, ShopSign},
    {{"door_panel", "panelled door, for a patch about twice as high as wide", false}, DoorPanel},
    {{"shutter_slats", "roller shutter; 1.5 m", true}, ShutterSlats},
    {{"license_plate", "number plate, for a patch about 4 times as wide as high", false},
     LicensePlate},
    {{"label_sheet", "shipping label with bar codes", false}, LabelSheet},
    {{"calendar", "wall calendar with a photograph", false}, Calendar},
    {{"screen_desktop", "computer screen with two windows", false}, ScreenDesktop},
    {{"map", "topographic map", false}, Map},
};

}  // namespace

std::span<const TextureRecipe> PictureRecipes() { return kPictures; }

}  // namespace sgf::synth
