#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <type_traits>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/metrics/derivative.h>
#include <sgf/metrics/sample.h>
#include <sgf/metrics/traits.h>

/// Dissimilarities of two windows that are functions of a few sums over the pixel pairs. Each is a
/// struct M with
///
///     M::kInfo, M::kDim         as for point dissimilarities
///     M::Sums<T>                additive statistics; windows slide by += and -=
///     e.Value(sums)             the dissimilarity
///     e.Derivative(sums, i, j)  exact derivative for sample i of one pair (i, j) of the window
///     e(i, j)                   the dissimilarity of two spans of samples
///
/// A window without information (flat, black) has the value 1, that of unrelated windows, whatever
/// the other is, also if both are flat; its derivative is 0. Sums that slide leave rounding
/// residues behind; in double, sums of 8-bit intensities are exact.
namespace sgf::metrics {

namespace windowed_internal {

/// Sums over all pairs of two windows.
/// @throws Error for windows that are empty or differ in size.
template <class Metric, class T>
auto SumOver(std::span<const Sample<T>> i, std::span<const Sample<T>> j) {
  if (i.empty() || i.size() != j.size())
    throw Error(std::string(Metric::kInfo.name),
                fmt::format("windows of {} and {} pixels", i.size(), j.size()));
  typename Metric::template Sums<T> sums;
  for (size_t k = 0; k < i.size(); ++k) sums.Add(i[k], j[k]);
  return sums;
}

}  // namespace windowed_internal

/// Gradient orientation measure of Taylor et al. (eq. 5), in [0, 1]. Does not tell a gradient from
/// its opposite.
struct Gom {
  static constexpr MetricInfo kInfo{.name = "gom",
                                    .alias = "",
                                    .formula = "1 - sum_W |g_i.g_j| / sum_W |g_i| |g_j|",
                                    .equation = "5",
                                    .traits = {.kind = MetricKind::kWindow,
                                               .zero_at_equality = true,
                                               .symmetric = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  struct Sums {
    T dot = T(0);    ///< sum of |g_i.g_j|, (grey levels/px)^2
    T norms = T(0);  ///< sum of ||g_i|| ||g_j||, (grey levels/px)^2

    void Add(const Sample<T>& i, const Sample<T>& j) {
      const T product = i.gx * j.gx + i.gy * j.gy;
      dot += product < T(0) ? -product : product;
      norms += i.norm * j.norm;
    }
    Sums& operator+=(const Sums& other) {
      dot += other.dot;
      norms += other.norms;
      return *this;
    }
    Sums& operator-=(const Sums& other) {
      dot -= other.dot;
      norms -= other.norms;
      return *this;
    }
  };

  template <class T>
  T Value(const Sums<T>& window) const {
    return window.norms > T(0) ? T(1) - window.dot / window.norms : T(1);
  }

  template <class T>
  T operator()(std::span<const Sample<T>> i, std::span<const Sample<T>> j) const {
    return Value(windowed_internal::SumOver<Gom>(i, j));
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sums<T>& window, const Sample<T>& i,
                                    const Sample<T>& j) const {
    if (!(window.norms > T(0))) return {};
    const T similarity = window.dot / window.norms;
    const Vector2<T> d_dot = Sign(Gradient(i).dot(Gradient(j))) * Gradient(j);
    const Vector2<T> d_norms = j.norm * UnitGradient(i);
    return GradientDerivative<T, 1>(((similarity * d_norms - d_dot) / window.norms).transpose());
  }
};

/// One minus the normalised cross-correlation of the intensities; in [0, 1] where they are not
/// negative.
struct Ncc {
  static constexpr MetricInfo kInfo{.name = "ncc",
                                    .alias = "",
                                    .formula = "1 - sum_W I_i I_j / sqrt(sum_W I_i^2 sum_W I_j^2)",
                                    .equation = "-",
                                    .traits = {.kind = MetricKind::kWindow,
                                               .zero_at_equality = true,
                                               .symmetric = true,
                                               .gain_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  struct Sums {
    T ii = T(0), jj = T(0), ij = T(0);  ///< sums of products of intensities, (grey levels)^2

    void Add(const Sample<T>& i, const Sample<T>& j) {
      ii += i.intensity * i.intensity;
      jj += j.intensity * j.intensity;
      ij += i.intensity * j.intensity;
    }
    Sums& operator+=(const Sums& other) {
      ii += other.ii;
      jj += other.jj;
      ij += other.ij;
      return *this;
    }
    Sums& operator-=(const Sums& other) {
      ii -= other.ii;
      jj -= other.jj;
      ij -= other.ij;
      return *this;
    }
  };

  template <class T>
  T Value(const Sums<T>& window) const {
    using std::sqrt;
    if (IsBlack(window)) return T(1);
    return T(1) - window.ij / sqrt(window.ii * window.jj);
  }

  template <class T>
  T operator()(std::span<const Sample<T>> i, std::span<const Sample<T>> j) const {
    return Value(windowed_internal::SumOver<Ncc>(i, j));
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sums<T>& window, const Sample<T>& i,
                                    const Sample<T>& j) const {
    if (IsBlack(window)) return {};
    const T slope = window.ij / window.ii;
    return IntensityDerivative((slope * i.intensity - j.intensity) /
                               std::sqrt(window.ii * window.jj));
  }

 private:
  template <class T>
  static bool IsBlack(const Sums<T>& window) {
    return !(window.ii > T(0) && window.jj > T(0));
  }
};

/// One minus the zero-mean normalised cross-correlation of the intensities, in [0, 2].
struct Zncc {
  static constexpr MetricInfo kInfo{.name = "zncc",
                                    .alias = "",
                                    .formula = "1 - cov_W(I_i, I_j) / sqrt(var_W(I_i) var_W(I_j))",
                                    .equation = "-",
                                    .traits = {.kind = MetricKind::kWindow,
                                               .zero_at_equality = true,
                                               .symmetric = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true,
                                               .differentiable = true}};
  static constexpr int kDim = 1;

  template <class T>
  struct Sums {
    T n = T(0);                         ///< pixels
    T i = T(0), j = T(0);               ///< sums of intensities, grey levels
    T ii = T(0), jj = T(0), ij = T(0);  ///< sums of their products, (grey levels)^2

    void Add(const Sample<T>& sample_i, const Sample<T>& sample_j) {
      n += T(1);
      i += sample_i.intensity;
      j += sample_j.intensity;
      ii += sample_i.intensity * sample_i.intensity;
      jj += sample_j.intensity * sample_j.intensity;
      ij += sample_i.intensity * sample_j.intensity;
    }
    Sums& operator+=(const Sums& other) {
      n += other.n;
      i += other.i;
      j += other.j;
      ii += other.ii;
      jj += other.jj;
      ij += other.ij;
      return *this;
    }
    Sums& operator-=(const Sums& other) {
      n -= other.n;
      i -= other.i;
      j -= other.j;
      ii -= other.ii;
      jj -= other.jj;
      ij -= other.ij;
      return *this;
    }
  };

  template <class T>
  T Value(const Sums<T>& window) const {
    using std::sqrt;
    const Moments<T> m(window);
    return m.flat ? T(1) : T(1) - m.covariance / sqrt(m.variance_i * m.variance_j);
  }

  template <class T>
  T operator()(std::span<const Sample<T>> i, std::span<const Sample<T>> j) const {
    return Value(windowed_internal::SumOver<Zncc>(i, j));
  }

  template <class T>
  SampleDerivative<T, 1> Derivative(const Sums<T>& window, const Sample<T>& i,
                                    const Sample<T>& j) const {
    const Moments<T> m(window);
    if (m.flat) return {};
    const T centred_i = i.intensity - window.i / window.n;
    const T centred_j = j.intensity - window.j / window.n;
    const T slope = m.covariance / m.variance_i;
    return IntensityDerivative((slope * centred_i - centred_j) /
                               std::sqrt(m.variance_i * m.variance_j));
  }

 private:
  /// Central moments times the number of pixels.
  template <class T>
  struct Moments {
    T variance_i, variance_j, covariance;
    bool flat;  ///< a variance is no larger than the rounding of the sums it comes from

    explicit Moments(const Sums<T>& window)
        : variance_i(window.ii - window.i * window.i / window.n),
          variance_j(window.jj - window.j * window.j / window.n),
          covariance(window.ij - window.i * window.j / window.n) {
      using Real = std::conditional_t<std::is_same_v<T, float>, float, double>;
      const T rounding = window.n * T(std::numeric_limits<Real>::epsilon());
      flat = !(variance_i > rounding * window.ii && variance_j > rounding * window.jj);
    }
  };
};

}  // namespace sgf::metrics
