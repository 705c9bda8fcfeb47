#include <Eigen/Eigenvalues>

#include <sgf/core/square_root.h>

namespace sgf {

using Eigen::MatrixXd, Eigen::VectorXd;

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

}  // namespace sgf
