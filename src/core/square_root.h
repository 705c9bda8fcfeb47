#pragma once

#include <span>

#include <Eigen/Core>

namespace sgf {

/// x^T H x / 2 + b^T x as least squares, |S x + e|^2 / 2 up to a constant: S has a row for each
/// direction that anything is known of.
struct SquareRoot {
  Eigen::MatrixXd S;  ///< r x n for n parameters, r <= n
  Eigen::VectorXd e;  ///< r
};

/// @param H n x n, symmetric, without negative eigenvalues but for rounding. @param b n.
/// @return nothing at all (0 x 0) for n = 0.
SquareRoot SquareRootOf(const Eigen::MatrixXd& H, const Eigen::VectorXd& b);

/// S x + e where the parameters come in blocks, in the form in which Ceres asks for it.
/// @param blocks their sizes, together as many as S has columns.
/// @param parameters x, block by block.
/// @param residuals room for as many as S has rows.
/// @param jacobians null, or for each block null or room for its columns of S, row by row.
void EvaluateRows(const Eigen::MatrixXd& S, const Eigen::VectorXd& e, std::span<const int> blocks,
                  const double* const* parameters, double* residuals, double** jacobians);

/// The same for a cost whose value is known, and slope b and curvature H, where the parameters are:
/// half the squared residuals are the cost. They are those of SquareRootOf(H, b), zeros, and a last
/// one without slope that makes up for the rest.
/// @param residuals room for one more than H has rows; `jacobians` have as many.
void EvaluateReduced(double cost, const Eigen::MatrixXd& H, const Eigen::VectorXd& b,
                     std::span<const int> blocks, double* residuals, double** jacobians);

}  // namespace sgf
