#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include <sgf/core/options.h>
#include <sgf/metrics/epsilon.h>
#include <sgf/metrics/sample_image.h>

#include "unit/metrics/fields.h"

namespace sgf::metrics {
namespace {

using testing::RandomTexture;

constexpr EpsilonScope kScopes[] = {EpsilonScope::kImage, EpsilonScope::kTile,
                                    EpsilonScope::kWindow};

GradientImage TextureGradient(int rows, int cols) {
  return ComputeGradient(cv::Mat1f(RandomTexture(rows, cols, 3)), GradientOperator::kCentral);
}

// Horizontal gradients whose squares are 1 in the left half and 9 in the right one.
GradientImage TwoHalves(int rows, int cols) {
  GradientImage gradient{cv::Mat1f(rows, cols, 1.F), cv::Mat1f::zeros(rows, cols)};
  gradient.x.colRange(cols / 2, cols) = 3;
  return gradient;
}

TEST(Epsilon, OfTheImageIsEquation6) {
  const GradientImage gradient = TextureGradient(20, 30);
  const cv::Mat1f epsilon = ComputeEpsilon(gradient, {});
  ASSERT_EQ(epsilon.size(), gradient.x.size());
  for (const float value : epsilon)
    EXPECT_EQ(value, static_cast<float>(MeanSquaredGradient(gradient)));
}

TEST(Epsilon, OfTilesIsTheirMeanAtTheCentreAndLinearBetween) {
  const cv::Mat1f epsilon =
      ComputeEpsilon(TwoHalves(10, 40), {.scope = EpsilonScope::kTile, .tile_px = 20});
  for (int y = 0; y < 10; ++y) {
    EXPECT_FLOAT_EQ(epsilon(y, 0), 1);
    EXPECT_FLOAT_EQ(epsilon(y, 9), 1);  // centre 10 lies half a pixel further
    EXPECT_FLOAT_EQ(epsilon(y, 10), 1 + 8 * 0.5F / 20);
    EXPECT_FLOAT_EQ(epsilon(y, 19), 1 + 8 * 9.5F / 20);
    EXPECT_FLOAT_EQ(epsilon(y, 29), 1 + 8 * 19.5F / 20);
    EXPECT_FLOAT_EQ(epsilon(y, 39), 9);
  }
}

TEST(Epsilon, OfTilesRunsDownTheImageToo) {
  GradientImage gradient = TwoHalves(10, 40);
  gradient = {gradient.x.t(), gradient.y.t()};
  const cv::Mat1f epsilon = ComputeEpsilon(gradient, {.scope = EpsilonScope::kTile, .tile_px = 20});
  EXPECT_FLOAT_EQ(epsilon(9, 3), 1);
  EXPECT_FLOAT_EQ(epsilon(19, 3), 1 + 8 * 9.5F / 20);
  EXPECT_FLOAT_EQ(epsilon(39, 3), 9);
}

TEST(Epsilon, TilesDivideTheImageEvenly) {
  const GradientImage gradient = TwoHalves(10, 52);  // two tiles of 26, not one of 40 and a sliver
  const cv::Mat1f epsilon = ComputeEpsilon(gradient, {.scope = EpsilonScope::kTile, .tile_px = 30});
  EXPECT_FLOAT_EQ(epsilon(5, 0), 1);
  EXPECT_FLOAT_EQ(epsilon(5, 51), 9);
  const cv::Mat1f one = ComputeEpsilon(gradient, {.scope = EpsilonScope::kTile, .tile_px = 64});
  for (const float value : one) EXPECT_FLOAT_EQ(value, 5);
}

TEST(Epsilon, OfAWindowIsItsMeanWithReplicatedBorder) {
  const GradientImage gradient = TextureGradient(12, 15);
  const cv::Mat1f epsilon =
      ComputeEpsilon(gradient, {.scope = EpsilonScope::kWindow, .window_px = 5});
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 15; ++x) {
      double sum = 0;
      for (int dy = -2; dy <= 2; ++dy)
        for (int dx = -2; dx <= 2; ++dx) {
          const int v = std::clamp(y + dy, 0, 11), u = std::clamp(x + dx, 0, 14);
          sum += std::pow(gradient.x(v, u), 2) + std::pow(gradient.y(v, u), 2);
        }
      EXPECT_NEAR(epsilon(y, x), sum / 25, 1e-5 * sum);
    }
}

TEST(Epsilon, OfAWindowWiderThanTheImageIsFinite) {
  const GradientImage gradient = TextureGradient(6, 7);
  const cv::Mat1f epsilon =
      ComputeEpsilon(gradient, {.scope = EpsilonScope::kWindow, .window_px = 31});
  const double mean = MeanSquaredGradient(gradient);
  for (const float value : epsilon) EXPECT_TRUE(value > mean / 10 && value < mean * 10) << value;
}

// Running sums leave a residue behind where strong gradients go out of a window of weak ones.
TEST(Epsilon, IsNeverNegativeBesideStrongGradients) {
  GradientImage gradient{cv::Mat1f::zeros(40, 60), cv::Mat1f::zeros(40, 60)};
  std::mt19937 generator(1);
  for (float& value : gradient.x)
    value = std::pow(10.F, std::uniform_real_distribution<float>(-9, 9)(generator));
  gradient.x.colRange(30, 60) = 0;
  const cv::Mat1f epsilon =
      ComputeEpsilon(gradient, {.scope = EpsilonScope::kWindow, .window_px = 3});
  for (const float value : epsilon) EXPECT_GE(value, 0);
}

TEST(Epsilon, NoiseFloorIsAdded) {
  const GradientImage gradient = TextureGradient(40, 50);
  for (const EpsilonScope scope : kScopes) {
    const cv::Mat1f without = ComputeEpsilon(gradient, {.scope = scope});
    const cv::Mat1f with = ComputeEpsilon(gradient, {.scope = scope, .noise_floor = 12.5});
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 50; ++x) EXPECT_FLOAT_EQ(with(y, x), without(y, x) + 12.5F);
  }
}

TEST(Epsilon, RejectsOptionsAndGradientsThatMakeNoSense) {
  const GradientImage gradient = TextureGradient(6, 7);
  EXPECT_THROW(ComputeEpsilon({}, {}), Error);
  EXPECT_THROW(ComputeEpsilon({gradient.x, gradient.y.colRange(0, 6)}, {}), Error);
  EXPECT_THROW(ComputeEpsilon(gradient, {.tile_px = 0}), Error);
  EXPECT_THROW(ComputeEpsilon(gradient, {.window_px = 8}), Error);
  EXPECT_THROW(ComputeEpsilon(gradient, {.window_px = -1}), Error);
  EXPECT_THROW(ComputeEpsilon(gradient, {.noise_floor = -1}), Error);
  EXPECT_THROW(ComputeEpsilon(gradient, {.noise_floor = std::nan("")}), Error);
  EXPECT_THROW(ComputeEpsilon(gradient, {.noise_floor = HUGE_VAL}), Error);
}

TEST(Epsilon, OptionsAreReadByName) {
  EpsilonOptions options;
  ReadOptions(YAML::Load("{scope: window, window_px: 15, noise_floor: 2}"), options, "run.yaml");
  EXPECT_EQ(options.scope, EpsilonScope::kWindow);
  EXPECT_EQ(options.window_px, 15);
  ReadOptions(YAML::Load("{scope: tile, tile_px: 16}"), options, "run.yaml");
  EXPECT_EQ(options.scope, EpsilonScope::kTile);
  EXPECT_EQ(options.noise_floor, 2);
}

// Mean sgf between an image and itself with the right part dimmed to 0.3, as by a lamp switched
// off.
double SgfUnderLocalLight(EpsilonScope scope) {
  const cv::Mat1f image = RandomTexture(120, 240, 5);
  cv::Mat1f dimmed(image.size());
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      dimmed(y, x) = image(y, x) * (1 - 0.7F / (1 + std::exp(static_cast<float>(120 - x) / 10)));
  const EpsilonOptions options{.scope = scope, .tile_px = 24, .window_px = 15};
  const SampleImage i = MakeSampleImage(image, GradientOperator::kCentral, options);
  const SampleImage j = MakeSampleImage(dimmed, GradientOperator::kCentral, options);
  double sum = 0;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) sum += Sgf{}(i.At(y, x), j.At(y, x));
  return sum / static_cast<double>(image.total());
}

TEST(Epsilon, OfTilesAndWindowsRestoresTheInvarianceToLocalGain) {
  const double image = SgfUnderLocalLight(EpsilonScope::kImage);
  const double tile = SgfUnderLocalLight(EpsilonScope::kTile);
  const double window = SgfUnderLocalLight(EpsilonScope::kWindow);
  RecordProperty("sgf_image_tile_window", fmt::format("{:.4f} {:.4f} {:.4f}", image, tile, window));
  EXPECT_GT(image, 0.2);
  EXPECT_LT(tile, image / 8);
  EXPECT_LT(window, image / 8);
}

}  // namespace
}  // namespace sgf::metrics
