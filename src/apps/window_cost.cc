#include <sgf/apps/window_cost.h>
#include <sgf/metrics/sample_image.h>

namespace sgf::apps {

SampleField::SampleField(const cv::Mat& grey, const SampleOptions& options)
    : rows_(grey.rows), cols_(grey.cols) {
  metrics::RequireTau(options.tau);
  const GradientImage gradient = ComputeGradient(grey, options.gradient);
  const cv::Mat1f epsilon = metrics::ComputeEpsilon(gradient, options.epsilon);
  cv::Mat1d intensity;
  grey.convertTo(intensity, CV_64F);
  samples_.reserve(intensity.total());
  for (int y = 0; y < rows_; ++y)
    for (int x = 0; x < cols_; ++x)
      samples_.push_back(metrics::MakeSample<double>(intensity(y, x), gradient.x(y, x),
                                                     gradient.y(y, x), epsilon(y, x), options.tau));
}

}  // namespace sgf::apps
