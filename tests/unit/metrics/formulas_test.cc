#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include <sgf/metrics/point_metrics.h>

namespace sgf::metrics {
namespace {

using Vec = Eigen::Vector2d;

constexpr double kEpsilonI = 30, kEpsilonJ = 50;

// A random pair of pixels and the paper's symbols for it, straight from their definitions.
struct Pair {
  double intensity_i, intensity_j;
  Vec g_i, g_j, a, b;
  Sample<double> i, j;
};

Pair MakePair(double intensity_i, double intensity_j, const Vec& g_i, const Vec& g_j) {
  return {intensity_i,
          intensity_j,
          g_i,
          g_j,
          g_i / std::sqrt(g_i.squaredNorm() + kEpsilonI),
          g_j / std::sqrt(g_j.squaredNorm() + kEpsilonJ),
          MakeSample<double>(intensity_i, g_i.x(), g_i.y(), kEpsilonI),
          MakeSample<double>(intensity_j, g_j.x(), g_j.y(), kEpsilonJ)};
}

// Gradients from far below to far above sqrt(epsilon), so that every branch is taken.
std::vector<Pair> RandomPairs() {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  std::vector<Pair> pairs;
  for (const double strength_i : {0.02, 1.0, 10.0, 300.0})
    for (const double strength_j : {0.02, 1.0, 10.0, 300.0})
      for (int k = 0; k < 200; ++k) {
        const Vec g_i(strength_i * normal(generator), strength_i * normal(generator));
        const Vec g_j(strength_j * normal(generator), strength_j * normal(generator));
        pairs.push_back(
            MakePair(128 + 8 * normal(generator), 128 + 8 * normal(generator), g_i, g_j));
      }
  return pairs;
}

TEST(Formulas, AreThePapers) {
  for (const Pair& p : RandomPairs()) {
    const double scale = 1e-12 * (1 + p.g_i.norm() * p.g_j.norm());
    EXPECT_EQ(Photo{}(p.i, p.j), p.intensity_i - p.intensity_j);
    EXPECT_EQ(Sad{}(p.i, p.j), std::abs(p.intensity_i - p.intensity_j));
    EXPECT_NEAR(Gm{}(p.i, p.j), p.g_i.norm() - p.g_j.norm(), scale);
    EXPECT_NEAR(Agm{}(p.i, p.j), std::abs(p.g_i.norm() - p.g_j.norm()), scale);
    EXPECT_EQ(Gn{}(p.i, p.j), p.g_i - p.g_j);
    EXPECT_NEAR(Ngf{}(p.i, p.j), 1 - std::pow(p.a.dot(p.b), 2), 1e-14);
    EXPECT_NEAR(Ugf{}(p.i, p.j), 1 - p.a.dot(p.b), 1e-14);
    const double largest = std::max({p.a.squaredNorm(), p.b.squaredNorm(), kTau});
    EXPECT_NEAR(Sgf{}(p.i, p.j), 1 - p.a.dot(p.b) / largest, 1e-14);
    const double n_ij = p.b.norm() / p.a.norm() * p.g_i.squaredNorm();
    const double n_ji = p.a.norm() / p.b.norm() * p.g_j.squaredNorm();
    EXPECT_NEAR(Sgf2{}(p.i, p.j), std::max(n_ij, n_ji) - p.g_i.dot(p.g_j),
                1e-12 * std::max(n_ij, n_ji));
    EXPECT_NEAR(Sgf3{}(p.i, p.j), p.g_i.norm() * p.g_j.norm() - p.g_i.dot(p.g_j), scale);
    EXPECT_LT((Ngv{}(p.i, p.j) - (p.a - p.b)).norm(), 1e-14);
    EXPECT_LT((Sgv{}(p.i, p.j) - (p.a - p.b) / std::sqrt(largest)).norm(), 1e-12);
    const double ratio = std::sqrt(p.g_j.norm() / p.g_i.norm());
    EXPECT_LT((Sgf3Vec{}(p.i, p.j) - (ratio * p.g_i - p.g_j / ratio)).norm(), scale);
  }
}

TEST(Formulas, OfPmBlendsAndTruncates) {
  const Pair near = MakePair(50, 53, Vec(1, 1), Vec(0.5, 1.25));
  const Pair far = MakePair(50, 70, Vec(1, 1), Vec(-3, 4));
  EXPECT_DOUBLE_EQ(Pm{}(near.i, near.j), 0.1 * 3 + 0.9 * 0.75);
  EXPECT_DOUBLE_EQ(Pm{}(far.i, far.j), 0.1 * 10 + 0.9 * 2);
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_DOUBLE_EQ((Pm{0.9, inf, inf}(far.i, far.j)), 0.1 * 20 + 0.9 * 7);
}

TEST(Formulas, OfNormalisedGradientsStayInRange) {
  for (const Pair& p : RandomPairs())
    for (const auto& [i, j] : {std::pair(p.i, p.j), std::pair(p.i, p.i)}) {
      const double ngf = Ngf{}(i, j), ugf = Ugf{}(i, j), sgf = Sgf{}(i, j);
      EXPECT_TRUE(ngf >= 0 && ngf <= 1) << ngf;
      EXPECT_TRUE(ugf >= 0 && ugf <= 2) << ugf;
      // 1 - x, where x <= 1 carries three roundings.
      EXPECT_TRUE(sgf >= -4e-16 && sgf <= 2 + 4e-16) << sgf;
    }
}

TEST(Formulas, SatisfyTheIdentitiesBetweenScalarsAndVectors) {
  for (const Pair& p : RandomPairs()) {
    const double a2 = p.a.squaredNorm(), b2 = p.b.squaredNorm(), largest = std::max(a2, b2);
    EXPECT_NEAR(Ugf{}(p.i, p.j), (Ngv{}(p.i, p.j).squaredNorm() + (1 - a2) + (1 - b2)) / 2, 1e-12);
    EXPECT_NEAR(Sgf3{}(p.i, p.j), Sgf3Vec{}(p.i, p.j).squaredNorm() / 2,
                1e-12 * p.i.norm * p.j.norm);
    if (largest < kTau) continue;
    const double imbalance = std::abs(a2 - b2) / largest;
    EXPECT_NEAR(Sgf{}(p.i, p.j), ((p.a - p.b).squaredNorm() / largest + imbalance) / 2, 1e-12);
    EXPECT_NEAR(Sgf{}(p.i, p.j), (Sgv{}(p.i, p.j).squaredNorm() + imbalance) / 2, 1e-12);
  }
}

TEST(Formulas, OnlyNgfTakesAGradientForItsOpposite) {
  const Pair opposite = MakePair(0, 0, Vec(6, 8), Vec(-6, -8));
  const Pair same = MakePair(0, 0, Vec(6, 8), Vec(6, 8));
  EXPECT_EQ(Ngf{}(opposite.i, opposite.j), Ngf{}(same.i, same.j));
  EXPECT_GT(Ugf{}(opposite.i, opposite.j), 1);
  EXPECT_LT(Ugf{}(same.i, same.j), 1);
  EXPECT_GT(Sgf{}(opposite.i, opposite.j), 1);
  EXPECT_LT(Sgf{}(same.i, same.j), 1);
}

// Figure 3 of the paper: a weak edge among stronger ones of its own direction.
TEST(Formulas, UgfPrefersTheStrongerEdgeAndSgfTheEqualOne) {
  const auto edge = [](double strength) { return MakeSample<double>(0, strength, 0, kEpsilonI); };
  EXPECT_LT(Ugf{}(edge(5), edge(20)), Ugf{}(edge(5), edge(5)));
  EXPECT_LT(Ngf{}(edge(5), edge(20)), Ngf{}(edge(5), edge(5)));
  EXPECT_GT(Sgf{}(edge(5), edge(20)), Sgf{}(edge(5), edge(5)) + 0.1);
}

// Image i darkened to 0.6, its epsilon with it: of its pixels, the one that was s times as strong
// as the reference matches where both regularised norms agree.
TEST(Formulas, MinimumOfSgf2MovesWithTheGain) {
  const double gain = 0.6, strength = std::sqrt(kEpsilonI);
  const Sample<double> reference = MakeSample<double>(0, strength, 0, kEpsilonI);
  const auto darkened = [&](double s) {
    return MakeSample<double>(0, gain * s * strength, 0, gain * gain * kEpsilonI);
  };
  const double moved = std::sqrt(2 - gain * gain) / gain;
  EXPECT_GT(moved, 2);
  EXPECT_NEAR(Sgf2{}(darkened(moved), reference), 0, 1e-12);
  EXPECT_GT(Sgf2{}(darkened(1), reference), 1);
  EXPECT_NEAR(Sgf{}(darkened(1), reference), 0, 1e-12);
  EXPECT_GT(Sgf{}(darkened(moved), reference), 0.1);
}

TEST(Formulas, OfSgf3IsBlindToMagnitudeAndFlatPixels) {
  const Pair parallel = MakePair(0, 0, Vec(3, 4), Vec(30, 40));
  const Pair flat = MakePair(0, 0, Vec(3, 4), Vec(0, 0));
  EXPECT_NEAR(Sgf3{}(parallel.i, parallel.j), 0, 1e-12);
  EXPECT_NEAR(Sgf3Vec{}(parallel.i, parallel.j).norm(), 0, 1e-12);
  EXPECT_EQ(Sgf3{}(flat.i, flat.j), 0);
  EXPECT_EQ(Sgf3Vec{}(flat.i, flat.j).norm(), 0);
}

TEST(Formulas, OfSgfRiseToOneBelowTau) {
  const double weak = std::sqrt(kEpsilonI * kTau / 4);
  const Sample<double> sample = MakeSample<double>(0, weak, 0, kEpsilonI);
  EXPECT_NEAR(Sgf{}(sample, sample), 0.75, 1e-4);
  const Sample<double> blank = MakeSample<double>(7, 0, 0, 0);
  EXPECT_EQ(Sgf{}(blank, blank), 1);
}

}  // namespace
}  // namespace sgf::metrics
