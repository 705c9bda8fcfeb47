#pragma once

#include <string_view>

/// What is known of a dissimilarity at compile time.
namespace sgf::metrics {

/// What a dissimilarity compares.
enum class MetricKind {
  kPoint,      ///< two samples: operator()(i, j)
  kWindow,     ///< two windows through additive Sums: one number
  kPatch,      ///< two patches: one residual per pixel
  kSignature,  ///< two bit signatures of neighbourhoods
};

/// What a dissimilarity returns.
enum class ResidualKind {
  kNonNegative,  ///< a cost: scalar, never negative
  kSigned,       ///< scalar of either sign; costs and least squares take its magnitude
  kVector,       ///< several components; costs and least squares take its norm
};

/// Properties of a dissimilarity e, each tested, and where it is false its absence too.
struct MetricTraits {
  MetricKind kind = MetricKind::kPoint;
  ResidualKind residual = ResidualKind::kNonNegative;
  bool zero_at_equality = false;  ///< e(i, i) = 0 (sgf: where ||a||^2 >= tau; windows: not flat)
  bool symmetric = false;         ///< e(i, j) = e(j, i); all others have e(i, j) = -e(j, i)
  bool gain_invariant = false;  ///< unchanged by I -> k I, k > 0, of one image, epsilon recomputed
  bool offset_invariant = false;  ///< unchanged by I -> I + c of one image
  bool differentiable = false;    ///< has a closed-form derivative, exact wherever it exists

  /// Whether more than one pixel enters.
  constexpr bool windowed() const { return kind != MetricKind::kPoint; }
};

/// One line of the name table; every dissimilarity holds its own as kInfo.
struct MetricInfo {
  std::string_view name;      ///< as in options files and result tables
  std::string_view alias;     ///< another accepted name, or empty
  std::string_view formula;   ///< one line, in the paper's notation
  std::string_view equation;  ///< number in the paper, "-" where it has none
  MetricTraits traits;
};

template <class M>
concept PointMetric = M::kInfo.traits.kind == MetricKind::kPoint;

template <class M>
concept WindowMetric = M::kInfo.traits.kind == MetricKind::kWindow;

}  // namespace sgf::metrics
