#include <cmath>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <sgf/core/error.h>
#include <sgf/synth/texture.h>

namespace sgf::synth {
namespace {

using Eigen::Array4f;

// Colours without any regularity.
cv::Mat3f Scatter(int size) {
  cv::Mat3f image(size, size);
  uint32_t state = 1;
  for (cv::Vec3f& texel : image)
    for (int c = 0; c < 3; ++c) {
      state = state * 1664525 + 1013904223;
      texel[c] = static_cast<float>(state >> 8) / static_cast<float>(1 << 24);
    }
  return image;
}

cv::Vec3f ToVec(const Array4f& color) { return {color[0], color[1], color[2]}; }

// Texels are kept in steps of 1/65535.
constexpr double kStep = 1.0 / 65535;

TEST(Texture, ConstantImageStaysConstantAtAnyFootprint) {
  const cv::Vec3f color(0.25f, 0.5f, 0.125f);
  const Texture texture(cv::Mat3f(64, 64, color));
  for (float footprint : {0.0f, 0.001f, 1.0f / 64, 0.02f, 0.1f, 0.7f, 1.0f, 5.0f, 1e9f})
    for (float u : {-3.7f, 0.0f, 0.31f, 0.999f, 12.5f})
      EXPECT_LT(cv::norm(ToVec(texture.Sample(u, 1 - u, footprint)) - color), kStep)
          << footprint << " " << u;
}

TEST(Texture, FinestLevelReproducesTheTexelsWithVUpwards) {
  const int n = 16;
  const cv::Mat3f image = Scatter(n);
  const Texture texture(image);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      const float u = (x + 0.5f) / n, v = 1 - (y + 0.5f) / n;
      EXPECT_LT(cv::norm(ToVec(texture.Sample(u, v, 1.0f / n)) - image(y, x)), kStep);
    }
}

TEST(Texture, IsBilinearBetweenTexels) {
  const int n = 16;
  const cv::Mat3f image = Scatter(n);
  const Texture texture(image);
  // A quarter of the way from column 3 to 4, three quarters of the way from row 6 up to row 5.
  const cv::Vec3f lower = image(6, 3) * 0.75f + image(6, 4) * 0.25f;
  const cv::Vec3f upper = image(5, 3) * 0.75f + image(5, 4) * 0.25f;
  const cv::Vec3f expected = lower * 0.25f + upper * 0.75f;
  const cv::Vec3f sampled = ToVec(texture.Sample(3.75f / n, 1 - 5.75f / n, 0));
  EXPECT_LT(cv::norm(sampled - expected), kStep);
}

TEST(Texture, RepeatsAndIsContinuousAcrossTheBorder) {
  const Texture texture(Scatter(32));
  for (float footprint : {0.01f, 0.08f, 0.3f})
    for (float t : {0.03f, 0.4f, 0.77f}) {
      const float e = 1e-5f;
      const auto close = [](const Array4f& a, const Array4f& b) {
        return (a - b).abs().maxCoeff() < 1e-3f;
      };
      EXPECT_TRUE(close(texture.Sample(-e, t, footprint), texture.Sample(e, t, footprint)));
      EXPECT_TRUE(close(texture.Sample(t, 1 - e, footprint), texture.Sample(t, 1 + e, footprint)));
      EXPECT_TRUE(close(texture.Sample(t, t, footprint), texture.Sample(t - 2, t + 3, footprint)));
    }
}

TEST(Texture, IsContinuousInTheFootprint) {
  const Texture texture(Scatter(64));
  Array4f last = texture.Sample(0.3f, 0.6f, 0.5f / 64);
  for (float footprint = 0.5f / 64; footprint < 3; footprint *= 1.005f) {
    const Array4f color = texture.Sample(0.3f, 0.6f, footprint);
    EXPECT_LT((color - last).abs().maxCoeff(), 0.02f) << footprint;
    last = color;
  }
}

TEST(Texture, EveryLevelKeepsTheMean) {
  const int n = 32;
  const cv::Mat3f image = Scatter(n);
  const Texture texture(image);
  const cv::Scalar mean = cv::mean(image);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(texture.mean()[c], mean[c], 1e-5);
  for (int side = 1; side <= n; side *= 2) {  // the texels of one level
    Array4f sum = Array4f::Zero();
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        sum += texture.Sample((x + 0.5f) / side, (y + 0.5f) / side, 1.0f / side);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c] / (side * side), mean[c], 1e-5) << side;
  }
}

TEST(Texture, FootprintOfOneTexelOfALevelGivesItsBoxMean) {
  const int n = 32;
  const cv::Mat3f image = Scatter(n);
  const Texture texture(image);
  // The block of 8 x 8 texels in columns 8..15 from the left, rows 16..23 from the top.
  const cv::Scalar mean = cv::mean(image(cv::Rect(8, 16, 8, 8)));
  const Array4f sampled = texture.Sample(12.0f / n, 1 - 20.0f / n, 8.0f / n);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(sampled[c], mean[c], 1e-5);
}

TEST(Texture, RefusesOtherShapes) {
  EXPECT_THROW(Texture(cv::Mat3f(16, 32)), Error);
  EXPECT_THROW(Texture(cv::Mat3f(24, 24)), Error);
  EXPECT_THROW(Texture(cv::Mat3f(0, 0)), Error);
}

constexpr int kSize = 128;

bool Same(const cv::Mat3f& a, const cv::Mat3f& b) { return cv::norm(a, b, cv::NORM_INF) == 0; }

cv::Mat1f Grey(const cv::Mat3f& image) {
  cv::Mat1f grey;
  cv::transform(image, grey, cv::Matx13f(1.0f / 3, 1.0f / 3, 1.0f / 3));
  return grey;
}

double StandardDeviation(const cv::Mat3f& image) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(Grey(image), mean, deviation);
  return deviation[0];
}

bool IsWeak(std::string_view name) {
  static const std::set<std::string_view> kWeak = {"plaster", "plain_noise_weak", "cardboard"};
  return kWeak.contains(name);
}

// Mean absolute difference between neighbouring columns, at the seam and inside. For rows pass the
// transpose.
struct Steps {
  double seam = 0, inside = 0, largest = 0;
};

Steps ColumnSteps(const cv::Mat1f& image) {
  Steps steps;
  for (int x = 0; x < image.cols; ++x) {
    const cv::Mat difference = image.col(x) - image.col((x + 1) % image.cols);
    const double mean = cv::norm(difference, cv::NORM_L1) / image.rows;
    if (x + 1 == image.cols) {
      steps.seam = mean;
    } else {
      steps.inside += mean / (image.cols - 1);
      steps.largest = std::max(steps.largest, mean);
    }
  }
  return steps;
}

class ProceduralTexture : public testing::TestWithParam<TextureInfo> {};

TEST_P(ProceduralTexture, IsAnAlbedoWithDetail) {
  const cv::Mat3f image = MakeTexture(GetParam().name, kSize, 1);
  ASSERT_EQ(image.size(), cv::Size(kSize, kSize));
  EXPECT_TRUE(cv::checkRange(image.reshape(1), true, nullptr, 0, std::nextafter(1.0, 2.0)));
  const double contrast = StandardDeviation(image) / cv::mean(Grey(image))[0];
  if (IsWeak(GetParam().name)) {
    EXPECT_GT(contrast, 0.001);
    EXPECT_LT(contrast, 0.06);
  } else {
    EXPECT_GT(contrast, 0.04);
  }
}

TEST_P(ProceduralTexture, DependsOnTheSeedAlone) {
  const cv::Mat3f image = MakeTexture(GetParam().name, kSize, 7);
  EXPECT_TRUE(Same(image, MakeTexture(GetParam().name, kSize, 7)));
  EXPECT_FALSE(Same(image, MakeTexture(GetParam().name, kSize, 8)));
}

TEST_P(ProceduralTexture, TilesWithoutASeam) {
  if (!GetParam().tiles) return;
  const cv::Mat1f grey = Grey(MakeTexture(GetParam().name, kSize, 3));
  for (const cv::Mat1f& image : {grey, cv::Mat1f(grey.t())}) {
    const Steps steps = ColumnSteps(image);
    // Joints and borders of a pattern may fall on the seam; nothing may be stronger there than
    // inside.
    EXPECT_LE(steps.seam, std::max(1.5 * steps.inside, 1.1 * steps.largest));
  }
}

INSTANTIATE_TEST_SUITE_P(All, ProceduralTexture,
                         testing::ValuesIn(AllTextures().begin(), AllTextures().end()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(ProceduralTextures, AreManyAndHaveUniqueNames) {
  std::set<std::string_view> names;
  for (const TextureInfo& info : AllTextures()) names.insert(info.name);
  EXPECT_EQ(names.size(), AllTextures().size());
  EXPECT_GE(names.size(), 30u);
}

TEST(ProceduralTextures, BadRequestsAreRefused) {
  EXPECT_THROW(MakeTexture("brick", 8, 1), Error);
  try {
    MakeTexture("no such thing", 64, 1);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("no such thing"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("terrazzo"), std::string::npos);
  }
}

}  // namespace
}  // namespace sgf::synth
