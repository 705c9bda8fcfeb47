#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>

#include <Eigen/Cholesky>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/core/stopwatch.h>
#include <sgf/odometry/odometry.h>

namespace sgf::odometry {
namespace {

double Seconds(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

/// Slope of the inverse depth (1/m per px) around a pixel, by least squares over the neighbours
/// whose depth is near its own; 0 where there are too few of them.
template <class InverseDepth>
Eigen::Vector2f SlopeAt(const cv::Point& centre, const cv::Size& size,
                        const InverseDepth& inverse_depth) {
  constexpr int kRadius = 4, kLeastPixels = 20;
  constexpr float kNear = 0.1f;  // relative
  const float middle = inverse_depth(centre.y, centre.x);
  const cv::Rect window =
      cv::Rect(centre.x - kRadius, centre.y - kRadius, 2 * kRadius + 1, 2 * kRadius + 1) &
      cv::Rect({}, size);
  Eigen::Matrix3f H = Eigen::Matrix3f::Zero();
  Eigen::Vector3f b = Eigen::Vector3f::Zero();
  for (int y = window.y; y < window.br().y; ++y)
    for (int x = window.x; x < window.br().x; ++x) {
      const float difference = inverse_depth(y, x) - middle;
      if (std::abs(difference) > kNear * middle) continue;
      const Eigen::Vector3f row(static_cast<float>(x - centre.x), static_cast<float>(y - centre.y),
                                1);
      H += row * row.transpose();
      b += row * difference;
    }
  if (H(2, 2) < kLeastPixels) return {0, 0};
  H.diagonal() += Eigen::Vector3f(1, 1, 0);  // neighbours on one line
  return H.ldlt().solve(b).head<2>();
}

/// Angular rates since the last frame.
class GyroBuffer {
 public:
  void Add(std::int64_t time_ns, const Eigen::Vector3d& rate) {
    if (samples_.empty() || time_ns > samples_.back().time_ns) samples_.push_back({time_ns, rate});
  }

  /// Forgets what has no say after a time.
  void DropBefore(std::int64_t time_ns) {
    while (samples_.size() > 1 && samples_[1].time_ns <= time_ns) samples_.pop_front();
  }

  /// Rotation R_from_to, each rate holding until the next; none where samples do not span the time.
  std::optional<Eigen::Quaterniond> Integrate(std::int64_t from_ns, std::int64_t to_ns) const {
    constexpr std::int64_t kMostGap = 20'000'000;
    if (samples_.empty() || samples_.front().time_ns > from_ns + kMostGap ||
        samples_.back().time_ns < to_ns - kMostGap)
      return std::nullopt;
    Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
    for (size_t k = 0; k < samples_.size(); ++k) {
      const std::int64_t begin = k == 0 ? from_ns : std::max(from_ns, samples_[k].time_ns);
      const std::int64_t end =
          k + 1 < samples_.size() ? std::min(to_ns, samples_[k + 1].time_ns) : to_ns;
      if (end > begin) R = (R * ExpSO3(samples_[k].rate * Seconds(end - begin))).normalized();
    }
    return R;
  }

 private:
  struct Rate {
    std::int64_t time_ns;
    Eigen::Vector3d rate;
  };
  std::deque<Rate> samples_;
};

}  // namespace

void CheckOptions(const OdometryOptions& options) {
  CheckOptions(options.selection);
  CheckOptions(options.refinement);
  if (!(options.min_depth_m > 0 && options.max_depth_m > options.min_depth_m &&
        std::isfinite(options.max_depth_m)))
    throw Error("min_depth_m", fmt::format("is {} with max_depth_m {}; 0 < min < max < infinity",
                                           options.min_depth_m, options.max_depth_m));
  Require(options.keyframe_overlap >= 0 && options.keyframe_overlap <= 1, "keyframe_overlap",
          options.keyframe_overlap, "in [0, 1]");
  Require(options.keyframe_inliers >= 0 && options.keyframe_inliers <= 1, "keyframe_inliers",
          options.keyframe_inliers, "in [0, 1]");
  Require(options.tracking_levels >= 1, "tracking_levels", options.tracking_levels, "positive");
  Require(options.relocation_keyframes >= 1, "relocation_keyframes", options.relocation_keyframes,
          "positive");
  Require(options.lost_frames >= 0, "lost_frames", options.lost_frames, "at least 0");
}

class Odometry::Impl {
 public:
  Impl(const Rig& rig, const OdometryOptions& options)
      : rig_(rig),
        options_(options),
        aligner_(rig.camera, options.alignment),
        matcher_(options.matcher) {
    CheckOptions(options);
    Require(rig.baseline_m >= 0, "baseline_m", rig.baseline_m, "at least 0");
  }

  FrameResult ProcessStereo(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right) {
    if (rig_.baseline_m <= 0) throw Error("rig", "has no baseline for stereo pairs");
    CheckFrame(time_ns, left);
    CheckImage(right);
    return Process(time_ns, left,
                   [&](StageTimes& times) { return StereoPoints(left, right, times); });
  }

  FrameResult ProcessDepth(std::int64_t time_ns, const cv::Mat& grey, const cv::Mat1f& depth_m) {
    CheckFrame(time_ns, grey);
    if (depth_m.size() != grey.size())
      throw Error("depth image", fmt::format("is {}x{} px; the camera has {}x{}", depth_m.cols,
                                             depth_m.rows, grey.cols, grey.rows));
    return Process(time_ns, grey, [&](StageTimes& times) { return DepthPoints(depth_m, times); });
  }

  void ProcessGyro(std::int64_t time_ns, const Eigen::Vector3d& gyro) { gyro_.Add(time_ns, gyro); }

  const Keyframe& LastKeyframe() const {
    if (references_.empty()) throw Error("odometry", "has no key-frame before the first frame");
    return references_.back().keyframe;
  }

 private:
  using Points = std::vector<alignment::ReferencePoint>;
  using MakePoints = std::function<Points(StageTimes&)>;  ///< of the frame in pyramid_

  struct Reference {
    int index = 0;
    Keyframe keyframe = {};
    std::shared_ptr<const alignment::DirectAligner::Reference> patches;
  };

  /// The last frame that was handed over.
  struct Last {
    std::int64_t time_ns = 0;
    SE3 T_world_cam;
    SE3 motion = {};  ///< of the camera over the last period, T_before_cam
    double period_s = 0;
    bool believed = false;
  };

  void CheckImage(const cv::Mat& image) const {
    if (image.type() != CV_8UC1)
      throw Error("image", fmt::format("is of type {}; it has to be 8-bit grey",
                                       cv::typeToString(image.type())));
    if (image.cols != rig_.camera.width || image.rows != rig_.camera.height)
      throw Error("image", fmt::format("is {}x{} px; the camera has {}x{}", image.cols, image.rows,
                                       rig_.camera.width, rig_.camera.height));
  }

  void CheckFrame(std::int64_t time_ns, const cv::Mat& image) const {
    CheckImage(image);
    if (last_ && time_ns <= last_->time_ns)
      throw Error("frame", fmt::format("time {} ns is not after the last one's, {} ns", time_ns,
                                       last_->time_ns));
  }

  FrameResult Process(std::int64_t time_ns, const cv::Mat& grey, const MakePoints& make_points) {
    FrameResult result{.time_ns = time_ns};
    Stopwatch total, stage;
    aligner_.MakePyramid(grey, pyramid_);
    result.times.pyramid_s = stage.Lap();
    if (references_.empty()) {
      result.state = TrackingState::kInitialised;
    } else {
      Track(Predict(time_ns), result);
    }
    result.times.alignment_s = stage.Lap();
    lost_frames_ = result.state == TrackingState::kLost ? lost_frames_ + 1 : 0;
    if (lost_frames_ > options_.lost_frames) BeginAnew(result);
    if (NeedsKeyframe(result)) AddKeyframe(make_points, result);
    if (result.state == TrackingState::kInitialised) lost_frames_ = 0;
    Remember(result);
    result.times.total_s = total.Lap();
    return result;
  }

  /// At the predicted pose: what alignment found does not count.
  static void BeginAnew(FrameResult& result) {
    result = {.time_ns = result.time_ns,
              .state = TrackingState::kInitialised,
              .T_world_cam = result.T_world_cam,
              .iterations = result.iterations,
              .times = result.times};
  }

  /// Motion since the last frame: rotation by gyroscope, else as over the period before.
  SE3 Predict(std::int64_t time_ns) const {
    const double share =
        last_->period_s > 0 ? Seconds(time_ns - last_->time_ns) / last_->period_s : 0;
    SE3 motion{ExpSO3(share * LogSO3(last_->motion.R)), share * last_->motion.p};
    if (const auto R = gyro_.Integrate(last_->time_ns, time_ns)) motion.R = *R;
    return last_->T_world_cam * motion;
  }

  /// Aligns with the last key-frame and, while that fails, from other guesses and with key-frames
  /// before it.
  void Track(const SE3& predicted, FrameResult& result) const {
    result.T_world_cam = predicted;
    const Reference& last = references_.back();
    const int all = options_.alignment.levels;
    if (TrackFrom(last, predicted, options_.tracking_levels, result) ||
        TrackFrom(last, predicted, all, result) || TrackFrom(last, last_->T_world_cam, all, result))
      return;
    if (last_->period_s == 0)
      for (const SE3& motion : FirstMotions(last.keyframe))
        if (TrackFrom(last, last_->T_world_cam * motion, all, result)) return;
    for (auto reference = references_.rbegin(); reference != references_.rend(); ++reference)
      if (TrackFrom(*reference, reference->keyframe.T_world_cam, all, result)) return;
  }

  /// What may have happened where no motion is known yet: ahead by shares of the scene's depth, as
  /// vehicles go, straight or turning.
  static std::vector<SE3> FirstMotions(const Keyframe& keyframe) {
    std::vector<double> inverse_depths;
    for (const alignment::ReferencePoint& point : keyframe.points)
      inverse_depths.push_back(point.inverse_depth);
    const auto middle = inverse_depths.begin() + static_cast<ptrdiff_t>(inverse_depths.size() / 2);
    std::nth_element(inverse_depths.begin(), middle, inverse_depths.end());
    std::vector<SE3> motions;
    for (const double share : {0.05, 0.1})
      for (const double yaw : {0., -0.04, 0.04})  // rad
        motions.push_back({ExpSO3({0, yaw, 0}), {0, 0, share / *middle}});
    return motions;
  }

  bool TrackFrom(const Reference& reference, const SE3& T_world_cam, int levels,
                 FrameResult& result) const {
    const alignment::AlignmentResult aligned =
        aligner_.Align(*reference.patches, pyramid_,
                       T_world_cam.Inverse() * reference.keyframe.T_world_cam, levels);
    result.iterations += aligned.iterations;
    result.keyframe = reference.index;
    result.overlap = aligned.overlap;
    result.inlier_share = aligned.inlier_share;
    result.condition = aligned.condition;
    result.failure = aligned.failure;
    if (!aligned.ok()) return false;
    result.state = TrackingState::kTracked;
    result.covariance = aligned.covariance;
    result.T_world_cam = reference.keyframe.T_world_cam * aligned.T_cur_ref.Inverse();
    return true;
  }

  bool NeedsKeyframe(const FrameResult& result) const {
    if (result.state == TrackingState::kInitialised) return true;
    return result.state == TrackingState::kTracked &&
           (result.overlap < options_.keyframe_overlap ||
            result.inlier_share < options_.keyframe_inliers ||
            result.keyframe != references_.back().index);
  }

  void AddKeyframe(const MakePoints& make_points, FrameResult& result) {
    Points points = make_points(result.times);
    if (static_cast<int>(points.size()) < options_.alignment.min_points) {
      if (result.state == TrackingState::kInitialised) result.state = TrackingState::kLost;
      return;
    }
    Stopwatch stage;
    Reference reference{.index = keyframes_++, .patches = aligner_.MakeReference(pyramid_, points)};
    reference.keyframe = {result.time_ns, result.T_world_cam, std::move(points)};
    references_.push_back(std::move(reference));
    if (static_cast<int>(references_.size()) > std::max(1, options_.relocation_keyframes))
      references_.pop_front();
    result.new_keyframe = true;
    result.times.selection_s += stage.Lap();
  }

  void Remember(const FrameResult& result) {
    Last next{.time_ns = result.time_ns,
              .T_world_cam = result.T_world_cam,
              .believed = result.state != TrackingState::kLost};
    if (last_ && last_->believed && result.state == TrackingState::kTracked) {
      next.motion = last_->T_world_cam.Inverse() * result.T_world_cam;
      next.period_s = Seconds(result.time_ns - last_->time_ns);
    }
    last_ = next;
    gyro_.DropBefore(result.time_ns);
  }

  Points StereoPoints(const cv::Mat& left, const cv::Mat& right, StageTimes& times) {
    Stopwatch stage;
    cv::Mat1s disparity;
    matcher_.Compute(left, right, disparity);
    times.depth_s = stage.Lap();
    const double scale = 1.0 / (rig_.camera.fx * rig_.baseline_m);
    Points points = Select([&](int y, int x) {
      return disparity(y, x) > 0 ? static_cast<float>(disparity(y, x) / 16.0 * scale) : 0.f;
    });
    if (options_.refinement.enabled) {
      alignment::MakeSampleChannels(right, options_.alignment.image, right_samples_);
      RefineDepths(pyramid_.samples[0], right_samples_, rig_.camera, rig_.baseline_m,
                   options_.refinement, points);
      std::erase_if(points, [&](const auto& point) { return !InRange(point.inverse_depth); });
    }
    times.selection_s = stage.Lap();
    return points;
  }

  Points DepthPoints(const cv::Mat1f& depth_m, StageTimes& times) const {
    Stopwatch stage;
    Points points = Select([&](int y, int x) {
      const float depth = depth_m(y, x);
      return std::isfinite(depth) && depth > 0 ? 1 / depth : 0.f;
    });
    times.selection_s = stage.Lap();
    return points;
  }

  bool InRange(float inverse_depth) const {
    return inverse_depth >= static_cast<float>(1 / options_.max_depth_m) &&
           inverse_depth <= static_cast<float>(1 / options_.min_depth_m);
  }

  /// @param inverse_depth of a pixel, 1/m; 0 where unknown.
  template <class InverseDepth>
  Points Select(const InverseDepth& inverse_depth) const {
    cv::Mat1b eligible(pyramid_.size);
    for (int y = 0; y < eligible.rows; ++y)
      for (int x = 0; x < eligible.cols; ++x) eligible(y, x) = InRange(inverse_depth(y, x));
    Points points;
    for (const cv::Point& p :
         alignment::SelectPoints(pyramid_.samples[0], eligible, options_.selection))
      points.push_back({Eigen::Vector2f(static_cast<float>(p.x), static_cast<float>(p.y)),
                        inverse_depth(p.y, p.x), SlopeAt(p, pyramid_.size, inverse_depth)});
    return points;
  }

  Rig rig_;
  OdometryOptions options_;
  alignment::DirectAligner aligner_;
  stereo::BlockMatcher matcher_;
  alignment::Pyramid pyramid_;  ///< of the frame at hand
  alignment::SampleChannels right_samples_;
  std::deque<Reference> references_;
  int keyframes_ = 0;
  int lost_frames_ = 0;
  std::optional<Last> last_;
  GyroBuffer gyro_;
};

Odometry::Odometry(const Rig& rig, const OdometryOptions& options)
    : impl_(std::make_unique<Impl>(rig, options)) {}
Odometry::~Odometry() = default;
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;

FrameResult Odometry::ProcessStereo(std::int64_t time_ns, const cv::Mat& left,
                                    const cv::Mat& right) {
  return impl_->ProcessStereo(time_ns, left, right);
}

FrameResult Odometry::ProcessDepth(std::int64_t time_ns, const cv::Mat& grey,
                                   const cv::Mat1f& depth_m) {
  return impl_->ProcessDepth(time_ns, grey, depth_m);
}

void Odometry::ProcessGyro(std::int64_t time_ns, const Eigen::Vector3d& gyro) {
  impl_->ProcessGyro(time_ns, gyro);
}

const Keyframe& Odometry::LastKeyframe() const { return impl_->LastKeyframe(); }

std::span<const std::pair<const char*, TrackingState>> EnumNames(TrackingState) {
  static constexpr std::pair<const char*, TrackingState> kNames[] = {
      {"initialised", TrackingState::kInitialised},
      {"tracked", TrackingState::kTracked},
      {"lost", TrackingState::kLost}};
  return kNames;
}

}  // namespace sgf::odometry
