#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include <sgf/core/square_root.h>

namespace sgf {

using Eigen::MatrixXd, Eigen::VectorXd;

namespace {

/// Hands out S block by block, with zeros below.
void CopyBlocks(const MatrixXd& S, std::span<const int> blocks, Eigen::Index rows,
                double** jacobians) {
  Eigen::Index column = 0;
  for (size_t k = 0; k < blocks.size(); column += blocks[k++]) {
    if (!jacobians[k]) continue;
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<RowMajor> J(jacobians[k], rows, blocks[k]);
    J.topRows(S.rows()) = S.middleCols(column, blocks[k]);
    J.bottomRows(rows - S.rows()).setZero();
  }
}

}  // namespace

SquareRoot SquareRootOf(const MatrixXd& H, const VectorXd& b) {
  if (b.size() == 0) return {};
  // Parameters have units of their own.
  const VectorXd unit = (H.diagonal().array().abs() + 1e-10).rsqrt();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(unit.asDiagonal() * H * unit.asDiagonal());
  constexpr double kLeast = 1e-9;  // of the largest; below are rounding errors
  const double least = kLeast * eigen.eigenvalues()(b.size() - 1);
  const Eigen::Index known = (eigen.eigenvalues().array() > least).count();  // the last ones
  const VectorXd root = eigen.eigenvalues().tail(known).cwiseSqrt();
  const MatrixXd V = eigen.eigenvectors().rightCols(known);
  return {root.asDiagonal() * V.transpose() * unit.cwiseInverse().asDiagonal(),
          root.cwiseInverse().asDiagonal() * V.transpose() * unit.asDiagonal() * b};
}

void EvaluateRows(const MatrixXd& S, const VectorXd& e, std::span<const int> blocks,
                  const double* const* parameters, double* residuals, double** jacobians) {
  Eigen::Map<VectorXd> r(residuals, e.size());
  r = e;
  Eigen::Index column = 0;
  for (size_t k = 0; k < blocks.size(); column += blocks[k++])
    r += S.middleCols(column, blocks[k]) * Eigen::Map<const VectorXd>(parameters[k], blocks[k]);
  if (jacobians) CopyBlocks(S, blocks, S.rows(), jacobians);
}

void EvaluateReduced(double cost, const MatrixXd& H, const VectorXd& b, std::span<const int> blocks,
                     double* residuals, double** jacobians) {
  const SquareRoot root = SquareRootOf(H, b);
  Eigen::Map<VectorXd> r(residuals, b.size() + 1);
  r.setZero();
  r.head(root.e.size()) = root.e;
  r(b.size()) = std::sqrt(std::max(0., 2 * cost - root.e.squaredNorm()));
  CopyBlocks(root.S, blocks, r.size(), jacobians);
}

}  // namespace sgf
