#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <sgf/core/require.h>
#include <sgf/direct/initializer.h>

namespace sgf::direct {
namespace {

constexpr int kLeastCorners = 60;

/// 8-bit image whose mean and contrast do not depend on the exposure.
cv::Mat1b Normalised(const cv::Mat1f& image) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  constexpr double kContrast = 50, kLeastDeviation = 4;
  const double gain = kContrast / std::max(deviation[0], kLeastDeviation);
  cv::Mat1b result;
  image.convertTo(result, CV_8U, gain, 128 - gain * mean[0]);
  return result;
}

SE3 ToSE3(const cv::Matx33d& R, const cv::Vec3d& t) {
  Eigen::Matrix3d rotation;
  cv::cv2eigen(R, rotation);
  return {Eigen::Quaterniond(rotation).normalized(), {t[0], t[1], t[2]}};
}

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <class T>
std::vector<T> Kept(const std::vector<T>& values, const std::vector<uchar>& keep) {
  std::vector<T> result;
  for (size_t k = 0; k < values.size(); ++k)
    if (keep[k]) result.push_back(values[k]);
  return result;
}

}  // namespace

void CheckOptions(const InitializerOptions& options) {
  Require(options.corners >= kLeastCorners, "initializer.corners", options.corners, "at least 60");
  Require(options.min_flow > 0, "initializer.min_flow", options.min_flow, "positive");
  Require(options.min_parallax_deg > 0, "initializer.min_parallax_deg", options.min_parallax_deg,
          "positive");
  Require(options.min_inliers > 0 && options.min_inliers <= 1, "initializer.min_inliers",
          options.min_inliers, "in (0, 1]");
  Require(options.max_frames >= 2, "initializer.max_frames", options.max_frames, "at least 2");
}

Initializer::Initializer(const Camera& camera, const InitializerOptions& options)
    : camera_(camera), options_(options) {
  CheckOptions(options);
}

std::optional<InitialMotion> Initializer::Add(const cv::Mat1f& image) {
  const cv::Mat1b normalised = Normalised(image);
  if (tracks_.empty() || frames() >= options_.max_frames || !Follow(normalised)) {
    Begin(normalised);
    return std::nullopt;
  }
  return Solve();
}

void Initializer::Begin(const cv::Mat1b& image) {
  constexpr double kQuality = 0.005, kSpacing = 8;  // px
  Corners corners;
  cv::goodFeaturesToTrack(image, corners, options_.corners, kQuality, kSpacing);
  tracks_.assign(1, corners);
  last_ = image;
}

/// @return whether enough corners are left.
bool Initializer::Follow(const cv::Mat1b& image) {
  if (static_cast<int>(tracks_.back().size()) < kLeastCorners) return false;
  Corners found, back;
  std::vector<uchar> there, here;
  std::vector<float> errors;
  const cv::Size window(21, 21);
  constexpr int kLevels = 4;
  cv::calcOpticalFlowPyrLK(last_, image, tracks_.back(), found, there, errors, window, kLevels);
  cv::calcOpticalFlowPyrLK(image, last_, found, back, here, errors, window, kLevels);
  constexpr double kMostDifference = 0.5;  // px
  for (size_t k = 0; k < found.size(); ++k)
    there[k] = there[k] && here[k] && cv::norm(back[k] - tracks_.back()[k]) < kMostDifference;
  tracks_.push_back(found);
  for (Corners& corners : tracks_) corners = Kept(corners, there);
  last_ = image;
  return static_cast<int>(tracks_.back().size()) >= kLeastCorners;
}

std::optional<InitialMotion> Initializer::Solve() const {
  const Corners &first = tracks_.front(), &last = tracks_.back();
  std::vector<double> flow;
  for (size_t k = 0; k < first.size(); ++k) flow.push_back(cv::norm(last[k] - first[k]));
  if (MedianOf(flow) < options_.min_flow * (camera_.width + camera_.height)) return std::nullopt;

  const cv::Matx33d K(camera_.fx, 0, camera_.cx, 0, camera_.fy, camera_.cy, 0, 0, 1);
  std::vector<uchar> inliers;
  const cv::Mat E = cv::findEssentialMat(first, last, K, cv::RANSAC, 0.9999, 0.7, inliers);
  if (E.rows != 3 || E.cols != 3) return std::nullopt;
  cv::Matx33d R;
  cv::Vec3d t;
  cv::Mat triangulated;
  constexpr double kFarthest = 200;  // baselines
  cv::recoverPose(E, first, last, K, R, t, kFarthest, inliers, triangulated);
  const auto agree =
      std::count_if(inliers.begin(), inliers.end(), [](uchar in) { return in != 0; });
  if (agree < kLeastCorners / 2 ||
      static_cast<double>(agree) < options_.min_inliers * static_cast<double>(first.size()))
    return std::nullopt;

  std::vector<cv::Point3d> points;
  std::vector<double> depths, parallaxes;
  for (int k = 0; k < triangulated.cols; ++k) {
    if (!inliers[k]) continue;
    cv::Matx41d X = triangulated.col(k);
    const cv::Vec3d point(X(0) / X(3), X(1) / X(3), X(2) / X(3));
    const cv::Vec3d seen = R * point + t;
    const double cosine = (R * point).dot(seen) / (cv::norm(point) * cv::norm(seen));
    points.emplace_back(point);
    depths.push_back(point[2]);
    parallaxes.push_back(std::acos(std::clamp(cosine, -1., 1.)) * 180 / CV_PI);
  }
  if (MedianOf(parallaxes) < options_.min_parallax_deg) return std::nullopt;

  const double unit = MedianOf(depths);
  InitialMotion motion;
  cv::Vec3d rotation, translation;
  bool guessed = false;
  for (const Corners& corners : tracks_) {
    const Corners seen = Kept(corners, inliers);
    if (&corners == &tracks_.front()) {
      motion.T_cam_first.emplace_back();
      continue;
    }
    if (&corners == &last) {
      motion.T_cam_first.push_back(ToSE3(R, t / unit));
      continue;
    }
    cv::solvePnP(points, seen, K, cv::noArray(), rotation, translation, guessed,
                 cv::SOLVEPNP_ITERATIVE);
    guessed = true;
    cv::Matx33d turn;
    cv::Rodrigues(rotation, turn);
    motion.T_cam_first.push_back(ToSE3(turn, translation / unit));
  }
  return motion;
}

}  // namespace sgf::direct
