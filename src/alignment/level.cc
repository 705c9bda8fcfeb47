#include <algorithm>
#include <array>
#include <numeric>

#include <opencv2/imgproc.hpp>

#include <sgf/alignment/level.h>
#include <sgf/alignment/sample_rows.h>
#include <sgf/core/parallel.h>

namespace sgf::alignment {

namespace {

internal::GreyRows RowsAround(const cv::Mat1f& image, int y) {
  return {image[std::max(y - 1, 0)], image[y], image[std::min(y + 1, image.rows - 1)], image.cols};
}

cv::Mat1f OneEpsilon(double sum, const cv::Mat1f& image, const LevelOptions& options) {
  const double mean = sum / static_cast<double>(image.total());
  return cv::Mat1f(1, 1, static_cast<float>(mean + options.epsilon.noise_floor));
}

/// The paper's epsilon (eq. 6) of a whole image, rows added up in order.
cv::Mat1f ImageEpsilon(const cv::Mat1f& image, const LevelOptions& options, int threads) {
  std::vector<double> sums(image.rows);
  ParallelForBatches(image.rows, threads, [&](int y) {
    sums[y] = internal::SumSquaredGradient(RowsAround(image, y), options.gradient);
  });
  return OneEpsilon(std::accumulate(sums.begin(), sums.end(), 0.), image, options);
}

bool OfWholeImage(const LevelOptions& options) {
  return options.epsilon.scope == metrics::EpsilonScope::kImage;
}

cv::Mat1f PixelEpsilon(const cv::Mat1f& image, const LevelOptions& options) {
  return metrics::ComputeEpsilon(ComputeGradient(image, options.gradient), options.epsilon);
}

/// @throws Error for an image that cannot be worked on.
cv::Mat1f ToFloat(const cv::Mat& grey, const LevelOptions& options) {
  RequireGreyImage(grey, "image");
  metrics::CheckOptions(options.epsilon);
  return grey;  // converts where it is not float
}

}  // namespace

void MakeSampleChannels(const cv::Mat& grey, const LevelOptions& options, SampleChannels& samples,
                        int threads) {
  const cv::Mat1f image = ToFloat(grey, options);
  const cv::Mat1f epsilon =
      OfWholeImage(options) ? ImageEpsilon(image, options, threads) : PixelEpsilon(image, options);
  samples.Create(image.rows, image.cols);
  ParallelForBatches(image.rows, threads, [&](int y) {
    internal::MakeSampleRow(RowsAround(image, y), options.gradient,
                            {epsilon[std::min(y, epsilon.rows - 1)], size_t(epsilon.cols)},
                            samples.Row(y));
  });
}

SampleChannels MakeSampleChannels(const cv::Mat& grey, const LevelOptions& options) {
  SampleChannels samples;
  MakeSampleChannels(grey, options, samples);
  return samples;
}

cv::Mat1f MakeGradientChannels(const cv::Mat& grey, const LevelOptions& options,
                               GradientChannels& gradients) {
  const cv::Mat1f image = ToFloat(grey, options);
  gradients.Create(image.rows, image.cols);
  double sum = 0;
  for (int y = 0; y < image.rows; ++y)
    sum += internal::MakeGradientRow(RowsAround(image, y), options.gradient, gradients.Row(y));
  return OfWholeImage(options) ? OneEpsilon(sum, image, options) : PixelEpsilon(image, options);
}

void MakeBitPlanes(const cv::Mat& grey, BitPlanes& planes) {
  RequireGreyImage(grey, "image");
  constexpr double kBefore = 0.75, kAfter = 1.5;  // px
  cv::Mat1f smooth;
  grey.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {}, kBefore, kBefore, cv::BORDER_REPLICATE);
  cv::Mat1f padded;
  cv::copyMakeBorder(smooth, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  std::array<cv::Mat, BitPlanes::kChannels> smoothed;
  for (int k = 0; k < BitPlanes::kChannels; ++k) {
    const int place = k < 4 ? k : k + 1;  // of the nine, without the centre
    const cv::Mat1f neighbour = padded(cv::Rect({place % 3, place / 3}, grey.size()));
    cv::Mat1f plane;
    cv::Mat(neighbour > smooth).convertTo(plane, CV_32F, 1 / 255.);
    cv::GaussianBlur(plane, smoothed[k], {}, kAfter, kAfter, cv::BORDER_REPLICATE);
  }
  planes.Assign(smoothed);
}

void GreyPyramid(const cv::Mat& grey, int levels, std::vector<cv::Mat1f>& pyramid) {
  RequireGreyImage(grey, "image");
  pyramid.resize(levels);
  // An image that another one may be looking at, as after a call with floats, is not written to.
  if (!pyramid[0].u || pyramid[0].u->refcount > 1) pyramid[0].release();
  if (grey.depth() == CV_32F)
    pyramid[0] = grey;
  else
    grey.convertTo(pyramid[0], CV_32F);
  for (int level = 1; level < levels; ++level) {
    const cv::Mat1f& fine = pyramid[level - 1];
    const cv::Size half(fine.cols / 2, fine.rows / 2);
    cv::resize(fine(cv::Rect({}, half * 2)), pyramid[level], half, 0, 0, cv::INTER_AREA);
  }
}

std::vector<cv::Mat1f> GreyPyramid(const cv::Mat& grey, int levels) {
  std::vector<cv::Mat1f> pyramid;
  GreyPyramid(grey, levels, pyramid);
  return pyramid;
}

Camera LevelCamera(const Camera& camera, int level) {
  const double scale = 1.0 / (1 << level);
  Camera result = camera;
  result.width = camera.width >> level;
  result.height = camera.height >> level;
  result.fx = camera.fx * scale;
  result.fy = camera.fy * scale;
  result.cx = ToLevel(camera.cx, level);
  result.cy = ToLevel(camera.cy, level);
  return result;
}

}  // namespace sgf::alignment
