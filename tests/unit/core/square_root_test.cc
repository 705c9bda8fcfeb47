#include <gtest/gtest.h>

#include <sgf/core/square_root.h>

namespace sgf {
namespace {

constexpr int n = 8;

TEST(SquareRootOf, IsTheSameQuadratic) {
  Eigen::MatrixXd A(n, n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) A(i, k) = i == k ? 3 + i : 1.0 / (1 + i + 2 * k);
  const Eigen::MatrixXd H = A.transpose() * A;
  const Eigen::VectorXd b = A.transpose() * Eigen::VectorXd::LinSpaced(n, -1, 2);
  const SquareRoot root = SquareRootOf(H, b);
  EXPECT_LT((root.S.transpose() * root.S - H).norm(), 1e-8 * H.norm());
  EXPECT_LT((root.S.transpose() * root.e - b).norm(), 1e-8 * b.norm());
}

TEST(SquareRootOf, LeavesOutWhatIsNotKnown) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  H(1, 1) = 4;
  const SquareRoot root = SquareRootOf(H, Eigen::VectorXd::Zero(n));
  EXPECT_EQ(root.S.rows(), 1);
  EXPECT_NEAR((root.S.transpose() * root.S - H).norm(), 0, 1e-9);
}

TEST(SquareRootOf, OfNothingIsEmpty) {
  EXPECT_EQ(SquareRootOf(Eigen::MatrixXd(0, 0), Eigen::VectorXd(0)).e.size(), 0);
}

}  // namespace
}  // namespace sgf
