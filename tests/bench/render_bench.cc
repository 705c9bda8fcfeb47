// Stereo frames a second of the renderer, with all layers, beside the rate at which Embree alone
// traces primary rays of the same scene with the same instruction set.

#include <map>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include <sgf/core/parallel.h>
#include <sgf/io/euroc.h>
#include <sgf/synth/ray_scene.h>
#include <sgf/synth/sequence.h>

namespace sgf::synth {
namespace {

constexpr int kSamples = 4;

/// A scene and a rig that looks at its first view.
struct Stage {
  std::unique_ptr<Renderer> renderer;
  std::vector<PixelRays> rays;
  std::vector<SE3> T_world_cam;
};

Stage MakeStage(const std::string& scene, int threads) {
  Stage stage;
  stage.renderer =
      std::make_unique<Renderer>(BuildScene(scene), RenderOptions{.samples_per_pixel = kSamples,
                                                                  .light_samples = 4,
                                                                  .bounce_samples = 4,
                                                                  .threads = threads});
  const std::vector<EurocCamera> rig = RigCameras(RigModel::kEuroc);
  const View& view = stage.renderer->scene().views[0];
  const SE3 T_world_left = LookAt(view.eye.cast<double>(), view.target.cast<double>());
  for (const EurocCamera& eye : rig) {
    stage.rays.emplace_back(eye.camera, kSamples);
    stage.T_world_cam.push_back(T_world_left * rig[0].T_body_cam.Inverse() * eye.T_body_cam);
  }
  return stage;
}

void CountFrames(benchmark::State& state, double rays_per_frame) {
  using benchmark::Counter;
  state.counters["frames"] = Counter(1, Counter::kIsIterationInvariantRate);
  state.counters["rays"] = Counter(rays_per_frame, Counter::kIsIterationInvariantRate);
}

/// Both eyes of a stereo frame, 752x480, all layers.
void StereoFrame(benchmark::State& state, const std::string& scene) {
  const Stage stage = MakeStage(scene, static_cast<int>(state.range(0)));
  for (auto _ : state)
    for (size_t eye = 0; eye < stage.rays.size(); ++eye)
      benchmark::DoNotOptimize(
          stage.renderer->Render(stage.rays[eye], stage.T_world_cam[eye]).diffuse.data);
  CountFrames(state, 2.0 * 752 * 480 * kSamples);
}

/// Four rays a pixel of the left eye, traced and forgotten.
void PrimaryRays(benchmark::State& state, const std::string& scene_name) {
  const Scene scene = BuildScene(scene_name);
  const internal::RayScene rays(scene);
  const Camera camera = RigCameras(RigModel::kEuroc)[0].camera;
  const SE3 pose = LookAt(scene.views[0].eye.cast<double>(), scene.views[0].target.cast<double>());
  const Eigen::Matrix3f R = pose.R.toRotationMatrix().cast<float>();
  std::vector<internal::Ray> all;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      for (int k = 0; k < kSamples; ++k) {
        const Eigen::Vector3d ray = camera.Unproject({x + 0.25 * (k % 2), y + 0.25 * (k / 2)});
        all.push_back({pose.p.cast<float>(), R * ray.cast<float>()});
      }
  for (auto _ : state)
    ParallelFor(camera.height, static_cast<int>(state.range(0)), [&](int y) {
      const size_t row = static_cast<size_t>(camera.width) * kSamples;
      std::vector<internal::Hit> hits(row);
      rays.Intersect(std::span(all).subspan(y * row, row), hits.data());
      benchmark::DoNotOptimize(hits.data());
    });
  CountFrames(state, 4.0 * camera.width * camera.height);
}

}  // namespace
}  // namespace sgf::synth

int main(int argc, char** argv) {
  using namespace sgf::synth;
  benchmark::Initialize(&argc, argv);
  for (const SceneInfo& scene : AllScenes()) {
    const std::string name(scene.name);
    for (int threads : {1, 2}) {
      benchmark::RegisterBenchmark(("stereo_frame/" + name).c_str(), StereoFrame, name)
          ->Arg(threads)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
      benchmark::RegisterBenchmark(("primary_rays/" + name).c_str(), PrimaryRays, name)
          ->Arg(threads)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    }
  }
  benchmark::RunSpecifiedBenchmarks();
}
