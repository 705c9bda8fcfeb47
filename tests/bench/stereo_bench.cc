// Throughput of block matching on sgf, gradients included, against cv::StereoBM with its prefilter
// (the same pair, disparities, window and filters: uniqueness only), and of semi-global matching
// on sgf, eight directions, against cv::StereoSGBM, five (window 5, uniqueness, left-right check).
//
// SGF_BENCH_PAIR names a folder with im0.png and im1.png. Benchmarks are called
// case/implementation/isa/threads; mde_per_s is width * height * disparities / 10^6 a second,
// peak_mib the memory that one call takes beyond what the process held before.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/core.h>
#include <malloc.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/core/simd.h>
#include <sgf/io/image.h>
#include <sgf/stereo/stereo_sgf.h>

#include "bench/bench_main.h"

namespace sgf {
namespace {

constexpr int kWindow = 9;
constexpr int kSemiGlobalWindow = 5;
constexpr int kUniqueness = 15;  // OpenCV's default

struct Case {
  std::string name;
  cv::Mat1b left, right;
  int disparities;
};

Case MakeCase(const cv::Mat1b& left, const cv::Mat1b& right, cv::Size size, int disparities) {
  Case c{fmt::format("motorcycle_{}x{}", size.width, size.height), left, right, disparities};
  if (size != left.size()) {
    cv::resize(left, c.left, size, 0, 0, cv::INTER_CUBIC);
    cv::resize(right, c.right, size, 0, 0, cv::INTER_CUBIC);
  }
  return c;
}

// A value of /proc/self/status in MiB.
double StatusMib(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == key + ":") {
      double kib = 0;
      status >> kib;
      return kib / 1024;
    }
  return 0;
}

// Memory that a call needs at its peak; 0 where the kernel does not let the peak be reset.
double PeakMib(const std::function<void()>& call) {
  malloc_trim(0);  // what earlier calls freed does not count as held
  std::ofstream reset("/proc/self/clear_refs");
  if (!(reset << 5 << std::flush)) return 0;
  const double before = StatusMib("VmRSS");
  call();
  return StatusMib("VmHWM") - before;
}

void Measure(benchmark::State& state, const Case& c, const std::function<void()>& match) {
  state.counters["peak_mib"] = PeakMib(match);
  for (auto _ : state) match();
  const double evaluations = static_cast<double>(c.left.total()) * c.disparities / 1e6;
  state.counters["mde_per_s"] = benchmark::Counter(
      evaluations * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

void Measure(benchmark::State& state, const Case& c, cv::StereoMatcher& matcher) {
  Measure(state, c, [&] {
    cv::Mat disparity;
    matcher.compute(c.left, c.right, disparity);
    benchmark::DoNotOptimize(disparity.data);
  });
}

void OpenCvBm(benchmark::State& state, const Case& c, int threads) {
  cv::setNumThreads(threads);
  const auto matcher = cv::StereoBM::create(c.disparities, kWindow);
  matcher->setTextureThreshold(0);
  matcher->setUniquenessRatio(kUniqueness);
  Measure(state, c, *matcher);
}

void OpenCvSgbm(benchmark::State& state, const Case& c, int threads) {
  cv::setNumThreads(threads);
  // Penalties as OpenCV's documentation proposes for one channel: 8 and 32 a pixel of the window.
  constexpr int kArea = kSemiGlobalWindow * kSemiGlobalWindow;
  const auto matcher = cv::StereoSGBM::create(0, c.disparities, kSemiGlobalWindow, 8 * kArea,
                                              32 * kArea, 1, 63, kUniqueness);
  Measure(state, c, *matcher);
}

void SgfBm(benchmark::State& state, const Case& c, const std::string& isa, int threads) {
  cv::setNumThreads(1);
  RestrictSimd(isa);
  const auto matcher = StereoSgf::create(c.disparities, kWindow);
  matcher->setUniquenessRatio(kUniqueness);
  matcher->setDisp12MaxDiff(-1);
  matcher->setThreads(threads);
  Measure(state, c, *matcher);
  RestrictSimd("");
}

void SgfSgm(benchmark::State& state, const Case& c, const std::string& isa, int threads) {
  cv::setNumThreads(1);
  RestrictSimd(isa);
  const auto matcher = StereoSgfSemiGlobal::create(0, c.disparities, kSemiGlobalWindow);
  matcher->setUniquenessRatio(kUniqueness);
  matcher->setThreads(threads);
  Measure(state, c, *matcher);
  RestrictSimd("");
}

template <class Run>
void Register(const Case& c, const char* implementation, const std::string& isa, int threads,
              Run run) {
  const std::string name = fmt::format("{}/{}/{}/{}", c.name, implementation, isa, threads);
  benchmark::RegisterBenchmark(name.c_str(), run)->Unit(benchmark::kMillisecond)->UseRealTime();
}

using OpenCvMatcher = void (*)(benchmark::State&, const Case&, int threads);
using SgfMatcher = void (*)(benchmark::State&, const Case&, const std::string& isa, int threads);

// OpenCV's implementation and ours, on one thread and two and on every instruction set.
void RegisterPair(const Case& c, const char* opencv_name, OpenCvMatcher opencv,
                  const char* sgf_name, SgfMatcher sgf) {
  for (const int threads : {1, 2})
    Register(c, opencv_name, "own", threads,
             [=, &c](benchmark::State& state) { opencv(state, c, threads); });
  const auto targets = SimdTargets();
  for (const std::string& isa : targets) {
    if (isa == "scalar") continue;
    for (const int threads : {1, 2})
      if (threads == 1 || isa == targets.front())
        Register(c, sgf_name, isa, threads,
                 [=, &c](benchmark::State& state) { sgf(state, c, isa, threads); });
  }
}

void RegisterCase(const Case& c) {
  RegisterPair(c, "opencv_bm", OpenCvBm, "sgf_bm", SgfBm);
  RegisterPair(c, "opencv_sgbm", OpenCvSgbm, "sgf_sgm", SgfSgm);
}

int Run(int argc, char** argv) {
  const char* folder = std::getenv("SGF_BENCH_PAIR");
  if (!folder) throw Error("SGF_BENCH_PAIR", "is not set: name a folder with im0.png and im1.png");
  const cv::Mat1b left = ReadGrey(std::filesystem::path(folder) / "im0.png");
  const cv::Mat1b right = ReadGrey(std::filesystem::path(folder) / "im1.png");
  const std::vector<Case> cases{MakeCase(left, right, left.size(), 128),
                                MakeCase(left, right, left.size() * 2, 256)};
  for (const Case& c : cases) RegisterCase(c);
  return RunRegistered(argc, argv);
}

}  // namespace
}  // namespace sgf

int main(int argc, char** argv) { return sgf::BenchmarkMain(argc, argv, sgf::Run); }
