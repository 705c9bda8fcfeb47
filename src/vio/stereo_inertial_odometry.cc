#include <algorithm>
#include <cmath>
#include <set>

#include <sgf/core/keyframe_choice.h>
#include <sgf/core/require.h>
#include <sgf/core/stopwatch.h>
#include <sgf/vio/inertial_start.h>
#include <sgf/vio/stereo_inertial_odometry.h>
#include <sgf/vio/triangulation.h>

namespace sgf::vio {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

ImuBias BiasOf(const BodyState& state) { return {state.gyro_bias, state.accel_bias}; }

}  // namespace

void CheckOptions(const VioOptions& options) {
  flow::CheckOptions(options.flow);
  CheckOptions(options.window);
  CheckOptions(options.start);
  Require(options.states >= 2 && options.states <= 10, "states", options.states, "from 2 to 10");
  Require(options.keyframes >= 2 && options.keyframes <= 30, "keyframes", options.keyframes,
          "from 2 to 30");
  Require(options.keyframe_share > 0 && options.keyframe_share <= 1, "keyframe_share",
          options.keyframe_share, "in (0, 1]");
  Require(options.keyframe_gap >= 1, "keyframe_gap", options.keyframe_gap, "positive");
  Require(options.least_parallax > 0, "least_parallax", options.least_parallax, "positive");
  Require(options.least_sights >= 3, "least_sights", options.least_sights, "at least 3");
  Require(options.blind_s >= 0, "blind_s", options.blind_s, "at least 0");
  Require(options.start_s > 0, "start_s", options.start_s, "positive");
  Require(options.max_inertial_error > 0, "max_inertial_error", options.max_inertial_error,
          "positive");
  const CalibrationOptions& calibration = options.calibration;
  constexpr double kMost_s = 0.05, kMost_rad = 0.2, kMost_m = 0.5;  // the start takes it as right
  Require(calibration.time_offset_sd_s >= 0 && calibration.time_offset_sd_s <= kMost_s,
          "calibration.time_offset_sd_s", calibration.time_offset_sd_s, "from 0 to 0.05");
  Require(calibration.rotation_sd_rad >= 0 && calibration.rotation_sd_rad <= kMost_rad,
          "calibration.rotation_sd_rad", calibration.rotation_sd_rad, "from 0 to 0.2");
  Require(calibration.position_sd_m >= 0 && calibration.position_sd_m <= kMost_m,
          "calibration.position_sd_m", calibration.position_sd_m, "from 0 to 0.5");
  Require(options.threads >= 0, "threads", options.threads, "at least 0");
}

class StereoInertialOdometry::Impl {
 public:
  Impl(const flow::StereoRig& rig, const SE3& T_body_left, const ImuNoise& noise,
       const VioOptions& options)
      : cameras_(rig),
        options_(Resolved(options)),
        flow_(rig, options_.flow),
        imu_(noise, options.imu),
        window_(RigOf(rig, T_body_left), options.window, options.threads),
        start_(options_.start, options.start_s, static_cast<size_t>(options.states)) {
    CheckOptions(options);
  }

  void AddImu(const ImuSample& sample) { imu_.Add(sample); }

  VioFrameResult Process(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right) {
    Stopwatch total, stage;
    VioFrameResult result{.time_ns = time_ns, .segment = segment_};
    Frame frame = Predict(time_ns);
    const flow::FlowFrame seen =
        flow_.Process(time_ns, left, right, RotationSinceLast(frame), Expected(frame));
    result.flow = seen.times;
    result.times.flow_s = stage.Lap();
    result.tracks = static_cast<int>(seen.observations.size());
    result.stereo_tracks = seen.stereo;
    if (window_.frames.empty())
      Begin(frame);
    else if (inertial_ && frame.since_last && !frame.inertial)
      ResumeInertial(frame);
    window_.frames.push_back(std::move(frame));
    Observe(seen);
    const bool blind = window_.frames.size() > 1 && CountSeen() < options_.least_sights;
    if (NeedsKeyframe(seen)) MakeKeyframe(seen, left, result);
    result.landmarks = CountSeen();
    Refine(blind, result);
    ToWorld(result);
    result.times.refinement_s = stage.Lap();
    if (result.state == VioState::kLost) {
      Lose();
    } else if (SeesNothingYet(result)) {
      Forget();
    } else {
      if (options_.inertial && !inertial_) Start(result);
      Marginalize();
    }
    imu_.DropBefore(start_.first_ns().value_or(time_ns));
    result.inertial = inertial_ && Newest()->inertial;
    if (inertial_ && !result.inertial) result.problem = InitialisationProblem::kGapInData;
    result.times.marginalization_s = stage.Lap();
    result.times.total_s = total.Lap();
    return result;
  }

  const ImuHealth& imu_health() const { return imu_.health(); }

  std::vector<VioPoint> TakeFinishedPoints() { return std::exchange(finished_, {}); }

  std::vector<VioPoint> ActivePoints() const {
    std::vector<VioPoint> points;
    for (const auto& [id, landmark] : window_.landmarks) points.push_back(ToPoint(landmark));
    return points;
  }

 private:
  /// What is one number for all is stated once.
  static VioOptions Resolved(VioOptions options) {
    options.flow.threads = options.threads;
    options.start.gravity = options.window.gravity;
    return options;
  }

  static VioRig RigOf(const flow::StereoRig& rig, const SE3& T_body_left) {
    return {{T_body_left, T_body_left * rig.T_left_right}, 0.5 * (rig.left.fx + rig.left.fy)};
  }

  using PoseSigmas = Eigen::Matrix<double, kPoseParameters, 1>;
  static PoseSigmas HeldPose() {
    constexpr double kHeld = 1e-4;  // rad, m
    return PoseSigmas::Constant(kHeld);
  }

  const Frame* Newest() const { return window_.frames.empty() ? nullptr : &window_.frames.back(); }

  /// Whether it is known better than by constant velocity: not where the sensor is saturated.
  static bool TellsPose(const Preintegration& imu) {
    constexpr double kRotationSd_rad = 0.05, kPositionSd_m = 0.05;
    const auto variance = imu.covariance().diagonal();
    return variance.segment<3>(kRotation).maxCoeff() < kRotationSd_rad * kRotationSd_rad &&
           variance.segment<3>(kPosition).maxCoeff() < kPositionSd_m * kPositionSd_m;
  }

  /// The new frame where the inertial sensor, or constant velocity, takes the last one.
  Frame Predict(std::int64_t time_ns) const {
    Frame frame;
    frame.id = next_id_;
    frame.state = last_;
    frame.state.time_ns = time_ns;
    const Frame* last = Newest();
    if (!last) return frame;
    if (options_.inertial)
      frame.since_last = imu_.Between(last->state.time_ns, time_ns, BiasOf(last->state));
    if (const auto gyro = options_.inertial ? imu_.GyroAt(time_ns) : std::nullopt)
      frame.angular_velocity = *gyro - last->state.gyro_bias;
    const bool told = frame.since_last && TellsPose(*frame.since_last);
    if (frame.since_last && last->inertial) {
      frame.state = frame.since_last->Predict(last->state, options_.window.gravity);
      frame.inertial = true;
      if (told) return frame;
    }
    if (window_.frames.size() >= 2) {
      const BodyState& before = window_.frames[window_.frames.size() - 2].state;
      const double share = static_cast<double>(time_ns - last->state.time_ns) /
                           static_cast<double>(last->state.time_ns - before.time_ns);
      const SE3 motion = before.T_world_body.Inverse() * last->state.T_world_body;
      frame.state.T_world_body = last->state.T_world_body * PartOf(motion, share);
    }
    if (told && gyro_fits_)
      frame.state.T_world_body.R = last->state.T_world_body.R * frame.since_last->delta_R();
    return frame;
  }

  std::optional<Eigen::Quaterniond> RotationSinceLast(const Frame& frame) const {
    const Frame* last = Newest();
    if (!last || !frame.since_last) return std::nullopt;
    const Eigen::Quaterniond R_body_left = window_.rig().T_body_cam[0].R;
    return R_body_left.conjugate() * frame.state.T_world_body.R.conjugate() *
           last->state.T_world_body.R * R_body_left;
  }

  /// Where the new frame is thought to see the landmarks that the last one saw.
  flow::ExpectedPixels Expected(const Frame& frame) const {
    flow::ExpectedPixels expected;
    if (window_.frames.size() < 2) return expected;
    const SE3 T_cam_world = window_.PoseOf(frame, 0).Inverse();
    for (const auto& [id, track] : tracks_) {
      const auto landmark = window_.landmarks.find(id);
      if (landmark == window_.landmarks.end()) continue;
      const Vector3d point = T_cam_world * PositionOf(landmark->second);
      const Vector2d pixel = point.z() > 0 ? cameras_.left.Project(point) : Vector2d(-1, -1);
      if (pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < cameras_.left.width &&
          pixel.y() < cameras_.left.height)
        expected[id] = pixel;
    }
    return expected;
  }

  // --- Begin ---

  /// The first frame of a map. Its attitude is what the accelerometer says, if there is one, until
  /// the inertial sensor takes part.
  void Begin(Frame& frame) {
    if (options_.inertial && segment_ == 0 && !imu_.samples().empty()) {
      Vector3d accel = Vector3d::Zero();
      for (const ImuSample& sample : imu_.samples()) accel += sample.accel;
      const Vector3d up = frame.state.T_world_body.R * accel;
      frame.state.T_world_body.R =
          (RotationBetween(up, Vector3d::UnitZ()) * frame.state.T_world_body.R).normalized();
    }
    frame.keyframe = true;
    start_.Clear();
    window_.AnchorPose(frame, HeldPose());
  }

  /// Lets the inertial sensor take part as soon as it can be told where down is.
  void Start(VioFrameResult& result) {
    const auto found = start_.Add({result.time_ns, window_.frames.back().state.T_world_body}, imu_);
    if (!found) return;
    result.problem = found->problem;
    if (found->ok() && window_.frames.size() >= static_cast<size_t>(options_.states))
      TakeOver(*found);
  }

  void TakeOver(const InertialInitialisation& found) {
    const size_t first = window_.frames.size() - static_cast<size_t>(options_.states);
    window_.DropPrior();
    const BodyState& last_found = found.states.back();
    for (size_t k = 0; k < window_.frames.size(); ++k) {
      Frame& frame = window_.frames[k];
      frame.state.T_world_body = found.T_world_visual * frame.state.T_world_body;
      if (k < first) continue;
      frame.inertial = true;
      frame.state.velocity =
          found.states[found.states.size() - (window_.frames.size() - k)].velocity;
      frame.state.gyro_bias = last_found.gyro_bias;
      frame.state.accel_bias = last_found.accel_bias;
      if (k > first)
        frame.since_last = imu_.Between(window_.frames[k - 1].state.time_ns, frame.state.time_ns,
                                        BiasOf(frame.state));
    }
    PoseSigmas pose = HeldPose();
    pose.head<2>().setConstant(found.tilt_sd_rad);
    window_.AnchorPose(window_.frames.front(), pose);
    constexpr double kVelocitySigma = 0.2;  // m/s
    Eigen::Matrix<double, kMotionParameters, 1> motion;
    motion << Vector3d::Constant(kVelocitySigma), found.gyro_bias_sd, found.accel_bias_sd;
    window_.AnchorMotion(window_.frames[first], motion);
    if (!options_.calibration.IsHeld()) window_.AnchorCalibration(CalibrationSigmas());
    inertial_ = true;
    disagreement_ = 0;
    start_.Clear();
    R_gravity_world_ = found.T_world_visual.R * R_gravity_world_;
    last_ = window_.frames.back().state;
  }

  CalibrationVector CalibrationSigmas() const {
    CalibrationVector sigmas;
    sigmas << Vector3d::Constant(options_.calibration.rotation_sd_rad),
        Vector3d::Constant(options_.calibration.position_sd_m),
        options_.calibration.time_offset_sd_s;
    return sigmas;
  }

  /// After a gap of the inertial sensor: the last frame has a velocity again, from where it was
  /// before, and biases are what they were, with what is expected of them.
  void ResumeInertial(Frame& frame) {
    Frame& last = window_.frames.back();
    constexpr double kVelocitySigma = 1;  // m/s
    last.state.velocity = SeenVelocity();
    Eigen::Matrix<double, kMotionParameters, 1> sigmas;
    constexpr double kGyroBiasSigma = 0.01;  // rad/s
    sigmas << Vector3d::Constant(kVelocitySigma), Vector3d::Constant(kGyroBiasSigma),
        Vector3d::Constant(options_.start.accel_bias_sd);
    window_.AnchorMotion(last, sigmas);
    frame.inertial = true;
    frame.state = frame.since_last->Predict(last.state, options_.window.gravity);
  }

  // --- Every frame ---

  std::optional<Vector2d> RayOf(const Camera& camera, const Vector2d& pixel) const {
    const auto ray = camera.TryUnproject(pixel);
    return ray ? std::optional<Vector2d>(ray->head<2>()) : std::nullopt;
  }

  /// Remembers what the newest frame shows, and adds it to the landmarks.
  void Observe(const flow::FlowFrame& seen) {
    const int id = Newest()->id;
    next_id_ = id + 1;
    std::map<std::int64_t, std::vector<LandmarkSight>> tracks;  // those that go on
    for (const flow::FlowObservation& at : seen.observations) {
      std::vector<LandmarkSight> sights;
      if (const auto ray = RayOf(cameras_.left, at.left_px)) sights.push_back({id, 0, *ray});
      if (at.right_px)
        if (const auto ray = RayOf(cameras_.right, *at.right_px)) sights.push_back({id, 1, *ray});
      if (sights.empty() || sights[0].camera != 0) continue;
      const auto landmark = window_.landmarks.find(at.id);
      if (landmark != window_.landmarks.end()) {
        auto& all = landmark->second.sights;
        all.insert(all.end(), sights.begin(), sights.end());
      }
      auto& track = tracks[at.id];
      if (const auto before = tracks_.find(at.id); before != tracks_.end())
        track = std::move(before->second);
      std::erase_if(track, [&](const LandmarkSight& s) { return !window_.Find(s.frame); });
      track.insert(track.end(), sights.begin(), sights.end());
    }
    tracks_ = std::move(tracks);
  }

  /// Landmarks that the newest frame sees.
  int CountSeen() const {
    int count = 0;
    for (const auto& [id, track] : tracks_) count += window_.landmarks.contains(id);
    return count;
  }

  bool NeedsKeyframe(const flow::FlowFrame& seen) const {
    if (window_.frames.size() == 1) return true;
    if (seen.observations.empty()) return false;
    const double share = CountSeen() / static_cast<double>(seen.observations.size());
    return share < options_.keyframe_share && since_keyframe_ + 1 >= options_.keyframe_gap;
  }

  /// Tracks without a landmark become one of the newest frame, where two rays tell its depth.
  void MakeKeyframe(const flow::FlowFrame& seen, const cv::Mat1b& left, VioFrameResult& result) {
    Frame& frame = window_.frames.back();
    frame.keyframe = result.new_keyframe = true;
    for (const flow::FlowObservation& at : seen.observations) {
      const auto track = tracks_.find(at.id);
      if (track == tracks_.end() || window_.landmarks.contains(at.id)) continue;
      if (auto landmark = MakeLandmark(frame, track->second)) {
        landmark->grey = left(static_cast<int>(at.left_px.y()), static_cast<int>(at.left_px.x()));
        window_.landmarks.emplace(at.id, std::move(*landmark));
      }
    }
  }

  std::optional<Landmark> MakeLandmark(const Frame& host,
                                       const std::vector<LandmarkSight>& track) const {
    const auto own = std::find_if(track.begin(), track.end(), [&](const LandmarkSight& sight) {
      return sight.frame == host.id && sight.camera == 0;
    });
    if (own == track.end()) return std::nullopt;
    const SE3 T_world_host = window_.PoseOf(host, 0);
    // The right image first, then the oldest frame.
    std::vector<const LandmarkSight*> others;
    for (const LandmarkSight& sight : track)
      if (sight.frame == host.id && sight.camera == 1) others.push_back(&sight);
    for (const LandmarkSight& sight : track)
      if (sight.frame != host.id) others.push_back(&sight);
    for (const LandmarkSight* other : others) {
      const SE3 T_other_host =
          window_.PoseOf(*window_.Find(other->frame), other->camera).Inverse() * T_world_host;
      const double least = other->frame == host.id ? 1e-3 : options_.least_parallax;
      if (const auto rho = TriangulateInverseDepth(own->ray, other->ray, T_other_host, least)) {
        return Landmark{.host = host.id, .ray = own->ray, .inverse_depth = *rho, .sights = track};
      }
    }
    return std::nullopt;
  }

  void Refine(bool blind, VioFrameResult& result) {
    const Frame& newest = window_.frames.back();
    const bool first = window_.frames.size() == 1;
    if (!first) {
      result.window = window_.Refine();
      if (InertialDisagrees(result.window)) {
        LeaveInertialOut(result);
        result.window = window_.Refine();
      }
      result.window.outliers = window_.RemoveOutliers();
    }
    const double blind_s = 1e-9 * static_cast<double>(newest.state.time_ns - last_sight_ns_);
    if (window_.landmarks.empty() && !inertial_) {
      result.state = VioState::kInitialising;
    } else if (!first && !result.window.usable) {
      result.state = VioState::kLost;
    } else if (blind) {
      result.state =
          newest.inertial && blind_s <= options_.blind_s ? VioState::kPredicted : VioState::kLost;
    } else {
      result.state = VioState::kTracked;
      last_sight_ns_ = newest.state.time_ns;
    }
    if (!inertial_) JudgeGyroscope(result.state);
    result.body = last_;
    result.body.time_ns = result.time_ns;
    if (result.state == VioState::kLost) return;
    since_keyframe_ = result.new_keyframe ? 0 : since_keyframe_ + 1;
    last_ = newest.state;
    if (!newest.inertial) last_.velocity = SeenVelocity();
    result.body = last_;
    if (!first)
      result.motion = std::prev(window_.frames.end(), 2)->state.T_world_body.Inverse() *
                      newest.state.T_world_body;
    result.calibration = window_.calibration();
    if (!options_.covariance) return;
    const FrameCovariance known = window_.CovarianceOf(newest);
    result.covariance = known.state;
    result.motion_covariance = known.motion;
    result.calibration_covariance = known.calibration;
  }

  /// Whether the inertial sensor has not measured what the images show for some frames, or, the
  /// more it is off, for few.
  bool InertialDisagrees(const WindowSummary& window) {
    constexpr double kPatience = 5, kMost = 3;
    const double excess = window.inertial_error / options_.max_inertial_error;
    disagreement_ =
        excess > 1 ? disagreement_ + std::min(excess, kMost) : std::max(0., disagreement_ - 1);
    return disagreement_ >= kPatience;
  }

  void LeaveInertialOut(VioFrameResult& result) {
    window_.DropInertial(HeldPose());
    inertial_ = false;
    disagreement_ = 0;
    result.problem = InitialisationProblem::kMotionDisagrees;
    start_.Refute(result.time_ns);
  }

  /// Whether the gyroscope may tell the next rotation before the sensor takes part: its unit or
  /// axes may be wrong, and tracks would be searched where they are not.
  void JudgeGyroscope(VioState state) {
    if (state == VioState::kLost) {
      gyro_fits_ = !gyro_fits_;  // so much for that
      return;
    }
    const size_t count = window_.frames.size();
    if (count < 2 || !Newest()->since_last) return;
    const Eigen::Quaterniond turn =
        window_.frames[count - 2].state.T_world_body.R.conjugate() * Newest()->state.T_world_body.R;
    constexpr double kUnexplained = 0.3;  // of the turn
    const double error = LogSO3(Newest()->since_last->delta_R().conjugate() * turn).norm();
    gyro_fits_ = error < kUnexplained * LogSO3(turn).norm() +
                             options_.start.max_gyro_bias * Newest()->since_last->dt_s();
  }

  /// Velocity from the last two poses, m/s.
  Vector3d SeenVelocity() const {
    const size_t count = window_.frames.size();
    if (count < 2) return Vector3d::Zero();
    const BodyState &before = window_.frames[count - 2].state, &now = window_.frames.back().state;
    const double dt_s = 1e-9 * static_cast<double>(now.time_ns - before.time_ns);
    return (now.T_world_body.p - before.T_world_body.p) / dt_s;
  }

  /// From the window's world, whose z points up, to that of the trajectory.
  void ToWorld(VioFrameResult& result) const {
    result.R_gravity_world = R_gravity_world_;
    const Eigen::Quaterniond R = R_gravity_world_.conjugate();
    result.body.T_world_body = SE3{R, {0, 0, 0}} * result.body.T_world_body;
    result.body.velocity = R * result.body.velocity;
    StateMatrix turn = StateMatrix::Identity();
    for (const int at : {kPosition, kVelocity}) turn.block<3, 3>(at, at) = R.toRotationMatrix();
    result.covariance = turn * result.covariance * turn.transpose();
  }

  /// Without a landmark there is no map to predict from.
  bool SeesNothingYet(const VioFrameResult& result) const {
    return result.state == VioState::kInitialising && window_.landmarks.empty();
  }

  /// A new map begins at the last believed state.
  void Lose() {
    for (const auto& [id, landmark] : window_.landmarks) finished_.push_back(ToPoint(landmark));
    Forget();
    ++segment_;
  }

  void Forget() {
    const Calibration calibration = window_.calibration();
    window_ = Window(window_.rig(), options_.window, options_.threads);
    window_.SetCalibration(calibration);
    tracks_.clear();
    start_.Clear();
    inertial_ = false;
    since_keyframe_ = 0;
  }

  // --- Leaving the window ---

  void Marginalize() {
    std::vector<int> leaving, motions;
    const int count = static_cast<int>(window_.frames.size());
    std::vector<const Frame*> keyframes;
    for (int k = 0; k < count - options_.states; ++k) {
      const Frame& frame = window_.frames[k];
      if (!frame.keyframe) {
        leaving.push_back(frame.id);
        continue;
      }
      keyframes.push_back(&frame);
      if (frame.inertial) motions.push_back(frame.id);
    }
    if (static_cast<int>(keyframes.size()) > options_.keyframes)
      leaving.push_back(LeastUseful(keyframes));
    if (leaving.empty() && motions.empty()) return;
    const std::set<int> hosts(leaving.begin(), leaving.end());
    for (const auto& [id, landmark] : window_.landmarks) {
      if (!hosts.contains(landmark.host)) continue;
      finished_.push_back(ToPoint(landmark));
      // What its sights say is in the prior: a new landmark of the track must not say it again.
      if (const auto track = tracks_.find(id); track != tracks_.end()) track->second.clear();
    }
    std::erase_if(motions, [&](int id) { return hosts.contains(id); });
    window_.Marginalize(leaving, motions);
  }

  /// One that hardly any track still sees, else the one that is far from the newest and near to
  /// others (Engel, Koltun, Cremers, 2018, eq. 20).
  int LeastUseful(const std::vector<const Frame*>& keyframes) const {
    std::map<int, std::pair<int, int>> seen;  // by host: of its landmarks, how many
    for (const auto& [id, landmark] : window_.landmarks) {
      auto& [now, all] = seen[landmark.host];
      ++all;
      now += tracks_.contains(id);
    }
    constexpr double kHardly = 0.05;
    const size_t old = keyframes.size() - 1;  // the newest of them stays
    for (size_t k = 0; k < old; ++k) {
      const auto [now, all] = seen[keyframes[k]->id];
      if (now <= kHardly * all) return keyframes[k]->id;
    }
    std::vector<Vector3d> places;
    for (size_t k = 0; k < old; ++k) places.push_back(keyframes[k]->state.T_world_body.p);
    return keyframes[LeastUsefulKeyframe(places, Newest()->state.T_world_body.p)]->id;
  }

  /// In the window's world.
  Vector3d PositionOf(const Landmark& landmark) const {
    return window_.PoseOf(*window_.Find(landmark.host), 0) *
           (landmark.ray.homogeneous() / landmark.inverse_depth);
  }

  VioPoint ToPoint(const Landmark& landmark) const {
    return {.host_ns = window_.Find(landmark.host)->state.time_ns,
            .position = R_gravity_world_.conjugate() * PositionOf(landmark),
            .inverse_depth = landmark.inverse_depth,
            .inverse_depth_variance = landmark.inverse_depth_variance,
            .support = static_cast<int>(landmark.sights.size()),
            .grey = landmark.grey,
            .segment = segment_};
  }

  flow::StereoRig cameras_;
  VioOptions options_;
  flow::StereoFlow flow_;
  ImuBuffer imu_;
  Window window_;
  std::map<std::int64_t, std::vector<LandmarkSight>> tracks_;  ///< of the newest frame, by id
  std::vector<VioPoint> finished_;
  BodyState last_;
  Eigen::Quaterniond R_gravity_world_ = Eigen::Quaterniond::Identity();
  bool inertial_ = false;    ///< the inertial sensor takes part
  bool gyro_fits_ = true;    ///< its rotations are those of the images
  double disagreement_ = 0;  ///< over the last frames, with what the images show
  InertialStart start_;
  int next_id_ = 0;
  int since_keyframe_ = 0;
  int segment_ = 0;
  std::int64_t last_sight_ns_ = 0;
};

StereoInertialOdometry::StereoInertialOdometry(const flow::StereoRig& rig, const SE3& T_body_left,
                                               const ImuNoise& noise, const VioOptions& options)
    : impl_(std::make_unique<Impl>(rig, T_body_left, noise, options)) {}
StereoInertialOdometry::~StereoInertialOdometry() = default;
StereoInertialOdometry::StereoInertialOdometry(StereoInertialOdometry&&) noexcept = default;
StereoInertialOdometry& StereoInertialOdometry::operator=(StereoInertialOdometry&&) noexcept =
    default;

void StereoInertialOdometry::AddImu(const ImuSample& sample) { impl_->AddImu(sample); }
VioFrameResult StereoInertialOdometry::Process(std::int64_t time_ns, const cv::Mat& left,
                                               const cv::Mat& right) {
  return impl_->Process(time_ns, left, right);
}
const ImuHealth& StereoInertialOdometry::imu_health() const { return impl_->imu_health(); }
std::vector<VioPoint> StereoInertialOdometry::TakeFinishedPoints() {
  return impl_->TakeFinishedPoints();
}
std::vector<VioPoint> StereoInertialOdometry::ActivePoints() const { return impl_->ActivePoints(); }

std::span<const std::pair<const char*, VioState>> EnumNames(VioState) {
  static constexpr std::pair<const char*, VioState> kNames[] = {
      {"initialising", VioState::kInitialising},
      {"tracked", VioState::kTracked},
      {"predicted", VioState::kPredicted},
      {"lost", VioState::kLost}};
  return kNames;
}

}  // namespace sgf::vio
