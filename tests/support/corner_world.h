#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

namespace sgf::test {

inline const Camera kCamera{
    .width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 160, .cy = 120};

/// Two textured planes that meet in a corner before the camera: z = 4 + x/2 and z = 4 - x/2 (m),
/// whichever is nearer. Images and depths are computed pixel by pixel.
class CornerWorld {
 public:
  explicit CornerWorld(const Camera& camera) : camera_(camera) {}

  struct View {
    cv::Mat1b grey;
    cv::Mat1f depth_m;
  };

  View Render(const SE3& T_world_cam, double gain = 1, double offset = 0) const {
    View view{cv::Mat1b(camera_.height, camera_.width), cv::Mat1f(camera_.height, camera_.width)};
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector3d ray((x - camera_.cx) / camera_.fx, (y - camera_.cy) / camera_.fy, 1);
        const double depth = Depth(T_world_cam, ray);
        const double grey = Texture(T_world_cam * (depth * ray));
        view.grey(y, x) = cv::saturate_cast<uint8_t>(gain * grey + offset);
        view.depth_m(y, x) = static_cast<float>(depth);
      }
    return view;
  }

 private:
  static double Depth(const SE3& T_world_cam, const Eigen::Vector3d& ray) {
    const Eigen::Vector3d d = T_world_cam.R * ray;
    const Eigen::Vector3d& o = T_world_cam.p;
    // z = 4 + s x along o + t d
    const auto meet = [&](double s) { return (4 + s * o.x() - o.z()) / (d.z() - s * d.x()); };
    const double a = meet(0.5), b = meet(-0.5);
    return a > 0 && (b <= 0 || a < b) ? a : b;
  }

  static double Texture(const Eigen::Vector3d& p) {
    const double u = p.x(), v = p.y();
    return 120 + 28 * std::sin(9 * u + 4 * v) + 24 * std::sin(-13 * u + 11 * v + 1) +
           18 * std::sin(23 * u + 5 * v + 2) + 18 * std::sin(6 * u - 27 * v + 3) +
           12 * std::sin(31 * u + 29 * v + 4);
  }

  Camera camera_;
};

}  // namespace sgf::test
