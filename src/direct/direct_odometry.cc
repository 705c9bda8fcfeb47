#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include <sgf/alignment/warp.h>
#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/core/require.h>
#include <sgf/core/stopwatch.h>
#include <sgf/direct/activation.h>
#include <sgf/direct/direct_odometry.h>
#include <sgf/direct/leaving.h>
#include <sgf/direct/pose_history.h>
#include <sgf/direct/projection.h>

namespace sgf::direct {
namespace {

using alignment::ReferencePoint;
using Eigen::Vector2f, Eigen::Vector3d;

/// How many of Hypotheses() come before the turns, which are for when none of these was followed.
constexpr int kSteadyHypotheses = 4;

/// Motions that may have happened since the last frame, T_cur_last, the likeliest first.
std::vector<SE3> Hypotheses(const SE3& motion) {
  const SE3 none;
  const std::array<SE3, kSteadyHypotheses> steady = {motion, none, PartOf(motion, 0.5),
                                                     motion * motion};
  std::vector<SE3> motions(steady.begin(), steady.end());
  // Turns about all axes and their diagonals, on top of the motion.
  for (const double angle : {0.02, 0.05})  // rad
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z)
          if (x != 0 || y != 0 || z != 0)
            motions.push_back(SE3{ExpSO3(angle * Vector3d(x, y, z)), {0, 0, 0}} * motion);
  return motions;
}

}  // namespace

void CheckOptions(const DirectOptions& options) {
  CheckOptions(options.selection);
  CheckOptions(options.depth);
  CheckOptions(options.tracking);
  CheckOptions(options.window);
  CheckOptions(options.initializer);
  if (options.tracking.residual == "bit_planes")
    throw Error("tracking.residual", "'bit_planes' has no window to go with it");
  if (options.tracking.residual == "lssd" && options.tracking.pattern == alignment::Pattern::kPoint)
    throw Error("tracking.residual", "'lssd' is constant over patches of one pixel");
  Require(options.active_points >= 100, "active_points", options.active_points, "at least 100");
  Require(options.min_keyframes >= 3, "min_keyframes", options.min_keyframes, "at least 3");
  Require(options.keyframes >= options.min_keyframes && options.keyframes <= kMostKeyframes,
          "keyframes", options.keyframes, fmt::format("from min_keyframes to {}", kMostKeyframes));
  Require(options.keyframe_flow > 0, "keyframe_flow", options.keyframe_flow, "positive");
  Require(options.keyframe_parallax > 0, "keyframe_parallax", options.keyframe_parallax,
          "positive");
  Require(options.keyframe_brightness > 0, "keyframe_brightness", options.keyframe_brightness,
          "positive");
  Require(options.keyframe_inliers >= 0 && options.keyframe_inliers <= 1, "keyframe_inliers",
          options.keyframe_inliers, "in [0, 1]");
  Require(options.lost_frames >= 1, "lost_frames", options.lost_frames, "positive");
  Require(options.threads >= 0, "threads", options.threads, "at least 0");
}

class DirectOdometry::Impl {
 public:
  Impl(const Camera& camera, const DirectOptions& options)
      : given_camera_(camera),
        camera_(camera),
        options_(WithThreads(options)),
        aligner_(camera, options_.tracking),
        depth_(MakeDepthEstimator(camera, options.depth)),
        selector_(options.selection),
        activation_(camera, options_) {
    CheckOptions(options);
    BeginMap();
  }

  DirectFrameResult Process(std::int64_t time_ns, const cv::Mat& grey,
                            std::optional<double> exposure_ms) {
    CheckFrame(time_ns, grey, exposure_ms);
    last_time_ns_ = time_ns;
    DirectFrameResult result{.time_ns = time_ns, .segment = segment_};
    Stopwatch total, stage;
    const cv::Mat1f image = AsFloat(grey);
    log_exposure_ = exposure_ms ? std::log(*exposure_ms / *first_exposure_ms_) : 0;
    if (!initializer_) {
      aligner_.MakePyramid(image, pyramid_);
      result.times.image_s = stage.Lap();
      Track(result);
      result.times.tracking_s = stage.Lap();
    }
    if (initializer_) {
      result.state = DirectState::kInitialising;
      Initialise(time_ns, image, grey, result);
      result.times.keyframe_s = stage.Lap();
    } else if (result.state == DirectState::kTracked) {
      TraceAll();
      result.times.tracing_s = stage.Lap();
      if (NeedsKeyframe(result)) MakeKeyframe(result);
      result.times.keyframe_s = stage.Lap();
    }
    if (!window_.empty()) result.T_world_cam = history_.LastPose().Inverse();
    result.segment = segment_;
    result.active_points = CountActive(window_);
    result.times.total_s = total.Lap();
    return result;
  }

  std::vector<DirectPose> Trajectory() const {
    std::vector<DirectPose> poses;
    for (const PoseHistory::Record& record : history_.records())
      poses.push_back({record.time_ns, record.segment, history_.PoseOf(record).Inverse()});
    return poses;
  }

  const Camera& camera() const { return camera_; }

  std::vector<MapPoint> TakeFinishedPoints() { return std::exchange(finished_, {}); }

  std::vector<MapPoint> ActivePoints() const {
    std::vector<MapPoint> points;
    for (const auto& frame : window_)
      for (const ActivePoint& point : frame->points) points.push_back(ToMapPoint(*frame, point));
    return points;
  }

 private:
  /// A frame before there is a map.
  struct Waiting {
    std::int64_t time_ns = 0;
    cv::Mat grey;  ///< as it came
    double log_exposure = 0;
  };

  /// The image itself, or its grey levels as float in memory that is used again.
  cv::Mat1f AsFloat(const cv::Mat& grey) {
    if (grey.depth() == CV_32F) return grey;
    grey.convertTo(float_image_, CV_32F);
    return float_image_;
  }

  static DirectOptions WithThreads(DirectOptions options) {
    options.tracking.threads = options.threads;
    return options;
  }

  void CheckFrame(std::int64_t time_ns, const cv::Mat& grey, std::optional<double> exposure_ms) {
    if (grey.type() != CV_8UC1 && grey.type() != CV_32FC1)
      throw Error("image", fmt::format("is of type {}; it has to be 8-bit or float grey",
                                       cv::typeToString(grey.type())));
    if (grey.cols != camera_.width || grey.rows != camera_.height)
      throw Error("image", fmt::format("is {}x{} px; the camera has {}x{}", grey.cols, grey.rows,
                                       camera_.width, camera_.height));
    if (grey.depth() == CV_32F && !cv::checkRange(grey))
      throw Error("image", "has grey levels that are not finite");
    if (last_time_ns_ && time_ns <= *last_time_ns_)
      throw Error("frame", fmt::format("time {} ns is not after the last one's, {} ns", time_ns,
                                       *last_time_ns_));
    if (exposure_ms && !(*exposure_ms > 0 && std::isfinite(*exposure_ms)))
      throw Error("exposure", fmt::format("is {} ms; it has to be positive", *exposure_ms));
    if (last_time_ns_ && exposure_ms.has_value() != first_exposure_ms_.has_value())
      throw Error("exposure", "is known for some frames only");
    if (!last_time_ns_) first_exposure_ms_ = exposure_ms;
  }

  void Believe(std::int64_t time_ns, int keyframe, const SE3& T_cam_keyframe) {
    history_.Add({time_ns, segment_, keyframe, T_cam_keyframe});
  }

  // --- Begin ---

  void BeginMap() {
    if (options_.window.sigma_intrinsics > 0) UseCamera(given_camera_);
    initializer_.emplace(camera_, options_.initializer);
    waiting_.clear();
    lost_ = 0;
  }

  void LeaveMap() {
    for (const MapPoint& point : ActivePoints()) finished_.push_back(point);
    window_.clear();
    reference_.reset();
    ++segment_;
    BeginMap();
  }

  void Initialise(std::int64_t time_ns, const cv::Mat1f& image, const cv::Mat& grey,
                  DirectFrameResult& result) {
    const auto motion = initializer_->Add(image);
    if (initializer_->frames() == 1) waiting_.clear();
    waiting_.push_back({time_ns, grey.clone(), log_exposure_});
    if (!motion) return;
    if (MakeMap(*motion)) {
      result.state = DirectState::kTracked;
      result.new_keyframe = result.new_map = true;
      result.window = last_refinement_;
    }
    waiting_.clear();
    if (result.new_map) {
      initializer_.reset();
    } else {
      window_.clear();
      BeginMap();
    }
  }

  std::unique_ptr<Keyframe> NewKeyframe(const SE3& T_cam_world, double log_exposure) {
    auto frame = std::make_unique<Keyframe>();
    frame->id = history_.AddKeyframe(T_cam_world);
    frame->T_cam_world = T_cam_world;
    frame->log_exposure = log_exposure;
    frame->brightness.a = log_exposure;
    return frame;
  }

  void AddImmature(Keyframe& frame) {
    for (const cv::Point& p : selector_(frame.image()))
      frame.immature.push_back(MakeImmaturePoint(
          frame.image(), Vector2f(static_cast<float>(p.x), static_cast<float>(p.y))));
  }

  /// The first two key-frames, from the waiting frames' motion.
  bool MakeMap(const InitialMotion& motion) {
    constexpr size_t kMostViews = 12;  // that depth is searched in
    const int least_points = std::min(100, options_.selection.points / 2);
    const SE3 T_world_first = history_.records().empty() ? SE3{} : history_.LastPose().Inverse();
    const size_t last = waiting_.size() - 1;
    const int keyframes_before = history_.keyframes();
    const auto pose_of = [&](size_t k) { return motion.T_cam_first[k] * T_world_first.Inverse(); };

    auto first = NewKeyframe(pose_of(0), waiting_[0].log_exposure);
    aligner_.MakePyramid(waiting_[0].grey, first->pyramid);
    AddImmature(*first);
    const size_t stride = (last + kMostViews - 1) / kMostViews;
    for (size_t k = last % stride == 0 ? stride : last % stride; k <= last; k += stride) {
      aligner_.MakePyramid(waiting_[k].grey, pyramid_);
      // Where exposures are not known, the images' means have to do.
      Brightness brightness{waiting_[k].log_exposure, 0};
      if (!first_exposure_ms_) brightness.a = MeanLogRatio(*first, pyramid_);
      Trace(*first, pyramid_.samples[0], motion.T_cam_first[k],
            Between(first->brightness, brightness));
    }
    auto second = NewKeyframe(pose_of(last), waiting_[last].log_exposure);
    second->pyramid = std::move(pyramid_);
    pyramid_ = {};
    if (!first_exposure_ms_) second->brightness.a = MeanLogRatio(*first, second->pyramid);
    for (const ImmaturePoint& point : first->immature)
      if (point.found > 0 && std::isfinite(point.inverse_depth_max))
        first->points.push_back({.pixel = point.pixel,
                                 .inverse_depth = point.InverseDepth(),
                                 .observations = {{second->id}}});
    first->immature.clear();
    first->points_made = static_cast<int>(first->points.size());
    optimizer_.emplace(camera_, options_.window, options_.threads);
    optimizer_->Anchor(*first);
    window_.push_back(std::move(first));
    window_.push_back(std::move(second));
    for (int round = 0; round < 3; ++round) last_refinement_ = Refine();
    if (CountActive(window_) < least_points || !last_refinement_.usable) {
      history_.ForgetKeyframes(keyframes_before);
      return false;
    }
    AddImmature(*window_.back());
    PoseWaiting(motion);
    Believe(waiting_[last].time_ns, window_.back()->id, {});
    SetReference();
    return true;
  }

  static double MeanLogRatio(const Keyframe& first, const alignment::Pyramid& pyramid) {
    const auto mean = [](const alignment::SampleChannels& image) {
      double sum = 0;
      for (int y = 0; y < image.rows(); ++y)
        for (int x = 0; x < image.cols(); ++x) sum += image.At(y, x)[alignment::kIntensity];
      return sum;
    };
    const double ratio = mean(pyramid.samples.back()) / mean(first.pyramid.samples.back());
    return std::isfinite(ratio) && ratio > 0 ? std::log(ratio) : 0;
  }

  /// Aligns the frames between the first two key-frames with the first.
  void PoseWaiting(const InitialMotion& motion) {
    const Keyframe& first = *window_.front();
    std::vector<ReferencePoint> points;
    for (const ActivePoint& point : first.points)
      points.push_back({point.pixel, static_cast<float>(point.inverse_depth)});
    const auto reference = aligner_.MakeReference(first.pyramid, points);
    Believe(waiting_.front().time_ns, first.id, {});
    // The refinement may have changed the scale.
    const double scale =
        (history_.KeyframePose(window_.back()->id) * history_.KeyframePose(first.id).Inverse())
            .p.norm() /
        motion.T_cam_first.back().p.norm();
    for (size_t k = 1; k + 1 < waiting_.size(); ++k) {
      aligner_.MakePyramid(waiting_[k].grey, pyramid_);
      SE3 guess = motion.T_cam_first[k];
      guess.p *= scale;
      const auto aligned = aligner_.Align(*reference, pyramid_, guess);
      if (aligned.ok()) Believe(waiting_[k].time_ns, first.id, aligned.T_cur_ref);
    }
  }

  // --- Every frame ---

  void Track(DirectFrameResult& result) {
    const auto& records = history_.records();
    const PoseHistory::Record& last = records.back();
    const SE3 T_last_ref = history_.PoseOf(last) * history_.KeyframePose(reference_id_).Inverse();
    SE3 motion;
    if (records.size() >= 2 && records[records.size() - 2].segment == segment_ && lost_ == 0) {
      const PoseHistory::Record& before = records[records.size() - 2];
      const double share = static_cast<double>(result.time_ns - last.time_ns) /
                           static_cast<double>(last.time_ns - before.time_ns);
      motion = PartOf(history_.PoseOf(last) * history_.PoseOf(before).Inverse(), share);
    }
    alignment::AlignmentResult best;
    best.failure = alignment::AlignmentFailure::kFewPoints;
    for (const SE3& hypothesis : Hypotheses(motion)) {
      const auto aligned = aligner_.Align(*reference_, pyramid_, hypothesis * T_last_ref);
      ++result.hypotheses;
      if (aligned.ok() && (!best.ok() || aligned.mean_cost < best.mean_cost)) best = aligned;
      if (best.ok() && (LikeTheLast(best) || result.hypotheses >= kSteadyHypotheses)) break;
    }
    result.inlier_share = best.inlier_share;
    result.overlap = best.overlap;
    if (!best.ok()) {
      result.state = DirectState::kLost;
      if (++lost_ > options_.lost_frames) LeaveMap();
      return;
    }
    lost_ = 0;
    last_cost_ = best.mean_cost;
    last_inlier_share_ = best.inlier_share;
    result.state = DirectState::kTracked;
    brightness_ = BrightnessNow(best);
    result.brightness = brightness_;
    T_cur_ref_ = best.T_cur_ref;
    Believe(result.time_ns, reference_id_, best.T_cur_ref);
  }

  /// As good as the last frame, so that there is no need to look further. Costs rise with the
  /// distance from the key-frame; inliers do not mind.
  bool LikeTheLast(const alignment::AlignmentResult& aligned) const {
    constexpr double kAlike = 1.5, kFewerInliers = 0.03;
    return aligned.mean_cost < kAlike * last_cost_ ||
           aligned.inlier_share > last_inlier_share_ - kFewerInliers;
  }

  /// Of the frame at hand; where motion is estimated without it, as exposures or means say.
  Brightness BrightnessNow(const alignment::AlignmentResult& aligned) const {
    const Keyframe& newest = *window_.back();
    if (options_.tracking.residual == "photo_affine")
      return Apply(newest.brightness, {aligned.alpha, aligned.beta});
    if (first_exposure_ms_) return {log_exposure_, 0};
    return {newest.brightness.a + MeanLogRatio(newest, pyramid_), 0};
  }

  void Trace(Keyframe& host, const alignment::SampleChannels& image, const SE3& T_target_host,
             const RelativeBrightness& relative) const {
    ParallelForBatches(static_cast<int>(host.immature.size()), options_.threads, [&](int k) {
      ImmaturePoint& point = host.immature[k];
      if (!point.GivenUp()) depth_->Trace(host, image, T_target_host, relative, point);
    });
  }

  void TraceAll() {
    const SE3 T_cur_world = history_.LastPose();
    for (const auto& host : window_)
      Trace(*host, pyramid_.samples[0], T_cur_world * host->T_cam_world.Inverse(),
            Between(host->brightness, brightness_));
  }

  bool NeedsKeyframe(const DirectFrameResult& result) const {
    double flow = 0, parallax = 0;
    int seen = 0;
    const SE3 moved{Eigen::Quaterniond::Identity(), T_cur_ref_.p};
    for (const ReferencePoint& point : reference_points_) {
      const Projection full = Project(camera_, T_cur_ref_, point.pixel, point.inverse_depth);
      const Projection shifted = Project(camera_, moved, point.pixel, point.inverse_depth);
      if (!full.in_view) continue;
      ++seen;
      flow += (full.pixel - point.pixel).squaredNorm();
      parallax += (shifted.pixel - point.pixel).squaredNorm();
    }
    if (seen == 0) return true;
    const double side = camera_.width + camera_.height;
    const double share =
        std::sqrt(flow / seen) / (options_.keyframe_flow * side) +
        std::sqrt(parallax / seen) / (options_.keyframe_parallax * side) +
        std::abs(brightness_.a - window_.back()->brightness.a) / options_.keyframe_brightness;
    return share > 1 || result.inlier_share < options_.keyframe_inliers;
  }

  /// The points of the window as the newest key-frame sees them, for frames to be aligned with.
  void SetReference() {
    const Keyframe& newest = *window_.back();
    reference_points_.clear();
    for (const auto& host : window_) {
      const SE3 T = newest.T_cam_world * host->T_cam_world.Inverse();
      for (const ActivePoint& point : host->points) {
        if (host.get() != &newest && !point.SeenBy(newest.id)) continue;
        const Projection seen = Project(camera_, T, point.pixel, point.inverse_depth);
        if (seen.in_view) reference_points_.push_back({seen.pixel, seen.inverse_depth});
      }
    }
    reference_ = aligner_.MakeReference(newest.pyramid, reference_points_);
    reference_id_ = newest.id;
    last_cost_ = INFINITY;
    last_inlier_share_ = 0;
  }

  // --- Key-frames ---

  void UseCamera(const Camera& camera) {
    camera_ = camera;
    aligner_ = alignment::DirectAligner(camera, options_.tracking);
    depth_ = MakeDepthEstimator(camera, options_.depth);
  }

  WindowSummary Refine() {
    const WindowSummary summary = optimizer_->Refine(window_, first_exposure_ms_.has_value());
    if (options_.window.sigma_intrinsics > 0) UseCamera(optimizer_->camera());
    history_.Update(window_);
    return summary;
  }

  void MakeKeyframe(DirectFrameResult& result) {
    auto frame = NewKeyframe(history_.LastPose(), log_exposure_);
    frame->brightness = brightness_;
    frame->pyramid = std::move(pyramid_);
    pyramid_ = std::exchange(spare_, {});
    history_.MakeLastKeyframe(frame->id);
    window_.push_back(std::move(frame));
    ObserveInNewest();
    activation_.Activate(camera_, *depth_, window_);
    last_refinement_ = Refine();
    result.window = last_refinement_;
    result.new_keyframe = true;
    SetReference();
    LeaveWindow();
    AddImmature(*window_.back());
  }

  void ObserveInNewest() {
    const Keyframe& newest = *window_.back();
    for (const auto& host : window_) {
      const SE3 T = newest.T_cam_world * host->T_cam_world.Inverse();
      if (host->id == newest.id) continue;
      for (ActivePoint& point : host->points)
        if (Project(camera_, T, point.pixel, point.inverse_depth).in_view)
          point.observations.push_back({newest.id});
    }
  }

  MapPoint ToMapPoint(const Keyframe& host, const ActivePoint& point) const {
    const Eigen::Vector2d ray = alignment::RayOf<double>(camera_, point.pixel.cast<double>());
    return {.position = host.T_cam_world.Inverse() * (ray.homogeneous() / point.inverse_depth),
            .inverse_depth = point.inverse_depth,
            .inverse_depth_variance = point.variance,
            .support = point.support,
            .grey = host.image().At(static_cast<int>(point.pixel.y()),
                                    static_cast<int>(point.pixel.x()))[alignment::kIntensity],
            .keyframe = host.id,
            .segment = segment_};
  }

  /// Points and key-frames leave the window: what they say stays as the prior, or is dropped.
  void LeaveWindow() {
    const std::vector<int> leaving = LeavingKeyframes(window_, options_);
    const std::vector<std::vector<char>> gone = LeavingPoints(window_, leaving);
    std::vector<std::pair<int, const ActivePoint*>> marginalised;
    for (size_t k = 0; k < window_.size(); ++k)
      for (size_t i = 0; i < gone[k].size(); ++i) {
        if (!gone[k][i]) continue;
        const ActivePoint& point = window_[k]->points[i];
        finished_.push_back(ToMapPoint(*window_[k], point));
        constexpr size_t kLeastObservations = 2;
        if (point.observations.size() >= kLeastObservations)
          marginalised.emplace_back(static_cast<int>(k), &point);
      }
    optimizer_->Marginalize(window_, marginalised);
    for (size_t k = 0; k < window_.size(); ++k) {
      std::vector<ActivePoint> stay;
      for (size_t i = 0; i < window_[k]->points.size(); ++i)
        if (!gone[k][i]) stay.push_back(std::move(window_[k]->points[i]));
      window_[k]->points = std::move(stay);
    }
    std::vector<int> ids;
    for (int k : leaving) ids.push_back(window_[k]->id);
    for (int id : ids) LeaveWindow(id);
  }

  void LeaveWindow(int id) {
    const auto frame =
        std::find_if(window_.begin(), window_.end(), [&](const auto& f) { return f->id == id; });
    optimizer_->Marginalize(**frame);
    spare_ = std::move((*frame)->pyramid);
    window_.erase(frame);
    for (const auto& host : window_) {
      for (ActivePoint& point : host->points)
        std::erase_if(point.observations, [&](const Observation& o) { return o.target == id; });
    }
  }

  Camera given_camera_, camera_;
  DirectOptions options_;
  alignment::DirectAligner aligner_;
  std::unique_ptr<const DepthEstimator> depth_;
  PixelSelector selector_;
  PointActivation activation_;

  std::optional<Initializer> initializer_;  ///< while there is no map
  std::vector<Waiting> waiting_;
  std::optional<WindowOptimizer> optimizer_;
  Window window_;
  WindowSummary last_refinement_;

  std::vector<ReferencePoint> reference_points_;  ///< in the newest key-frame
  std::shared_ptr<const alignment::DirectAligner::Reference> reference_;
  int reference_id_ = 0;
  double last_cost_ = INFINITY;
  double last_inlier_share_ = 0;

  cv::Mat1f float_image_;
  alignment::Pyramid pyramid_;  ///< of the frame at hand
  alignment::Pyramid spare_;    ///< memory of a key-frame that has left
  SE3 T_cur_ref_;
  Brightness brightness_;
  double log_exposure_ = 0;

  PoseHistory history_;
  std::vector<MapPoint> finished_;
  int segment_ = 0;
  int lost_ = 0;
  std::optional<std::int64_t> last_time_ns_;
  std::optional<double> first_exposure_ms_;
};

DirectOdometry::DirectOdometry(const Camera& camera, const DirectOptions& options)
    : impl_(std::make_unique<Impl>(camera, options)) {}
DirectOdometry::~DirectOdometry() = default;
DirectOdometry::DirectOdometry(DirectOdometry&&) noexcept = default;
DirectOdometry& DirectOdometry::operator=(DirectOdometry&&) noexcept = default;

DirectFrameResult DirectOdometry::Process(std::int64_t time_ns, const cv::Mat& grey,
                                          std::optional<double> exposure_ms) {
  return impl_->Process(time_ns, grey, exposure_ms);
}

std::vector<DirectPose> DirectOdometry::Trajectory() const { return impl_->Trajectory(); }
const Camera& DirectOdometry::camera() const { return impl_->camera(); }
std::vector<MapPoint> DirectOdometry::TakeFinishedPoints() { return impl_->TakeFinishedPoints(); }
std::vector<MapPoint> DirectOdometry::ActivePoints() const { return impl_->ActivePoints(); }

std::span<const std::pair<const char*, DirectState>> EnumNames(DirectState) {
  static constexpr std::pair<const char*, DirectState> kNames[] = {
      {"initialising", DirectState::kInitialising},
      {"tracked", DirectState::kTracked},
      {"lost", DirectState::kLost}};
  return kNames;
}

}  // namespace sgf::direct
