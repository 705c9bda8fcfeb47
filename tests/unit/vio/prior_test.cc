#include <vector>

#include <Eigen/LU>
#include <Eigen/QR>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/core/random.h>
#include <sgf/vio/prior.h>

namespace sgf::vio {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr BlockId kPose0{0, Part::kPose}, kMotion0{0, Part::kMotion}, kPose1{1, Part::kPose},
    kMotion1{1, Part::kMotion}, kPose2{2, Part::kPose};

MatrixXd RandomMatrix(Index rows, Index columns, std::uint64_t seed) {
  MatrixXd m(rows, columns);
  for (Index k = 0; k < m.size(); ++k) m(k) = Gaussian(seed, k);
  return m;
}

/// Normal equations: x^T H x / 2 + b^T x, and the blocks of x.
struct Normal {
  explicit Normal(std::vector<BlockId> order) : blocks(std::move(order)) {
    Index size = 0;
    for (const BlockId block : blocks) size += block.size();
    H = MatrixXd::Zero(size, size);
    b = VectorXd::Zero(size);
  }

  Index OffsetOf(BlockId wanted) const {
    Index offset = 0;
    for (const BlockId block : blocks) {
      if (block == wanted) return offset;
      offset += block.size();
    }
    ADD_FAILURE() << "no such block";
    return 0;
  }

  /// Where the parameters of some blocks are among all of them.
  std::vector<Index> IndicesOf(const std::vector<BlockId>& some) const {
    std::vector<Index> indices;
    for (const BlockId block : some)
      for (int k = 0; k < block.size(); ++k) indices.push_back(OffsetOf(block) + k);
    return indices;
  }

  void Add(const std::vector<BlockId>& some, const MatrixXd& S, const VectorXd& e) {
    const auto at = IndicesOf(some);
    H(at, at) += S.transpose() * S;
    b(at) += S.transpose() * e;
  }

  /// What minimising over all blocks but some leaves: the Schur complement.
  Normal Of(const std::vector<BlockId>& some) const {
    Normal rest(some);
    std::vector<BlockId> others;
    for (const BlockId block : blocks)
      if (std::find(some.begin(), some.end(), block) == some.end()) others.push_back(block);
    const auto a = IndicesOf(some), m = IndicesOf(others);
    const MatrixXd inverse = MatrixXd(H(m, m)).completeOrthogonalDecomposition().pseudoInverse();
    rest.H = H(a, a) - H(a, m) * inverse * H(m, a);
    rest.b = b(a) - H(a, m) * inverse * b(m);
    return rest;
  }

  std::vector<BlockId> blocks;
  MatrixXd H;
  VectorXd b;
};

void ExpectSame(const SquareRootPrior& prior, const Normal& expected) {
  EXPECT_EQ(prior.blocks(), expected.blocks);
  ASSERT_EQ(prior.S().cols(), expected.H.cols());
  const double scale = expected.H.norm();
  EXPECT_LT((prior.S().transpose() * prior.S() - expected.H).norm(), 1e-10 * scale);
  EXPECT_LT((prior.S().transpose() * prior.e() - expected.b).norm(), 1e-10 * scale);
  EXPECT_LE(prior.S().rows(), prior.S().cols()) << "no more rows than directions";
}

/// A chain as an odometry has it, in units far apart.
struct Chain {
  explicit Chain(std::uint64_t seed) {
    Add({kPose0, kMotion0}, 15, seed);
    Add({kPose0, kMotion0, kPose1, kMotion1}, 15, seed + 1);
    Add({kPose2, kPose0}, 12, seed + 2);  // another order than the prior's
    Add({kPose1, kPose2}, 12, seed + 3);
    Add({kMotion1}, 9, seed + 4);
  }

  void Add(const std::vector<BlockId>& blocks, Index rows, std::uint64_t seed) {
    Index size = 0;
    for (const BlockId block : blocks) size += block.size();
    MatrixXd S = RandomMatrix(rows, size, seed);
    Index column = 0;
    for (const BlockId block : blocks) {
      if (block.part == Part::kMotion) S.middleCols(column + 3, 3) *= 1e3;
      column += block.size();
    }
    const VectorXd e = RandomMatrix(rows, 1, seed + 100);
    prior.Add(blocks, S, e);
    normal.Add(blocks, S, e);
  }

  SquareRootPrior prior;
  Normal normal{{kPose0, kMotion0, kPose1, kMotion1, kPose2}};
};

TEST(SquareRootPrior, AddsRowsToTheirBlocks) {
  Chain chain(1);
  EXPECT_EQ(chain.prior.S().rows(), 63);
  EXPECT_EQ(chain.prior.blocks(), chain.normal.blocks) << "in the order of their first coming";
  EXPECT_LT((chain.prior.S().transpose() * chain.prior.S() - chain.normal.H).norm(),
            1e-12 * chain.normal.H.norm());
  EXPECT_LT((chain.prior.S().transpose() * chain.prior.e() - chain.normal.b).norm(),
            1e-12 * chain.normal.H.norm());
  EXPECT_EQ(chain.prior.OffsetOf(kPose0), 0);
  EXPECT_EQ(chain.prior.OffsetOf(kMotion0), 6);
  EXPECT_EQ(chain.prior.OffsetOf(kPose2), 30);
  EXPECT_TRUE(chain.prior.Has(kMotion1));
  EXPECT_FALSE(chain.prior.Has({2, Part::kMotion}));
  EXPECT_THAT(ErrorMessage([&] {
                chain.prior.OffsetOf({7, Part::kPose});
              }),
              testing::HasSubstr("has no frame 7"));
}

TEST(SquareRootPrior, MarginalizesToTheSchurComplement) {
  for (std::uint64_t seed = 0; seed < 200; seed += 10) {
    Chain chain(seed);
    chain.prior.Marginalize(std::vector{kMotion0, kPose0});
    ExpectSame(chain.prior, chain.normal.Of({kPose1, kMotion1, kPose2}));
    chain.prior.Marginalize(std::vector{kMotion1});
    ExpectSame(chain.prior, chain.normal.Of({kPose1, kPose2}));
  }
}

TEST(SquareRootPrior, AddsToWhatMarginalizationLeft) {
  Chain chain(5);
  chain.prior.Marginalize(std::vector{kPose1});
  chain.normal = chain.normal.Of({kPose0, kMotion0, kMotion1, kPose2});
  chain.Add({kPose2, kMotion0}, 20, 77);
  chain.prior.Marginalize(std::vector{kPose2});
  ExpectSame(chain.prior, chain.normal.Of({kPose0, kMotion0, kMotion1}));
}

TEST(SquareRootPrior, IgnoresBlocksThatItDoesNotHave) {
  Chain chain(3);
  const MatrixXd H = chain.prior.S().transpose() * chain.prior.S();
  chain.prior.Marginalize(std::vector<BlockId>{{9, Part::kPose}, {2, Part::kMotion}});
  ExpectSame(chain.prior, chain.normal);
  EXPECT_LT((chain.prior.S().transpose() * chain.prior.S() - H).norm(), 1e-12 * H.norm());
  SquareRootPrior empty;
  empty.Marginalize(std::vector{kPose0});
  EXPECT_TRUE(empty.blocks().empty());
  EXPECT_EQ(empty.e().size(), 0);
}

TEST(SquareRootPrior, TakesOutTheLastBlock) {
  SquareRootPrior prior;
  prior.Add(std::vector{kPose0}, RandomMatrix(6, 6, 1), VectorXd::Ones(6));
  prior.Marginalize(std::vector{kPose0});
  EXPECT_TRUE(prior.blocks().empty());
  EXPECT_EQ(prior.S().cols(), 0);
  prior.Add(std::vector{kPose1}, RandomMatrix(6, 6, 2), VectorXd::Ones(6));
  EXPECT_EQ(prior.S().rows(), 6);
}

TEST(SquareRootPrior, LeavesOutDirectionsThatNothingIsKnownOf) {
  for (const int known : {0, 1, 3, 5}) {
    // Rows that know only some directions of the leaving pose, and of what stays.
    const MatrixXd directions = RandomMatrix(known, 6, 8);
    MatrixXd S(20, 15);
    S.leftCols<6>() = RandomMatrix(20, known, 9) * directions;
    S.rightCols<9>() = RandomMatrix(20, 4, 10) * RandomMatrix(4, 9, 11);
    S.col(10).setZero();
    const VectorXd e = RandomMatrix(20, 1, 12);
    SquareRootPrior prior;
    prior.Add(std::vector{kPose0, kMotion1}, S, e);
    Normal normal({kPose0, kMotion1});
    normal.Add({kPose0, kMotion1}, S, e);
    prior.Marginalize(std::vector{kPose0});
    ExpectSame(prior, normal.Of({kMotion1}));
    EXPECT_EQ(prior.S().rows(), 4) << "a row for each direction that something is known of";
    EXPECT_TRUE(prior.S().allFinite());
  }
}

TEST(SquareRootPrior, KeepsUnobservableDirectionsThroughManyMarginalizations) {
  // Differences of neighbours only: all of them may move together, however many have left.
  SquareRootPrior prior;
  for (int k = 0; k < 200; ++k) {
    const MatrixXd A = RandomMatrix(6, 6, k);
    MatrixXd S(6, 12);
    S << A, -A;
    prior.Add(std::vector<BlockId>{{k, Part::kPose}, {k + 1, Part::kPose}}, S, VectorXd::Zero(6));
    MatrixXd far(6, 12);
    far << 1e-2 * A, -1e-2 * A;
    prior.Add(std::vector<BlockId>{{k, Part::kPose}, {k + 2, Part::kPose}}, far, VectorXd::Zero(6));
    prior.Marginalize(std::vector<BlockId>{{k, Part::kPose}});
    ASSERT_EQ(prior.blocks().size(), 2u);
    MatrixXd together(12, 6);
    together << MatrixXd::Identity(6, 6), MatrixXd::Identity(6, 6);
    ASSERT_LT((prior.S() * together).norm(), 1e-8 * prior.S().norm()) << k;
    ASSERT_LE(prior.S().rows(), 12);
  }
}

}  // namespace
}  // namespace sgf::vio
