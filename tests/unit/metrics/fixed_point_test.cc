#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <support/fixed_point.h>

namespace sgf::metrics {
namespace {

TEST(Q15, MultipliesRoundedHalvesUpAndAddsSaturated) {
  const auto product = [](int a, int b) {
    return int{(Q15{static_cast<int16_t>(a)} * Q15{static_cast<int16_t>(b)}).v};
  };
  EXPECT_EQ(product(32767, 32767), 32766);
  EXPECT_EQ(product(16384, 1), 1);   // 0.5
  EXPECT_EQ(product(-16384, 1), 0);  // -0.5
  EXPECT_EQ(product(-16385, 1), -1);
  EXPECT_EQ(product(16383, 1), 0);
  EXPECT_EQ(product(-32768, 32767), -32767);
  EXPECT_EQ((Q15{32767} + Q15{1}).v, 32767);
  EXPECT_EQ((Q15{-32768} + Q15{-1}).v, -32768);
  EXPECT_EQ((Q15{-300} + Q15{100}).v, -200);
}

struct GradientF {
  float x, y;
};

// Gradients of every strength, in pairs of every relation.
class RandomGradients {
 public:
  std::pair<GradientF, GradientF> Pair() {
    const GradientF i = Any();
    switch (generator_() % 5) {
      case 0:
        return {i, {Strength() * i.x, Strength() * i.y}};
      case 1:
        return {i, {-i.x, -i.y}};
      case 2:
        return {i, {i.x * 1.01F, i.y * 0.99F}};
      case 3:
        return {i, i};
      default:
        return {i, Any()};
    }
  }

  float Epsilon() {
    constexpr std::array<float, 4> kChoices = {0, 0.01F, 30, 5000};
    return kChoices[generator_() % kChoices.size()];
  }

 private:
  float Strength() {
    return std::pow(10.F, std::uniform_real_distribution<float>(-6, 6)(generator_));
  }
  GradientF Any() {
    if (generator_() % 50 == 0) return {0, 0};
    const float angle = std::uniform_real_distribution<float>(-4, 4)(generator_);
    // Mostly around sqrt(epsilon), where nothing is at its limits.
    const float strength =
        generator_() % 2 ? Strength() : std::uniform_real_distribution<float>(0, 12)(generator_);
    return {strength * std::cos(angle), strength * std::sin(angle)};
  }

  std::mt19937 generator_{9};
};

class FixedSgfTest : public ::testing::TestWithParam<int> {};

TEST_P(FixedSgfTest, IsWithinItsBoundOfTheDoubleDefinition) {
  const int scale = GetParam();
  const double tau = std::max(kTau, scale / 32767.0);
  const double bound = 1.5 + 2 * std::sqrt(scale / 32767.0);
  RandomGradients random;
  double worst = 0;
  for (int k = 0; k < 200000; ++k) {
    const auto [g_i, g_j] = random.Pair();
    const float epsilon_i = random.Epsilon(), epsilon_j = random.Epsilon();
    const int cost =
        FixedSgfCost(QuantizeSample(MakeSample<float>(0, g_i.x, g_i.y, epsilon_i), scale),
                     QuantizeSample(MakeSample<float>(0, g_j.x, g_j.y, epsilon_j), scale), scale);
    const double exact = scale * Sgf{}(MakeSample<double>(0, g_i.x, g_i.y, epsilon_i, tau),
                                       MakeSample<double>(0, g_j.x, g_j.y, epsilon_j, tau));
    worst = std::max(worst, std::abs(cost - exact));
    ASSERT_LT(std::abs(cost - exact), bound)
        << g_i.x << ", " << g_i.y << " eps " << epsilon_i << " against " << g_j.x << ", " << g_j.y
        << " eps " << epsilon_j;
    ASSERT_TRUE(cost >= 0 && cost <= 2 * scale + 1) << cost;
  }
  RecordProperty("worst_error", fmt::format("{:.3f} of {:.3f}", worst, bound));
  EXPECT_GT(worst, bound / 3);  // or the bound says nothing
}

INSTANTIATE_TEST_SUITE_P(Scales, FixedSgfTest, ::testing::Values(127, 74, 34, 12, 1));

TEST(QuantizeSample, RoundsToNearestEvenAndLimitsR) {
  const auto quantize = [](float ax, float r, int scale) {
    Sample<float> sample{};
    sample.ax = ax;
    sample.ay = -ax;
    sample.r = r;
    return QuantizeSample(sample, scale);
  };
  EXPECT_EQ(quantize(1, 1, 127).ax.v, 32767);
  EXPECT_EQ(quantize(1, 1, 127).ay.v, -32767);
  EXPECT_EQ(quantize(1, 1, 127).r.v, 127);
  EXPECT_EQ(quantize(0, 1.25F, 2).r.v, 2);  // 2.5
  EXPECT_EQ(quantize(0, 1.75F, 2).r.v, 4);  // 3.5
  EXPECT_EQ(quantize(0, 1e4F, 127).r.v, 32767);
  EXPECT_EQ(quantize(0, 1e30F, 127).r.v, 32767);
}

}  // namespace
}  // namespace sgf::metrics
