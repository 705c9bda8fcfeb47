#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/odometry/rectification.h>

namespace sgf::odometry {
namespace {

constexpr const char* kWhere = "cameras";

// Bounds in normalised rectified coordinates (x/z, y/z).
struct View {
  double left = -std::numeric_limits<double>::infinity();
  double top = left;
  double right = -left;
  double bottom = -left;

  bool empty() const { return !(left < right && top < bottom); }
};

void RequirePair(const Camera& left, const Camera& right, const SE3& T_left_right) {
  left.Check();
  right.Check();
  const Eigen::Vector3d& p = T_left_right.p;
  if (!p.allFinite() || !(p.x() > p.norm() * std::numbers::sqrt2 / 2))
    throw Error(kWhere, fmt::format("the right camera is at ({}, {}, {}) m in the left one's "
                                    "coordinates; it has to be on its right, along +x",
                                    p.x(), p.y(), p.z()));
}

// Whether both images are seen by one ideal camera from centres along its x axis.
bool IsRectified(const Camera& a, const Camera& b, const SE3& T_left_right) {
  const bool same = a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
                    a.cx == b.cx && a.cy == b.cy;
  const double off_row = T_left_right.p.tail<2>().norm();
  return same && !a.distorted() && !b.distorted() && LogSO3(T_left_right.R).norm() < 1e-9 &&
         off_row < 1e-9 * T_left_right.p.norm();
}

// Axes of the rectified camera as columns, in left camera coordinates.
Eigen::Matrix3d RectifiedAxes(const SE3& T_left_right) {
  const Eigen::Vector3d mean_optical_axis =
      Eigen::Vector3d::UnitZ() + T_left_right.R * Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d axes;
  axes.col(0) = T_left_right.p.normalized();
  axes.col(1) = mean_optical_axis.cross(axes.col(0)).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

// Where a raw pixel lies in normalised rectified coordinates; nothing for a fisheye lens' pixels
// from 90 degrees off its axis on, which are farther out than all others.
std::optional<Eigen::Vector2d> RectifiedRay(const Camera& camera, const Eigen::Matrix3d& R_raw_rect,
                                            double x, double y) {
  const auto raw = camera.TryUnproject({x, y});
  if (!raw && camera.omega != 0) return std::nullopt;
  const Eigen::Vector3d ray = R_raw_rect.transpose() * (raw ? *raw : camera.Unproject({x, y}));
  if (ray.z() <= 0)
    throw Error(kWhere, fmt::format("pixel ({}, {}) looks away from the common view", x, y));
  return ray.hnormalized();
}

// Shrinks `view` until it lies within what a camera sees: within the innermost point of each side
// of its image. That one may lie between two pixels of the side, which costs less than 1e-3 px.
void ShrinkToImage(const Camera& camera, const Eigen::Matrix3d& R_raw_rect, View& view) {
  const double right = camera.width - 1, bottom = camera.height - 1;
  for (int y = 0; y < camera.height; ++y) {
    if (const auto ray = RectifiedRay(camera, R_raw_rect, 0, y))
      view.left = std::max(view.left, ray->x());
    if (const auto ray = RectifiedRay(camera, R_raw_rect, right, y))
      view.right = std::min(view.right, ray->x());
  }
  for (int x = 0; x < camera.width; ++x) {
    if (const auto ray = RectifiedRay(camera, R_raw_rect, x, 0))
      view.top = std::max(view.top, ray->y());
    if (const auto ray = RectifiedRay(camera, R_raw_rect, x, bottom))
      view.bottom = std::min(view.bottom, ray->y());
  }
}

// The camera of a size whose image just fits into a view: it fills the view's smaller side and
// shows the middle of the other.
Camera FittingCamera(const View& view, int width, int height) {
  if (view.empty() || width < 2 || height < 2)
    throw Error(kWhere, "have no common view that fills an image");
  Camera camera;
  camera.width = width;
  camera.height = height;
  const double x = (width - 1) / (view.right - view.left);
  const double y = (height - 1) / (view.bottom - view.top);
  camera.fx = camera.fy = std::max(x, y);
  camera.cx = 0.5 * ((width - 1) - camera.fx * (view.left + view.right));
  camera.cy = 0.5 * ((height - 1) - camera.fy * (view.top + view.bottom));
  return camera;
}

void RequireSize(const cv::Mat& image, cv::Size size, const char* name) {
  if (image.size() != size)
    throw Error(name, fmt::format("image is {}x{}, but the camera has {}x{} px", image.cols,
                                  image.rows, size.width, size.height));
}

RemapTable MakeTable(const Camera& raw, const Camera& ideal, const Eigen::Matrix3d& R_raw_ideal) {
  cv::Mat1f x(ideal.height, ideal.width), y(x.size());
  for (int v = 0; v < x.rows; ++v)
    for (int u = 0; u < x.cols; ++u) {
      const Eigen::Vector2d from = raw.Project(R_raw_ideal * ideal.Unproject({u, v}));
      x(v, u) = static_cast<float>(from.x());
      y(v, u) = static_cast<float>(from.y());
    }
  RemapTable table;
  cv::convertMaps(x, y, table.position, table.fraction, CV_16SC2);
  return table;
}

cv::Mat Remap(const cv::Mat& raw, const RemapTable& table) {
  if (table.position.empty()) return raw;
  cv::Mat rectified;
  // Rounding may leave a position at the edge outside of the image by 1/64 px at most.
  cv::remap(raw, rectified, table.position, table.fraction, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return rectified;
}

}  // namespace

Undistorter::Undistorter(const Camera& raw) : camera_(raw) {
  raw.Check();
  if (!raw.distorted()) return;
  View view;
  ShrinkToImage(raw, Eigen::Matrix3d::Identity(), view);
  camera_ = FittingCamera(view, raw.width, raw.height);
  table_ = MakeTable(raw, camera_, Eigen::Matrix3d::Identity());
}

cv::Mat Undistorter::Undistort(const cv::Mat& raw) const {
  RequireSize(raw, {camera_.width, camera_.height}, "image");
  return Remap(raw, table_);
}

StereoRectifier::StereoRectifier(const Camera& left, const Camera& right, const SE3& T_left_right)
    : camera_(left),
      baseline_m_(T_left_right.p.norm()),
      R_left_rect_(Eigen::Matrix3d::Identity()),
      R_right_rect_(Eigen::Matrix3d::Identity()),
      left_size_(left.width, left.height),
      right_size_(right.width, right.height) {
  RequirePair(left, right, T_left_right);
  if (IsRectified(left, right, T_left_right)) return;
  R_left_rect_ = RectifiedAxes(T_left_right);
  R_right_rect_ = T_left_right.R.conjugate() * R_left_rect_;
  View view;
  ShrinkToImage(left, R_left_rect_, view);
  ShrinkToImage(right, R_right_rect_, view);
  camera_ = FittingCamera(view, left.width, left.height);
  left_table_ = MakeTable(left, camera_, R_left_rect_);
  right_table_ = MakeTable(right, camera_, R_right_rect_);
}

std::pair<cv::Mat, cv::Mat> StereoRectifier::Rectify(const cv::Mat& left,
                                                     const cv::Mat& right) const {
  RequireSize(left, left_size_, "left image");
  RequireSize(right, right_size_, "right image");
  return {Remap(left, left_table_), Remap(right, right_table_)};
}

}  // namespace sgf::odometry
