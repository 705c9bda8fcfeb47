#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/core/parallel.h>
#include <sgf/core/random.h>
#include <sgf/synth/arithmetic.h>
#include <sgf/synth/texture.h>

/// What the procedural textures are made of: noise that repeats, colours, and a canvas with
/// anti-aliased shapes. Image coordinates (u, v) are in [0, 1]: u to the right, v downwards.
namespace sgf::synth {

using Rgb = cv::Vec3f;  ///< linear red, green, blue

/// The linear colour of an sRGB code 0xRRGGBB.
Rgb Srgb(uint32_t code);

inline Rgb Mix(const Rgb& a, const Rgb& b, float t) { return a + (b - a) * t; }
inline float Mix(float a, float b, float t) { return a + (b - a) * t; }
inline float Clamp01(float x) { return std::clamp(x, 0.0f, 1.0f); }

/// 0 below a, 1 above b, smooth between.
inline float SmoothStep(float a, float b, float x) {
  const float t = Clamp01((x - a) / (b - a));
  return t * t * (3 - 2 * t);
}

inline float Fraction(float x) { return x - static_cast<float>(Floor(x)); }

/// Non-negative remainder.
inline int Wrap(int i, int n) { return (i % n + n) % n; }

/// The same for i in [-n, 2 n), without a division.
inline int WrapOnce(int i, int n) { return i < 0 ? i + n : i < n ? i : i - n; }

/// Uniform in (0, 1): the value of cell (i, j).
inline float Random(uint64_t seed, int i, int j = 0) {
  const auto index = static_cast<uint64_t>(static_cast<uint32_t>(j)) << 32;
  return static_cast<float>(Uniform01(seed, index | static_cast<uint32_t>(i)));
}

/// Random in [a, b].
inline float RandomIn(float a, float b, uint64_t seed, int i, int j = 0) {
  return Mix(a, b, Random(seed, i, j));
}

/// One of several, at random.
template <size_t N>
const Rgb& Pick(const Rgb (&choices)[N], uint64_t seed, int i, int j = 0) {
  return choices[Hash64(Hash64(seed, static_cast<uint64_t>(i)), static_cast<uint64_t>(j)) % N];
}

/// Gradient noise (Perlin, "An image synthesizer", SIGGRAPH 1985) with period 1 in u and v, of
/// about [-1, 1]; cells_u x cells_v lattice cells in a period.
class Noise {
 public:
  Noise(int cells_u, int cells_v, uint64_t seed);

  float operator()(float u, float v) const {
    const float x = Fraction(u) * static_cast<float>(nu_);
    const float y = Fraction(v) * static_cast<float>(nv_);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j);
    const int x0 = WrapOnce(i, nu_), y0 = WrapOnce(j, nv_);
    const int x1 = WrapOnce(i + 1, nu_), y1 = WrapOnce(j + 1, nv_);
    const float top = Mix(Dot(x0, y0, fx, fy), Dot(x1, y0, fx - 1, fy), Fade(fx));
    const float bottom = Mix(Dot(x0, y1, fx, fy - 1), Dot(x1, y1, fx - 1, fy - 1), Fade(fx));
    return 1.6f * Mix(top, bottom, Fade(fy));
  }

 private:
  static float Fade(float t) { return t * t * t * (t * (6 * t - 15) + 10); }
  float Dot(int i, int j, float x, float y) const {
    const Eigen::Vector2f& g = gradients_[static_cast<size_t>(j) * nu_ + i];
    return g.x() * x + g.y() * y;
  }

  int nu_, nv_;
  std::vector<Eigen::Vector2f> gradients_;
};

/// Octaves of noise, each of twice the frequency and `gain` times the amplitude; about [-1, 1].
class Fractal {
 public:
  Fractal(int cells_u, int cells_v, int octaves, uint64_t seed, float gain = 0.5f);
  Fractal(int cells, int octaves, uint64_t seed) : Fractal(cells, cells, octaves, seed) {}

  float operator()(float u, float v) const {
    float sum = 0, amplitude = scale_;
    for (const Noise& octave : octaves_) {
      sum += amplitude * octave(u, v);
      amplitude *= gain_;
    }
    return sum;
  }

 private:
  float gain_, scale_;
  std::vector<Noise> octaves_;
};

/// Cells about randomly placed points with period 1 (Worley, "A cellular texture basis function",
/// SIGGRAPH 1996).
class Cells {
 public:
  struct Hit {
    float nearest, second;  ///< distances in cell sides
    float du, dv;           ///< from the nearest point, in cell sides
    int id;                 ///< of the nearest point, in [0, cells^2)
  };

  /// @param jitter 0 for a regular grid, 1 for points anywhere in their cell.
  Cells(int cells, uint64_t seed, float jitter = 1);

  Hit operator()(float u, float v) const;

 private:
  int n_;
  std::vector<Eigen::Vector2f> points_;  // in [0, 1]^2 of their cell
};

/// The image with f(u, v) in every texel, clamped to [0, 1].
template <class F>
cv::Mat3f Shade(int size, F&& f) {
  cv::Mat3f image(size, size);
  const float px = 1.0f / static_cast<float>(size);
  ParallelFor(size, 0, [&](int y) {
    for (int x = 0; x < size; ++x) {
      const Rgb color = f((static_cast<float>(x) + 0.5f) * px, (static_cast<float>(y) + 0.5f) * px);
      image(y, x) = Rgb(Clamp01(color[0]), Clamp01(color[1]), Clamp01(color[2]));
    }
  });
  return image;
}

/// Coverage of a texel by a shape: `distance` to its border, negative inside, and the texel's side.
inline float Cover(float distance, float px) { return Clamp01(0.5f - distance / px); }

/// Signed distance from (u, v) to a rectangle with rounded corners.
inline float RectDistance(float u, float v, float u0, float v0, float u1, float v1, float r = 0) {
  const float x = std::abs(u - (u0 + u1) / 2) - (u1 - u0) / 2 + r;
  const float y = std::abs(v - (v0 + v1) / 2) - (v1 - v0) / 2 + r;
  return std::hypot(std::max(x, 0.0f), std::max(y, 0.0f)) + std::min(std::max(x, y), 0.0f) - r;
}

/// Distance from (u, v) to the segment a-b.
float SegmentDistance(float u, float v, float ua, float va, float ub, float vb);

/// An image to draw on. Shapes may hang over its borders.
class Canvas {
 public:
  struct Box {
    float u0, v0, u1, v1;

    float width() const { return u1 - u0; }
    float height() const { return v1 - v0; }
    Box Shrunk(float by) const { return {u0 + by, v0 + by, u1 - by, v1 - by}; }
    /// The part between fractions of its width and height.
    Box Part(float a, float b, float c, float d) const {
      return {Mix(u0, u1, a), Mix(v0, v1, b), Mix(u0, u1, c), Mix(v0, v1, d)};
    }
  };

  /// @param aspect width over height of the patch the picture is made for: u runs from 0 to
  /// `aspect`,
  ///               so that circles stay round there.
  Canvas(int size, const Rgb& background, float aspect = 1)
      : image_(size, size, background), aspect_(aspect) {}

  /// Goes on with a picture for a square patch.
  explicit Canvas(cv::Mat3f image) : image_(std::move(image)) {}

  Box Whole() const { return {0, 0, aspect_, 1}; }

  /// Mixes color(u, v) into the box wherever distance(u, v) is negative.
  template <class D, class C>
  void Paint(const Box& box, D&& distance, C&& color) {
    const float du = aspect_ / static_cast<float>(image_.cols);
    const float dv = 1 / static_cast<float>(image_.rows);
    const auto first = [&](float x, float step) { return std::max(Floor(x / step) - 1, 0); };
    const auto last = [&](float x, float step) {
      return std::min(Floor(x / step) + 2, image_.cols);
    };
    for (int y = first(box.v0, dv); y < last(box.v1, dv); ++y)
      for (int x = first(box.u0, du); x < last(box.u1, du); ++x) {
        const float u = (static_cast<float>(x) + 0.5f) * du,
                    v = (static_cast<float>(y) + 0.5f) * dv;
        const float cover = Cover(distance(u, v), std::max(du, dv));
        if (cover > 0) image_(y, x) = Mix(image_(y, x), color(u, v), cover);
      }
  }

  void Rect(const Box& box, const Rgb& color, float radius = 0);
  void Frame(const Box& box, float width, const Rgb& color);
  void Disc(float u, float v, float radius, const Rgb& color);
  void Ring(float u, float v, float radius, float width, const Rgb& color);
  void Line(float ua, float va, float ub, float vb, float width, const Rgb& color);

  /// One line of glyph-like marks from the left of the box, as high as the box; about `fill` of its
  /// width is used.
  void Text(const Box& box, const Rgb& color, uint64_t seed, float fill = 1);
  /// Lines of text from top to bottom.
  void Paragraph(const Box& box, int lines, const Rgb& color, uint64_t seed);
  /// A photograph seen from afar: soft areas of light and dark in the given colours.
  void Photo(const Box& box, const Rgb& dark, const Rgb& light, uint64_t seed);

  /// The picture with f(color, u, v) in every texel, clamped to [0, 1]; u and v in [0, 1].
  template <class F>
  cv::Mat3f Finish(F&& f) const {
    return Shade(image_.cols, [&](float u, float v) {
      const float n = static_cast<float>(image_.cols);
      return f(image_(static_cast<int>(v * n), static_cast<int>(u * n)), u, v);
    });
  }

 private:
  void Glyph(const Box& box, const Rgb& color, uint64_t seed);

  cv::Mat3f image_;
  float aspect_ = 1;
};

/// How a texture is made, from a seed that is a hash already.
struct TextureRecipe {
  TextureInfo info;
  cv::Mat3f (*make)(int size_px, uint64_t seed);
};

/// Surfaces that repeat without a seam, and pictures for one patch.
std::span<const TextureRecipe> SurfaceRecipes();
std::span<const TextureRecipe> PictureRecipes();

}  // namespace sgf::synth
