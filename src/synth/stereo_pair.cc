#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <sgf/core/error.h>
#include <sgf/core/options.h>
#include <sgf/io/hash.h>
#include <sgf/synth/stereo_pair.h>

namespace sgf::synth {

namespace {

const View& FindView(const Scene& scene, const std::string& name) {
  std::string known;
  for (const View& view : scene.views) {
    if (view.name == name) return view;
    known += (known.empty() ? "" : ", ") + view.name;
  }
  throw Error("view", fmt::format("scene {} has no view '{}'; known: {}", scene.name, name, known));
}

Camera MakeCamera(const PairOptions& o) {
  if (!(o.baseline_m > 0)) throw Error("baseline_m", fmt::format("is {}", o.baseline_m));
  Camera camera{.width = o.width, .height = o.height, .fx = o.focal_px, .fy = o.focal_px};
  camera.cx = 0.5 * (o.width - 1);
  camera.cy = 0.5 * (o.height - 1);
  camera.Check();
  return camera;
}

/// Disparities to search: those in the image, rounded up to what OpenCV's matchers take.
int NumDisparities(const cv::Mat1f& disparity) {
  float largest = 0;
  for (float d : disparity)
    if (d > largest) largest = d;
  return 16 * (static_cast<int>(largest) / 16 + 1);
}

void AddDisparities(const Renderer& renderer, RenderedPair& pair) {
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  const cv::Mat1b seen =
      renderer.SeenFrom(pair.left.depth, pair.camera, pair.T_world_left, pair.T_world_right.p);
  pair.disparity.create(seen.size());
  pair.disparity_noc.create(seen.size());
  const double scale = pair.calib.f * pair.calib.baseline_m;
  for (int y = 0; y < seen.rows; ++y)
    for (int x = 0; x < seen.cols; ++x) {
      const float z = pair.left.depth(y, x);
      const float d = std::isfinite(z) ? static_cast<float>(scale / z) : kUnknown;
      const bool inside = static_cast<float>(x) - d >= 0;
      pair.disparity(y, x) = d;
      pair.disparity_noc(y, x) = seen(y, x) && inside ? d : kUnknown;
    }
}

}  // namespace

RenderedPair RenderPair(const Renderer& renderer, const PairOptions& options) {
  const View& view = FindView(renderer.scene(), options.view);
  RenderedPair pair;
  pair.camera = MakeCamera(options);
  pair.T_world_left = LookAt(view.eye.cast<double>(), view.target.cast<double>());
  pair.T_world_right = pair.T_world_left * SE3{.p = {options.baseline_m, 0, 0}};
  const PixelRays rays(pair.camera, renderer.options().samples_per_pixel);
  pair.left = renderer.Render(rays, pair.T_world_left);
  pair.right = renderer.Render(rays, pair.T_world_right);
  pair.calib = {.f = options.focal_px,
                .cx = pair.camera.cx,
                .cy = pair.camera.cy,
                .baseline_m = options.baseline_m,
                .width = options.width,
                .height = options.height};
  AddDisparities(renderer, pair);
  pair.calib.ndisp = NumDisparities(pair.disparity);
  return pair;
}

StereoPair Expose(const RenderedPair& pair, const PairOptions& options, int threads) {
  const PhotometricCamera camera(pair.camera, options.photometry, threads);
  const auto take = [&](const Frame& frame, double exposure_ms, int index) {
    return camera.Expose(Luminance(frame.Radiance()), exposure_ms,
                         FrameSeed(options.seed, index, 0));
  };
  return {.name = options.scene + "_" + options.view,
          .left = take(pair.left, options.left_exposure_ms, 0),
          .right = take(pair.right, options.right_exposure_ms, 1),
          .truth_all = pair.disparity,
          .truth_noc = pair.disparity_noc,
          .num_disparities = pair.calib.ndisp};
}

std::string RecipeHash(const PairOptions& pair, const RenderOptions& options, bool keep_exr) {
  return Sha256(fmt::format("{}exr {}\n{}\n", RenderingKey(options), keep_exr,
                            YAML::Dump(WriteOptions(pair))));
}

}  // namespace sgf::synth
