#pragma once

#include <algorithm>
#include <random>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <sgf/metrics/registry.h>
#include <sgf/metrics/sample.h>

/// Synthetic images in double precision for tests of the dissimilarities.
namespace sgf::metrics::testing {

/// googletest's list of the types in a tuple.
template <class Tuple>
struct TestTypesOf;
template <class... M>
struct TestTypesOf<std::tuple<M...>> {
  using Type = ::testing::Types<M...>;
};
using AllMetricTestTypes = TestTypesOf<MetricTypes>::Type;

/// Names typed tests after the dissimilarity.
struct MetricTestName {
  template <class M>
  static std::string GetName(int) {
    return std::string(M::kInfo.name);
  }
};

/// Random texture: multiples of 1/9 in [0, 255], noise smoothed over 3 x 3 pixels. Neighbouring
/// values that differ do so by far more than rounding, in float as well.
inline cv::Mat1d RandomTexture(int rows, int cols, unsigned seed) {
  std::mt19937 generator(seed);
  cv::Mat1d noise(rows + 2, cols + 2);
  for (double& value : noise) value = static_cast<double>(generator() % 256);
  cv::Mat1d texture(rows, cols);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x) texture(y, x) = cv::sum(noise(cv::Rect(x, y, 3, 3)))[0] / 9;
  return texture;
}

/// An image and its samples, everything in double: central differences with replicated border and
/// epsilon over the image (eq. 6).
struct Field {
  cv::Mat1d intensity;
  std::vector<Sample<double>> samples;  ///< row by row

  explicit Field(const cv::Mat1d& image) : intensity(image.clone()) {
    const int last_x = image.cols - 1, last_y = image.rows - 1;
    std::vector<Vector2<double>> gradients;
    double sum = 0;
    for (int y = 0; y <= last_y; ++y)
      for (int x = 0; x <= last_x; ++x) {
        gradients.emplace_back(
            (image(y, std::min(x + 1, last_x)) - image(y, std::max(x - 1, 0))) / 2,
            (image(std::min(y + 1, last_y), x) - image(std::max(y - 1, 0), x)) / 2);
        sum += gradients.back().squaredNorm();
      }
    const double epsilon = sum / static_cast<double>(image.total());
    for (size_t k = 0; k < gradients.size(); ++k)
      samples.push_back(MakeSample<double>(
          image(static_cast<int>(k) / image.cols, static_cast<int>(k) % image.cols),
          gradients[k].x(), gradients[k].y(), epsilon));
  }

  /// Samples of a square window with its top left corner at (x, y).
  std::vector<Sample<double>> Window(int x, int y, int size) const {
    std::vector<Sample<double>> window;
    for (int row = y; row < y + size; ++row)
      for (int col = x; col < x + size; ++col)
        window.push_back(samples[row * intensity.cols + col]);
    return window;
  }
};

inline Eigen::VectorXd AsVector(double value) { return Eigen::VectorXd::Constant(1, value); }
inline Eigen::VectorXd AsVector(const Eigen::VectorXd& value) { return value; }

/// Residuals of a dissimilarity all over two images: at every pixel, or for windows of 5 x 5
/// pixels.
template <class M>
std::vector<Eigen::VectorXd> Residuals(const Field& i, const Field& j) {
  constexpr int kWindow = 5;
  const M metric;
  std::vector<Eigen::VectorXd> residuals;
  if constexpr (PointMetric<M>) {
    for (size_t k = 0; k < i.samples.size(); ++k)
      residuals.push_back(AsVector(metric(i.samples[k], j.samples[k])));
  } else if constexpr (M::kInfo.traits.kind == MetricKind::kSignature) {
    const CensusImage census_i = ComputeCensus(cv::Mat1f(i.intensity));
    const CensusImage census_j = ComputeCensus(cv::Mat1f(j.intensity));
    for (int y = 0; y < census_i.rows(); ++y)
      for (int x = 0; x < census_i.cols(); ++x)
        residuals.push_back(AsVector(metric(census_i.Row(y)[x], census_j.Row(y)[x])));
  } else {
    using Span = std::span<const Sample<double>>;
    for (int y = 0; y + kWindow <= i.intensity.rows; y += 2)
      for (int x = 0; x + kWindow <= i.intensity.cols; x += 2)
        residuals.push_back(
            AsVector(metric(Span(i.Window(x, y, kWindow)), Span(j.Window(x, y, kWindow)))));
  }
  return residuals;
}

}  // namespace sgf::metrics::testing
