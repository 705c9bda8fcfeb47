#include <algorithm>

#include <sgf/alignment/point_selection.h>
#include <sgf/core/require.h>

namespace sgf::alignment {

void CheckOptions(const SelectionOptions& options) {
  Require(options.cell_px >= 1, "cell_px", options.cell_px, "positive");
  Require(options.border_px >= 0, "border_px", options.border_px, "at least 0");
  Require(options.min_gradient >= 0, "min_gradient", options.min_gradient, "at least 0");
}

std::vector<cv::Point> SelectPoints(const SampleChannels& image, const cv::Mat1b& eligible,
                                    const SelectionOptions& options) {
  const int border = options.border_px;
  const auto least = static_cast<float>(options.min_gradient * options.min_gradient);
  std::vector<cv::Point> points;
  for (int top = border; top < image.rows() - border; top += options.cell_px)
    for (int left = border; left < image.cols() - border; left += options.cell_px) {
      cv::Point best(-1, -1);
      float most = least;
      for (int y = top; y < std::min(top + options.cell_px, image.rows() - border); ++y)
        for (int x = left; x < std::min(left + options.cell_px, image.cols() - border); ++x) {
          const float* pixel = image.At(y, x);
          const float g2 =
              pixel[kGradientX] * pixel[kGradientX] + pixel[kGradientY] * pixel[kGradientY];
          if (g2 > most && eligible(y, x)) {
            most = g2;
            best = {x, y};
          }
        }
      if (best.x >= 0) points.push_back(best);
    }
  return points;
}

}  // namespace sgf::alignment
