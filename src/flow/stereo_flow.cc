#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/core/require.h>
#include <sgf/core/stopwatch.h>
#include <sgf/flow/detection.h>
#include <sgf/flow/patch_tracker.h>
#include <sgf/flow/stereo_flow.h>

namespace sgf::flow {
namespace {

using Eigen::Vector2f, Eigen::Vector3d;
using internal::PatchTemplate, internal::PatchTracker, internal::PatchWarp, internal::Pyramid;

void CheckRig(const StereoRig& rig, const FlowOptions& options) {
  constexpr int kLeastSide = 8;  // px, of the coarsest level
  for (const Camera& camera : {rig.left, rig.right}) {
    camera.Check();
    if (std::min(camera.width, camera.height) >> (options.levels - 1) < kLeastSide)
      throw Error("flow.levels", fmt::format("{} levels are too many for images of {}x{} px",
                                             options.levels, camera.width, camera.height));
  }
  if (!(rig.T_left_right.p.norm() > 0) || !rig.T_left_right.p.allFinite())
    throw Error("rig", "the cameras have to be at two places");
}

void RequireImage(const cv::Mat& image, const Camera& camera, const char* name) {
  if (image.type() != CV_8UC1)
    throw Error(name, fmt::format("is of OpenCV's type {}; 8-bit grey is needed", image.type()));
  if (image.cols != camera.width || image.rows != camera.height)
    throw Error(name, fmt::format("has {}x{} px, its camera {}x{}", image.cols, image.rows,
                                  camera.width, camera.height));
}

/// Whether two pixels can show one point: their rays meet, before the cameras.
class EpipolarCheck {
 public:
  EpipolarCheck(const StereoRig& rig, double most)
      : rig_(rig), baseline_(rig.T_left_right.p.normalized()), most_(most) {}

  bool operator()(const Vector2f& left, const Vector2f& right) const {
    const auto left_ray = rig_.left.TryUnproject(left.cast<double>());
    const auto right_ray = rig_.right.TryUnproject(right.cast<double>());
    if (!left_ray || !right_ray) return false;
    const Vector3d l = left_ray->normalized();
    const Vector3d r = rig_.T_left_right.R * right_ray->normalized();
    // The nearer a point, the more the right ray leans back against the baseline.
    return std::abs(baseline_.cross(l).dot(r)) <= most_ && (l - r).dot(baseline_) >= -most_;
  }

 private:
  StereoRig rig_;
  Vector3d baseline_;
  double most_;
};

/// Where a rotation of the camera takes the surroundings of a pixel; not found where it is out of
/// the camera's view.
bool Rotate(const Camera& camera, const Eigen::Quaterniond& R_cur_last, const Vector2f& pixel,
            PatchWarp& warp) {
  std::array<Eigen::Vector2d, 2> moved;
  for (int k = 0; k < 2; ++k) {
    const auto ray = camera.TryUnproject(pixel.cast<double>() + Eigen::Vector2d(k, 0));
    if (!ray) return false;
    const Vector3d rotated = R_cur_last * *ray;
    if (!(rotated.z() > 0)) return false;
    moved[size_t(k)] = camera.Project(rotated);
  }
  const Eigen::Vector2d along = moved[1] - moved[0];
  warp.centre = moved[0].cast<float>();
  warp.angle = static_cast<float>(std::atan2(along.y(), along.x()));
  return true;
}

struct Track {
  std::int64_t id = 0;
  Vector2f left = Vector2f::Zero();
  std::optional<Vector2f> right = std::nullopt;
  std::optional<Vector2f> disparity = std::nullopt;  ///< right - left when it was last known, px
  std::unique_ptr<PatchTemplate> patch = nullptr;    ///< of the left image
  bool found = true;
};

}  // namespace

void CheckOptions(const FlowOptions& o) {
  if (!internal::CanTrack(o.residual))
    throw Error("flow.residual", fmt::format("patches cannot be followed by '{}'", o.residual));
  RequireRange("flow.levels", o.levels, 1, 12);
  RequireRange("flow.stereo_levels", o.stereo_levels, 1, o.levels);
  RequireRange("flow.max_iterations", o.max_iterations, 1, 1000);
  RequireRange("flow.tolerance_px", o.tolerance_px, 0, 1);
  RequireRange("flow.cell_px", o.cell_px, 8, 1e6);
  RequireRange("flow.border_px", o.border_px, 0, 1e6);
  RequireRange("flow.least_fast_threshold", o.least_fast_threshold, 1, 255);
  RequireRange("flow.fast_threshold", o.fast_threshold, o.least_fast_threshold, 255);
  RequireRange("flow.max_backward_px", o.max_backward_px, 0, 1e6);
  RequireRange("flow.max_disparity_px", o.max_disparity_px, 0, 1e6);
  RequireRange("flow.max_epipolar_error", o.max_epipolar_error, 0, 2);
  metrics::CheckOptions(o.image.epsilon);
  ResolveThreads(o.threads);
}

class StereoFlow::Impl {
 public:
  Impl(const StereoRig& rig, const FlowOptions& options)
      : rig_(rig),
        options_(options),
        tracker_(internal::MakePatchTracker({.residual = options.residual,
                                             .pattern = options.pattern,
                                             .levels = options.levels,
                                             .max_iterations = options.max_iterations,
                                             .tolerance_px = options.tolerance_px,
                                             .image = options.image})),
        on_epipolar_line_(rig, options.max_epipolar_error) {}

  FlowFrame Process(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right,
                    const std::optional<Eigen::Quaterniond>& R_cur_last,
                    const ExpectedPixels& expected) {
    CheckInput(time_ns, left, right);
    Stopwatch whole, watch;
    FlowFrame frame;
    frame.time_ns = time_ns;
    MakePyramids(left, right);
    frame.times.pyramid_s = watch.Lap();
    TrackAll(R_cur_last, expected, frame);
    frame.times.tracking_s = watch.Lap();
    Detect(left, frame);
    frame.times.detection_s = watch.Lap();
    MatchAll(!right.empty());
    frame.times.stereo_s = watch.Lap();
    Report(frame);
    std::swap(last_left_, left_);
    last_time_ns_ = time_ns;
    frame.times.total_s = whole.Lap();
    return frame;
  }

 private:
  void CheckInput(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right) const {
    RequireImage(left, rig_.left, "left image");
    if (!right.empty()) RequireImage(right, rig_.right, "right image");
    if (last_time_ns_ && time_ns <= *last_time_ns_)
      throw Error("time_ns", fmt::format("{} does not come after {}", time_ns, *last_time_ns_));
  }

  void MakePyramids(const cv::Mat& left, const cv::Mat& right) {
    ParallelFor(right.empty() ? 1 : 2, options_.threads, [&](int camera) {
      tracker_->MakePyramid(camera == 0 ? left : right, camera == 0 ? left_ : right_);
    });
  }

  void TrackAll(const std::optional<Eigen::Quaterniond>& R_cur_last, const ExpectedPixels& expected,
                FlowFrame& frame) {
    ParallelForBatches(int(tracks_.size()), options_.threads, [&](int k) {
      Track& track = tracks_[size_t(k)];
      const auto place = expected.find(track.id);
      track.found = (place != expected.end() && TrackFrom(R_cur_last, place->second, track)) ||
                    TrackFrom(R_cur_last, std::nullopt, track);
    });
    frame.lost = int(std::erase_if(tracks_, [](const Track& track) { return !track.found; }));
    frame.tracked = int(tracks_.size());
  }

  /// @param place where the track is expected, if not where the rotation takes it.
  bool TrackFrom(const std::optional<Eigen::Quaterniond>& R_cur_last,
                 const std::optional<Eigen::Vector2d>& place, Track& track) const {
    PatchWarp warp;
    warp.centre = track.left;
    if (R_cur_last && !Rotate(rig_.left, *R_cur_last, track.left, warp)) return false;
    if (place) warp.centre = place->cast<float>();
    const PatchWarp guess = warp;
    if (!tracker_->Track(*track.patch, left_, options_.levels, warp)) return false;
    auto there = tracker_->NewTemplate();  // the old one is needed for another try
    if (!ComesBack(track.left, last_left_, left_, options_.levels, guess, warp.centre, *there))
      return false;
    track.left = warp.centre;
    track.patch = std::move(there);
    return true;
  }

  /// Whether the patch that another image shows is found in the first image where it came from.
  /// @param guess where the way there began; the way back begins as far off, so that it proves
  ///   something.
  /// @param[out] there the patch of the other image, at `to`.
  bool ComesBack(const Vector2f& from, const Pyramid& image, const Pyramid& other, int levels,
                 const PatchWarp& guess, const Vector2f& to, PatchTemplate& there) const {
    PatchWarp back;
    back.centre = to - (guess.centre - from);
    back.angle = -guess.angle;
    return tracker_->MakeTemplate(other, to, levels, there) &&
           tracker_->Track(there, image, levels, back) &&
           (back.centre - from).norm() <= options_.max_backward_px;
  }

  cv::Rect Cell(int column, int row) const {
    const int size = options_.cell_px, border = options_.border_px;
    const cv::Rect inside(border, border, rig_.left.width - 2 * border,
                          rig_.left.height - 2 * border);
    return cv::Rect(border + column * size, border + row * size, size, size) & inside;
  }

  /// Cells of the grid without a track.
  std::vector<cv::Rect> EmptyCells() const {
    const int size = options_.cell_px, border = options_.border_px;
    const int columns = std::max(0, (rig_.left.width - 2 * border + size - 1) / size);
    const int rows = std::max(0, (rig_.left.height - 2 * border + size - 1) / size);
    std::vector<char> taken(size_t(columns) * size_t(rows));
    for (const Track& track : tracks_) {
      const int column = int(std::floor((track.left.x() - float(border)) / float(size)));
      const int row = int(std::floor((track.left.y() - float(border)) / float(size)));
      if (column >= 0 && column < columns && row >= 0 && row < rows)
        taken[size_t(row * columns + column)] = 1;
    }
    std::vector<cv::Rect> cells;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column)
        if (!taken[size_t(row * columns + column)]) cells.push_back(Cell(column, row));
    return cells;
  }

  void Detect(const cv::Mat1b& left, FlowFrame& frame) {
    const std::vector<cv::Rect> cells = EmptyCells();
    std::vector<Track> found(cells.size());
    ParallelForBatches(int(cells.size()), options_.threads, [&](int k) {
      Track& track = found[size_t(k)];
      const auto corner = internal::StrongestCorner(
          left, cells[size_t(k)], {options_.fast_threshold, options_.least_fast_threshold});
      track.found = corner.has_value();
      if (!corner) return;
      track.left = *corner;
      track.patch = tracker_->NewTemplate();
      track.found = tracker_->MakeTemplate(left_, track.left, options_.levels, *track.patch);
    });
    for (Track& track : found) {
      if (!track.found) continue;
      track.id = next_id_++;
      tracks_.push_back(std::move(track));
      ++frame.detected;
    }
  }

  void MatchAll(bool has_right) {
    ParallelForBatches(int(tracks_.size()), options_.threads, [&](int k) {
      Track& track = tracks_[size_t(k)];
      track.right.reset();
      if (has_right) Match(track);
    });
  }

  void Match(Track& track) const {
    if (track.disparity) track.right = MatchFrom(track, *track.disparity, options_.stereo_levels);
    if (!track.right) track.right = Search(track);
    track.disparity.reset();
    if (track.right) track.disparity = *track.right - track.left;
  }

  /// Looks along the epipolar line, from infinity on, in steps that are a pixel at the coarsest
  /// level, and goes on from the place that fits best.
  std::optional<Vector2f> Search(const Track& track) const {
    std::vector<Vector2f> places;
    const auto ray = rig_.left.TryUnproject(track.left.cast<double>());
    if (!ray) return std::nullopt;
    const SE3 T_right_left = rig_.T_left_right.Inverse();
    const double step_px = 1 << (options_.levels - 1);
    const double step = step_px / (rig_.right.fx * rig_.T_left_right.p.norm());  // 1/m
    for (int k = 0; k * step_px <= options_.max_disparity_px; ++k) {
      const Vector3d point = T_right_left.R * *ray + k * step * T_right_left.p;
      if (point.z() > 0) places.push_back(rig_.right.Project(point).cast<float>());
    }
    if (places.empty()) return std::nullopt;
    const Vector2f place = tracker_->Likeliest(*track.patch, right_, places);
    return MatchFrom(track, place - track.left, options_.levels);
  }

  std::optional<Vector2f> MatchFrom(const Track& track, const Vector2f& disparity,
                                    int levels) const {
    PatchWarp guess;
    guess.centre = track.left + disparity;
    PatchWarp warp = guess;
    if (!tracker_->Track(*track.patch, right_, levels, warp) ||
        !on_epipolar_line_(track.left, warp.centre))
      return std::nullopt;
    const auto there = tracker_->NewTemplate();
    if (!ComesBack(track.left, left_, right_, levels, guess, warp.centre, *there))
      return std::nullopt;
    return warp.centre;
  }

  void Report(FlowFrame& frame) const {
    for (const Track& track : tracks_) {
      FlowObservation& seen =
          frame.observations.emplace_back(FlowObservation{track.id, track.left.cast<double>()});
      if (!track.right) continue;
      seen.right_px = track.right->cast<double>();
      ++frame.stereo;
    }
  }

  StereoRig rig_;
  FlowOptions options_;
  std::unique_ptr<const PatchTracker> tracker_;
  EpipolarCheck on_epipolar_line_;
  Pyramid last_left_, left_, right_;
  std::vector<Track> tracks_;  ///< sorted by id
  std::int64_t next_id_ = 0;
  std::optional<std::int64_t> last_time_ns_;
};

StereoFlow::StereoFlow(const StereoRig& rig, const FlowOptions& options) {
  CheckOptions(options);
  CheckRig(rig, options);
  impl_ = std::make_unique<Impl>(rig, options);
}
StereoFlow::~StereoFlow() = default;
StereoFlow::StereoFlow(StereoFlow&&) noexcept = default;
StereoFlow& StereoFlow::operator=(StereoFlow&&) noexcept = default;

FlowFrame StereoFlow::Process(std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right,
                              const std::optional<Eigen::Quaterniond>& R_cur_last,
                              const ExpectedPixels& expected) {
  return impl_->Process(time_ns, left, right, R_cur_last, expected);
}

}  // namespace sgf::flow
