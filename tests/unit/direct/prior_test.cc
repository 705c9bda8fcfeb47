#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <sgf/core/random.h>
#include <sgf/direct/prior.h>

namespace sgf::direct {
namespace {

constexpr int n = kFrameParameters;

/// A positive definite quadratic in the parameters of three key-frames.
struct Quadratic {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(3 * n);
};

Quadratic RandomQuadratic() {
  Quadratic q;
  Eigen::MatrixXd J(40, 3 * n);
  for (int i = 0; i < J.rows(); ++i)
    for (int k = 0; k < J.cols(); ++k) J(i, k) = Uniform01(7, i * 100 + k) - 0.5;
  // Units that differ: a translation weighs a million times what an offset of brightness does.
  for (int k = 0; k < J.cols(); ++k) J.col(k) *= k % n < 3 ? 1e3 : (k % n == 7 ? 1e-3 : 1);
  q.H = J.transpose() * J;
  for (int k = 0; k < q.b.size(); ++k) q.b(k) = J.col(k).sum();
  return q;
}

TEST(Prior, MarginalisingAFrameKeepsTheMinimumOfTheOthers) {
  const Quadratic q = RandomQuadratic();
  Prior prior;
  prior.Add({4, 9, 2}, q.H, q.b);
  const Eigen::VectorXd all = -q.H.ldlt().solve(q.b);
  prior.Marginalize(9);
  ASSERT_EQ(prior.frames(), (std::vector<int>{4, 2}));
  const Eigen::VectorXd rest = -prior.H().ldlt().solve(prior.b());
  Eigen::VectorXd expected(2 * n);
  expected << all.head<n>(), all.tail<n>();
  EXPECT_LT((rest - expected).cwiseQuotient(expected).norm(), 1e-4);
}

TEST(Prior, AddsWhatItIsGivenToTheRightFrames) {
  Prior prior;
  prior.Add({1, 2}, Eigen::MatrixXd::Identity(2 * n, 2 * n), Eigen::VectorXd::Ones(2 * n));
  prior.Add({2}, 2 * Eigen::MatrixXd::Identity(n, n), Eigen::VectorXd::Ones(n));
  EXPECT_EQ(prior.H()(0, 0), 1);
  EXPECT_EQ(prior.H()(prior.OffsetOf(2), prior.OffsetOf(2)), 3);
  EXPECT_EQ(prior.b()(prior.OffsetOf(2)), 2);
}

}  // namespace
}  // namespace sgf::direct
