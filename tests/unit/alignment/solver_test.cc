#include <cmath>

#include <gtest/gtest.h>

#include <sgf/alignment/robust.h>
#include <sgf/alignment/solver.h>

namespace sgf::alignment {
namespace {

/// Minimises residual(x)^2 from x = 1.
template <class ResidualAndSlope>
SolverSummary MinimizeFromOne(const ResidualAndSlope& residual, int max_iterations, double& x) {
  x = 1;
  NormalEquations<double, 1> last;
  const auto linearize = [&](double at) {
    const auto [r, slope] = residual(at);
    NormalEquations<double, 1> equations;
    equations.Add(Eigen::Matrix<double, 1, 1>(r), Eigen::Matrix<double, 1, 1>(slope), 1);
    equations.AddCost(0.5 * r * r, 1);
    return equations;
  };
  return Minimize<1>(
      x, linearize, [](double at, const auto& step) { return at + step(0); },
      {.max_iterations = max_iterations, .tolerance = 1e-12}, last);
}

TEST(Minimize, FindsTheRootOfAStraightLineAtOnce) {
  double x;
  const auto summary = MinimizeFromOne([](double at) { return std::pair(3 * at - 1, 3.); }, 5, x);
  EXPECT_TRUE(summary.converged);
  EXPECT_NEAR(x, 1 / 3., 1e-6);
}

TEST(Minimize, DoesNotCreepToADoubleRoot) {
  // Gauss-Newton halves the distance with every step: 0.004 after eight.
  double x;
  MinimizeFromOne([](double at) { return std::pair(at * at, 2 * at); }, 8, x);
  EXPECT_NEAR(x, 0, 1e-4);
}

TEST(RobustCost, IsTheSumOfRho) {
  for (const RobustKind kind : {RobustKind::kNone, RobustKind::kHuber, RobustKind::kStudentT}) {
    const RobustLoss<double> loss{kind, 0.3};
    RobustCost<double> cost(loss);
    double sum = 0;
    for (int k = 0; k < 500; ++k) {
      const double s = std::exp(0.05 * k - 10);  // squared norms from 5e-5 to 3e6
      cost.Add(s);
      sum += 0.5 * loss.Rho(s);
    }
    EXPECT_EQ(cost.residuals(), 500);
    EXPECT_NEAR(cost.Value(), sum, 1e-9 * sum);
  }
}

}  // namespace
}  // namespace sgf::alignment
