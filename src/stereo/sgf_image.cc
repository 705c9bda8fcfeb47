#include <array>
#include <numeric>

#include <sgf/core/parallel.h>
#include <sgf/stereo/band.h>
#include <sgf/stereo/sgf_image.h>

namespace sgf::stereo::internal {
namespace {

// Eq. 6 of an 8-bit image without a gradient image: exact, so the same number as
// MeanSquaredGradient.
double MeanSquaredGradient(const cv::Mat1b& image, const CostOptions& options) {
  constexpr int kParts = 8;
  std::array<int64_t, kParts> sums{};
  ParallelFor(kParts, options.threads, [&](int i) {
    sums[i] = SumSquaredGradient(image, options.gradient, image.rows * i / kParts,
                                 image.rows * (i + 1) / kParts);
  });
  constexpr double kUnitsPerSquaredLevel = 32.0 * 32.0;
  const int64_t total = std::accumulate(sums.begin(), sums.end(), int64_t{0});
  return static_cast<double>(total) / kUnitsPerSquaredLevel / static_cast<double>(image.total());
}

bool UsesPixels(const cv::Mat& image, const CostOptions& options) {
  return image.type() == CV_8UC1 && options.epsilon.scope == metrics::EpsilonScope::kImage;
}

SgfImage FromPixels(const cv::Mat& image, const CostOptions& options) {
  const double epsilon = MeanSquaredGradient(image, options) + options.epsilon.noise_floor;
  return {image,
          options.gradient,
          {},
          cv::Mat1f(1, 1, static_cast<float>(epsilon)),
          static_cast<float>(options.tau)};
}

SgfImage FromGradient(const cv::Mat& image, const CostOptions& options) {
  SgfImage prepared{{},
                    options.gradient,
                    ComputeGradient(image, options.gradient),
                    {},
                    static_cast<float>(options.tau)};
  prepared.epsilon = metrics::ComputeEpsilon(prepared.gradient, options.epsilon);
  return prepared;
}

}  // namespace

SgfImage PrepareSgf(const cv::Mat& image, const CostOptions& options) {
  return UsesPixels(image, options) ? FromPixels(image, options) : FromGradient(image, options);
}

}  // namespace sgf::stereo::internal
