#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/core/random.h>
#include <sgf/synth/surface_finder.h>

namespace sgf::synth {
namespace {

using Eigen::Vector3d;

/// A cube of side 2 m on the floor, as an object, and a lamp 5 m above it.
Scene CubeUnderALamp() {
  Scene scene;
  scene.name = "cube";
  scene.Add("cube", Box(2, 2, 2), Material{});
  scene.lights.push_back(
      {.group = "lamp", .corner = {-0.5f, -0.5f, 7}, .edge_s = {0, 1, 0}, .edge_t = {1, 0, 0}});
  return scene;
}

TEST(SurfaceFinder, FindsFacesEdgesAndCorners) {
  const SurfaceFinder finder(CubeUnderALamp());
  const struct {
    Vector3d point, place;
    double offset_m;
  } cases[] = {{{0.3, 0.2, 2.5}, {0.3, 0.2, 2}, 0.5},     // over a face
               {{0.3, 0.2, 1.75}, {0.3, 0.2, 2}, -0.25},  // under it, within the solid
               {{4, 0.7, -4}, {1, 0.7, 0}, 5},            // off an edge
               {{-1 - 2, 1 + 3, -6}, {-1, 1, 0}, 7}};     // off a corner
  for (const auto& [point, place, offset_m] : cases) {
    const NearestSurface found = finder.Nearest(point);
    EXPECT_LT((found.place - place).norm(), 1e-6) << found.place.transpose();
    EXPECT_NEAR(found.offset_m, offset_m, 1e-6);
    EXPECT_EQ(found.object, 1);
  }
}

TEST(SurfaceFinder, CountsLampsAsSurfacesOfNoObject) {
  const NearestSurface found = SurfaceFinder(CubeUnderALamp()).Nearest({0.1, 0.1, 6});
  EXPECT_NEAR(std::abs(found.offset_m), 1, 1e-6);
  EXPECT_EQ(found.object, 0);
}

// Against all points of a fine grid over the patches of round things.
TEST(SurfaceFinder, FindsNothingFartherThanTheNearestPointOfAGrid) {
  Scene scene;
  scene.name = "round";
  scene.Add("sphere", Sphere(0.9f), Material{});
  scene.Add("cushion",
            Transformed(Cushion(1, 1, 0.3f, 0.05f), Eigen::Affine3f(Eigen::Translation3f(0, 3, 0))),
            Material{});
  const SurfaceFinder finder(scene);
  for (uint64_t k = 0; k < 200; ++k) {
    const Vector3d point(2 * Gaussian(1, 3 * k), 2 * Gaussian(1, 3 * k + 1),
                         Gaussian(1, 3 * k + 2));
    double nearest = std::numeric_limits<double>::infinity();
    for (const Object& object : scene.objects)
      for (const Patch& patch : object.parts[0].patches)
        for (const Eigen::Vector3f& p : patch.points)
          nearest = std::min(nearest, (p.cast<double>() - point).norm());
    const NearestSurface found = finder.Nearest(point);
    const double distance = std::abs(found.offset_m);
    ASSERT_LT(distance, nearest + 1e-5);
    ASSERT_GT(distance, nearest - 0.15) << "between grid points lies no more than that";
    ASSERT_NEAR((found.place - point).norm(), distance, 1e-9);
  }
}

TEST(SurfaceFinder, FindsNothingNearAPointThatIsNotFinite) {
  const SurfaceFinder finder(CubeUnderALamp());
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300})
    EXPECT_TRUE(std::isnan(finder.Nearest({0, bad, 0}).offset_m)) << bad;
}

TEST(SurfaceFinder, NeedsObjects) {
  Scene scene;
  scene.name = "void";
  EXPECT_EQ(ErrorMessage([&] { SurfaceFinder finder(scene); }), "scene void: has no objects");
}

}  // namespace
}  // namespace sgf::synth
