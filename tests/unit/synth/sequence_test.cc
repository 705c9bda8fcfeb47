#include <cmath>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>
#include <support/temp_dir.h>

#include <sgf/io/dso_calibration.h>
#include <sgf/io/exr.h>
#include <sgf/io/image.h>
#include <sgf/io/manifest.h>
#include <sgf/synth/sequence.h>

namespace sgf::synth {
namespace {

const RenderOptions kCoarse{
    .samples_per_pixel = 1, .light_texels = 2000, .light_samples = 4, .bounce_samples = 4};

Scene Corridor() {
  Scene scene;
  scene.name = "corridor";
  const int brick = scene.AddTexture("brick", 64);
  scene.Add("floor", Quad({-20, -2, 0}, {40, 0, 0}, {0, 4, 0}), {.texture = brick});
  scene.Add("wall", Quad({-20, 2, 0}, {40, 0, 0}, {0, 0, 4}), {.texture = brick});
  scene.Add("end", Quad({6, 2, 0}, {0, -4, 0}, {0, 0, 4}), {.texture = brick});
  for (const char* group : {"ceiling", "spot"})
    scene.lights.push_back({.group = group,
                            .corner = {-1, -1, 3.9f},
                            .edge_s = {0, 2, 0},
                            .edge_t = {2, 0, 0},
                            .radiance = {80, 80, 80}});
  return scene;
}

SequenceRecipe Walk() {
  SequenceRecipe recipe;
  recipe.duration_s = 2;
  recipe.short_version = {.from_s = 0.5, .frames = 3};
  recipe.trajectory.waypoints = {
      {0, 0, 1.5, 0, 0, 0}, {1, 0, 1.5, 10, 0, 0}, {2, 0, 1.6, 20, 5, 0}};
  recipe.trajectory.knot_interval_s = 0.4;
  recipe.photometry.vignette = {.model = VignetteModel::kPolynomial, .coefficients = {-0.3}};
  return recipe;
}

TEST(Sequence, IsAnEurocSequenceWithItsGroundTruth) {
  const TempDir temp;
  const Renderer renderer(Corridor(), kCoarse);
  const SequenceRecipe recipe = Walk();
  RenderSequence(renderer, {.recipe = recipe, .folder = temp.path() / "walk"});

  const EurocSequence sequence = ReadEuroc(temp.path() / "walk");
  ASSERT_EQ(sequence.images.size(), 2);
  ASSERT_EQ(sequence.images[0].size(), 3);
  EXPECT_EQ(sequence.images[0][1].time_ns - sequence.images[0][0].time_ns, 50'000'000);
  EXPECT_TRUE(sequence.truth_has_rates);
  EXPECT_NEAR(1e-9 * static_cast<double>(sequence.imu[1].time_ns - sequence.imu[0].time_ns), 0.005,
              1e-9);
  // The ground truth at the first image is the trajectory's pose at 0.5 s.
  const Trajectory trajectory =
      MakeTrajectory(recipe.trajectory, sequence.sensors.cameras[0].T_body_cam);
  const auto state =
      std::ranges::find(sequence.truth, sequence.images[0][0].time_ns, &BodyState::time_ns);
  ASSERT_NE(state, sequence.truth.end());
  EXPECT_LT((state->T_world_body.p - trajectory.At(0.5).T_world_body.p).norm(), 1e-9);
  EXPECT_GT(state->velocity.norm(), 0.1);

  const auto cam0 = temp.path() / "walk/mav0/cam0";
  double least = 0;
  cv::minMaxLoc(ReadVignette(cam0 / "vignette.png"), &least);
  EXPECT_NEAR(least, 0.7, 1e-3);
  EXPECT_EQ(ReadPcalib(cam0 / "pcalib.txt").size(), 256);
  EXPECT_EQ(ReadFrameTimes(cam0 / "times.txt")[0].exposure_ms, recipe.exposure.base_ms);
  EXPECT_NO_THROW(CheckManifest(temp.path() / "walk"));
}

TEST(Sequence, DepthOfAFrameFitsItsImageAndPose) {
  const TempDir temp;
  const Renderer renderer(Corridor(), kCoarse);
  RenderSequence(renderer, {.recipe = Walk(), .folder = temp.path() / "walk"});
  const EurocSequence sequence = ReadEuroc(temp.path() / "walk");
  const EurocCamera& left = sequence.sensors.cameras[0];
  const ExrImage depth = ReadExr(temp.path() / "walk/mav0/depth0/data" /
                                 sequence.images[0][0].file.filename().replace_extension(".exr"));
  const auto state =
      std::ranges::find(sequence.truth, sequence.images[0][0].time_ns, &BodyState::time_ns);
  const SE3 T_world_cam = state->T_world_body * left.T_body_cam;
  // The middle of the image shows the end of the corridor at x = 6.
  const float z = depth.channels.at("Z").values.at<float>(240, 376);
  EXPECT_NEAR((T_world_cam * (z * left.camera.Unproject({376, 240}))).x(), 6, 1e-4);
}

TEST(Sequence, SameRecipeSameBytesForAnyNumberOfThreads) {
  const TempDir temp;
  SequenceRecipe recipe = Walk();
  recipe.blur_samples = 3;
  recipe.exposure.automatic.enabled = true;
  const auto render = [&](const char* name, int threads) {
    RenderOptions options = kCoarse;
    options.threads = threads;
    const Renderer renderer(Corridor(), options);
    RenderSequence(renderer, {.recipe = recipe, .keep_exr = true, .folder = temp.path() / name});
    return ReadManifest(temp.path() / name);
  };
  const Manifest one = render("one", 1), two = render("two", 2);
  EXPECT_EQ(one.recipe_hash, two.recipe_hash);
  ASSERT_EQ(one.files.size(), two.files.size());
  for (size_t i = 0; i < one.files.size(); ++i) {
    EXPECT_EQ(one.files[i].path, two.files[i].path);
    EXPECT_EQ(one.files[i].sha256, two.files[i].sha256) << one.files[i].path;
  }
}

double MeanOfFirstImage(const SequenceRecipe& recipe) {
  const TempDir temp;
  const Renderer renderer(Corridor(), kCoarse);
  RenderSequence(renderer, {.recipe = recipe, .folder = temp.path() / "walk"});
  return cv::mean(ReadGrey(ReadEuroc(temp.path() / "walk").images[0][0].file))[0];
}

TEST(Sequence, ExposureAndLightsShowInTheImages) {
  SequenceRecipe recipe = Walk();
  recipe.short_version.frames = 1;
  recipe.photometry.noise = {.shot = false, .read_noise_e = 0};
  recipe.exposure.base_ms = 8;
  const double bright = MeanOfFirstImage(recipe);
  recipe.exposure.base_ms = 4;
  const double half = MeanOfFirstImage(recipe);
  recipe.exposure.base_ms = 8;
  recipe.exposure.lights = {{.group = "spot", .from_s = 0, .strength = 0}};
  const double one_lamp = MeanOfFirstImage(recipe);
  EXPECT_GT(bright, 20);
  EXPECT_LT(bright, 250);
  EXPECT_NEAR(half, bright / 2, 1);
  EXPECT_NEAR(one_lamp, bright / 2, 1);  // both lamps are alike
}

TEST(Sequence, HashChangesWithWhatDecidesTheContent) {
  const auto hash = [](const SequenceRecipe& recipe, SequenceVersion version, int threads) {
    RenderOptions options = kCoarse;
    options.threads = threads;
    return RecipeHash(recipe, version, false, options);
  };
  SequenceRecipe recipe = Walk();
  const std::string before = hash(recipe, SequenceVersion::kShort, 1);
  EXPECT_EQ(hash(recipe, SequenceVersion::kShort, 2), before);
  EXPECT_NE(hash(recipe, SequenceVersion::kFull, 1), before);
  recipe.seed = 7;
  EXPECT_NE(hash(recipe, SequenceVersion::kShort, 1), before);
}

TEST(Sequence, EstimateIsAnUpperBound) {
  const TempDir temp;
  const SequenceRecipe recipe = Walk();
  const Renderer renderer(Corridor(), kCoarse);
  for (bool keep_exr : {false, true}) {
    RenderSequence(renderer,
                   {.recipe = recipe, .keep_exr = keep_exr, .folder = temp.path() / "walk"});
    uint64_t bytes = 0;
    for (const ManifestFile& file : ReadManifest(temp.path() / "walk").files)
      if (file.path.ends_with(".png") || file.path.ends_with(".exr")) bytes += file.size;
    const int64_t bound = Estimate(recipe, SequenceVersion::kShort, keep_exr).bytes;
    EXPECT_LT(bytes, bound);
    EXPECT_GT(bytes, bound / 20);
  }
}

TEST(Sequence, AFailedOneLeavesNothingThatLooksWhole) {
  const TempDir temp;
  const Renderer renderer(Corridor(), kCoarse);
  SequenceRequest request{.recipe = Walk(), .folder = temp.path() / "walk"};
  request.progress = [](int, int) { throw Error("test", "interrupted"); };
  EXPECT_EQ(ErrorMessage([&] { RenderSequence(renderer, request); }), "test: interrupted");
  EXPECT_TRUE(std::filesystem::is_empty(temp.path()));
}

TEST(Sequence, BadRecipes) {
  const TempDir temp;
  const Renderer renderer(Corridor(), kCoarse);
  const auto error = [&](auto change) {
    SequenceRecipe recipe = Walk();
    change(recipe);
    return ErrorMessage(
        [&] { RenderSequence(renderer, {.recipe = recipe, .folder = temp.path() / "walk"}); });
  };
  EXPECT_EQ(error([](auto& r) { r.short_version.frames = 201; }),
            "short.frames: is 201; it has to be 1 to 200");
  EXPECT_EQ(error([](auto& r) { r.short_version.from_s = 1.95; }),
            "short.frames: is 3; it has to be within duration_s");
  EXPECT_EQ(error([](auto& r) { r.blur_samples = 2; }),
            "blur_samples: is 2; it has to be odd and positive");
  EXPECT_EQ(error([](auto& r) { r.photometry.bits = 1 << 30; }),
            "bits: is 1073741824; it has to be 8 or 16");
  EXPECT_THAT(error([](auto& r) { r.imu.rate_hz = 1e300; }),
              testing::HasSubstr("rate_hz is 1e+300"));
  EXPECT_THAT(error([](auto& r) { r.duration_s = 60; }), testing::StartsWith("duration_s: is 60"));
  EXPECT_THAT(error([](auto& r) { r.exposure.base_ms = -1; }), testing::HasSubstr("-1"));
  EXPECT_THAT(error([](auto& r) { r.exposure.lights = {{.group = "moon"}}; }),
              testing::HasSubstr("moon"));
  EXPECT_THAT(error([](auto& r) {
                r.trajectory.waypoints = {{5.95, 0, 1.5, 0, 0, 0}, {5.96, 0, 1.5, 0, 0, 0}};
              }),
              testing::HasSubstr("from a surface"));
  EXPECT_TRUE(std::filesystem::is_empty(temp.path()));
}

}  // namespace
}  // namespace sgf::synth
