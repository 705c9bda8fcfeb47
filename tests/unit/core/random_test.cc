#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include <sgf/core/random.h>

namespace sgf {
namespace {

// With the seed's hash as its state, SplitMix64 gives these outputs; the first is the reference
// implementation's first output from state 0, whose hash is the start of seed 0's sequence.
TEST(Random, HashIsTheSplitMix64Sequence) {
  std::uint64_t state = 0xe220a8397b1dcdaf;
  for (std::uint64_t index = 0; index < 5; ++index) {
    std::uint64_t z = state += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    EXPECT_EQ(Hash64(0, index), z ^ (z >> 31));
  }
}

TEST(Random, NeighbouringSeedsAndIndicesShareNoValue) {
  std::set<std::uint64_t> values;
  for (std::uint64_t seed = 0; seed < 100; ++seed)
    for (std::uint64_t index = 0; index < 100; ++index) values.insert(Hash64(seed, index));
  EXPECT_EQ(values.size(), 10000u);
}

TEST(Random, UniformFillsTheOpenUnitIntervalEvenly) {
  constexpr int kDraws = 100000, kBins = 20;
  std::vector<int> counts(kBins);
  for (int i = 0; i < kDraws; ++i) {
    const double u = Uniform01(7, i);
    ASSERT_GT(u, 0);
    ASSERT_LT(u, 1);
    ++counts[static_cast<int>(u * kBins)];
  }
  for (const int count : counts) EXPECT_NEAR(count, kDraws / kBins, 5 * std::sqrt(kDraws / kBins));
}

TEST(Random, GaussianHasTheMomentsOfANormalDistribution) {
  constexpr int kDraws = 200000;
  double sum[5] = {}, product = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = Gaussian(3, i);
    for (int power = 1; power < 5; ++power) sum[power] += std::pow(x, power) / kDraws;
    product += x * Gaussian(3, i + 1) / kDraws;
  }
  const double sigma = 1 / std::sqrt(kDraws);  // of the mean of kDraws draws
  EXPECT_NEAR(sum[1], 0, 4 * sigma);
  EXPECT_NEAR(sum[2], 1, 4 * sigma * std::sqrt(2));
  EXPECT_NEAR(sum[3], 0, 4 * sigma * std::sqrt(15));
  EXPECT_NEAR(sum[4], 3, 4 * sigma * std::sqrt(96));
  EXPECT_NEAR(product, 0, 4 * sigma);
}

TEST(Random, ValuesAreFixed) {
  EXPECT_EQ(Hash64(1, 2), Hash64(1, 2));
  EXPECT_NE(Hash64(1, 2), Hash64(2, 1));
  EXPECT_NE(Gaussian(1, 2), Gaussian(1, 3));
}

}  // namespace
}  // namespace sgf
