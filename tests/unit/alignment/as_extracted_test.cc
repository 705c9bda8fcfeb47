#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include <sgf/alignment/as_extracted.h>
#include <sgf/core/random.h>

namespace sgf::alignment {
namespace {

metrics::Sample<double> RandomSample(uint64_t seed, double epsilon) {
  return metrics::MakeSample<double>(0, 10 * Gaussian(seed, 0), 10 * Gaussian(seed, 1), epsilon);
}

// Median relative error, in per cent, on the gradients that docs/dissimilarities.md describes.
template <class AsExtracted, class Exact>
double MedianErrorPct() {
  std::vector<double> errors;
  for (uint64_t k = 0; k < 3000; ++k) {
    const auto i = RandomSample(2 * k, 30), j = RandomSample(2 * k + 1, 50);
    const auto exact = Exact{}.Derivative(i, j).gradient;
    errors.push_back((AsExtracted{}.Derivative(i, j).gradient - exact).norm() / exact.norm());
  }
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  return 100 * errors[errors.size() / 2];
}

TEST(AsExtracted, IsOffByWhatTheDocumentationSays) {
  EXPECT_NEAR((MedianErrorPct<SgfAsExtracted, metrics::Sgf>()), 7, 0.5);
  EXPECT_NEAR((MedianErrorPct<Sgf2AsExtracted, metrics::Sgf2>()), 48, 1);
  EXPECT_NEAR((MedianErrorPct<Sgf3AsExtracted, metrics::Sgf3>()), 35.5, 1);
}

// With epsilon = |g_i|^2 the two are the same in eq. 22.
TEST(AsExtracted, OfSgf2IsExactWhereEpsilonIsTheSquaredGradient) {
  for (const double epsilon_j : {1.0, 100.0}) {
    const auto i = metrics::MakeSample<double>(0, 3, -4, 25);
    const auto j = metrics::MakeSample<double>(0, 2, 5, epsilon_j);
    const auto exact = metrics::Sgf2{}.Derivative(i, j).gradient;
    EXPECT_LT((Sgf2AsExtracted{}.Derivative(i, j).gradient - exact).norm(), 1e-13);
  }
}

TEST(AsExtracted, IsFiniteWhereGradientsVanish) {
  const auto flat = metrics::MakeSample<double>(50, 0, 0, 0);
  const auto edge = metrics::MakeSample<double>(90, 3, -4, 30);
  for (const auto& [i, j] : {std::pair(flat, flat), std::pair(flat, edge), std::pair(edge, flat)}) {
    EXPECT_TRUE((SgfAsExtracted{}.Derivative(i, j).gradient.allFinite()));
    EXPECT_TRUE((Sgf2AsExtracted{}.Derivative(i, j).gradient.allFinite()));
    EXPECT_TRUE((Sgf3AsExtracted{}.Derivative(i, j).gradient.allFinite()));
  }
}

}  // namespace
}  // namespace sgf::alignment
