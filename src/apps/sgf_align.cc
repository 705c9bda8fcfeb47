// Visual odometry by direct image alignment on a sequence of stereo pairs or of images with depth.

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <sgf/alignment/residual_table.h>
#include <sgf/apps/cli.h>
#include <sgf/apps/sequence_run.h>
#include <sgf/eval/statistics.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/trajectory.h>
#include <sgf/odometry/odometry.h>
#include <sgf/odometry/rectification.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

struct AlignOptions {
  odometry::OdometryOptions odometry;
  RgbdOptions rgbd;
  SequenceChange change;
  bool use_gyro = false;

  template <class V>
  void VisitFields(V&& visit) {
    odometry.VisitFields(visit);
    visit("rgbd", rgbd, "", "what an RGB-D sequence does not say");
    visit("change", change, "", "change of light put on the images");
    visit("use_gyro", use_gyro, "", "predict rotations from the inertial sensor");
  }
};

// A sequence whose frames come as the odometry takes them.
class FrameSource {
 public:
  FrameSource(OdometrySequence sequence, const SequenceChange& change)
      : sequence_(std::move(sequence)), load_(change, sequence_.frames[0].time_ns) {
    if (!sequence_.stereo()) {
      if (sequence_.has_depth()) return;
      throw Error(sequence_.name, "has one camera and no depth; sgf_direct tracks such");
    }
    const auto& [left, right] = std::tie(sequence_.cameras[0], sequence_.cameras[1]);
    rectifier_.emplace(left.camera, right.camera, left.T_body_cam.Inverse() * right.T_body_cam);
  }

  const OdometrySequence& sequence() const { return sequence_; }
  double clipped_share() const { return load_.clipped_share(); }

  odometry::Rig Rig() const {
    if (rectifier_) return {rectifier_->camera(), rectifier_->baseline_m()};
    return {sequence_.cameras[0].camera, 0};
  }

  // Pose of the camera that is tracked on the body.
  SE3 T_body_cam() const {
    const SE3& T_body_left = sequence_.cameras[0].T_body_cam;
    if (!rectifier_) return T_body_left;
    return T_body_left * SE3{Eigen::Quaterniond(rectifier_->R_left_rect()), {0, 0, 0}};
  }

  odometry::FrameResult Track(const OdometryFrame& frame, odometry::Odometry& odometry) {
    const cv::Mat1b left = load_(frame.left, frame.time_ns, sequence_.cameras[0].camera);
    if (!rectifier_)
      return odometry.ProcessDepth(frame.time_ns, left,
                                   ReadDepth(frame.depth, sequence_.depth_levels_per_m));
    const auto [rect_left, rect_right] =
        rectifier_->Rectify(left, load_(frame.right, frame.time_ns, sequence_.cameras[1].camera));
    return odometry.ProcessStereo(frame.time_ns, rect_left, rect_right);
  }

 private:
  OdometrySequence sequence_;
  ImageLoader load_;
  std::optional<odometry::StereoRectifier> rectifier_;
};

// What a run has found.
struct Run {
  std::vector<odometry::FrameResult> frames;
  std::vector<TimedPose> trajectory;  // T_world_body of believed poses; world: the first body
};

void Report(ReportClock& clock, size_t done, size_t total, const odometry::FrameResult& result) {
  if (result.state == odometry::TrackingState::kLost) spdlog::warn("frame {} is lost", done - 1);
  if (clock.Due(done, total))
    spdlog::info("{}/{} frames, key-frame {}, inliers {:.0f} %, {:.1f} ms", done, total,
                 result.keyframe, 100 * result.inlier_share, 1e3 * result.times.total_s);
}

// Rates up to a time, in camera coordinates.
class GyroFeed {
 public:
  GyroFeed(const std::vector<ImuSample>& samples, const SE3& T_body_cam)
      : samples_(samples), R_cam_body_(T_body_cam.R.conjugate()) {}

  void Until(std::int64_t time_ns, odometry::Odometry& odometry) {
    for (; next_ < samples_.size() && samples_[next_].time_ns <= time_ns; ++next_)
      odometry.ProcessGyro(samples_[next_].time_ns, R_cam_body_ * samples_[next_].gyro);
  }

 private:
  const std::vector<ImuSample>& samples_;
  Eigen::Quaterniond R_cam_body_;
  size_t next_ = 0;
};

Run TrackSequence(FrameSource& source, std::span<const OdometryFrame> frames,
                  const AlignOptions& options) {
  odometry::Odometry odometry(source.Rig(), options.odometry);
  const SE3 T_body_cam = source.T_body_cam();
  GyroFeed gyro(source.sequence().imu, T_body_cam);
  ReportClock clock;
  Run run;
  for (const OdometryFrame& frame : frames) {
    if (options.use_gyro) gyro.Until(frame.time_ns, odometry);
    const odometry::FrameResult result = source.Track(frame, odometry);
    run.frames.push_back(result);
    if (result.state != odometry::TrackingState::kLost)
      run.trajectory.push_back(
          {frame.time_ns, T_body_cam * result.T_world_cam * T_body_cam.Inverse()});
    Report(clock, run.frames.size(), frames.size(), result);
  }
  return run;
}

void WriteFrames(const fs::path& file, const Run& run) {
  std::string text =
      "time_ns,state,keyframe,new_keyframe,overlap,inlier_share,condition,iterations,"
      "sigma_position_m,sigma_rotation_deg\n";
  for (const odometry::FrameResult& f : run.frames)
    text += fmt::format("{},{},{},{:d},{:.4f},{:.4f},{:.4g},{},{:.6g},{:.6g}\n", f.time_ns,
                        EnumName(f.state), f.keyframe, f.new_keyframe, f.overlap, f.inlier_share,
                        f.condition, f.iterations,
                        std::sqrt(f.covariance.topLeftCorner<3, 3>().trace()),
                        std::sqrt(f.covariance.bottomRightCorner<3, 3>().trace()) * 180 / M_PI);
  WriteTextFile(file, text);
}

void WriteTimings(const fs::path& file, const Run& run) {
  std::string text = "time_ns,pyramid_ms,alignment_ms,depth_ms,selection_ms,total_ms\n";
  for (const odometry::FrameResult& f : run.frames)
    text += fmt::format("{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f}\n", f.time_ns,
                        1e3 * f.times.pyramid_s, 1e3 * f.times.alignment_s, 1e3 * f.times.depth_s,
                        1e3 * f.times.selection_s, 1e3 * f.times.total_s);
  WriteTextFile(file, text);
}

void WriteSummary(const fs::path& file, const FrameSource& source, const Run& run) {
  int keyframes = 0;
  std::vector<double> total_ms;
  for (const odometry::FrameResult& f : run.frames) {
    keyframes += f.new_keyframe;
    total_ms.push_back(1e3 * f.times.total_s);
  }
  const nlohmann::ordered_json summary = {{"sequence", source.sequence().name},
                                          {"frames", run.frames.size()},
                                          {"posed", run.trajectory.size()},
                                          {"skipped", source.sequence().skipped_frames},
                                          {"keyframes", keyframes},
                                          {"clipped_share", source.clipped_share()}};
  WriteTextFile(file, summary.dump(2) + "\n");
  spdlog::info("{} of {} frames have a pose, {} key-frames, {:.2f} % of pixels clipped",
               run.trajectory.size(), run.frames.size(), keyframes, 100 * source.clipped_share());
  spdlog::info("a frame took {:.1f} ms in the median, {:.1f} ms at the 99th percentile",
               Median(total_ms), Quantile(total_ms, 0.99));
}

void ListResiduals() {
  for (const alignment::ResidualInfo& residual : alignment::AllResiduals())
    fmt::print("{:14} {}{}\n", residual.name, residual.formula,
               residual.inverse_compositional ? "  [forward, inverse]" : "  [forward]");
}

void RunAlign(const SequenceArguments& arguments, const OptionFlags& flags) {
  AlignOptions options;
  flags.Apply(options);
  FrameSource source(arguments.Open(options.rgbd), options.change);
  const auto frames = arguments.Chosen(source.sequence());
  const fs::path folder = arguments.output;
  MakeFolder(folder);  // before the work, which would be lost
  if (const int skipped = source.sequence().skipped_frames)
    spdlog::warn("left out: {} x frame with a missing file", skipped);
  const Run run = TrackSequence(source, frames, options);
  WriteTrajectory(folder / "trajectory.txt", run.trajectory);
  WriteFrames(folder / "frames.csv", run);
  WriteTimings(folder / "timings.csv", run);
  WriteSummary(folder / "summary.json", source, run);
  WriteRunOptions(folder / "options.yaml", WriteOptions(options));
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  apps::SequenceArguments arguments;
  bool list_residuals = false;
  CLI::App app(
      "Tracks a camera through a sequence by direct image alignment: writes trajectory.txt (TUM "
      "format: the body's pose at each frame's time, in the frame of the first), frames.csv, "
      "timings.csv, summary.json and options.yaml.",
      "sgf_align");
  arguments.AddTo(app);
  app.add_flag("--list-residuals", list_residuals, "print the table of residuals");
  const apps::OptionFlags flags(app, apps::AlignOptions{}, {});
  return apps::RunTool(app, argc, argv, [&] {
    if (list_residuals) return apps::ListResiduals();
    apps::RunAlign(arguments, flags);
  });
}
