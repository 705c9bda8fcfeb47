// Time of a frame of stereo optical flow, all of it (both pyramids, detection, tracking there and
// back, stereo matching there and back), against cv::calcOpticalFlowPyrLK: 209 points, 21 x 21, 4
// levels, there and back, left image only, one thread.
//
// Images are those of EuRoC's MH_01 where SGF_DATA names a folder with euroc/MH_01_easy, else of a
// computed world. They are gone through forth and back, so that no frame follows a jump. Benchmarks
// are called lk or flow/residual/isa/threads; tracks, stereo (share of the tracks that have a right
// point) and lost (share of the tracks) are means over the frames.

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/core.h>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <support/corner_world.h>

#include <sgf/core/simd.h>
#include <sgf/flow/stereo_flow.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>

#include "bench/bench_main.h"

namespace sgf {
namespace {

constexpr int kPoints = 209;
constexpr size_t kFrames = 120;

struct Images {
  flow::StereoRig rig;
  std::vector<cv::Mat> left, right;
};

Images ReadImages(const std::filesystem::path& folder) {
  const OdometrySequence sequence = OpenOdometrySequence(folder);
  const auto& cameras = sequence.cameras;
  Images images{{cameras[0].camera, cameras[1].camera,
                 cameras[0].T_body_cam.Inverse() * cameras[1].T_body_cam},
                {},
                {}};
  for (size_t k = 0; k < std::min(kFrames, sequence.frames.size()); ++k) {
    images.left.push_back(ReadGrey(sequence.frames[k].left));
    images.right.push_back(ReadGrey(sequence.frames[k].right));
  }
  return images;
}

Images ComputeImages() {
  const Camera camera{.width = 752, .height = 480, .fx = 458, .fy = 458, .cx = 376, .cy = 240};
  const test::CornerWorld world(camera);
  Images images{{camera, camera, {Eigen::Quaterniond::Identity(), {0.11, 0, 0}}}, {}, {}};
  for (int k = 0; k < 12; ++k) {
    const SE3 pose{ExpSO3({0.002 * k, 0.003 * k, 0.004 * k}), {0.02 * k, 0.01 * k, 0.02 * k}};
    images.left.push_back(world.Render(pose).grey);
    images.right.push_back(world.Render(pose * images.rig.T_left_right).grey);
  }
  return images;
}

// The frame after so many steps forth and back.
size_t At(const Images& images, size_t step) {
  const size_t last = images.left.size() - 1;
  const size_t place = step % (2 * last);
  return place <= last ? place : 2 * last - place;
}

void LucasKanade(benchmark::State& state, const Images& images) {
  cv::setNumThreads(1);
  std::vector<std::vector<cv::Point2f>> points(images.left.size());
  for (size_t k = 0; k < points.size(); ++k)
    cv::goodFeaturesToTrack(images.left[k], points[k], kPoints, 0.001, 20);
  std::vector<cv::Point2f> there, back;
  std::vector<unsigned char> found;
  std::vector<float> errors;
  double tracks = 0;
  size_t step = 0;
  for (auto _ : state) {
    const size_t from = At(images, step++), to = At(images, step);
    cv::calcOpticalFlowPyrLK(images.left[from], images.left[to], points[from], there, found, errors,
                             {21, 21}, 3);
    cv::calcOpticalFlowPyrLK(images.left[to], images.left[from], there, back, found, errors,
                             {21, 21}, 3);
    tracks += double(points[from].size());
  }
  state.counters["tracks"] = tracks / double(step);
}

void Flow(benchmark::State& state, const Images& images, const flow::FlowOptions& options,
          const std::string& isa) {
  cv::setNumThreads(1);
  RestrictSimd(isa);
  flow::StereoFlow flow(images.rig, options);
  double tracks = 0, stereo = 0, lost = 0;
  flow::FlowTimes sum;
  size_t step = 0;
  const auto process = [&] {
    const size_t k = At(images, step++);
    return flow.Process(std::int64_t(step), images.left[k], images.right[k]);
  };
  for (size_t k = 0; k < images.left.size(); ++k) process();  // until it has its tracks
  const size_t begin = step;
  for (auto _ : state) {
    const flow::FlowFrame frame = process();
    tracks += double(frame.observations.size());
    stereo += frame.stereo;
    lost += frame.lost;
    sum.pyramid_s += frame.times.pyramid_s;
    sum.tracking_s += frame.times.tracking_s;
    sum.detection_s += frame.times.detection_s;
    sum.stereo_s += frame.times.stereo_s;
  }
  RestrictSimd("");
  const double frames = double(step - begin);
  state.counters["tracks"] = tracks / frames;
  state.counters["stereo"] = stereo / tracks;
  state.counters["lost"] = lost / tracks;
  state.counters["pyramid_ms"] = 1e3 * sum.pyramid_s / frames;
  state.counters["tracking_ms"] = 1e3 * sum.tracking_s / frames;
  state.counters["detection_ms"] = 1e3 * sum.detection_s / frames;
  state.counters["stereo_ms"] = 1e3 * sum.stereo_s / frames;
}

// Cells that hold about kPoints tracks of MH_01's first frames: costs lose more of them.
int CellOf(const std::string& residual) {
  const bool cost =
      residual == "ugf" || residual == "sgf" || residual == "sgf2" || residual == "sgf3";
  return cost ? 49 : 59;
}

template <class Run>
void Register(const std::string& name, Run run) {
  benchmark::RegisterBenchmark(name.c_str(), run)->Unit(benchmark::kMillisecond)->UseRealTime();
}

void RegisterFlow(const Images& images, const char* residual, const std::string& isa, int threads) {
  flow::FlowOptions options{.residual = residual};
  options.threads = threads;
  options.cell_px = CellOf(residual);
  Register(fmt::format("flow/{}/{}/{}", residual, isa, threads),
           [=, &images](auto& state) { Flow(state, images, options, isa); });
}

int Run(int argc, char** argv) {
  const char* data = std::getenv("SGF_DATA");
  const Images images =
      data ? ReadImages(std::filesystem::path(data) / "euroc" / "MH_01_easy") : ComputeImages();
  Register("lk", [&](auto& state) { LucasKanade(state, images); });
  const auto targets = SimdTargets();
  for (const char* residual : {"lssd", "sgf3", "ngv"})
    for (const int threads : {1, 2}) RegisterFlow(images, residual, targets.front(), threads);
  for (const char* residual : {"photo", "gm", "gn", "ugf", "sgf", "sgf2", "sgv", "sgf3_vec"})
    RegisterFlow(images, residual, targets.front(), 1);
  for (const std::string& isa : targets)
    if (isa != targets.front() && isa != "scalar")
      for (const char* residual : {"lssd", "sgf3", "ngv"}) RegisterFlow(images, residual, isa, 1);
  return RunRegistered(argc, argv);
}

}  // namespace
}  // namespace sgf

int main(int argc, char** argv) { return sgf::BenchmarkMain(argc, argv, sgf::Run); }
