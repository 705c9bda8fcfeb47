#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/synth/frame_exr.h>
#include <sgf/synth/renderer.h>

namespace sgf::synth {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

const RenderOptions kCoarse{.light_texels = 4000, .light_samples = 16, .bounce_samples = 16};

Camera SmallCamera() {
  return {.width = 80, .height = 60, .fx = 70, .fy = 70, .cx = 39.5, .cy = 29.5};
}

/// A floor that only lamps light, with walls out of sight.
Scene Floor(const Material& material = {}) {
  Scene scene;
  scene.name = "floor";
  scene.Add("floor", Quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}), material);
  scene.lights.push_back({.group = "lamp",
                          .corner = {-0.05f, -0.05f, 2},
                          .edge_s = {0, 0.1f, 0},
                          .edge_t = {0.1f, 0, 0},
                          .radiance = {100, 100, 50}});
  return scene;
}

Frame RenderSmall(const Renderer& renderer, const SE3& T_world_cam) {
  return renderer.Render(PixelRays(SmallCamera(), renderer.options().samples_per_pixel),
                         T_world_cam);
}

// Depth along the optical axis of a plane n.x = c at every pixel centre.
double PlaneDepth(const SE3& T_world_cam, const Vector3d& n, double c, int x, int y) {
  const Vector3d ray = T_world_cam.R * SmallCamera().Unproject({x, y});
  return (c - n.dot(T_world_cam.p)) / n.dot(ray);
}

TEST(Renderer, DepthAndNormalOfAPlaneAreExact) {
  const Renderer renderer(Floor(), kCoarse);
  const SE3 pose = LookAt({0.3, -1.2, 1.5}, {0.1, 0.6, 0});
  const Frame frame = RenderSmall(renderer, pose);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) {
      const double expected = PlaneDepth(pose, Vector3d::UnitZ(), 0, x, y);
      ASSERT_NEAR(frame.depth(y, x), expected, 2e-6 * expected) << x << ", " << y;
      ASSERT_NEAR(frame.normal(y, x)[2], 1, 1e-6);
      ASSERT_EQ(frame.id(y, x), 1);
    }
}

TEST(Renderer, DepthAtAnEdgeIsThatOfThePixelCentre) {
  Scene scene = Floor();
  scene.Add("board", Quad({0.013f, -5, 0.5f}, {4, 0, 0}, {0, 10, 0}), {});
  const Renderer renderer(std::move(scene), kCoarse);
  const SE3 down = LookAt({0, 0.001, 1.5}, {0, 0.002, 0});
  const Frame frame = RenderSmall(renderer, down);
  for (int x = 0; x < 80; ++x) {
    const Vector3d ray = down.R * SmallCamera().Unproject({x, 30});
    const bool on_board = (down.p + ray / -ray.z()).x() > 0.013;
    ASSERT_NEAR(frame.depth(30, x), on_board ? 1.0 : 1.5, 1e-5) << x;
    ASSERT_EQ(frame.id(30, x), on_board ? 2 : 1) << x;
  }
}

TEST(Renderer, SmallLampLightsAFloorByTheLawOfSquares) {
  // A black room's floor: no light but the lamp's own. Radiance = albedo / pi * E.
  const Material grey{.tint = {0.5f, 0.25f, 1}};
  const Renderer renderer(Floor(grey), {.light_texels = 40000, .bounce_samples = 4});
  const SE3 down = LookAt({0, 0.001, 1.5}, {0, 0.002, 0});
  const Frame frame = RenderSmall(renderer, down);
  for (const auto& [x, y] : {std::pair(40, 30), std::pair(70, 30), std::pair(10, 50)}) {
    const Vector3d at = down.p + 1.5 * (down.R * SmallCamera().Unproject({x, y}));
    const double d2 = at.head<2>().squaredNorm() + 4;
    const double irradiance = 100 * 0.01 * (4 / d2) / d2;
    const cv::Vec3f seen = frame.light[0](y, x);
    EXPECT_NEAR(seen[0], 0.5 * irradiance / std::numbers::pi, 0.01 * seen[0]);
    EXPECT_NEAR(seen[1], 0.5 * seen[0], 1e-3 * seen[0]);
    EXPECT_NEAR(seen[2], seen[0], 1e-3 * seen[0]);
  }
}

TEST(Renderer, ABoardCastsAShadowWithAPenumbra) {
  Scene scene = Floor();
  scene.lights[0].corner = {-0.5f, -0.5f, 2};
  scene.lights[0].edge_s = {0, 1, 0};
  scene.lights[0].edge_t = {1, 0, 0};
  scene.Add("board", Quad({0, -3, 1}, {3, 0, 0}, {0, 6, 0}), {.tint = Vector3f::Zero()});
  const Renderer renderer(std::move(scene), {.light_texels = 100000, .bounce_samples = 4});
  // Along the floor from lit to dark: with the lamp over x in [-0.5, 0.5] and the board's edge
  // above x = 0, half-way down, the penumbra lies over x in [-0.5, 0.5].
  const SE3 pose = LookAt({0, -0.5, 0.9}, {0, 0, 0});
  const Frame frame = RenderSmall(renderer, pose);
  const auto light_at = [&](double x) {
    const Eigen::Vector2d pixel = SmallCamera().Project(pose.Inverse() * Vector3d(x, 0, 0));
    return frame.light[0](static_cast<int>(std::lround(pixel.y())),
                          static_cast<int>(std::lround(pixel.x())))[0];
  };
  EXPECT_LT(light_at(0.46), 0.06f * light_at(-0.46));
  EXPECT_GT(light_at(0), 0.3f * light_at(-0.46));
  EXPECT_LT(light_at(0), 0.7f * light_at(-0.46));
}

TEST(Renderer, GroupsAddUpAndStrengthsScaleThem) {
  Scene scene = Floor();
  scene.lights.push_back(scene.lights[0]);
  scene.lights[1].group = "second";
  scene.lights[1].corner.x() += 1;
  const Renderer renderer(std::move(scene), kCoarse);
  const Frame frame = RenderSmall(renderer, LookAt({0, -1, 1}, {0, 0, 0}));
  ASSERT_EQ(frame.groups, (std::vector<std::string>{"lamp", "second"}));
  const cv::Vec3f both = frame.Radiance()(30, 40);
  const cv::Vec3f second = frame.Radiance({0, 1})(30, 40);
  EXPECT_FLOAT_EQ(both[0], frame.light[0](30, 40)[0] + frame.light[1](30, 40)[0]);
  EXPECT_FLOAT_EQ(second[0], frame.light[1](30, 40)[0]);
  EXPECT_GT(second[0], 0);
  EXPECT_EQ(ErrorMessage([&] { frame.Radiance({1}); }), "light strengths: 1 given for 2 groups");
}

TEST(Renderer, GlossIsInTheLightButNotInTheDiffuseLayer) {
  const auto render = [](const Material& material) {
    const Renderer renderer(Floor(material), kCoarse);
    return RenderSmall(renderer, LookAt({0, -2, 2}, {0, 0, 0}));
  };
  const Frame matt = render({});
  const Frame shiny = render({.specular = 0.5f, .shininess = 100});
  const Frame mirror = render({.mirror = 0.5f});
  double shine = 0, lamp = 0;
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) {
      ASSERT_EQ(shiny.diffuse(y, x), matt.diffuse(y, x));
      ASSERT_EQ(mirror.diffuse(y, x), matt.diffuse(y, x));
      shine = std::max<double>(shine, shiny.light[0](y, x)[0] - matt.light[0](y, x)[0]);
      lamp = std::max<double>(lamp, mirror.light[0](y, x)[0] - matt.light[0](y, x)[0]);
    }
  EXPECT_GT(shine, 0.1);
  EXPECT_NEAR(lamp, 50, 5);  // half of the lamp's radiance of 100
}

TEST(Renderer, SkyIsInfinitelyFarAndLightsSurfaces) {
  Scene scene = Floor();
  scene.lights.clear();
  scene.sky = Sky{"sky", {1, 1, 1}, {1, 1, 1}};
  const Renderer renderer(std::move(scene), kCoarse);
  const Frame frame = RenderSmall(renderer, LookAt({0, -1, 1}, {0, 20, 1}));
  EXPECT_EQ(frame.depth(0, 40), std::numeric_limits<float>::infinity());
  EXPECT_EQ(frame.id(0, 40), 0);
  EXPECT_FLOAT_EQ(frame.light[0](0, 40)[0], 1);
  // A uniform sky of radiance 1 makes a white floor without walls as bright as itself.
  EXPECT_NEAR(frame.light[0](59, 40)[0], 1, 1e-3);
}

TEST(Renderer, SeesWhatNothingStandsBefore) {
  Scene scene = Floor();
  scene.Add("board", Quad({0, -5, 1}, {0.5f, 0, 0}, {0, 10, 0}), {});
  const Renderer renderer(std::move(scene), kCoarse);
  const SE3 down = LookAt({-1, 0.001, 3}, {-1, 0.002, 0});
  const Frame frame = RenderSmall(renderer, down);
  // From x = 1.5 the board hides the floor between x = -0.75 and x = 0.
  const cv::Mat1b seen = renderer.SeenFrom(frame.depth, SmallCamera(), down, {1.5, 0, 3});
  for (int x = 0; x < 80; ++x) {
    if (frame.id(30, x) != 1) continue;
    const double at = (down.p + 3 * (down.R * SmallCamera().Unproject({x, 30}))).x();
    if (std::abs(at + 0.75) < 0.02 || std::abs(at) < 0.02) continue;
    EXPECT_EQ(seen(30, x), at > -0.75 && at < 0 ? 0 : 255) << at;
  }
}

TEST(Renderer, SameBitsForAnyNumberOfThreads) {
  const auto render = [](int threads) {
    RenderOptions options = kCoarse;
    options.threads = threads;
    Scene scene = Floor({.specular = 0.3f, .mirror = 0.2f});
    scene.Add("ball", Transformed(Sphere(0.5f), Eigen::Affine3f(Eigen::Translation3f(0, 0, 0.5f))),
              {.texture = scene.AddTexture("brick", 64)});
    const Renderer renderer(std::move(scene), options);
    return RenderSmall(renderer, LookAt({0, -2, 1}, {0, 0, 0.3}));
  };
  const Frame one = render(1), two = render(2);
  EXPECT_EQ(cv::norm(one.light[0], two.light[0], cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(one.depth, two.depth, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(one.normal, two.normal, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(one.id, two.id, cv::NORM_INF), 0);
}

TEST(Renderer, BadInput) {
  EXPECT_THAT(ErrorMessage([] { BuildScene("attic"); }),
              testing::StartsWith("scene: unknown scene 'attic'; known: living_room"));
  Scene empty;
  empty.name = "void";
  EXPECT_EQ(ErrorMessage([&] { Renderer(empty, {}); }), "void: the scene has no objects");
  EXPECT_EQ(ErrorMessage([] { Renderer(Floor(), {.samples_per_pixel = 3}); }),
            "samples_per_pixel: is 3; known: 1, 4, 16");
  EXPECT_EQ(ErrorMessage([] { Renderer(Floor(), {.light_texels = 0}); }),
            "light_texels: is 0; it has to be positive");
}

TEST(FrameExr, LayersComeBack) {
  const Renderer renderer(Floor(), kCoarse);
  const SE3 pose = LookAt({0, -1, 1}, {0, 0, 0});
  const Frame frame = RenderSmall(renderer, pose);
  const ExrImage image = ToExr(frame, SmallCamera(), pose);
  for (const char* channel : {"R", "light.lamp.R", "diffuse.B", "Z", "N.X", "id"})
    EXPECT_TRUE(image.channels.contains(channel)) << channel;
  const Frame back = FromExr(image, "frame");
  EXPECT_EQ(back.groups, frame.groups);
  EXPECT_EQ(cv::norm(back.light[0], frame.light[0], cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(back.depth, frame.depth, cv::NORM_INF), 0);

  ExrImage without = image;
  without.channels.erase("Z");
  EXPECT_THAT(ErrorMessage([&] { FromExr(without, "frame.exr"); }), testing::HasSubstr("Z"));
  EXPECT_EQ(ErrorMessage([] { FromExr({}, "frame.exr"); }),
            "frame.exr: no layer light.<group> in the image");
}

}  // namespace
}  // namespace sgf::synth
