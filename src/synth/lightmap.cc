#include <algorithm>
#include <cmath>
#include <numbers>

#include <sgf/core/parallel.h>
#include <sgf/synth/lightmap.h>

namespace sgf::synth::internal {

namespace {

using Eigen::Array4f;
using Eigen::Vector3f;

// Sky light and light from other surfaces are found on every so many-th texel.
constexpr int kCoarse = 4;
constexpr int kBounces = 2;

/// Cell and weights of the bilinear look-up in one direction.
struct Lerp {
  int i0, i1;
  float w;

  Lerp(float x, int size) {
    const float p = std::clamp(x * size - 0.5f, 0.0f, static_cast<float>(size - 1));
    i0 = static_cast<int>(p);
    i1 = std::min(i0 + 1, size - 1);
    w = p - i0;
  }
};

/// Grid cell of surface coordinates, and the place in it.
struct Cell {
  int corner;
  float u, v;
};

Cell CellAt(const Patch& patch, float s, float t) {
  const float x = s * patch.nu, y = t * patch.nv;
  const int i = std::clamp(static_cast<int>(x), 0, patch.nu - 1);
  const int j = std::clamp(static_cast<int>(y), 0, patch.nv - 1);
  return {j * (patch.nu + 1) + i, x - i, y - j};
}

/// Interpolates as Embree does: a quad is two triangles along the diagonal between its 2nd and 4th
/// corner.
Vector3f Interpolate(const Patch& patch, const std::vector<Vector3f>& values, const Cell& cell) {
  const int a = cell.corner, b = a + 1, d = a + patch.nu + 1, c = d + 1;
  if (cell.u + cell.v <= 1)
    return (1 - cell.u - cell.v) * values[a] + cell.u * values[b] + cell.v * values[d];
  return (cell.u + cell.v - 1) * values[c] + (1 - cell.v) * values[b] + (1 - cell.u) * values[d];
}

/// Two axes that make a right-handed frame with a unit vector (Duff et al., JCGT 2017).
void Axes(const Vector3f& n, Vector3f& x, Vector3f& y) {
  const float sign = std::copysign(1.0f, n.z());
  const float a = -1.0f / (sign + n.z());
  const float b = n.x() * n.y() * a;
  x = {1.0f + sign * n.x() * n.x() * a, sign * b, -sign * n.x()};
  y = {b, sign + n.y() * n.y() * a, -n.y()};
}

/// Texels along a side of a patch: at least two, since the only one of a small patch may lie under
/// something.
int Texels(float length, float texel) {
  return std::clamp(static_cast<int>(std::lround(length / texel)), 2, 2048);
}

}  // namespace

void LightGrid::Sample(float s, float t, int groups, GroupLight& light) const {
  const Lerp x(s, columns), y(t, rows);
  const Array4f* top = texels.data() + static_cast<size_t>(y.i0) * columns * groups;
  const Array4f* bottom = texels.data() + static_cast<size_t>(y.i1) * columns * groups;
  for (int g = 0; g < groups; ++g) {
    const Array4f a =
        top[x.i0 * groups + g] + x.w * (top[x.i1 * groups + g] - top[x.i0 * groups + g]);
    const Array4f b =
        bottom[x.i0 * groups + g] + x.w * (bottom[x.i1 * groups + g] - bottom[x.i0 * groups + g]);
    light[g] = a + y.w * (b - a);
  }
}

SurfacePoint At(const Patch& patch, float s, float t) {
  const Cell cell = CellAt(patch, s, t);
  return {Interpolate(patch, patch.points, cell),
          Interpolate(patch, patch.normals, cell).normalized()};
}

Vector3f NormalAt(const Patch& patch, float s, float t) {
  return Interpolate(patch, patch.normals, CellAt(patch, s, t));
}

Array4f SkyRadiance(const Sky& sky, const Vector3f& direction) {
  const float up = std::max(direction.z(), 0.0f);
  return Rgb(sky.horizon + std::sqrt(up) * (sky.zenith - sky.horizon));
}

BakedLight::BakedLight(const Scene& scene, const RayScene& rays, const RenderOptions& options)
    : scene_(scene), rays_(rays), options_(options) {
  const std::vector<std::string> names = scene.LightGroups();
  const auto index = [&](const std::string& group) {
    return static_cast<int>(std::find(names.begin(), names.end(), group) - names.begin());
  };
  groups_ = static_cast<int>(names.size());
  for (const AreaLight& lamp : scene.lights) lamp_groups_.push_back(index(lamp.group));
  if (scene.sky) sky_group_ = index(scene.sky->group);
  MakeGrids();
  BakeDirect();
  const std::vector<LightGrid> direct = grids_;
  for (int bounce = 0; bounce < kBounces; ++bounce) {
    const std::vector<LightGrid> gathered = Gather();
    grids_ = direct;
    AddBounce(gathered);
  }
}

void BakedLight::MakeGrids() {
  double area = 0;
  for (const Surface& surface : rays_.surfaces())
    if (surface.patch) area += double{surface.patch->length_s_m} * surface.patch->length_t_m;
  const auto texel = static_cast<float>(std::sqrt(area / options_.light_texels));
  for (const Surface& surface : rays_.surfaces()) {
    LightGrid grid;
    if (surface.patch) {
      grid.columns = Texels(surface.patch->length_s_m, texel);
      grid.rows = Texels(surface.patch->length_t_m, texel);
      grid.texels.resize(static_cast<size_t>(grid.columns) * grid.rows * groups_, Array4f::Zero());
    }
    grids_.push_back(std::move(grid));
  }
}

void BakedLight::ForEachRow(const std::vector<LightGrid>& grids,
                            const std::function<void(int surface, int row)>& body) const {
  std::vector<std::pair<int, int>> rows;
  for (size_t surface = 0; surface < grids.size(); ++surface)
    for (int row = 0; row < grids[surface].rows; ++row)
      rows.emplace_back(static_cast<int>(surface), row);
  ParallelFor(static_cast<int>(rows.size()), options_.threads,
              [&](int i) { body(rows[i].first, rows[i].second); });
}

void BakedLight::BakeDirect() {
  ForEachRow(grids_, [&](int surface, int row) {
    LightGrid& grid = grids_[surface];
    const float t = (row + 0.5f) / grid.rows;
    for (int column = 0; column < grid.columns; ++column) {
      const float s = (column + 0.5f) / grid.columns;
      const SurfacePoint at = At(*rays_.surfaces()[surface].patch, s, t);
      Array4f* texel = &grid.texels[(static_cast<size_t>(row) * grid.columns + column) * groups_];
      GroupLight lit{};
      for (int g = 0; g < groups_; ++g) lit[g].setZero();
      std::array<float, kMaxGroups> unshadowed{};
      for (size_t k = 0; k < scene_.lights.size(); ++k) {
        const Array4f light = Lamp(scene_.lights[k], at.point + kLift * at.normal, at.normal);
        const float brightness = scene_.lights[k].radiance.sum();
        unshadowed[lamp_groups_[k]] += light[3] * brightness;
        texel[lamp_groups_[k]] += light;
        lit[lamp_groups_[k]][3] += light.head<3>().sum();
      }
      for (int g = 0; g < groups_; ++g)
        texel[g][3] = unshadowed[g] > 0 ? lit[g][3] / unshadowed[g] : 0.0f;
    }
  });
}

// Most points are fully lit or fully in shadow: a coarse pattern on the lamp tells, and the fine
// one is for penumbrae only.
Array4f BakedLight::Lamp(const AreaLight& lamp, const Vector3f& point,
                         const Vector3f& normal) const {
  const int side = std::max(2, static_cast<int>(std::lround(std::sqrt(options_.light_samples))));
  LampShare share = ShareOf(lamp, point, normal, (side + 1) / 2);
  if (share.open > 0 && share.open < share.all) share = ShareOf(lamp, point, normal, side);
  Array4f light = Rgb(lamp.radiance) * share.open;
  light[3] = share.all;
  return light;
}

BakedLight::LampShare BakedLight::ShareOf(const AreaLight& lamp, const Vector3f& point,
                                          const Vector3f& normal, int side) const {
  const Vector3f area = lamp.edge_s.cross(lamp.edge_t);
  LampShare share;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const Vector3f q =
          lamp.corner + (i + 0.5f) / side * lamp.edge_s + (j + 0.5f) / side * lamp.edge_t;
      const Vector3f d = q - point;
      const float d2 = d.squaredNorm();
      const float form = std::max(0.0f, d.dot(normal)) * std::max(0.0f, -d.dot(area)) / (d2 * d2);
      if (!(form > 0)) continue;
      share.all += form;
      if (!rays_.Blocked(point, q)) share.open += form;
    }
  const float scale = std::numbers::inv_pi_v<float> / static_cast<float>(side * side);
  return {share.open * scale, share.all * scale};
}

std::vector<LightGrid> BakedLight::Gather() const {
  std::vector<LightGrid> coarse = grids_;
  for (LightGrid& grid : coarse) {
    if (grid.rows == 0) continue;
    grid.columns = (grid.columns + kCoarse - 1) / kCoarse;
    grid.rows = (grid.rows + kCoarse - 1) / kCoarse;
    grid.texels.assign(static_cast<size_t>(grid.columns) * grid.rows * groups_, Array4f::Zero());
  }
  ForEachRow(coarse, [&](int surface, int row) {
    LightGrid& grid = coarse[surface];
    for (int column = 0; column < grid.columns; ++column)
      GatherAt(surface, (column + 0.5f) / grid.columns, (row + 0.5f) / grid.rows,
               &grid.texels[(static_cast<size_t>(row) * grid.columns + column) * groups_]);
  });
  return coarse;
}

// Cosine-weighted directions on a stratified square, mapped to the disc and lifted (Malley).
void BakedLight::GatherAt(int surface, float s, float t, Array4f* light) const {
  const SurfacePoint at = At(*rays_.surfaces()[surface].patch, s, t);
  Vector3f x, y;
  Axes(at.normal, x, y);
  const int side = std::max(2, static_cast<int>(std::lround(std::sqrt(options_.bounce_samples))));
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const float r2 = (i + 0.5f) / side;
      // Rows are turned against one another, so that directions do not line up.
      const float angle = 2 * std::numbers::pi_v<float> * (j + (i % 2 ? 0.25f : 0.75f)) / side;
      const float r = std::sqrt(r2);
      AddArriving(at.point + kLift * at.normal,
                  r * std::cos(angle) * x + r * std::sin(angle) * y + std::sqrt(1 - r2) * at.normal,
                  light);
    }
  for (int g = 0; g < groups_; ++g) light[g] /= static_cast<float>(side * side);
}

void BakedLight::AddArriving(const Vector3f& origin, const Vector3f& direction,
                             Array4f* light) const {
  const Hit hit = rays_.Intersect({origin, direction});
  if (hit.surface < 0) {
    if (sky_group_ >= 0) light[sky_group_] += SkyRadiance(*scene_.sky, direction);
    return;
  }
  const Surface& surface = rays_.surfaces()[hit.surface];
  // Lamps are counted as direct light; the back of a surface is the dark inside of a solid.
  if (!surface.patch || NormalAt(*surface.patch, hit.s, hit.t).dot(direction) >= 0) return;
  const Material& material = *surface.material;
  Array4f albedo = Rgb(material.tint);
  if (material.texture >= 0) albedo *= scene_.textures[material.texture].mean();
  GroupLight there;
  grids_[hit.surface].Sample(hit.s, hit.t, groups_, there);
  for (int g = 0; g < groups_; ++g) light[g] += albedo * there[g];
}

void BakedLight::AddBounce(const std::vector<LightGrid>& gathered) {
  ForEachRow(grids_, [&](int surface, int row) {
    LightGrid& grid = grids_[surface];
    for (int column = 0; column < grid.columns; ++column) {
      GroupLight light;
      gathered[surface].Sample((column + 0.5f) / grid.columns, (row + 0.5f) / grid.rows, groups_,
                               light);
      for (int g = 0; g < groups_; ++g)
        grid.texels[(static_cast<size_t>(row) * grid.columns + column) * groups_ + g].head<3>() +=
            light[g].head<3>();
    }
  });
}

}  // namespace sgf::synth::internal
