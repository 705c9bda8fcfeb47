#include <array>
#include <limits>
#include <numbers>

#include <sgf/synth/texture_painter.h>

namespace sgf::synth {

namespace {

// Linear value of every sRGB byte (IEC 61966-2-1).
std::array<float, 256> LinearValues() {
  std::array<float, 256> table;
  for (int k = 0; k < 256; ++k) {
    const float c = static_cast<float>(k) / 255;
    table[k] = c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);
  }
  return table;
}

}  // namespace

Rgb Srgb(uint32_t code) {
  static const std::array<float, 256> kLinear = LinearValues();
  return {kLinear[code >> 16 & 255], kLinear[code >> 8 & 255], kLinear[code & 255]};
}

Noise::Noise(int cells_u, int cells_v, uint64_t seed) : nu_(cells_u), nv_(cells_v) {
  for (int k = 0; k < nu_ * nv_; ++k) {
    const float angle = 2 * std::numbers::pi_v<float> * Random(seed, k);
    gradients_.emplace_back(std::cos(angle), std::sin(angle));
  }
}

Fractal::Fractal(int cells_u, int cells_v, int octaves, uint64_t seed, float gain) : gain_(gain) {
  float power = 0, amplitude = 1;
  for (int k = 0; k < octaves; ++k) {
    octaves_.emplace_back(cells_u << k, cells_v << k, Hash64(seed, static_cast<uint64_t>(k)));
    power += amplitude * amplitude;
    amplitude *= gain;
  }
  scale_ = 1 / std::sqrt(power);
}

Cells::Cells(int cells, uint64_t seed, float jitter) : n_(cells) {
  for (int k = 0; k < n_ * n_; ++k)
    points_.emplace_back(0.5f + jitter * (Random(seed, k, 0) - 0.5f),
                         0.5f + jitter * (Random(seed, k, 1) - 0.5f));
}

Cells::Hit Cells::operator()(float u, float v) const {
  const float x = Fraction(u) * static_cast<float>(n_), y = Fraction(v) * static_cast<float>(n_);
  const int cx = static_cast<int>(x), cy = static_cast<int>(y);
  constexpr float kFar = std::numeric_limits<float>::max();
  Hit hit{kFar, kFar, 0, 0, 0};
  for (int j = cy - 1; j <= cy + 1; ++j)
    for (int i = cx - 1; i <= cx + 1; ++i) {
      const int id = WrapOnce(j, n_) * n_ + WrapOnce(i, n_);
      const float du = x - static_cast<float>(i) - points_[id].x();
      const float dv = y - static_cast<float>(j) - points_[id].y();
      const float squared = du * du + dv * dv;
      if (squared < hit.nearest)
        hit = {squared, hit.nearest, du, dv, id};
      else
        hit.second = std::min(hit.second, squared);
    }
  hit.nearest = std::sqrt(hit.nearest);
  hit.second = std::sqrt(hit.second);
  return hit;
}

float SegmentDistance(float u, float v, float ua, float va, float ub, float vb) {
  const Eigen::Vector2f d(ub - ua, vb - va), p(u - ua, v - va);
  return (p - Clamp01(p.dot(d) / std::max(d.squaredNorm(), 1e-12f)) * d).norm();
}

void Canvas::Rect(const Box& box, const Rgb& color, float radius) {
  Paint(
      box,
      [&](float u, float v) { return RectDistance(u, v, box.u0, box.v0, box.u1, box.v1, radius); },
      [&](float, float) { return color; });
}

void Canvas::Frame(const Box& box, float width, const Rgb& color) {
  Rect({box.u0, box.v0, box.u1, box.v0 + width}, color);
  Rect({box.u0, box.v1 - width, box.u1, box.v1}, color);
  Rect({box.u0, box.v0, box.u0 + width, box.v1}, color);
  Rect({box.u1 - width, box.v0, box.u1, box.v1}, color);
}

void Canvas::Disc(float u, float v, float radius, const Rgb& color) {
  Paint(
      {u - radius, v - radius, u + radius, v + radius},
      [=](float x, float y) { return std::hypot(x - u, y - v) - radius; },
      [&](float, float) { return color; });
}

void Canvas::Ring(float u, float v, float radius, float width, const Rgb& color) {
  const float r = radius + width;
  Paint(
      {u - r, v - r, u + r, v + r},
      [=](float x, float y) { return std::abs(std::hypot(x - u, y - v) - radius) - width / 2; },
      [&](float, float) { return color; });
}

void Canvas::Line(float ua, float va, float ub, float vb, float width, const Rgb& color) {
  const Box box{std::min(ua, ub) - width, std::min(va, vb) - width, std::max(ua, ub) + width,
                std::max(va, vb) + width};
  Paint(
      box, [=](float u, float v) { return SegmentDistance(u, v, ua, va, ub, vb) - width / 2; },
      [&](float, float) { return color; });
}

void Canvas::Glyph(const Box& box, const Rgb& color, uint64_t seed) {
  // Two to four strokes between the points of a 2 x 3 grid, a stem most of the time.
  const float width = std::max(0.16f * box.height(), 0.7f / static_cast<float>(image_.rows));
  const auto u = [&](uint64_t k) { return Mix(box.u0, box.u1, static_cast<float>(k % 2)); };
  const auto v = [&](uint64_t k) { return Mix(box.v0, box.v1, 0.5f * static_cast<float>(k % 3)); };
  if (Hash64(seed, 0) % 4 != 0) Line(u(0), box.v0, u(0), box.v1, width, color);
  const int strokes = 2 + static_cast<int>(Hash64(seed, 1) % 2);
  for (int k = 0; k < strokes; ++k) {
    const uint64_t h = Hash64(seed, 2 + static_cast<uint64_t>(k));
    const uint64_t from = h >> 8, to = h >> 16;
    // Straight across or slanting, never the stem again.
    Line(u(0), v(from), u(1), v(k == 0 ? from : to), width, color);
  }
}

void Canvas::Text(const Box& box, const Rgb& color, uint64_t seed, float fill) {
  const float height = box.height(), advance = 0.72f * height;
  const float end = Mix(box.u0, box.u1, fill);
  float u = box.u0;
  for (int word = 0; u < end; ++word) {
    const int letters = 2 + static_cast<int>(Hash64(seed, static_cast<uint64_t>(word)) % 7);
    for (int k = 0; k < letters && u + advance < end; ++k) {
      const uint64_t glyph = Hash64(seed, 1000 + 16 * static_cast<uint64_t>(word) + k) % 26;
      Glyph({u, box.v0, u + 0.45f * height, box.v1}, color, glyph);
      u += advance;
    }
    u += 0.6f * height;
  }
}

void Canvas::Paragraph(const Box& box, int lines, const Rgb& color, uint64_t seed) {
  const float pitch = box.height() / static_cast<float>(lines);
  for (int k = 0; k < lines; ++k) {
    const float v = box.v0 + pitch * static_cast<float>(k);
    const float fill = k + 1 == lines ? 0.5f : RandomIn(0.85f, 1, seed, k);
    Text({box.u0, v, box.u1, v + 0.55f * pitch}, color, Hash64(seed, static_cast<uint64_t>(k)),
         fill);
  }
}

void Canvas::Photo(const Box& box, const Rgb& dark, const Rgb& light, uint64_t seed) {
  const Fractal ridge(2, 5, seed), detail(14, 4, seed + 1), clouds(3, 4, seed + 2);
  Paint(
      box, [&](float u, float v) { return RectDistance(u, v, box.u0, box.v0, box.u1, box.v1); },
      [&](float u, float v) {
        const float x = (u - box.u0) / box.width(), y = (v - box.v0) / box.height();
        float tone = 0.95f - 0.35f * y + 0.08f * clouds(x, y);
        for (int k = 0; k < 3; ++k) {
          const float layer = static_cast<float>(k);
          const float top = 0.45f + 0.17f * layer - 0.16f * ridge(0.8f * x, 0.2f + 0.3f * layer);
          const float land = 0.6f - 0.22f * layer + 0.1f * detail(x, y + 0.2f * layer);
          tone = Mix(tone, land, SmoothStep(0, 0.012f, y - top));
        }
        return Mix(dark, light, Clamp01(tone));
      });
}

}  // namespace sgf::synth
