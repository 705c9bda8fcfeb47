#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <sgf/core/parallel.h>
#include <sgf/stereo/mesh_refine.h>

namespace sgf::stereo::internal {
namespace {

float PlaneAt(const Plane& plane, int x, int y) {
  return plane.At(static_cast<float>(x), static_cast<float>(y));
}

// A histogram of disparities whose median is found in two steps.
class Histogram {
 public:
  static constexpr int kBinsPerPx = 8;

  explicit Histogram(int num_disparities)
      : bins_(static_cast<size_t>(num_disparities) * kBinsPerPx + 1),
        coarse_(num_disparities + 1) {}

  void Clear() {
    std::fill(bins_.begin(), bins_.end(), 0);
    std::fill(coarse_.begin(), coarse_.end(), 0);
  }
  void Add(int bin, int weight) {
    bins_[bin] += weight;
    coarse_[bin / kBinsPerPx] += weight;
  }
  // The first bin at which half of the weight is reached; there has to be some.
  int Median() const {
    const int64_t total = std::accumulate(coarse_.begin(), coarse_.end(), int64_t{0});
    int64_t sum = 0;
    size_t k = 0;
    while (2 * (sum + coarse_[k]) < total) sum += coarse_[k++];
    size_t bin = k * kBinsPerPx;
    while (2 * (sum += bins_[bin]) < total) ++bin;
    return static_cast<int>(bin);
  }

 private:
  std::vector<int> bins_, coarse_;
};

// Disparities as histogram bins.
cv::Mat1i Quantise(const cv::Mat1f& disparity, const MeshStereoOptions& options) {
  const auto unit = static_cast<float>(Histogram::kBinsPerPx);
  const auto least = static_cast<float>(options.min_disparity);
  const int highest = (options.num_disparities - 1) * Histogram::kBinsPerPx;
  cv::Mat1i bins(disparity.size());
  for (int y = 0; y < bins.rows; ++y)
    for (int x = 0; x < bins.cols; ++x)
      bins(y, x) =
          std::clamp(static_cast<int>(std::lrint(unit * (disparity(y, x) - least))), 0, highest);
  return bins;
}

void AddWindow(const SupportWindows& windows, int i, const cv::Mat1i& bins, Histogram& histogram) {
  const cv::Point centre = windows.Centre(i);
  const int radius = windows.window() / 2;
  const cv::Rect inside = WindowInside(centre, radius, bins.size());
  for (int y = inside.y; y < inside.br().y; ++y)
    for (int x = inside.x; x < inside.br().x; ++x)
      if (const int weight = windows.Weight(i, x, y)) histogram.Add(bins(y, x), weight);
}

}  // namespace

cv::Mat1f Render(const TriangleMesh& mesh, const std::vector<Plane>& planes, int min_disparity,
                 int num_disparities) {
  cv::Mat1f disparity(mesh.owner.size());
  const auto low = static_cast<float>(min_disparity);
  const auto high = static_cast<float>(min_disparity + num_disparities - 1);
  for (int y = 0; y < disparity.rows; ++y)
    for (int x = 0; x < disparity.cols; ++x)
      disparity(y, x) = std::clamp(PlaneAt(planes[mesh.owner(y, x)], x, y), low, high);
  return disparity;
}

cv::Mat1b CheckLeftRight(const cv::Mat1f& left, const cv::Mat1f& right, double largest) {
  cv::Mat1b valid(left.size());
  for (int y = 0; y < left.rows; ++y)
    for (int x = 0; x < left.cols; ++x) {
      const auto partner = std::lrint(static_cast<float>(x) - left(y, x));
      const bool inside = partner >= 0 && partner < left.cols;
      valid(y, x) =
          inside && std::abs(left(y, x) - right(y, static_cast<int>(partner))) <= largest ? 255 : 0;
    }
  return valid;
}

void MedianOfInvalid(const cv::Mat& image, const cv::Mat1b& valid, const MeshStereoOptions& options,
                     cv::Mat1f& disparity) {
  if (options.median_window == 0) return;
  const cv::Mat1i bins = Quantise(disparity, options);
  ParallelFor(disparity.rows, options.threads, [&](int y) {
    std::vector<cv::Point> holes;
    for (int x = 0; x < disparity.cols; ++x)
      if (!valid(y, x)) holes.emplace_back(x, y);
    const SupportWindows windows(image, holes, options.median_window, options.gamma, 1);
    Histogram histogram(options.num_disparities);
    for (size_t i = 0; i < holes.size(); ++i) {
      histogram.Clear();
      AddWindow(windows, static_cast<int>(i), bins, histogram);
      disparity(holes[i]) = static_cast<float>(options.min_disparity) +
                            static_cast<float>(histogram.Median()) / Histogram::kBinsPerPx;
    }
  });
}

}  // namespace sgf::stereo::internal
