#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace sgf::apps {

/// A similarity by which an image moves: it turns and grows about its centre, then shifts.
class ImageMotion {
 public:
  /// @param angle rad, from x towards y.
  /// @param shift px.
  ImageMotion(double angle, double scale, const Eigen::Vector2d& shift, cv::Size size);

  double angle() const { return angle_; }
  double scale() const { return scale_; }

  /// Where a pixel of the image is after the motion.
  Eigen::Vector2d operator()(const Eigen::Vector2d& pixel) const {
    return centre_ + shift_ + A_ * (pixel - centre_);
  }

  /// The moved image, sampled by cubic convolution; its border is replicated.
  cv::Mat1b Apply(const cv::Mat1b& image) const;

 private:
  double angle_, scale_;
  Eigen::Matrix2d A_;
  Eigen::Vector2d centre_, shift_;
};

}  // namespace sgf::apps
