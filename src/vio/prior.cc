#include <algorithm>
#include <cmath>

#include <Eigen/QR>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/vio/prior.h>

namespace sgf::vio {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

namespace {

int TotalSize(std::span<const BlockId> blocks) {
  int size = 0;
  for (const BlockId block : blocks) size += block.size();
  return size;
}

/// Turns the rows of [S e] such that the first `columns` columns are zero below as many rows as
/// they have directions that anything is known of.
/// @return the number of those rows.
Index Triangulate(Index columns, MatrixXd& rows) {
  constexpr double kKnown = 1e-10;  // of a column's norm; below are rounding errors
  const VectorXd norms = rows.leftCols(columns).colwise().norm();
  VectorXd work(rows.cols());
  Index rank = 0;
  for (Index k = 0; k < columns && rank < rows.rows(); ++k) {
    auto column = rows.col(k).tail(rows.rows() - rank);
    if (!(column.norm() > kKnown * norms(k))) continue;
    VectorXd essential(column.size() - 1);
    double tau = 0, beta = 0;
    column.makeHouseholder(essential, tau, beta);
    rows.bottomRightCorner(rows.rows() - rank, rows.cols() - k)
        .applyHouseholderOnTheLeft(essential, tau, work.data());
    ++rank;
  }
  return rank;
}

}  // namespace

bool SquareRootPrior::Has(BlockId block) const {
  return std::find(blocks_.begin(), blocks_.end(), block) != blocks_.end();
}

int SquareRootPrior::OffsetOf(BlockId block) const {
  const auto it = std::find(blocks_.begin(), blocks_.end(), block);
  if (it == blocks_.end()) throw Error("prior", fmt::format("has no frame {}", block.frame));
  return TotalSize(std::span(blocks_.begin(), it));
}

void SquareRootPrior::Add(std::span<const BlockId> blocks, const MatrixXd& S, const VectorXd& e) {
  for (const BlockId block : blocks)
    if (!Has(block)) blocks_.push_back(block);
  const Index before = S_.rows();
  S_.conservativeResizeLike(MatrixXd::Zero(before + S.rows(), TotalSize(blocks_)));
  e_.conservativeResize(before + e.size());
  e_.tail(e.size()) = e;
  Index column = 0;
  for (const BlockId block : blocks) {
    S_.block(before, OffsetOf(block), S.rows(), block.size()) = S.middleCols(column, block.size());
    column += block.size();
  }
}

void SquareRootPrior::Marginalize(std::span<const BlockId> blocks) {
  const auto leaves = [&](BlockId block) {
    return std::find(blocks.begin(), blocks.end(), block) != blocks.end();
  };
  std::vector<BlockId> order = blocks_;  // those that leave first
  std::stable_partition(order.begin(), order.end(), leaves);
  const auto stay = std::find_if_not(order.begin(), order.end(), leaves);
  const Index out = TotalSize(std::span(order.begin(), stay)), size = S_.cols();
  MatrixXd rows(S_.rows(), size + 1);
  Index column = 0;
  for (const BlockId block : order) {
    rows.middleCols(column, block.size()) = S_.middleCols(OffsetOf(block), block.size());
    column += block.size();
  }
  rows.col(size) = e_;
  const Index gone = Triangulate(out, rows);
  MatrixXd rest = rows.bottomRightCorner(rows.rows() - gone, size + 1 - out);
  const Index kept = std::min(rest.rows(), Triangulate(size - out, rest));
  S_ = rest.topLeftCorner(kept, size - out);
  e_ = rest.col(size - out).head(kept);
  blocks_.assign(stay, order.end());
}

}  // namespace sgf::vio
