#include <algorithm>
#include <array>

#include <opencv2/imgproc.hpp>

#include <sgf/alignment/level.h>

namespace sgf::alignment {

void MakeSampleChannels(const cv::Mat& grey, const LevelOptions& options, SampleChannels& samples) {
  static thread_local GradientImage memory;  // of the largest image so far, used again
  if (memory.x.rows < grey.rows || memory.x.cols < grey.cols)
    for (cv::Mat1f* plane : {&memory.x, &memory.y})
      plane->create(std::max(plane->rows, grey.rows), std::max(plane->cols, grey.cols));
  const cv::Rect whole({}, grey.size());
  GradientImage gradient{memory.x(whole), memory.y(whole)};
  ComputeGradient(grey, options.gradient, gradient);
  const cv::Mat1f epsilon = metrics::ComputeEpsilon(gradient, options.epsilon);
  cv::Mat1f intensity = grey;  // converts where it is not float
  const cv::Mat planes[] = {intensity, gradient.x, gradient.y, epsilon};
  samples.Assign(planes);
}

SampleChannels MakeSampleChannels(const cv::Mat& grey, const LevelOptions& options) {
  SampleChannels samples;
  MakeSampleChannels(grey, options, samples);
  return samples;
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

std::vector<cv::Mat1f> GreyPyramid(const cv::Mat& grey, int levels) {
  RequireGreyImage(grey, "image");
  std::vector<cv::Mat1f> pyramid(1);
  grey.convertTo(pyramid[0], CV_32F);
  for (int level = 1; level < levels; ++level) {
    const cv::Mat1f& fine = pyramid.back();
    const cv::Size half(fine.cols / 2, fine.rows / 2);
    cv::Mat1f coarse;
    cv::resize(fine(cv::Rect({}, half * 2)), coarse, half, 0, 0, cv::INTER_AREA);
    pyramid.push_back(coarse);
  }
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
