#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include <gtest/gtest.h>

#include <sgf/core/error.h>
#include <sgf/synth/patch.h>

namespace sgf::synth {
namespace {

using Eigen::Vector3f;

constexpr double kPi = std::numbers::pi;

using Key = std::array<float, 3>;
Key KeyOf(const Vector3f& p) { return {p.x() + 0.0f, p.y() + 0.0f, p.z() + 0.0f}; }  // -0 is 0

// Calls visit(a, b, c) for the two triangles of every quad, counter-clockwise seen from outside.
template <class V>
void ForEachTriangle(const Patch& patch, V&& visit) {
  const auto at = [&](int i, int j) -> size_t { return j * (patch.nu + 1) + i; };
  for (int j = 0; j < patch.nv; ++j)
    for (int i = 0; i < patch.nu; ++i) {
      visit(at(i, j), at(i + 1, j), at(i + 1, j + 1));
      visit(at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
}

// Volume by the divergence theorem.
double Volume(const Patches& patches) {
  double sum = 0;
  for (const Patch& patch : patches)
    ForEachTriangle(patch, [&](size_t a, size_t b, size_t c) {
      const auto p = [&](size_t k) -> Eigen::Vector3d { return patch.points[k].cast<double>(); };
      sum += p(a).dot(p(b).cross(p(c))) / 6;
    });
  return sum;
}

// Number of directed edges without their opposite, which is 0 for a closed, consistently oriented
// surface. Edges that have shrunk to a point do not count, nor do quads flattened to a line.
int OpenEdges(const Patches& patches) {
  std::map<std::pair<Key, Key>, int> count;
  for (const Patch& patch : patches)
    ForEachTriangle(patch, [&](size_t a, size_t b, size_t c) {
      const std::array<Key, 3> keys = {KeyOf(patch.points[a]), KeyOf(patch.points[b]),
                                       KeyOf(patch.points[c])};
      for (int k = 0; k < 3; ++k) {
        const Key &from = keys[k], &to = keys[(k + 1) % 3];
        if (from == to) continue;
        ++count[{from, to}];
        --count[{to, from}];
      }
    });
  int open = 0;
  for (const auto& [edge, n] : count) open += n > 0;
  return open;
}

void ExpectSoundPatches(const Patches& patches) {
  for (const Patch& patch : patches) {
    const size_t size = static_cast<size_t>(patch.nu + 1) * (patch.nv + 1);
    ASSERT_EQ(patch.points.size(), size);
    ASSERT_EQ(patch.normals.size(), size);
    EXPECT_GT(patch.length_s_m, 0);
    EXPECT_GT(patch.length_t_m, 0);
    for (const Vector3f& normal : patch.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5);
    ForEachTriangle(patch, [&](size_t a, size_t b, size_t c) {
      const Vector3f face =
          (patch.points[b] - patch.points[a]).cross(patch.points[c] - patch.points[a]);
      if (face.norm() < 1e-9f) return;
      // Within 45 degrees: the two disagree by the curvature of one quad only.
      for (size_t k : {a, b, c}) EXPECT_GT(face.normalized().dot(patch.normals[k]), 0.7);
    });
  }
}

// Half a ring between radii 0.5 and 1.
std::vector<Eigen::Vector2f> ArchProfile() {
  std::vector<Eigen::Vector2f> profile;
  const auto add = [&](float radius, int k) {
    profile.emplace_back(radius * std::cos(static_cast<float>(kPi) * k / 24),
                         radius * std::sin(static_cast<float>(kPi) * k / 24));
  };
  for (int k = 0; k <= 24; ++k) add(1, k);
  for (int k = 24; k >= 0; --k) add(0.5f, k);
  return profile;
}

struct Solid {
  const char* name;
  Patches patches;
  double volume;     // m^3
  double tolerance;  // relative: what the tessellation cuts off
};

std::vector<Solid> ClosedSolids() {
  // Minkowski sum of a box of 0.8 x 0.6 x 0.4 and a ball of radius 0.1.
  const double rounded = 0.8 * 0.6 * 0.4 + 2 * 0.1 * (0.8 * 0.6 + 0.6 * 0.4 + 0.8 * 0.4) +
                         kPi * 0.01 * (0.8 + 0.6 + 0.4) + 4 * kPi / 3 * 0.001;
  return {
      {"box", Box(0.3f, 0.7f, 1.1f), 0.3 * 0.7 * 1.1, 1e-6},
      {"rounded box", RoundedBox(1, 0.8f, 0.6f, 0.1f), rounded, 0.005},
      {"cylinder", Cylinder(0.3f, 2), kPi * 0.09 * 2, 0.01},
      {"thick cylinder", Cylinder(1.3f, 2), kPi * 1.69 * 2, 0.003},
      {"truncated cone", Cone(0.5f, 0.2f, 0.9f), kPi * 0.9 / 3 * (0.25 + 0.1 + 0.04), 0.01},
      {"cone", Cone(0.5f, 0, 0.9f), kPi * 0.9 / 3 * 0.25, 0.01},
      {"sphere", Sphere(0.4f), 4 * kPi / 3 * 0.064, 0.02},
      {"turned can", Lathe({{0, 0}, {0.3f, 0}, {0.3f, 1}, {0, 1}}), kPi * 0.09, 0.01},
      {"gable", Extrude({{-1, 0}, {1, 0}, {1, 1}, {0.3f, 1.7f}, {-1, 1}}, 0.5f), 0.5 * 2.7, 1e-5},
      {"arch", Extrude(ArchProfile(), 0.5f), 0.5 * kPi / 2 * (1 - 0.25), 0.01},
      {"hard cushion", Cushion(0.8f, 0.6f, 0.2f, 0), 0.8 * 0.6 * 0.2, 0.08},
  };
}

TEST(Patch, OpenSurfacesAreSound) {
  ExpectSoundPatches(Quad({1, 2, 3}, {2, 0, 0}, {0, 0, 1}));
  ExpectSoundPatches(Tube({{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 2, 1.5f}, {1, 3, 1.75f}}, 0.1f));
  ExpectSoundPatches(Curtain(2, 2.5f, 9, 0.1f));
  ExpectSoundPatches(Cushion(0.5f, 0.5f, 0.15f, 0.06f));
  ExpectSoundPatches(
      Lathe({{0, 0}, {0.1f, 0}, {0.2f, 0.2f}, {0.15f, 0.4f}, {0.05f, 0.5f}, {0.08f, 0.6f}}));
}

TEST(Patch, RefusesBadPolygons) {
  EXPECT_THROW(Extrude({{0, 0}, {1, 0}}, 1), Error);
  EXPECT_THROW(Extrude({{0, 0}, {0, 1}, {1, 1}, {1, 0}}, 1), Error);                  // clockwise
  EXPECT_THROW(Extrude({{0, 0}, {2, 0}, {2, 3}, {0, 3}, {1, 2}, {1, 1}}, 1), Error);  // a notch
}

TEST(Patch, SolidsAreClosedAndOfTheRightVolume) {
  for (const Solid& solid : ClosedSolids()) {
    SCOPED_TRACE(solid.name);
    ExpectSoundPatches(solid.patches);
    EXPECT_EQ(OpenEdges(solid.patches), 0);
    EXPECT_NEAR(Volume(solid.patches) / solid.volume, 1, solid.tolerance);
  }
}

TEST(Patch, NormalsOfRoundSolidsAreExact) {
  const Patches sphere = Sphere(0.4f);
  for (size_t k = 0; k < sphere[0].points.size(); ++k)
    EXPECT_LT((sphere[0].normals[k] - sphere[0].points[k] / 0.4f).norm(), 1e-5f);
  for (const Patch& patch : Tube({{0, 0, 0}, {0, 0, 2}}, 0.1f))
    for (size_t k = 0; k < patch.points.size(); ++k) {
      const Vector3f outwards(patch.points[k].x(), patch.points[k].y(), 0);
      EXPECT_LT((patch.normals[k] - outwards / 0.1f).norm(), 1e-5f);
    }
}

TEST(Patch, LengthsAreThoseOfTheGridLines) {
  const Patches quad = Quad({1, 2, 3}, {2, 0, 0}, {0, 0, 0.5f});
  EXPECT_FLOAT_EQ(quad[0].length_s_m, 2);
  EXPECT_FLOAT_EQ(quad[0].length_t_m, 0.5f);
  const Patches cylinder = Cylinder(0.5f, 3);
  EXPECT_NEAR(cylinder[0].length_s_m, kPi, 0.01);
  EXPECT_FLOAT_EQ(cylinder[0].length_t_m, 3);
  EXPECT_NEAR(Disc(0.5f)[0].length_s_m, 0.9, 0.15);  // between a chord near the border and 1
}

// A cylinder closed by sin and cos alone, and a sphere with poles.
TEST(Patch, MakePatchFindsSmoothNormalsAtSeamsAndPoles) {
  const auto angle = [](float s) { return 2 * static_cast<float>(kPi) * s; };
  const Patch cylinder = MakePatch(
      24, 2, [&](float s, float t) { return Vector3f(std::cos(angle(s)), std::sin(angle(s)), t); });
  for (size_t k = 0; k < cylinder.points.size(); ++k) {
    const Vector3f outwards(cylinder.points[k].x(), cylinder.points[k].y(), 0);
    EXPECT_LT((cylinder.normals[k] - outwards).norm(), 1e-5f);
  }
  for (int j = 0; j <= 2; ++j) EXPECT_EQ(cylinder.points[j * 25], cylinder.points[j * 25 + 24]);
  const Patch sphere = MakePatch(32, 16, [&](float s, float t) {
    const float latitude = angle(t) / 2 - angle(0.25f);
    return Vector3f(std::cos(angle(s)) * std::cos(latitude),
                    std::sin(angle(s)) * std::cos(latitude), std::sin(latitude));
  });
  for (size_t k = 0; k < sphere.points.size(); ++k)
    EXPECT_LT((sphere.normals[k] - sphere.points[k]).norm(), 0.02f);
}

TEST(Patch, MakePatchFollowsACurvedSheetUpToItsBorder) {
  const Patch sheet = MakePatch(
      20, 20, [](float s, float t) { return Vector3f(s, t, 0.3f * s * s - 0.2f * s * t); });
  for (const size_t k : {0, 20, 220, 420, 440}) {
    const float s = sheet.points[k].x(), t = sheet.points[k].y();
    const Vector3f expected = Vector3f(-0.6f * s + 0.2f * t, 0.2f * s, 1).normalized();
    EXPECT_LT((sheet.normals[k] - expected).norm(), 2e-3f) << k;
  }
}

TEST(Patch, SolidsStandOnTheFloor) {
  const Patches all[] = {Box(1, 2, 3), RoundedBox(1, 2, 3, 0.2f), Cylinder(1, 3), Cone(1, 0.5f, 3),
                         Cushion(1, 2, 3, 0)};
  for (const Patches& patches : all) {
    float lowest = 10, highest = -10;
    for (const Patch& patch : patches)
      for (const Vector3f& p : patch.points) {
        lowest = std::min(lowest, p.z());
        highest = std::max(highest, p.z());
      }
    EXPECT_NEAR(lowest, 0, 1e-6);
    EXPECT_NEAR(highest, 3, 1e-6);
  }
}

TEST(Patch, UprightFacesOfABoxHaveTUpwards) {
  for (const Patch& face : Box(1, 2, 3)) {
    if (std::abs(face.normals[0].z()) > 0.5f) continue;
    EXPECT_EQ(face.points[2] - face.points[0], Vector3f(0, 0, 3));
    EXPECT_FLOAT_EQ(face.length_t_m, 3);
  }
}

TEST(Patch, CushionBulgesAndCurtainFaces) {
  float highest = 0;
  for (const Patch& face : Cushion(1, 1, 0.2f, 0.05f))
    for (const Vector3f& p : face.points) {
      highest = std::max(highest, p.z());
      EXPECT_GE(p.z(), 0);
    }
  EXPECT_NEAR(highest, 0.25, 1e-3);
  const Patches curtain = Curtain(2, 2.5f, 9, 0.1f);
  Vector3f mean = Vector3f::Zero();
  for (const Vector3f& normal : curtain[0].normals) mean += normal;
  EXPECT_LT(mean.normalized().y(), -0.99f);
}

TEST(Patch, ShadingOfACushionRunsOnFromFaceToFace) {
  std::map<Key, Vector3f> normals;
  for (const Patch& face : Cushion(0.5f, 0.4f, 0.15f, 0.05f))
    for (size_t k = 0; k < face.points.size(); ++k) {
      const auto [entry, added] = normals.emplace(KeyOf(face.points[k]), face.normals[k]);
      EXPECT_LT((entry->second - face.normals[k]).norm(), 1e-6f);
    }
}

TEST(Patch, TransformedKeepsNormalsUprightOnTheSurface) {
  Eigen::Affine3f T = Eigen::Translation3f(1, 2, 3) *
                      Eigen::AngleAxisf(0.7f, Vector3f(1, 2, 0.5f).normalized()) *
                      Eigen::Scaling(2.0f, 1.0f, 0.5f);
  const Patches moved = Transformed(Sphere(0.4f), T);
  ExpectSoundPatches(moved);
  EXPECT_NEAR(Volume(moved), Volume(Sphere(0.4f)), 1e-4);
  const Patches box = Transformed(Box(1, 1, 1), Eigen::Affine3f(Eigen::Scaling(2.0f, 3.0f, 4.0f)));
  for (const Patch& face : box)
    EXPECT_FLOAT_EQ(
        face.length_s_m * face.length_t_m * std::abs(face.normals[0].dot(Vector3f(2, 3, 4))), 24);
  EXPECT_THROW(Transformed(Box(1, 1, 1), Eigen::Affine3f(Eigen::Scaling(-1.0f, 1.0f, 1.0f))),
               Error);
  EXPECT_THROW(Transformed(Box(1, 1, 1), Eigen::Affine3f(Eigen::Scaling(1.0f, 1.0f, 0.0f))), Error);
}

TEST(Patch, PlusJoins) { EXPECT_EQ((Box(1, 1, 1) + Sphere(1)).size(), 7u); }

}  // namespace
}  // namespace sgf::synth
