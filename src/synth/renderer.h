#pragma once

#include <memory>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>
#include <sgf/synth/scene.h>

namespace sgf::synth {

struct RenderOptions {
  int samples_per_pixel = 4;
  int light_texels = 300000;
  int light_samples = 64;
  int bounce_samples = 128;
  int threads = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("samples_per_pixel", samples_per_pixel, "", "rays per pixel: 1, 4 or 16");
    visit("light_texels", light_texels, "", "places at which light is baked, over the whole scene");
    visit("light_samples", light_samples, "",
          "shadow rays per place and lamp in penumbrae, rounded to a square");
    visit("bounce_samples", bounce_samples, "",
          "rays per place for sky light and light from other surfaces");
    visit("threads", threads, "", "threads; 0 for all cores");
  }
};

/// Identifies the rendering code and options in hashes of recipes: the same text, the same images.
std::string RenderingKey(const RenderOptions& options);

/// All layers of one view. Radiances are linear RGB.
struct Frame {
  std::vector<std::string> groups;  ///< names of the light groups
  std::vector<cv::Mat3f> light;     ///< radiance by each group alone, at its nominal strength
  cv::Mat3f diffuse;  ///< sum over the groups of what surfaces reflect matt; 0 for lamps and sky
  cv::Mat1f depth;    ///< m along the optical axis, at pixel centres; inf for the sky
  cv::Mat3f normal;   ///< world frame, unit, towards the camera; 0 for the sky
  cv::Mat1i id;       ///< object index + 1; 0 for lamps and sky

  /// Radiance of all groups, each scaled by its strength; all 1 when empty.
  cv::Mat3f Radiance(const std::vector<float>& strengths = {}) const;
};

/// The rays of a camera, computed once for many frames.
class PixelRays {
 public:
  /// @throws Error for a bad camera or a number of samples that is not 1, 4 or 16.
  PixelRays(const Camera& camera, int samples_per_pixel);
  ~PixelRays();
  PixelRays(PixelRays&&) noexcept;

  const Camera& camera() const;

 private:
  friend class Renderer;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Ray-traces a scene with Embree. The constructor bakes what static lamps send onto every surface,
/// directly and over two bounces, for each light group apart; a frame then costs its primary rays,
/// look-ups, and one more ray where a surface mirrors or shines. Same scene and options, same bits,
/// for any number of threads.
class Renderer {
 public:
  /// @throws Error for options out of range or a scene without objects or light.
  Renderer(Scene scene, const RenderOptions& options);
  ~Renderer();

  const Scene& scene() const;

  const RenderOptions& options() const;

  Frame Render(const PixelRays& rays, const SE3& T_world_cam) const;

  /// 255 where nothing stands between a depth map's point and another place, 0 elsewhere and for
  /// the sky. Whether the other place looks that way is not asked.
  /// @param depth m along the optical axis, of the camera's size.
  /// @param eye the other place, world, m.
  cv::Mat1b SeenFrom(const cv::Mat1f& depth, const Camera& camera, const SE3& T_world_cam,
                     const Eigen::Vector3d& eye) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Pose of a camera at `eye` that looks at `target`, image rows horizontal.
SE3 LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

}  // namespace sgf::synth
