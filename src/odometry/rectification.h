#pragma once

#include <utility>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

namespace sgf::odometry {

/// Where in a raw image each pixel of an ideal one comes from; empty where nothing is to be done.
struct RemapTable {
  cv::Mat position, fraction;  ///< as cv::convertMaps() makes them
};

/// Takes the distortion out of the images of one camera. The ideal camera has the same size, square
/// pixels and the smallest focal length at which every pixel has a value. One without distortion is
/// kept as it is, and so are its images.
class Undistorter {
 public:
  /// @throws Error for a camera out of range (Camera::Check()).
  explicit Undistorter(const Camera& raw);

  /// The image that the ideal camera takes, bilinearly interpolated.
  /// @throws Error for an image that is not of the camera's size.
  cv::Mat Undistort(const cv::Mat& raw) const;

  /// The ideal camera.
  const Camera& camera() const { return camera_; }

 private:
  Camera camera_;
  RemapTable table_;
};

/// Makes the rows of a calibrated stereo pair agree (Fusiello, Trucco, Verri: "A compact algorithm
/// for rectification of stereo pairs", 2000). Both images are seen by one ideal pinhole camera from
/// the two centres: its x axis points from the left to the right centre, its z axis is as close as
/// that allows to the mean of the two optical axes.
///
/// It has the raw left image's size, square pixels and the smallest focal length at which every
/// pixel has a value in both images: the widest view without any black border. Cameras that are
/// such a pair already are kept as they are, and so are their images.
class StereoRectifier {
 public:
  /// @param T_left_right maps coordinates of the right camera to those of the left.
  /// @throws Error for cameras out of range (Camera::Check()), a right camera that is not on the
  ///   right of the left one within 45 degrees, and cameras without a common view.
  StereoRectifier(const Camera& left, const Camera& right, const SE3& T_left_right);

  /// The rectified left and right image, of camera()'s size, bilinearly interpolated. Images of a
  /// pair that needs no rectification are passed on without a copy.
  /// @throws Error for an image that is not of its camera's size.
  std::pair<cv::Mat, cv::Mat> Rectify(const cv::Mat& left, const cv::Mat& right) const;

  /// The rectified camera, both left and right; without distortion.
  const Camera& camera() const { return camera_; }

  /// From the left to the right centre, along the rectified x axis, m.
  double baseline_m() const { return baseline_m_; }

  /// Maps rectified to raw left camera coordinates.
  const Eigen::Matrix3d& R_left_rect() const { return R_left_rect_; }

  /// Maps rectified to raw right camera coordinates.
  const Eigen::Matrix3d& R_right_rect() const { return R_right_rect_; }

 private:
  Camera camera_;
  double baseline_m_ = 0;
  Eigen::Matrix3d R_left_rect_, R_right_rect_;
  cv::Size left_size_, right_size_;
  RemapTable left_table_, right_table_;
};

}  // namespace sgf::odometry
