#pragma once

#include <Eigen/Core>

namespace sgf {

/// x^T H x / 2 + b^T x as least squares, |S x + e|^2 / 2 up to a constant: S has a row for each
/// direction that anything is known of.
struct SquareRoot {
  Eigen::MatrixXd S;
  Eigen::VectorXd e;
};

/// @param H symmetric, without negative eigenvalues but for rounding.
SquareRoot SquareRootOf(const Eigen::MatrixXd& H, const Eigen::VectorXd& b);

}  // namespace sgf
