#pragma once

#include <sgf/metrics/difference_metrics.h>
#include <sgf/metrics/normalized_metrics.h>
#include <sgf/metrics/scaled_metrics.h>

/// All pointwise dissimilarities. Each is a small struct M with
///
///     M::kInfo                   name, formula, equation and traits
///     M::kDim                    components of the residual: 1 (T) or 2 (Vector2<T>)
///     e(i, j)                    the residual of sample i (moving image) against j (reference)
///     e.Derivative(i, j)         its exact derivative with respect to sample i
///
/// e(i, j) takes Sample<float>, Sample<double> or samples of ceres::Jet. At kinks (|x| at 0, ||g||
/// at g = 0) Derivative is 0 for the part that has none.
