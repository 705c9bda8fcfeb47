#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/synth/patch.h>
#include <sgf/synth/tangent.h>

namespace sgf::synth {
namespace {

using Eigen::Vector3f;
using Points = std::vector<Vector3f>;

size_t Index(const Patch& patch, int i, int j) {
  return static_cast<size_t>(j) * (patch.nu + 1) + i;
}

// Polyline length of the grid line from (i, j) with `count` steps of `stride` in the point list.
float LineLength(const Points& points, size_t start, size_t stride, int count) {
  float length = 0;
  for (int k = 0; k < count; ++k)
    length += (points[start + (k + 1) * stride] - points[start + k * stride]).norm();
  return length;
}

// Points first..last of a grid line that are the same but for rounding are made the same, so that
// surfaces closed by sin and cos have no gap. Returns whether the two borders of the grid are one.
bool CloseSeam(Points& points, size_t end_offset, size_t stride, int count, float tolerance) {
  for (int k = 0; k <= count; ++k)
    if ((points[k * stride + end_offset] - points[k * stride]).norm() > tolerance) return false;
  for (int k = 0; k <= count; ++k) points[k * stride + end_offset] = points[k * stride];
  return true;
}

Vector3f Normal(const Patch& patch, int i, int j, bool closed_s, bool closed_t) {
  const auto along_s = [&](int k) { return patch.points[Index(patch, k, j)]; };
  const auto along_t = [&](int k) { return patch.points[Index(patch, i, k)]; };
  const Vector3f ds = TangentAt(along_s, i, patch.nu, closed_s);
  const Vector3f dt = TangentAt(along_t, j, patch.nv, closed_t);
  const Vector3f normal = ds.cross(dt);
  // Where the grid collapses to a point or both lines run the same way there is no normal yet.
  return normal.norm() > 1e-4f * ds.norm() * dt.norm() ? normal.normalized() : Vector3f::Zero();
}

// A border of the grid: its first point, the step along it, its number of quads, the step inwards.
struct Border {
  size_t start, stride;
  int count;
  ptrdiff_t inwards;
};

std::array<Border, 4> Borders(int nu, int nv) {
  const size_t row = nu + 1;
  const auto step = static_cast<ptrdiff_t>(row);
  return {{{0, 1, nu, step}, {row * nv, 1, nu, -step}, {0, row, nv, 1}, {row - 1, row, nv, -1}}};
}

// Makes a border that has shrunk to a point but for rounding shrink to it exactly.
void ClosePole(Points& points, const Border& border, float tolerance) {
  for (int k = 1; k <= border.count; ++k)
    if ((points[border.start + k * border.stride] - points[border.start]).norm() > tolerance)
      return;
  for (int k = 1; k <= border.count; ++k)
    points[border.start + k * border.stride] = points[border.start];
}

Vector3f Mean(const Points& vectors) {
  Vector3f sum = Vector3f::Zero();
  for (const Vector3f& v : vectors) sum += v;
  return sum.isZero() ? Vector3f::UnitZ() : sum.normalized();
}

// Gives a pole the mean normal of the grid line about it, and other points without a normal
// (corners where both grid lines run the same way) the mean of the patch.
void FillMissingNormals(Patch& patch) {
  for (const Border& border : Borders(patch.nu, patch.nv)) {
    Points around, own;
    for (int k = 0; k <= border.count; ++k) {
      const size_t index = border.start + k * border.stride;
      own.push_back(patch.normals[index]);
      around.push_back(patch.normals[index + border.inwards]);
    }
    if (std::any_of(own.begin(), own.end(), [](const Vector3f& n) { return !n.isZero(); }))
      continue;
    for (int k = 0; k <= border.count; ++k)
      patch.normals[border.start + k * border.stride] = Mean(around);
  }
  const Vector3f mean = Mean(patch.normals);
  for (Vector3f& normal : patch.normals)
    if (normal.isZero()) normal = mean;
}

}  // namespace

void ComputeLengths(Patch& patch) {
  const size_t row = patch.nu + 1;
  patch.length_s_m = patch.length_t_m = 0;
  for (int j = 0; j <= patch.nv; ++j)
    patch.length_s_m += LineLength(patch.points, j * row, 1, patch.nu) / (patch.nv + 1);
  for (int i = 0; i <= patch.nu; ++i)
    patch.length_t_m += LineLength(patch.points, i, row, patch.nv) / (patch.nu + 1);
}

Patch PatchFromPoints(int nu, int nv, std::vector<Eigen::Vector3f> points) {
  Patch patch{nu, nv, std::move(points), {}};
  ComputeLengths(patch);
  const float tolerance = 1e-5f * (patch.length_s_m + patch.length_t_m);
  for (const Border& border : Borders(nu, nv)) ClosePole(patch.points, border, tolerance);
  const size_t row = nu + 1;
  // A line that has shrunk to a point begins and ends there without being closed; the neighbours
  // count.
  const bool closed_s =
      patch.length_s_m > 10 * tolerance && CloseSeam(patch.points, nu, row, nv, tolerance);
  const bool closed_t =
      patch.length_t_m > 10 * tolerance && CloseSeam(patch.points, nv * row, 1, nu, tolerance);
  for (int j = 0; j <= nv; ++j)
    for (int i = 0; i <= nu; ++i) patch.normals.push_back(Normal(patch, i, j, closed_s, closed_t));
  FillMissingNormals(patch);
  return patch;
}

Patches Transformed(Patches patches, const Eigen::Affine3f& T) {
  const Eigen::Matrix3f M = T.linear();
  if (!(M.determinant() > 0))
    throw Error("transform",
                fmt::format("must not mirror or flatten, its determinant is {}", M.determinant()));
  const Eigen::Matrix3f normal_map = M.inverse().transpose();
  for (Patch& patch : patches) {
    for (Vector3f& point : patch.points) point = T * point;
    for (Vector3f& normal : patch.normals) normal = (normal_map * normal).normalized();
    ComputeLengths(patch);
  }
  return patches;
}

Patches operator+(Patches a, const Patches& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace sgf::synth
