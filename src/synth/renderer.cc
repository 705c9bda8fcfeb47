#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <fmt/format.h>

#include <sgf/core/error.h>
#include <sgf/core/options.h>
#include <sgf/core/parallel.h>
#include <sgf/core/require.h>
#include <sgf/synth/lightmap.h>
#include <sgf/synth/ray_scene.h>
#include <sgf/synth/renderer.h>
#include <sgf/synth/shading.h>

namespace sgf::synth {

namespace {

using Eigen::Array4f;
using Eigen::Vector3f;
using internal::Hit;
using internal::kMaxGroups;
using internal::Ray;
using internal::Samples;
using internal::Surface;

// To be raised whenever the same scene or recipe gives other images, so that what was rendered
// before is not taken for up to date.
constexpr int kRenderingVersion = 1;

constexpr int kRowsPerTask = 8;
// So few that their samples stay in the cache, so many that the rays that some of them need on top
// fill packets.
constexpr int kPixelsPerRun = 32;

struct PixelXY {
  float x, y;
};

/// Places of the samples in a pixel, relative to its centre: a rotated grid for four, so that they
/// differ in rows and columns and surround the centre.
std::vector<PixelXY> SamplePlaces(int samples) {
  switch (samples) {
    case 1:
      return {{0, 0}};
    case 4:
      return {{-0.125f, -0.375f}, {0.375f, -0.125f}, {-0.375f, 0.125f}, {0.125f, 0.375f}};
    case 16: {
      std::vector<PixelXY> places;
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) places.push_back({(i - 1.5f) / 4, (j - 1.5f) / 4});
      return places;
    }
    default:
      throw Error("samples_per_pixel", fmt::format("is {}; known: 1, 4, 16", samples));
  }
}

}  // namespace

struct PixelRays::Impl {
  Camera camera;
  int samples;
  float pixel_angle;             // rad, side of a sample's share of a pixel at the image centre
  std::vector<PixelXY> rays;     // samples of a pixel together; camera frame, z = 1
  std::vector<PixelXY> centres;  // through the pixel centres
};

PixelRays::PixelRays(const Camera& camera, int samples_per_pixel)
    : impl_(std::make_unique<Impl>()) {
  camera.Check();
  const std::vector<PixelXY> places = SamplePlaces(samples_per_pixel);
  impl_->camera = camera;
  impl_->samples = samples_per_pixel;
  impl_->pixel_angle =
      static_cast<float>(2 / (camera.fx + camera.fy) / std::sqrt(samples_per_pixel));
  const auto ray = [&](double x, double y) {
    const Eigen::Vector3d p = camera.Unproject({x, y});
    return PixelXY{static_cast<float>(p.x()), static_cast<float>(p.y())};
  };
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      impl_->centres.push_back(ray(x, y));
      for (const PixelXY& place : places) impl_->rays.push_back(ray(x + place.x, y + place.y));
    }
}

PixelRays::~PixelRays() = default;
PixelRays::PixelRays(PixelRays&&) noexcept = default;

const Camera& PixelRays::camera() const { return impl_->camera; }

std::string RenderingKey(const RenderOptions& options) {
  RenderOptions key = options;
  key.threads = 0;  // does not change the images
  return fmt::format("rendering {}\n{}\n", kRenderingVersion, YAML::Dump(WriteOptions(key)));
}

cv::Mat3f Frame::Radiance(const std::vector<float>& strengths) const {
  if (!strengths.empty() && strengths.size() != light.size())
    throw Error("light strengths",
                fmt::format("{} given for {} groups", strengths.size(), light.size()));
  cv::Mat3f sum = cv::Mat3f::zeros(depth.size());
  // Not by OpenCV, which rounds differently where the processor has fused multiply-add.
  for (size_t g = 0; g < light.size(); ++g) {
    const float strength = strengths.empty() ? 1.0f : strengths[g];
    std::transform(light[g].begin(), light[g].end(), sum.begin(), sum.begin(),
                   [&](const cv::Vec3f& add, const cv::Vec3f& old) {
                     return cv::Vec3f(old[0] + strength * add[0], old[1] + strength * add[1],
                                      old[2] + strength * add[2]);
                   });
  }
  return sum;
}

struct Renderer::Impl {
  /// The pixels of a row that are traced and shaded together.
  struct Run {
    const PixelRays::Impl& pixel_rays;
    Eigen::Matrix3f R;
    Vector3f origin;
    int y = 0, first = 0, count = 0;
    std::vector<Ray> rays = {};  // samples of a pixel together
    std::vector<Hit> hits = {};

    /// Samples of the run's k-th pixel.
    Samples Of(int k) const {
      const int n = pixel_rays.samples;
      return {&rays[static_cast<size_t>(k) * n], &hits[static_cast<size_t>(k) * n], n};
    }

    size_t Pixel(int k) const {
      return static_cast<size_t>(y) * pixel_rays.camera.width + first + k;
    }

    Ray Towards(const PixelXY& place) const {
      return {origin, R.col(0) * place.x + R.col(1) * place.y + R.col(2)};
    }
  };

  Scene scene;
  RenderOptions options;
  internal::RayScene rays;
  internal::BakedLight baked;
  internal::Shader shader;

  Impl(Scene s, const RenderOptions& o)
      : scene(std::move(s)),
        options(o),
        rays(scene),
        baked(scene, rays, options),
        shader(scene, rays, baked) {}

  void StoreLight(const Run& run, Frame& frame) const;
  void StoreGeometry(const Run& run, Frame& frame) const;
  void StoreHit(const Hit& hit, const Vector3f& centre, int x, int y, Frame& frame) const;
  void RenderRow(const PixelRays::Impl& pixel_rays, const Eigen::Matrix3f& R,
                 const Vector3f& origin, int y, Frame& frame) const;
};

void Renderer::Impl::StoreLight(const Run& run, Frame& frame) const {
  std::vector<internal::PixelLight> lights;
  std::vector<internal::MirrorRay> mirrors;
  for (int k = 0; k < run.count; ++k)
    lights.push_back(shader.Shade(run.Of(k), run.pixel_rays.pixel_angle, k, mirrors));
  std::vector<Ray> mirror_rays;
  for (const internal::MirrorRay& mirror : mirrors) mirror_rays.push_back(mirror.ray);
  std::vector<Hit> hits(mirrors.size());
  rays.Intersect(mirror_rays, hits.data());
  for (size_t i = 0; i < mirrors.size(); ++i)
    shader.AddMirrored(mirrors[i], hits[i], lights[mirrors[i].pixel]);

  const float share = 1.0f / static_cast<float>(run.pixel_rays.samples);
  const auto rgb = [&](const Array4f& light) {
    return cv::Vec3f(share * light[0], share * light[1], share * light[2]);
  };
  for (int k = 0; k < run.count; ++k) {
    for (int g = 0; g < baked.groups(); ++g)
      frame.light[g](run.y, run.first + k) = rgb(lights[k].groups[g]);
    frame.diffuse(run.y, run.first + k) = rgb(lights[k].diffuse);
  }
}

/// Geometry at the pixel centres: from the plane of the samples where they share one, which spares
/// a ray, else by a ray of its own. Directions have z = 1 in the camera, so distances are depths.
void Renderer::Impl::StoreGeometry(const Run& run, Frame& frame) const {
  std::vector<Ray> centres;
  std::vector<int> pixels;
  for (int k = 0; k < run.count; ++k) {
    const Ray centre = run.Towards(run.pixel_rays.centres[run.Pixel(k)]);
    if (!run.Of(k).InOnePlane()) {
      centres.push_back(centre);
      pixels.push_back(k);
      continue;
    }
    Hit hit = run.Of(k).Middle();
    if (hit.surface >= 0)
      hit.distance *= hit.plane_normal.dot(run.Of(k).rays[0].direction) /
                      hit.plane_normal.dot(centre.direction);
    StoreHit(hit, centre.direction, run.first + k, run.y, frame);
  }
  std::vector<Hit> hits(centres.size());
  rays.Intersect(centres, hits.data());
  for (size_t i = 0; i < hits.size(); ++i)
    StoreHit(hits[i], centres[i].direction, run.first + pixels[i], run.y, frame);
}

void Renderer::Impl::StoreHit(const Hit& hit, const Vector3f& centre, int x, int y,
                              Frame& frame) const {
  if (hit.surface < 0) {
    frame.depth(y, x) = std::numeric_limits<float>::infinity();
    return;
  }
  const Surface& s = rays.surfaces()[hit.surface];
  Vector3f normal =
      s.patch ? internal::NormalAt(*s.patch, hit.s, hit.t) : s.lamp->edge_s.cross(s.lamp->edge_t);
  normal *= (normal.dot(centre) > 0 ? -1.0f : 1.0f) / normal.norm();
  frame.depth(y, x) = hit.distance;
  frame.normal(y, x) = {normal.x(), normal.y(), normal.z()};
  frame.id(y, x) = s.id;
}

void Renderer::Impl::RenderRow(const PixelRays::Impl& pixel_rays, const Eigen::Matrix3f& R,
                               const Vector3f& origin, int y, Frame& frame) const {
  Run run{.pixel_rays = pixel_rays, .R = R, .origin = origin, .y = y};
  for (run.first = 0; run.first < pixel_rays.camera.width; run.first += kPixelsPerRun) {
    run.count = std::min(kPixelsPerRun, pixel_rays.camera.width - run.first);
    const auto places = std::span(pixel_rays.rays)
                            .subspan(run.Pixel(0) * pixel_rays.samples,
                                     static_cast<size_t>(run.count) * pixel_rays.samples);
    run.rays.clear();
    for (const PixelXY& place : places) run.rays.push_back(run.Towards(place));
    run.hits.resize(run.rays.size());
    rays.Intersect(run.rays, run.hits.data());
    StoreLight(run, frame);
    StoreGeometry(run, frame);
  }
}

namespace {

void CheckInput(const Scene& scene, const RenderOptions& options) {
  SamplePlaces(options.samples_per_pixel);
  Require(options.light_texels > 0, "light_texels", options.light_texels, "positive");
  Require(options.light_samples > 0, "light_samples", options.light_samples, "positive");
  Require(options.bounce_samples > 0, "bounce_samples", options.bounce_samples, "positive");
  if (scene.objects.empty()) throw Error(scene.name, "the scene has no objects");
  const auto groups = static_cast<int>(scene.LightGroups().size());
  if (groups < 1 || groups > kMaxGroups)
    throw Error(scene.name,
                fmt::format("the scene has {} light groups; known: 1 to {}", groups, kMaxGroups));
}

}  // namespace

Renderer::Renderer(Scene scene, const RenderOptions& options) {
  CheckInput(scene, options);
  impl_ = std::make_unique<Impl>(std::move(scene), options);
}

Renderer::~Renderer() = default;

const Scene& Renderer::scene() const { return impl_->scene; }

Frame Renderer::Render(const PixelRays& rays, const SE3& T_world_cam) const {
  const cv::Size size(rays.camera().width, rays.camera().height);
  Frame frame;
  frame.groups = impl_->scene.LightGroups();
  for (size_t g = 0; g < frame.groups.size(); ++g) frame.light.emplace_back(size);
  frame.diffuse.create(size);
  frame.depth.create(size);
  frame.normal = cv::Mat3f::zeros(size);
  frame.id = cv::Mat1i::zeros(size);
  const Eigen::Matrix3f R = T_world_cam.R.toRotationMatrix().cast<float>();
  const Vector3f origin = T_world_cam.p.cast<float>();
  ParallelFor((size.height + kRowsPerTask - 1) / kRowsPerTask, impl_->options.threads,
              [&](int task) {
                const int end = std::min(size.height, (task + 1) * kRowsPerTask);
                for (int y = task * kRowsPerTask; y < end; ++y)
                  impl_->RenderRow(*rays.impl_, R, origin, y, frame);
              });
  return frame;
}

const RenderOptions& Renderer::options() const { return impl_->options; }

cv::Mat1b Renderer::SeenFrom(const cv::Mat1f& depth, const Camera& camera, const SE3& T_world_cam,
                             const Eigen::Vector3d& eye) const {
  cv::Mat1b seen = cv::Mat1b::zeros(depth.size());
  ParallelFor(depth.rows, impl_->options.threads, [&](int y) {
    for (int x = 0; x < depth.cols; ++x) {
      if (!std::isfinite(depth(y, x))) continue;
      const Eigen::Vector3d point =
          T_world_cam * (static_cast<double>(depth(y, x)) * camera.Unproject({x, y}));
      if (!impl_->rays.Blocked(eye.cast<float>(), point.cast<float>())) seen(y, x) = 255;
    }
  });
  return seen;
}

SE3 LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << right, forward.cross(right), forward;
  return {Eigen::Quaterniond(R), eye};
}

}  // namespace sgf::synth
