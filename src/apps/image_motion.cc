#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <sgf/apps/image_motion.h>

namespace sgf::apps {
namespace {

// Weights of the four pixels around a place, `t` in [0, 1) after the second: cubic convolution with
// a = -1/2 (Keys, "Cubic convolution interpolation for digital image processing", 1981). Only that
// one keeps straight ramps; OpenCV's a = -3/4 would move the image by up to 0.03 px.
std::array<double, 4> CubicWeights(double t) {
  const double t2 = t * t, t3 = t2 * t;
  return {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2), 0.5 * (-3 * t3 + 4 * t2 + t),
          0.5 * (t3 - t2)};
}

// Grey level at a place; the border is replicated.
double SampleCubic(const cv::Mat1b& image, const Eigen::Vector2d& p) {
  const int x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
  const auto wx = CubicWeights(p.x() - x), wy = CubicWeights(p.y() - y);
  double sum = 0;
  for (int j = 0; j < 4; ++j) {
    const uchar* row = image[std::clamp(y + j - 1, 0, image.rows - 1)];
    for (int i = 0; i < 4; ++i)
      sum += wy[j] * wx[i] * row[std::clamp(x + i - 1, 0, image.cols - 1)];
  }
  return sum;
}

}  // namespace

ImageMotion::ImageMotion(double angle, double scale, const Eigen::Vector2d& shift, cv::Size size)
    : angle_(angle),
      scale_(scale),
      A_(scale * Eigen::Rotation2Dd(angle).toRotationMatrix()),
      centre_((size.width - 1) / 2.0, (size.height - 1) / 2.0),
      shift_(shift) {}

cv::Mat1b ImageMotion::Apply(const cv::Mat1b& image) const {
  const Eigen::Matrix2d back = A_.inverse();
  cv::Mat1b moved(image.size());
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector2d p = centre_ + back * (Eigen::Vector2d(x, y) - centre_ - shift_);
      moved(y, x) = cv::saturate_cast<uchar>(SampleCubic(image, p));
    }
  return moved;
}

}  // namespace sgf::apps
