#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/metrics/epsilon.h>

namespace sgf::metrics {
namespace {

void CheckPlanes(const GradientImage& gradient) {
  if (gradient.x.empty()) throw Error("gradient", "image is empty");
  if (gradient.x.size() != gradient.y.size())
    throw Error("gradient", fmt::format("planes differ in size: {}x{} and {}x{}", gradient.x.cols,
                                        gradient.x.rows, gradient.y.cols, gradient.y.rows));
}

cv::Mat1f SquaredMagnitude(const GradientImage& gradient) {
  return gradient.x.mul(gradient.x) + gradient.y.mul(gradient.y);
}

// One image axis divided evenly into cells, and the way from a pixel to the cells around it.
class TileAxis {
 public:
  TileAxis(int size, int tile_px)
      : size_(size), count_(std::max(1, static_cast<int>(std::lround(double(size) / tile_px)))) {}

  int count() const { return count_; }

  int Begin(int cell) const { return static_cast<int>(int64_t{size_} * cell / count_); }

  // A value at pixel p is (1 - weight) * cell + weight * next.
  struct Position {
    int cell, next;
    double weight;
  };

  Position Locate(int pixel) const {
    const double cell_px = static_cast<double>(size_) / count_;
    const double position = std::clamp((pixel + 0.5) / cell_px - 0.5, 0.0, count_ - 1.0);
    const int cell = static_cast<int>(position);
    return {cell, std::min(cell + 1, count_ - 1), position - cell};
  }

 private:
  int size_, count_;
};

cv::Mat1d TileMeans(const cv::Mat1f& squared, const TileAxis& rows, const TileAxis& cols) {
  cv::Mat1d means(rows.count(), cols.count());
  for (int i = 0; i < means.rows; ++i)
    for (int k = 0; k < means.cols; ++k)
      means(i, k) = cv::mean(squared(cv::Range(rows.Begin(i), rows.Begin(i + 1)),
                                     cv::Range(cols.Begin(k), cols.Begin(k + 1))))[0];
  return means;
}

cv::Mat1f TileEpsilon(const cv::Mat1f& squared, int tile_px) {
  const TileAxis rows(squared.rows, tile_px), cols(squared.cols, tile_px);
  const cv::Mat1d means = TileMeans(squared, rows, cols);
  std::vector<TileAxis::Position> across(squared.cols);
  for (int x = 0; x < squared.cols; ++x) across[x] = cols.Locate(x);
  cv::Mat1f epsilon(squared.size());
  for (int y = 0; y < squared.rows; ++y) {
    const TileAxis::Position down = rows.Locate(y);
    for (int x = 0; x < squared.cols; ++x) {
      const auto [cell, next, weight] = across[x];
      const double above = std::lerp(means(down.cell, cell), means(down.cell, next), weight);
      const double below = std::lerp(means(down.next, cell), means(down.next, next), weight);
      epsilon(y, x) = static_cast<float>(std::lerp(above, below, down.weight));
    }
  }
  return epsilon;
}

cv::Mat1f WindowEpsilon(const cv::Mat1f& squared, int window_px) {
  cv::Mat1f epsilon;
  cv::boxFilter(squared, epsilon, CV_32F, cv::Size(window_px, window_px), cv::Point(-1, -1), true,
                cv::BORDER_REPLICATE);
  // The filter's running sums may leave a negative rounding residue behind strong gradients.
  return cv::max(epsilon, 0);
}

cv::Mat1f MeanSquared(const GradientImage& gradient, const EpsilonOptions& options) {
  switch (options.scope) {
    case EpsilonScope::kTile:
      return TileEpsilon(SquaredMagnitude(gradient), options.tile_px);
    case EpsilonScope::kWindow:
      return WindowEpsilon(SquaredMagnitude(gradient), options.window_px);
    case EpsilonScope::kImage:
      break;
  }
  return cv::Mat1f(gradient.x.size(), static_cast<float>(MeanSquaredGradient(gradient)));
}

}  // namespace

std::span<const std::pair<const char*, EpsilonScope>> EnumNames(EpsilonScope) {
  static constexpr std::array<std::pair<const char*, EpsilonScope>, 3> kNames{
      {{"image", EpsilonScope::kImage},
       {"tile", EpsilonScope::kTile},
       {"window", EpsilonScope::kWindow}}};
  return kNames;
}

void CheckOptions(const EpsilonOptions& options) {
  if (options.tile_px < 1)
    throw Error("tile_px", fmt::format("must be at least 1, got {}", options.tile_px));
  if (options.window_px < 1 || options.window_px % 2 == 0)
    throw Error("window_px", fmt::format("must be odd and positive, got {}", options.window_px));
  if (!(options.noise_floor >= 0) || std::isinf(options.noise_floor))
    throw Error("noise_floor",
                fmt::format("must be finite and not negative, got {}", options.noise_floor));
}

cv::Mat1f ComputeEpsilon(const GradientImage& gradient, const EpsilonOptions& options) {
  CheckPlanes(gradient);
  CheckOptions(options);
  cv::Mat1f epsilon = MeanSquared(gradient, options);
  if (options.noise_floor > 0) epsilon += options.noise_floor;
  return epsilon;
}

}  // namespace sgf::metrics
