// The solids of patch.h.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/synth/arithmetic.h>
#include <sgf/synth/patch.h>
#include <sgf/synth/tangent.h>

namespace sgf::synth {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;
using Points = std::vector<Vector3f>;

constexpr int kCornerSegments = 4;  // quads round a quarter of a rounded edge
// Profiles that turn by more than 41 degrees have an edge there.
constexpr float kSharpCosine = 0.75f;

// The patch through p(i, j) with normals n(i, j), for surfaces that know their own.
template <class P, class N>
Patch MakeGrid(int nu, int nv, P&& p, N&& n) {
  Patch patch{nu, nv, {}, {}};
  for (int j = 0; j <= nv; ++j)
    for (int i = 0; i <= nu; ++i) {
      patch.points.push_back(p(i, j));
      patch.normals.push_back(Vector3f(n(i, j)).normalized());
    }
  ComputeLengths(patch);
  return patch;
}

// The bilinear patch between four corners; `p10` is the one at s = 1, t = 0.
Patch Bilinear(const Vector3f& p00, const Vector3f& p10, const Vector3f& p01, const Vector3f& p11) {
  return PatchFromPoints(1, 1, {p00, p10, p01, p11});
}

// Unit circle at k / count turns. The same bits wherever solids share a circle, closed exactly.
Vector2f Circle(int k, int count) {
  const float angle = 2 * kPi * static_cast<float>((k % count + count) % count) / count;
  return {std::cos(angle), std::sin(angle)};
}

// Quads round a circle; a multiple of 8, because discs split it into four sides of a square grid.
int Segments(float radius) { return radius < 0.05f ? 16 : radius < 0.6f ? 32 : 64; }

Vector3f OnCircle(int k, int count, float radius, float z) {
  const Vector2f c = Circle(k, count);
  return {radius * c.x(), radius * c.y(), z};
}

// Index on the circle of border point (i, j) of a square grid with n quads a side.
int CircleIndex(int i, int j, int n) {
  const int start = -n / 2;  // corner (0, 0) lies at -135 degrees = -n/2 - n steps of 90/n degrees
  if (j == 0) return start - n + i;
  if (i == n) return start + j;
  if (j == n) return start + n + (n - i);
  return start + 2 * n + (n - j);
}

// Flat disc at height z that faces up or down: a square grid bent smoothly into a circle, so that
// textures and baked light are nowhere squeezed into a pole.
Patch DiscPatch(float radius, float z, int segments, bool up) {
  const int n = segments / 4;
  const auto point = [&](int i, int j) {
    if (!up) i = n - i;
    if (i == 0 || j == 0 || i == n || j == n)
      return OnCircle(CircleIndex(i, j, n), segments, radius, z);
    const float a = kPi / 4 * (2.0f * i / n - 1), b = kPi / 4 * (2.0f * j / n - 1);
    const float scale = radius * std::numbers::sqrt2_v<float>;
    return Vector3f(scale * std::sin(a) * std::cos(b), scale * std::sin(b) * std::cos(a), z);
  };
  return MakeGrid(n, n, point, [&](int, int) { return Vector3f(0, 0, up ? 1 : -1); });
}

// The side of a truncated cone between two circles.
Patch ConeSide(const Vector2f& bottom, const Vector2f& top, int segments) {
  const auto point = [&](int i, int j) {
    const Vector2f& end = j == 0 ? bottom : top;
    return OnCircle(i, segments, end.x(), end.y());
  };
  const Vector2f rise = top - bottom;
  return MakeGrid(segments, 1, point,
                  [&](int i, int) { return OnCircle(i, segments, rise.y(), -rise.x()); });
}

// Cosine of k / kCornerSegments quarter turns, exact at the ends and symmetric with CornerSin, so
// that faces, edges and corners of a rounded box meet in the same bits.
float CornerCos(int k) {
  if (k == 0) return 1;
  if (k == kCornerSegments) return 0;
  return std::cos(kPi / 2 * static_cast<float>(k) / kCornerSegments);
}
float CornerSin(int k) { return CornerCos(kCornerSegments - k); }

// The corner of a box in the octant of `sign`, and its rounding.
struct RoundedCorner {
  Vector3f half, sign;
  float radius;

  Vector3f Direction(const Vector3f& d) const { return sign.cwiseProduct(d); }
  Vector3f Point(const Vector3f& d) const {
    const Vector3f center = half - Vector3f::Constant(radius);
    return sign.cwiseProduct(center + radius * d) + Vector3f(0, 0, half.z());
  }
  bool Mirrored() const { return sign.prod() < 0; }
};

Patch CornerPatch(const RoundedCorner& corner) {
  const int n = kCornerSegments;
  const auto direction = [&](int i, int j) {
    const int k = corner.Mirrored() ? n - i : i;
    return Vector3f(CornerCos(k) * CornerCos(j), CornerSin(k) * CornerCos(j), CornerSin(j));
  };
  return MakeGrid(
      n, n, [&](int i, int j) { return corner.Point(direction(i, j)); },
      [&](int i, int j) { return corner.Direction(direction(i, j)); });
}

// The rounded edge along `axis` between the corners whose other signs are a (axis + 1), b (axis +
// 2).
Patch EdgePatch(const Vector3f& half, float radius, int axis, float a, float b) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto corner = [&](int j) {
    Vector3f sign;
    sign[axis] = j == 0 ? -1 : 1;
    sign[u] = a;
    sign[v] = b;
    return RoundedCorner{half, sign, radius};
  };
  const auto direction = [&](int i) {
    const int k = a * b < 0 ? kCornerSegments - i : i;
    Vector3f d = Vector3f::Zero();
    d[u] = CornerCos(k);
    d[v] = CornerSin(k);
    return d;
  };
  return MakeGrid(
      kCornerSegments, 1, [&](int i, int j) { return corner(j).Point(direction(i)); },
      [&](int i, int j) { return corner(j).Direction(direction(i)); });
}

// The two directions along the faces across `axis`: s, and t, which points up on upright faces.
// Returns whether s x t points along the positive axis.
bool FaceAxes(int axis, int& u, int& v) {
  u = axis == 0 ? 1 : 0;
  v = axis == 2 ? 1 : 2;
  return axis != 1;
}

// The flat face at the `side` (+1 or -1) of `axis`.
Patch FacePatch(const Vector3f& half, float radius, int axis, float side) {
  int u, v;
  const bool forwards = FaceAxes(axis, u, v) == (side > 0);
  const auto point = [&](int i, int j) {
    Vector3f sign;
    sign[axis] = side;
    sign[u] = (i == 1) == forwards ? 1 : -1;
    sign[v] = j == 1 ? 1 : -1;
    return RoundedCorner{half, sign, radius}.Point(Vector3f::Unit(axis));
  };
  return MakeGrid(1, 1, point, [&](int, int) { return Vector3f(side * Vector3f::Unit(axis)); });
}

// Cubic through the points of a profile with tangents from their neighbours, in steps of about
// equal length; straight where there are two points only.
std::vector<Vector2f> SmoothProfile(const std::vector<Vector2f>& run) {
  if (run.size() == 2) return run;
  const int n = static_cast<int>(run.size());
  const auto tangent = [&](int k) -> Vector2f {
    const Vector2f step = run[std::min(k + 1, n - 1)] - run[std::max(k - 1, 0)];
    return step.normalized();
  };
  float total = 0;
  for (int k = 0; k + 1 < n; ++k) total += (run[k + 1] - run[k]).norm();
  const float step = total / static_cast<float>(4 * (n - 1));
  std::vector<Vector2f> result{run.front()};
  for (int k = 0; k + 1 < n; ++k) {
    const float length = (run[k + 1] - run[k]).norm();
    const Vector2f m0 = length * tangent(k), m1 = length * tangent(k + 1);
    const int parts = std::max(1, static_cast<int>(std::lround(length / step)));
    for (int i = 1; i < parts; ++i) {
      const float x = static_cast<float>(i) / parts, y = 1 - x;
      result.push_back(y * y * (1 + 2 * x) * run[k] + x * x * (1 + 2 * y) * run[k + 1] +
                       x * y * (y * m0 - x * m1));
    }
    result.push_back(run[k + 1]);
  }
  return result;
}

// A profile cut at its sharp corners.
std::vector<std::vector<Vector2f>> SplitAtCorners(const std::vector<Vector2f>& profile) {
  std::vector<std::vector<Vector2f>> runs;
  for (size_t k = 0; k + 1 < profile.size(); ++k) {
    const Vector2f step = (profile[k + 1] - profile[k]).normalized();
    const bool smooth =
        k > 0 && step.dot((profile[k] - profile[k - 1]).normalized()) > kSharpCosine;
    if (!smooth) runs.push_back({profile[k]});
    runs.back().push_back(profile[k + 1]);
  }
  return runs;
}

// The polygon with further points wherever a line of constant x through one of its points cuts it.
// Lengths are rounded to 10 um, so that points meant to lie above each other do.
std::vector<Vector2f> CutAtColumns(std::vector<Vector2f> polygon) {
  for (Vector2f& point : polygon) point = (point * 1e5f).array().round() / 1e5f;
  std::set<float> columns;
  for (const Vector2f& point : polygon) columns.insert(point.x());
  std::vector<Vector2f> result;
  for (size_t k = 0; k < polygon.size(); ++k) {
    const Vector2f &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    std::vector<Vector2f> cuts;
    for (float x : columns)
      if ((a.x() < x && x < b.x()) || (b.x() < x && x < a.x()))
        cuts.emplace_back(x, a.y() + (b.y() - a.y()) * (x - a.x()) / (b.x() - a.x()));
    if (b.x() < a.x()) std::reverse(cuts.begin(), cuts.end());
    result.push_back(a);
    result.insert(result.end(), cuts.begin(), cuts.end());
  }
  return result;
}

// The part of a polygon between two neighbouring columns: its lower and its upper edge, left to
// right.
struct Slab {
  std::vector<Vector2f> lower, upper;
};

std::vector<Slab> Slabs(const std::vector<Vector2f>& outline) {
  std::map<float, Slab> slabs;  // by the left column
  for (size_t k = 0; k < outline.size(); ++k) {
    const Vector2f &a = outline[k], &b = outline[(k + 1) % outline.size()];
    if (a.x() == b.x()) continue;
    Slab& slab = slabs[std::min(a.x(), b.x())];
    std::vector<Vector2f>& edge = a.x() < b.x() ? slab.lower : slab.upper;
    if (!edge.empty()) throw Error("polygon", fmt::format("is cut twice at x = {}", a.x()));
    edge = a.x() < b.x() ? std::vector{a, b} : std::vector{b, a};
  }
  std::vector<Slab> result;
  for (auto& [x, slab] : slabs) {
    if (slab.lower[0].y() + slab.lower[1].y() > slab.upper[0].y() + slab.upper[1].y())
      throw Error("polygon", fmt::format("must be counter-clockwise, is not at x = {}", x));
    result.push_back(std::move(slab));
  }
  return result;
}

// One smooth run of a prism's wall, from the back to the front.
Patch WallRun(const std::vector<Vector2f>& run, float depth) {
  Points points;
  for (float y : {depth / 2, -depth / 2})
    for (const Vector2f& p : run) points.emplace_back(p.x(), y, p.y());
  return PatchFromPoints(static_cast<int>(run.size()) - 1, 1, std::move(points));
}

// One smooth run of a lathe profile, with normals across its own tangents.
Patch RevolvedRun(const std::vector<Vector2f>& run, int segments) {
  const int nv = static_cast<int>(run.size()) - 1;
  const auto point = [&](int i, int j) { return OnCircle(i, segments, run[j].x(), run[j].y()); };
  const auto normal = [&](int i, int j) {
    const auto at = [&](int k) { return Vector3f(run[k].x(), run[k].y(), 0); };
    const Vector3f tangent = TangentAt(at, j, nv, false);
    return OnCircle(i, segments, tangent.y(), -tangent.x());
  };
  return MakeGrid(segments, nv, point, normal);
}

// A bend or a straight piece of a pipe's centre line; every piece starts where the last one ends.
using CentreLine = std::vector<Vector3f>;

// The arc that rounds off the corner of a polyline.
CentreLine Bend(const Vector3f& before, const Vector3f& corner, const Vector3f& after,
                float radius) {
  const Vector3f in = (corner - before).normalized(), out = (after - corner).normalized();
  const float angle = std::acos(std::clamp(in.dot(out), -1.0f, 1.0f));
  const float room = 0.45f * std::min((corner - before).norm(), (after - corner).norm());
  const float tangent = std::tan(std::min(angle, 0.95f * kPi) / 2);
  const float bend = std::min(radius, room / tangent);
  const Vector3f start = corner - bend * tangent * in;
  const Vector3f inwards = (out - in.dot(out) * in).normalized();
  const int steps = std::max(2, static_cast<int>(std::ceil(angle / (kPi / 16))));
  CentreLine arc;
  for (int k = 0; k <= steps; ++k) {
    const float phi = angle * static_cast<float>(k) / steps;
    arc.push_back(start + bend * (std::sin(phi) * in + (1 - std::cos(phi)) * inwards));
  }
  return arc;
}

bool IsStraight(const Vector3f& a, const Vector3f& b, const Vector3f& c) {
  return (b - a).normalized().dot((c - b).normalized()) > 0.9999f;
}

std::vector<CentreLine> RoundedPath(const Points& path, float bend_radius) {
  std::vector<CentreLine> pieces;
  Vector3f last = path.front();
  for (size_t k = 1; k + 1 < path.size(); ++k) {
    if (IsStraight(path[k - 1], path[k], path[k + 1])) continue;
    const CentreLine arc = Bend(path[k - 1], path[k], path[k + 1], bend_radius);
    pieces.push_back({last, arc.front()});
    pieces.push_back(arc);
    last = arc.back();
  }
  pieces.push_back({last, path.back()});
  return pieces;
}

// Two directions across a pipe, carried along it with as little turning as possible.
struct CrossSection {
  Vector3f x, y;

  explicit CrossSection(const Vector3f& along) {
    x = along.unitOrthogonal();
    y = along.cross(x).normalized();
  }
  void Follow(const Vector3f& along) {
    x = (x - along.dot(x) * along).normalized();
    y = along.cross(x).normalized();
  }
  Vector3f Direction(int k, int segments) const {
    const Vector2f c = Circle(k, segments);
    return c.x() * x + c.y() * y;
  }
};

Vector3f Tangent(const CentreLine& line, size_t k) {
  const auto at = [&](int i) { return line[i]; };
  return TangentAt(at, static_cast<int>(k), static_cast<int>(line.size()) - 1, false).normalized();
}

// One piece of pipe; `section` is the cross-section where it starts and afterwards where it ends.
Patch PipePiece(const CentreLine& line, float radius, int segments, CrossSection& section) {
  std::vector<CrossSection> sections;
  for (size_t k = 0; k < line.size(); ++k) {
    // The joint keeps the bits of the piece before.
    if (k > 0) section.Follow(Tangent(line, k));
    sections.push_back(section);
  }
  return MakeGrid(
      segments, static_cast<int>(line.size()) - 1,
      [&](int i, int j) -> Vector3f {
        return line[j] + radius * sections[j].Direction(i, segments);
      },
      [&](int i, int j) { return sections[j].Direction(i, segments); });
}

// A soft box: half sizes, edge radius and how far the middles of its faces stand out.
struct SoftBox {
  Vector3f half;
  float edge, puff;

  // Point of the soft surface for a point q of the sharp box around the origin on face (axis,
  // side).
  Vector3f Point(const Vector3f& q, int axis, float side) const {
    const Vector3f inner = half - Vector3f::Constant(edge);
    const Vector3f core = q.cwiseMax(-inner).cwiseMin(inner);
    Vector3f p = core + edge * (q - core).normalized();
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto arch = [&](int k) { return 1 - (q[k] / half[k]) * (q[k] / half[k]); };
    const bool lies_on_it = axis == 2 && side < 0;
    if (!lies_on_it) p[axis] += side * puff * arch(u) * arch(v);
    return p + Vector3f(0, 0, half.z());
  }

  int Quads(int axis) const {
    return std::clamp(static_cast<int>(std::lround(4 * half[axis] / edge)), 8, 40);
  }

  Patch Face(int axis, float side) const {
    int u, v;
    const bool forwards = FaceAxes(axis, u, v) == (side > 0);
    const int nu = Quads(u), nv = Quads(v);
    Points points;
    for (int j = 0; j <= nv; ++j)
      for (int i = 0; i <= nu; ++i) {
        const int k = forwards ? i : nu - i;
        Vector3f q;
        q[axis] = side * half[axis];
        q[u] = half[u] * (2.0f * k / nu - 1);
        q[v] = half[v] * (2.0f * j / nv - 1);
        points.push_back(Point(q, axis, side));
      }
    return PatchFromPoints(nu, nv, std::move(points));
  }
};

// Makes the shading run on smoothly from patch to patch: one normal for every shared point.
void ShareNormals(Patches& patches) {
  std::map<std::array<float, 3>, Vector3f> sums;
  const auto key = [](const Vector3f& p) { return std::array<float, 3>{p.x(), p.y(), p.z()}; };
  for (const Patch& patch : patches)
    for (size_t k = 0; k < patch.points.size(); ++k)
      sums.try_emplace(key(patch.points[k]), Vector3f::Zero()).first->second += patch.normals[k];
  for (Patch& patch : patches)
    for (size_t k = 0; k < patch.points.size(); ++k)
      patch.normals[k] = sums.at(key(patch.points[k])).normalized();
}

}  // namespace

Patches Quad(const Eigen::Vector3f& corner, const Eigen::Vector3f& edge_s,
             const Eigen::Vector3f& edge_t) {
  return {Bilinear(corner, corner + edge_s, corner + edge_t, corner + edge_s + edge_t)};
}

Patches Box(float x, float y, float z) {
  const Vector3f half(x / 2, y / 2, z / 2);
  Patches faces;
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) faces.push_back(FacePatch(half, 0, axis, side));
  return faces;
}

Patches RoundedBox(float x, float y, float z, float radius) {
  const Vector3f half(x / 2, y / 2, z / 2);
  radius = std::min(radius, 0.999f * half.minCoeff());
  Patches patches;
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) patches.push_back(FacePatch(half, radius, axis, side));
  for (int axis = 0; axis < 3; ++axis)
    for (float a : {-1.0f, 1.0f})
      for (float b : {-1.0f, 1.0f}) patches.push_back(EdgePatch(half, radius, axis, a, b));
  for (float a : {-1.0f, 1.0f})
    for (float b : {-1.0f, 1.0f})
      for (float c : {-1.0f, 1.0f})
        patches.push_back(CornerPatch({half, Vector3f(a, b, c), radius}));
  return patches;
}

Patches Cylinder(float radius, float height) { return Cone(radius, radius, height); }

Patches Cone(float bottom_radius, float top_radius, float height) {
  const int segments = Segments(std::max(bottom_radius, top_radius));
  Patches patches{ConeSide({bottom_radius, 0}, {top_radius, height}, segments)};
  if (bottom_radius > 0) patches.push_back(DiscPatch(bottom_radius, 0, segments, false));
  if (top_radius > 0) patches.push_back(DiscPatch(top_radius, height, segments, true));
  return patches;
}

Patches Sphere(float radius) {
  const int nu = 32, nv = 16;
  const auto direction = [&](int i, int j) -> Vector3f {
    if (j == 0 || j == nv) return Vector3f(0, 0, j == 0 ? -1 : 1);
    const float latitude = kPi * (static_cast<float>(j) / nv - 0.5f);
    return OnCircle(i, nu, std::cos(latitude), std::sin(latitude));
  };
  return {MakeGrid(
      nu, nv, [&](int i, int j) -> Vector3f { return radius * direction(i, j); }, direction)};
}

Patches Disc(float radius) { return {DiscPatch(radius, 0, Segments(radius), true)}; }

Patches Extrude(const std::vector<Eigen::Vector2f>& polygon, float depth) {
  if (polygon.size() < 3)
    throw Error("polygon", fmt::format("needs three points at least, has {}", polygon.size()));
  std::vector<Vector2f> outline = CutAtColumns(polygon);
  Patches patches;
  for (const auto& [lower, upper] : Slabs(outline)) {
    const auto at = [](const Vector2f& p, float y) { return Vector3f(p.x(), y, p.y()); };
    const float y = depth / 2;
    patches.push_back(
        Bilinear(at(lower[0], -y), at(lower[1], -y), at(upper[0], -y), at(upper[1], -y)));
    patches.push_back(Bilinear(at(lower[1], y), at(lower[0], y), at(upper[1], y), at(upper[0], y)));
  }
  outline.push_back(outline.front());
  for (const std::vector<Vector2f>& run : SplitAtCorners(outline))
    patches.push_back(WallRun(run, depth));
  return patches;
}

Patches Lathe(const std::vector<Eigen::Vector2f>& profile) {
  float largest = 0;
  for (const Vector2f& point : profile) largest = std::max(largest, point.x());
  const int segments = Segments(largest);
  Patches patches;
  for (const std::vector<Vector2f>& run : SplitAtCorners(profile)) {
    const bool flat = run.size() == 2 && run[0].y() == run[1].y();
    if (flat && run[0].x() == 0)
      patches.push_back(DiscPatch(run[1].x(), run[1].y(), segments, false));
    else if (flat && run[1].x() == 0)
      patches.push_back(DiscPatch(run[0].x(), run[0].y(), segments, true));
    else
      patches.push_back(RevolvedRun(SmoothProfile(run), segments));
  }
  return patches;
}

Patches Tube(const std::vector<Eigen::Vector3f>& path, float radius) {
  const int segments = radius < 0.02f ? 12 : radius < 0.2f ? 24 : 40;
  CrossSection section((path[1] - path[0]).normalized());
  Patches patches;
  for (const CentreLine& line : RoundedPath(path, 3 * radius))
    patches.push_back(PipePiece(line, radius, segments, section));
  return patches;
}

Patches Cushion(float x, float y, float z, float puff) {
  const SoftBox box{Vector3f(x / 2, y / 2, z / 2), 0.3f * std::min({x, y, z}), puff};
  Patches patches;
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) patches.push_back(box.Face(axis, side));
  ShareNormals(patches);
  return patches;
}

Patches Curtain(float x, float z, int folds, float depth) {
  // The folds are of unequal depth, lean a little, and open towards the hem.
  const auto sheet = [=](float s, float t) -> Vector3f {
    const float phase = 2 * kPi * static_cast<float>(folds) * s;
    const float fold = std::sin(phase + 0.4f * std::sin(0.37f * phase + 2 * t));
    const float unequal = 0.75f + 0.25f * std::sin(0.61f * phase + 1);
    return {(s - 0.5f) * x, depth / 2 * unequal * fold * (1 - 0.4f * t), t * z};
  };
  return {MakePatch(12 * folds, 12, sheet)};
}

}  // namespace sgf::synth
