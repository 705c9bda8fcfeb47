#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include <sgf/core/random.h>
#include <sgf/eval/statistics.h>

namespace sgf {
namespace {

TEST(WilsonInterval, HasTheValuesOfItsFormula) {
  const Interval half = WilsonInterval(50, 100);
  EXPECT_NEAR(half.low, 0.40383, 1e-5);
  EXPECT_NEAR(half.high, 0.59617, 1e-5);
  const Interval few = WilsonInterval(1, 10);
  EXPECT_NEAR(few.low, 0.01788, 1e-5);
  EXPECT_NEAR(few.high, 0.40415, 1e-5);
}

TEST(WilsonInterval, StaysWithinZeroAndOne) {
  const Interval none = WilsonInterval(0, 20), all = WilsonInterval(20, 20);
  EXPECT_NEAR(none.low, 0, 1e-12);
  EXPECT_GE(none.low, 0);
  EXPECT_NEAR(none.high, 0.16113, 1e-5);
  EXPECT_NEAR(all.low, 1 - none.high, 1e-12);
  EXPECT_LE(all.high, 1);
  EXPECT_TRUE(std::isnan(WilsonInterval(0, 0).low));
}

TEST(Median, IsTheMiddle) {
  EXPECT_EQ(Median({5, 1, 3}), 3);
  EXPECT_EQ(Median({5, 1, 4, 2}), 3);
  EXPECT_EQ(Median({7}), 7);
  EXPECT_TRUE(std::isnan(Median({})));
}

TEST(Quantile, IsTheNearestOfTheSortedValues) {
  EXPECT_EQ(Quantile({5, 1, 3, 2, 4}, 0), 1);
  EXPECT_EQ(Quantile({5, 1, 3, 2, 4}, 0.3), 2);
  EXPECT_EQ(Quantile({5, 1, 3, 2, 4}, 1), 5);
  EXPECT_TRUE(std::isnan(Quantile({}, 0.5)));
}

TEST(MedianInterval, IsThatOfTheOrderStatistics) {
  std::vector<double> values(401);
  std::iota(values.begin(), values.end(), 0);
  // The 95 % interval of the median's rank: 200 -+ 1.96 sqrt(401) / 2.
  const Interval interval = MedianInterval(values, 2000, 1);
  EXPECT_NEAR(interval.low, 200 - 19.6, 3);
  EXPECT_NEAR(interval.high, 200 + 19.6, 3);
}

TEST(MedianInterval, DependsOnTheSeedAlone) {
  std::vector<double> values;
  for (int k = 0; k < 50; ++k) values.push_back(Uniform01(3, k));
  const Interval a = MedianInterval(values, 40, 1), b = MedianInterval(values, 40, 1);
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
  const Interval other = MedianInterval(values, 40, 2);
  EXPECT_TRUE(other.low != a.low || other.high != a.high);
  EXPECT_TRUE(std::isnan(MedianInterval({}, 40, 1).low));
}

}  // namespace
}  // namespace sgf
