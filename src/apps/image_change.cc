#include <array>
#include <cmath>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/apps/image_change.h>
#include <sgf/core/error.h>
#include <sgf/core/random.h>

namespace sgf::apps {
namespace {

void Require(bool good, const char* option, const char* expected, double value) {
  if (!good) throw Error(option, fmt::format("must be {}, got {}", expected, value));
}

// Local light, exposure and vignette: one factor per pixel.
class Gain {
 public:
  Gain(cv::Size size, const ImageChange& change)
      : change_(change),
        centre_((size.width - 1) / 2.0, (size.height - 1) / 2.0),
        light_(change.light_x * size.width - 0.5, change.light_y * size.height - 0.5),
        corner2_(std::max(1.0, centre_.dot(centre_))),
        sigma_px_(change.light_radius * std::hypot(size.width, size.height)) {}

  double At(cv::Point2d pixel) const {
    const cv::Point2d from_centre = pixel - centre_;
    const double r2 = from_centre.dot(from_centre) / corner2_;
    return LightAt(pixel) * change_.exposure * (1 - change_.vignette * r2);
  }

 private:
  double LightAt(cv::Point2d pixel) const {
    if (change_.light == 0) return 1;
    const cv::Point2d from_light = (pixel - light_) / sigma_px_;
    return 1 + change_.light * std::exp(-0.5 * from_light.dot(from_light));
  }

  ImageChange change_;
  cv::Point2d centre_, light_;
  double corner2_, sigma_px_;
};

// Keeps 0 and 255 as they are.
double Curve(double level, double exponent) { return 255 * std::pow(level / 255, exponent); }

// Stored levels to light. Without a blur they are whole numbers: a table saves the power of each.
class ToLight {
 public:
  explicit ToLight(const ImageChange& change) : change_(change) {
    for (size_t level = 0; level < table_.size(); ++level)
      table_[level] = Curve(static_cast<double>(level), change.gamma);
  }

  double operator()(double level) const {
    return change_.blur > 0 ? Curve(level, change_.gamma) : table_[static_cast<size_t>(level)];
  }

 private:
  ImageChange change_;
  std::array<double, 256> table_;
};

// What happens to light: between the two gammas. The channels of a pixel stand side by side.
void ChangeLight(cv::Mat1d& levels, int channels, const ImageChange& change) {
  const Gain gain(cv::Size(levels.cols / channels, levels.rows), change);
  const bool curved = change.gamma != 1;
  const ToLight to_light(change);
  for (int y = 0; y < levels.rows; ++y)
    for (int x = 0; x < levels.cols; ++x) {
      double& level = levels(y, x);
      if (curved) level = to_light(level);
      level *= gain.At(cv::Point2d(x / channels, y));
      if (curved && change.encode) level = Curve(level, 1 / change.gamma);
    }
}

void AddNoise(cv::Mat1d& levels, double deviation, uint64_t seed) {
  uint64_t index = 0;
  for (double& level : levels) level += deviation * Gaussian(seed, index++);
}

}  // namespace

void CheckChange(const ImageChange& c) {
  for (const double value : {c.light_x, c.light_y, c.offset})
    Require(std::isfinite(value), "light_x, light_y and offset", "finite", value);
  Require(c.blur >= 0 && std::isfinite(c.blur), "blur", "finite and not negative", c.blur);
  Require(c.gamma > 0 && std::isfinite(c.gamma), "gamma", "finite and positive", c.gamma);
  Require(c.light > -1 && std::isfinite(c.light), "light", "finite and above -1", c.light);
  Require(c.light_radius > 0 && std::isfinite(c.light_radius), "light_radius",
          "finite and positive", c.light_radius);
  Require(c.exposure > 0 && std::isfinite(c.exposure), "exposure", "finite and positive",
          c.exposure);
  Require(c.vignette >= 0 && c.vignette < 1, "vignette", "in [0, 1)", c.vignette);
  Require(c.noise >= 0 && std::isfinite(c.noise), "noise", "finite and not negative", c.noise);
}

cv::Mat ApplyChange(const cv::Mat& image, const ImageChange& change, uint64_t seed) {
  CheckChange(change);
  const int channels = image.channels();
  cv::Mat blurred;
  image.convertTo(blurred, CV_64F);
  if (change.blur > 0) cv::GaussianBlur(blurred, blurred, cv::Size(), change.blur);
  cv::Mat1d levels = blurred.reshape(1);
  ChangeLight(levels, channels, change);
  levels += change.offset;
  if (change.noise > 0) AddNoise(levels, change.noise, seed);
  cv::Mat result;
  levels.reshape(channels).convertTo(result, change.quantise ? CV_8U : CV_32F);
  return result;
}

}  // namespace sgf::apps
