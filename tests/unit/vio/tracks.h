#pragma once

#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include <sgf/core/random.h>
#include <sgf/vio/triangulation.h>
#include <sgf/vio/window.h>

#include "unit/vio/flights.h"

/// Simulated points as a stereo camera on a flight sees them, for the tests of sgf::vio's window.
namespace sgf::vio {

inline constexpr double kGravity = 9.81;

inline VioRig TestRig() {
  const SE3 T_body_left{ExpSO3({0.05, -0.1, 0.02}), {0.05, -0.02, 0.03}};
  const SE3 T_left_right{ExpSO3({0.01, 0.02, -0.01}), {0.11, 0.002, -0.003}};
  return {{T_body_left, T_body_left * T_left_right}, 450};
}

/// Points on the walls of a room that SmoothRide() and its like are in.
inline std::vector<Eigen::Vector3d> WallPoints(int count, std::uint64_t seed) {
  const Eigen::Vector3d low(-5, -4, -2), high(8, 8, 5);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < count; ++k) {
    Eigen::Vector3d p;
    for (int axis = 0; axis < 3; ++axis)
      p(axis) = low(axis) + (high - low)(axis)*Uniform01(seed, 4 * k + axis);
    const int wall = static_cast<int>(6 * Uniform01(seed, 4 * k + 3));
    p(wall / 2) = wall % 2 ? low(wall / 2) : high(wall / 2);
    points.push_back(p);
  }
  return points;
}

/// What a frame of a flight shows.
class Sightings {
 public:
  /// @param sigma_px of every coordinate; 0 for exact rays.
  Sightings(const VioRig& rig, std::vector<Eigen::Vector3d> points, double sigma_px,
            std::uint64_t seed)
      : rig_(rig), points_(std::move(points)), sigma_(sigma_px / rig.focal_px), seed_(seed) {}

  const std::vector<Eigen::Vector3d>& points() const { return points_; }

  /// Point `k` in a camera of the frame, the same at every call; nothing outside the image.
  std::optional<LandmarkSight> See(int k, int camera, int frame, const SE3& T_world_body) const {
    const Eigen::Vector3d p = (T_world_body * rig_.T_body_cam[camera]).Inverse() * points_[k];
    constexpr double kView = 0.8;  // tangent
    if (p.z() < 0.3 || p.head<2>().lpNorm<Eigen::Infinity>() > kView * p.z()) return std::nullopt;
    const std::uint64_t stream = Hash64(seed_, (frame * 2 + camera) * points_.size() + k);
    const Eigen::Vector2d noise(Gaussian(stream, 0), Gaussian(stream, 1));
    const Eigen::Vector2d ray = p.head<2>() / p.z() + sigma_ * noise;
    return LandmarkSight{.frame = frame, .camera = camera, .ray = ray};
  }

  /// The point as a landmark of a frame that sees it in both cameras.
  std::optional<Landmark> Make(int k, int frame, const SE3& T_world_body) const {
    const auto left = See(k, 0, frame, T_world_body), right = See(k, 1, frame, T_world_body);
    if (!left || !right) return std::nullopt;
    const auto rho = TriangulateInverseDepth(
        left->ray, right->ray, rig_.T_body_cam[1].Inverse() * rig_.T_body_cam[0], 1e-3);
    if (!rho) return std::nullopt;
    return Landmark{
        .host = frame, .ray = left->ray, .inverse_depth = *rho, .sights = {*left, *right}};
  }

  void Show(int k, int frame, const SE3& T_world_body, Landmark& landmark) const {
    for (const int camera : {0, 1})
      if (const auto sight = See(k, camera, frame, T_world_body)) landmark.sights.push_back(*sight);
  }

 private:
  VioRig rig_;
  std::vector<Eigen::Vector3d> points_;
  double sigma_;
  std::uint64_t seed_;
};

/// A window that is fed with a flight, frame by frame, as the odometry does it.
class SimulatedWindow {
 public:
  static constexpr int kImuPerFrame = 20;  // 10 Hz

  struct Options {
    WindowOptions window = {.max_iterations = 20, .tolerance = 1e-9};
    int keyframe_gap = 3;
    int threads = 1;
    /// A landmark that comes again brings its older sights, though the prior may know them.
    bool reuse_sights = false;
    /// Images are taken so many inertial samples after their time stamps.
    int late_samples = 0;
  };

  SimulatedWindow(const Flight& flight, Sightings sightings, const Options& options)
      : window(TestRig(), options.window, options.threads),
        flight_(flight),
        sightings_(std::move(sightings)),
        options_(options) {}

  Window window;

  static size_t SampleOf(int frame) { return static_cast<size_t>(frame) * kImuPerFrame; }
  const BodyState& TruthOf(int frame) const { return flight_.truth[SampleOf(frame)]; }

  const SE3& PoseSeenOf(int frame) const {
    return flight_.truth[SampleOf(frame) + options_.late_samples].T_world_body;
  }

  /// The next frame, where the inertial sensor takes the last one.
  void Push(const std::optional<BodyState>& start = std::nullopt) {
    Frame frame;
    frame.id = next_++;
    frame.inertial = true;
    if (window.frames.empty()) {
      frame.state = start.value_or(TruthOf(frame.id));
    } else {
      const Frame& last = window.frames.back();
      frame.since_last = flight_.Integrate(SampleOf(last.id), SampleOf(frame.id),
                                           {last.state.gyro_bias, last.state.accel_bias});
      frame.state = frame.since_last->Predict(last.state, kGravity);
    }
    frame.angular_velocity = flight_.samples[SampleOf(frame.id)].gyro - frame.state.gyro_bias;
    frame.keyframe = frame.id % options_.keyframe_gap == 0;
    window.frames.push_back(frame);
    const SE3& truth = PoseSeenOf(frame.id);
    for (auto& [k, landmark] : window.landmarks)
      sightings_.Show(static_cast<int>(k), frame.id, truth, landmark);
    if (frame.keyframe) MakeLandmarks(frame.id, truth);
  }

  /// Takes frames out as the odometry does: all but the newest are slowed, those that are no
  /// key-frames leave, and the oldest key-frame where they are too many.
  void Marginalize(int states, int keyframes) {
    std::vector<int> leaving, motions, kept;
    for (size_t k = 0; k + states < window.frames.size(); ++k) {
      const Frame& frame = window.frames[k];
      if (!frame.keyframe)
        leaving.push_back(frame.id);
      else
        kept.push_back(frame.id);
    }
    if (static_cast<int>(kept.size()) > keyframes) {
      leaving.push_back(kept.front());
      kept.erase(kept.begin());
    }
    for (const int id : kept)
      if (window.Find(id)->inertial) motions.push_back(id);
    if (!leaving.empty() || !motions.empty()) window.Marginalize(leaving, motions);
  }

 private:
  void MakeLandmarks(int frame, const SE3& truth) {
    for (int k = 0; k < static_cast<int>(sightings_.points().size()); ++k) {
      if (window.landmarks.contains(k)) continue;
      auto landmark = sightings_.Make(k, frame, truth);
      if (!landmark) continue;
      if (options_.reuse_sights)
        for (const Frame& other : window.frames)
          if (other.id != frame) sightings_.Show(k, other.id, PoseSeenOf(other.id), *landmark);
      window.landmarks.emplace(k, *landmark);
    }
  }

  const Flight& flight_;
  Sightings sightings_;
  Options options_;
  int next_ = 0;
};

/// Standard deviations to anchor a first frame with: what gravity does not tell is held.
inline StateVector AnchorSigmas() {
  StateVector sigmas;
  sigmas << 0.02, 0.02, 1e-4, 1e-4, 1e-4, 1e-4, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1;
  return sigmas;
}

/// The state moved by Gaussian errors of these deviations, rotations about the world's axes.
inline BodyState Disturbed(const BodyState& state, const StateVector& sigmas, std::uint64_t seed) {
  StateVector d;
  for (int k = 0; k < kStateSize; ++k) d(k) = sigmas(k) * Gaussian(seed, k);
  d.head<3>() = state.T_world_body.R.conjugate() * d.head<3>();
  return Plus(state, d);
}

/// Holds a frame to what it is now, with standard deviations in the order of Plus().
inline void Anchor(Frame& frame, const StateVector& sigmas, Window& window) {
  window.AnchorPose(frame, sigmas.head<kPoseParameters>());
  if (frame.inertial) window.AnchorMotion(frame, sigmas.tail<kMotionParameters>());
}

}  // namespace sgf::vio
