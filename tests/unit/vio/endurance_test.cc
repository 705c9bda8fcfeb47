#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <malloc.h>

#include <sgf/synth/imu.h>
#include <sgf/synth/photometry.h>
#include <sgf/synth/renderer.h>
#include <sgf/vio/stereo_inertial_odometry.h>

// One hour: a closed loop of 30 s, whose images are rendered once, flown 120 times with time going
// on and the inertial sensor's noise drawn anew.
namespace sgf::vio {
namespace {

using Eigen::Vector3d;

constexpr int kLaps = 120, kFramesPerLap = 150;
constexpr std::int64_t kPeriod_ns = 200'000'000, kStart_ns = 1403636579763555584;
constexpr double kLap_s = 30;
const Camera kCamera{.width = 160, .height = 120, .fx = 110, .fy = 110, .cx = 79.5, .cy = 59.5};

flow::StereoRig Rig() { return {kCamera, kCamera, {Eigen::Quaterniond::Identity(), {0.2, 0, 0}}}; }

SE3 BodyLeft() { return {ExpSO3({0.02, -0.03, 0.05}), {0.03, 0.01, -0.02}}; }

/// A figure of eight through the middle of mocap_room_1.
synth::Trajectory Loop() {
  synth::TrajectoryOptions o;
  o.waypoints = {
      {0, 0, 1.5, 110, -8, 0},       {1.56, 1.7, 1.75, 172, -3, 7}, {1.8, 0.3, 1.9, 191, -2, 3},
      {0.9, -1.2, 2, 191, -5, -5},   {-0.9, -1.2, 2, 191, -11, -5}, {-1.8, 0.3, 1.9, 191, -14, 3},
      {-1.3, 1.6, 1.7, 160, -12, 6}, {0, 0, 1.5, 110, -8, 0},       {1.5, -1.7, 1.25, 48, -3, -7},
      {1.6, 0, 1.1, 28, -3, 0},      {0.5, 1.6, 1, 30, -7, 6},      {-1.6, 0, 1.1, 28, -13, 0}};
  o.knot_interval_s = kLap_s / static_cast<double>(o.waypoints.size());
  o.periodic = true;
  return synth::MakeTrajectory(o, BodyLeft());
}

using Images = std::array<cv::Mat1b, 2>;

std::vector<Images> RenderLap(const synth::Trajectory& loop) {
  const synth::Renderer renderer(
      synth::BuildScene("mocap_room_1"),
      {.samples_per_pixel = 4, .light_texels = 30000, .bounce_samples = 32});
  const synth::PixelRays rays(kCamera, renderer.options().samples_per_pixel);
  const SE3 T_body_left = BodyLeft(), T_body_right = T_body_left * Rig().T_left_right;
  const auto take = [&](const SE3& T_world_cam) {
    cv::Mat1b grey;
    synth::Luminance(renderer.Render(rays, T_world_cam).Radiance()).convertTo(grey, CV_8U, 255);
    return grey;
  };
  std::vector<Images> lap;
  for (int k = 0; k < kFramesPerLap; ++k) {
    const SE3 T = loop.At(1e-9 * static_cast<double>(k * kPeriod_ns)).T_world_body;
    lap.push_back({take(T * T_body_left), take(T * T_body_right)});
  }
  return lap;
}

double ResidentMib() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (double kib = 0; word == "VmRSS:" && status >> kib) return kib / 1024;
  return 0;
}

struct Lap {
  double resident_mib = 0;
  double median_ms = 0;  ///< of the processor, for a frame
  int tracked = 0;
  SE3 begin;  ///< first pose
};

class Endurance {
 public:
  Endurance()
      : loop_(Loop()), images_(RenderLap(loop_)), odometry_(Rig(), BodyLeft(), {}, Options()) {
    imu_.rate_hz = 100;
    malloc_trim(0);  // rendering took more than all that follows
  }

  Lap Fly(int number) {
    AddImu(number);
    Lap lap;
    std::vector<double> ms;
    for (int k = 0; k < kFramesPerLap; ++k) {
      const std::int64_t time_ns = kStart_ns + (number * kFramesPerLap + k) * kPeriod_ns;
      const std::clock_t begin = std::clock();
      last_ = odometry_.Process(time_ns, images_[k][0], images_[k][1]);
      ms.push_back(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
      odometry_.TakeFinishedPoints();
      EXPECT_TRUE(Minus(last_.body, {}).allFinite()) << number << " " << k;
      lap.tracked += last_.state == VioState::kTracked;
      if (k == 0) lap.begin = last_.body.T_world_body;
    }
    std::nth_element(ms.begin(), ms.begin() + kFramesPerLap / 2, ms.end());
    lap.median_ms = ms[kFramesPerLap / 2];
    lap.resident_mib = ResidentMib();
    return lap;
  }

  const VioFrameResult& last() const { return last_; }
  const BodyState& last_truth() const { return truth_.back(); }
  double path_m() const { return synth::SummarizeMotion(loop_).length_m; }

 private:
  static VioOptions Options() {
    VioOptions options;
    options.flow.cell_px = 20;
    options.flow.levels = 3;
    options.keyframes = 5;
    options.covariance = false;
    return options;
  }

  /// The samples of a lap; biases walk on from lap to lap.
  void AddImu(int lap) {
    imu_.seed = static_cast<std::uint64_t>(lap);
    for (const ImuSample& sample :
         synth::SimulateImu(loop_, lap * kLap_s, (lap + 1) * kLap_s, imu_, kStart_ns, &truth_))
      odometry_.AddImu(sample);
    Vector3d::Map(imu_.initial_gyroscope_bias.data()) = truth_.back().gyro_bias;
    Vector3d::Map(imu_.initial_accelerometer_bias.data()) = truth_.back().accel_bias;
  }

  synth::Trajectory loop_;
  std::vector<Images> images_;
  StereoInertialOdometry odometry_;
  synth::ImuOptions imu_;
  std::vector<BodyState> truth_;
  VioFrameResult last_;
};

// Which way is up, in body coordinates.
Vector3d UpOf(const SE3& T_world_body) { return T_world_body.R.conjugate() * Vector3d::UnitZ(); }

TEST(Endurance, HoldsForAnHour) {
  Endurance flight;
  std::vector<Lap> laps;
  double worst_drift_m = 0;
  for (int k = 0; k < kLaps; ++k) {
    laps.push_back(flight.Fly(k));
    EXPECT_EQ(laps[k].tracked, kFramesPerLap) << "lap " << k + 1;
    if (k > 0)
      worst_drift_m = std::max(worst_drift_m, (laps[k].begin.p - laps[k - 1].begin.p).norm());
  }
  const Lap &early = laps[4], &late = laps.back();
  // Times are reported only: other work on the machine would decide the test.
  std::printf(
      "lap 5: %.2f MiB, %.2f ms a frame; lap %d: %.2f MiB, %.2f ms; a lap of %.1f m closes to %.3f "
      "m at worst\n",
      early.resident_mib, early.median_ms, kLaps, late.resident_mib, late.median_ms,
      flight.path_m(), worst_drift_m);
  EXPECT_GT(early.resident_mib, 0);
  EXPECT_NEAR(late.resident_mib, early.resident_mib, 0.05 * early.resident_mib);
  EXPECT_LT(worst_drift_m, 0.02 * flight.path_m());
  // Position and yaw drift, tilt and biases do not.
  const VioFrameResult& last = flight.last();
  EXPECT_TRUE(last.inertial);
  EXPECT_EQ(last.segment, 0);
  const BodyState& truth = flight.last_truth();
  EXPECT_LT((last.body.gyro_bias - truth.gyro_bias).norm(), 0.003);
  EXPECT_GT(UpOf(last.body.T_world_body).dot(UpOf(truth.T_world_body)), std::cos(0.05));
}

}  // namespace
}  // namespace sgf::vio
