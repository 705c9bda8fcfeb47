#include <array>
#include <vector>

#include <gtest/gtest.h>

#include <sgf/core/square_root.h>

namespace sgf {
namespace {

constexpr int n = 8;

Eigen::MatrixXd SomeMatrix() {
  Eigen::MatrixXd A(n, n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) A(i, k) = i == k ? 3 + i : 1.0 / (1 + i + 2 * k);
  return A;
}

TEST(SquareRootOf, IsTheSameQuadratic) {
  const Eigen::MatrixXd A = SomeMatrix();
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

/// Room for residuals and derivatives by blocks of 5, 1 and 2 parameters.
struct Asked {
  explicit Asked(int rows) : residuals(rows) {
    for (const int size : blocks) J.emplace_back(rows, size).setConstant(99);
    for (auto& block : J) jacobians.push_back(block.data());
  }

  Eigen::MatrixXd WholeJacobian() const {
    Eigen::MatrixXd whole(residuals.size(), n);
    whole << J[0], J[1], J[2];
    return whole;
  }

  const std::array<int, 3> blocks = {5, 1, 2};
  Eigen::VectorXd residuals;
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J = {};
  std::vector<double*> jacobians = {};
};

TEST(EvaluateRows, HandsThemOutBlockByBlock) {
  const Eigen::MatrixXd S = SomeMatrix().topRows(6);
  const Eigen::VectorXd e = Eigen::VectorXd::LinSpaced(6, -1, 2),
                        x = Eigen::VectorXd::LinSpaced(n, 2, 3);
  const std::array<const double*, 3> parameters = {x.data(), x.data() + 5, x.data() + 6};
  Asked asked(6), value_only(6);
  EvaluateRows(S, e, asked.blocks, parameters.data(), asked.residuals.data(),
               asked.jacobians.data());
  EXPECT_LT((asked.residuals - (S * x + e)).norm(), 1e-12);
  EXPECT_EQ(asked.WholeJacobian(), S);
  EvaluateRows(S, e, asked.blocks, parameters.data(), value_only.residuals.data(), nullptr);
  EXPECT_EQ(value_only.residuals, asked.residuals);
}

TEST(EvaluateReduced, HasTheCostItsSlopeAndItsCurvature) {
  const Eigen::MatrixXd A = SomeMatrix().topRows(5);  // three directions are not known
  const Eigen::MatrixXd H = A.transpose() * A;
  const Eigen::VectorXd b = A.transpose() * Eigen::VectorXd::LinSpaced(5, -1, 2);
  Asked asked(n + 1);
  asked.jacobians[1] = nullptr;
  EvaluateReduced(50, H, b, asked.blocks, asked.residuals.data(), asked.jacobians.data());
  EXPECT_NEAR(0.5 * asked.residuals.squaredNorm(), 50, 1e-9);
  EXPECT_EQ(asked.J[1](0, 0), 99) << "not asked for";
  const Eigen::MatrixXd J = asked.J[0];
  EXPECT_LT((J.transpose() * J - H.topLeftCorner<5, 5>()).norm(), 1e-8 * H.norm());
  EXPECT_LT((J.transpose() * asked.residuals - b.head<5>()).norm(), 1e-8 * b.norm());
}

}  // namespace
}  // namespace sgf
