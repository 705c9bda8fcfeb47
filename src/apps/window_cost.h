#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <opencv2/core.hpp>

#include <sgf/core/error.h>
#include <sgf/core/gradient.h>
#include <sgf/metrics/registry.h>
#include <sgf/stereo/block_matcher.h>

/// Exact costs of windows, in double: what the studies of single images are made with. Stereo
/// matching has its own, faster rows (stereo/cost_rows.h) of the same dissimilarities.
namespace sgf::apps {

/// How the samples of an image are made.
struct SampleOptions {
  GradientOperator gradient = GradientOperator::kCentral;
  metrics::EpsilonOptions epsilon;
  double tau = metrics::kTau;

  template <class V>
  void VisitFields(V&& visit) {
    visit("gradient", gradient, "", "derivative operator");
    visit("epsilon", epsilon, "", "normalisation of gradients, eq. 6");
    visit("tau", tau, "", "lower bound of the denominator of sgf, eq. 10");
  }
};

/// The samples of an image in double.
class SampleField {
 public:
  /// @param grey one channel, 8-bit or float.
  /// @throws Error for an image that cannot be worked on, or options out of range.
  SampleField(const cv::Mat& grey, const SampleOptions& options);

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  const metrics::Sample<double>& At(int y, int x) const {
    return samples_[static_cast<size_t>(y) * cols_ + x];
  }

 private:
  int rows_, cols_;
  std::vector<metrics::Sample<double>> samples_;
};

/// Cost of a window by a dissimilarity, from sums over its pixel pairs: the sum of magnitudes for a
/// point dissimilarity, its own value for one that has a window.
template <class Metric>
struct WindowCost;

template <metrics::PointMetric Metric>
struct WindowCost<Metric> {
  using Sums = double;
  static constexpr bool kGrowsWithWindow = true;  ///< twice the pixels, twice the cost

  Metric metric;

  Sums Pair(const metrics::Sample<double>& i, const metrics::Sample<double>& j) const {
    if constexpr (Metric::kDim == 1)
      return std::abs(metric(i, j));
    else
      return metric(i, j).norm();
  }
  double Value(Sums window) const { return window; }
};

template <metrics::WindowMetric Metric>
struct WindowCost<Metric> {
  using Sums = typename Metric::template Sums<double>;
  static constexpr bool kGrowsWithWindow = false;

  Metric metric;

  Sums Pair(const metrics::Sample<double>& i, const metrics::Sample<double>& j) const {
    Sums sums;
    sums.Add(i, j);
    return sums;
  }
  double Value(const Sums& window) const { return metric.Value(window); }
};

/// f(WindowCost<M>) for the dissimilarity with this name or alias.
/// @throws Error listing the known names, or for one that is no cost of a window (census, lssd).
template <class F>
auto VisitWindowCost(const std::string& name, const stereo::PmOptions& pm, F&& f) {
  return metrics::VisitMetric(name, [&](auto metric) -> decltype(f(WindowCost<metrics::Sgf>{})) {
    using Metric = decltype(metric);
    if constexpr (std::is_same_v<Metric, metrics::Pm>) metric = {pm.alpha, pm.tau_c, pm.tau_g};
    if constexpr (metrics::PointMetric<Metric> || metrics::WindowMetric<Metric>)
      return f(WindowCost<Metric>{metric});
    else
      throw Error("metric", fmt::format("'{}' is no sum over the pixel pairs of a window", name));
  });
}

}  // namespace sgf::apps
