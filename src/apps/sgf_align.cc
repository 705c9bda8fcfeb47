// Visual odometry by direct image alignment on a sequence of stereo pairs or of images with depth.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <sgf/alignment/residual_table.h>
#include <sgf/apps/cli.h>
#include <sgf/apps/sequence_change.h>
#include <sgf/core/provenance.h>
#include <sgf/eval/statistics.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>
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

struct Arguments {
  std::string sequence;
  std::string output;
  std::string layout;
  int first = 0;
  std::optional<int> frames;
  bool list_residuals = false;
};

// A sequence whose frames come as the odometry takes them.
class FrameSource {
 public:
  FrameSource(OdometrySequence sequence, const SequenceChange& change)
      : sequence_(std::move(sequence)), change_(change) {
    CheckChange(change);
    if (!sequence_.stereo()) return;
    const auto& [left, right] = std::tie(sequence_.cameras[0], sequence_.cameras[1]);
    rectifier_.emplace(left.camera, right.camera, left.T_body_cam.Inverse() * right.T_body_cam);
  }

  const OdometrySequence& sequence() const { return sequence_; }
  double clipped_share() const { return images_ ? clipped_ / images_ : 0; }

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
    const cv::Mat1b left = Load(frame.left, frame.time_ns, sequence_.cameras[0].camera);
    if (!rectifier_)
      return odometry.ProcessDepth(frame.time_ns, left,
                                   ReadDepth(frame.depth, sequence_.depth_levels_per_m));
    const auto [rect_left, rect_right] =
        rectifier_->Rectify(left, Load(frame.right, frame.time_ns, sequence_.cameras[1].camera));
    return odometry.ProcessStereo(frame.time_ns, rect_left, rect_right);
  }

 private:
  cv::Mat1b Load(const fs::path& path, std::int64_t time_ns, const Camera& camera) {
    cv::Mat1b image = ReadGrey(path);
    if (image.size() != cv::Size(camera.width, camera.height))
      throw Error(path.string(), fmt::format("has {}x{} px, the camera {}x{}", image.cols,
                                             image.rows, camera.width, camera.height));
    if (!ChangesNothing(change_))
      image = ApplyChange(image, ChangeAt(change_, time_ns - sequence_.frames[0].time_ns), 0);
    clipped_ += ClippedShare(image);
    ++images_;
    return image;
  }

  OdometrySequence sequence_;
  SequenceChange change_;
  std::optional<odometry::StereoRectifier> rectifier_;
  double clipped_ = 0;
  int images_ = 0;
};

// What a run has found.
struct Run {
  std::vector<odometry::FrameResult> frames;
  std::vector<TimedPose> trajectory;  // T_world_body of believed poses; world: the first body
};

std::string_view Name(odometry::TrackingState state) {
  for (const auto& [name, value] : EnumNames(state))
    if (value == state) return name;
  return "";
}

class Progress {
 public:
  void operator()(size_t done, size_t total, const odometry::FrameResult& result) {
    if (result.state == odometry::TrackingState::kLost) spdlog::warn("frame {} is lost", done - 1);
    const auto now = std::chrono::steady_clock::now();
    if (done < total && now - last_ < std::chrono::seconds(2)) return;
    last_ = now;
    spdlog::info("{}/{} frames, key-frame {}, inliers {:.0f} %, {:.1f} ms", done, total,
                 result.keyframe, 100 * result.inlier_share, 1e3 * result.times.total_s);
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

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
  Progress progress;
  Run run;
  for (const OdometryFrame& frame : frames) {
    if (options.use_gyro) gyro.Until(frame.time_ns, odometry);
    const odometry::FrameResult result = source.Track(frame, odometry);
    run.frames.push_back(result);
    if (result.state != odometry::TrackingState::kLost)
      run.trajectory.push_back(
          {frame.time_ns, T_body_cam * result.T_world_cam * T_body_cam.Inverse()});
    progress(run.frames.size(), frames.size(), result);
  }
  return run;
}

void WriteFrames(const fs::path& file, const Run& run) {
  std::string text =
      "time_ns,state,keyframe,new_keyframe,overlap,inlier_share,condition,iterations,"
      "sigma_position_m,sigma_rotation_deg\n";
  for (const odometry::FrameResult& f : run.frames)
    text += fmt::format("{},{},{},{:d},{:.4f},{:.4f},{:.4g},{},{:.6g},{:.6g}\n", f.time_ns,
                        Name(f.state), f.keyframe, f.new_keyframe, f.overlap, f.inlier_share,
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

void WriteRunOptions(const fs::path& file, const AlignOptions& options) {
  YAML::Node node;
  node["options"] = WriteOptions(options);
  node["build"]["version"] = BuildProvenance().version;
  node["build"]["revision"] = BuildProvenance().git_revision;
  WriteTextFile(file, YAML::Dump(node) + "\n");
}

void ListResiduals() {
  for (const alignment::ResidualInfo& residual : alignment::AllResiduals())
    fmt::print("{:14} {}{}\n", residual.name, residual.formula,
               residual.inverse_compositional ? "  [forward, inverse]" : "  [forward]");
}

std::span<const OdometryFrame> Chosen(const OdometrySequence& sequence,
                                      const Arguments& arguments) {
  const int count = static_cast<int>(sequence.frames.size());
  if (arguments.first < 0 || arguments.first >= count)
    throw Error("--from", fmt::format("is {}; the sequence has {} frames", arguments.first, count));
  const int wanted = arguments.frames.value_or(count);
  if (wanted < 1) throw Error("--frames", fmt::format("is {}; it has to be positive", wanted));
  return std::span(sequence.frames)
      .subspan(arguments.first, std::min(wanted, count - arguments.first));
}

void RunAlign(const Arguments& arguments, const OptionFlags& flags) {
  if (arguments.list_residuals) return ListResiduals();
  if (arguments.sequence.empty()) throw Error("", "expected a sequence's folder; see --help");
  if (arguments.output.empty())
    throw Error("--output", "is missing: name a folder for the results");
  AlignOptions options;
  flags.Apply(options);
  std::optional<OdometryLayout> layout;
  if (!arguments.layout.empty())
    options_internal::ParseValue(YAML::Node(arguments.layout), "layout", "command line",
                                 layout.emplace());
  FrameSource source(OpenOdometrySequence(arguments.sequence, layout, options.rgbd),
                     options.change);
  const auto frames = Chosen(source.sequence(), arguments);
  const fs::path folder = arguments.output;
  MakeFolder(folder);  // before the work, which would be lost
  if (const int skipped = source.sequence().skipped_frames)
    spdlog::warn("left out: {} x frame with a missing file", skipped);
  const Run run = TrackSequence(source, frames, options);
  WriteTrajectory(folder / "trajectory.txt", run.trajectory);
  WriteFrames(folder / "frames.csv", run);
  WriteTimings(folder / "timings.csv", run);
  WriteSummary(folder / "summary.json", source, run);
  WriteRunOptions(folder / "options.yaml", options);
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  apps::Arguments arguments;
  CLI::App app(
      "Tracks a camera through a sequence by direct image alignment: writes trajectory.txt (TUM "
      "format: the body's pose at each frame's time, in the frame of the first), frames.csv, "
      "timings.csv, summary.json and options.yaml.",
      "sgf_align");
  app.add_option("sequence", arguments.sequence, "FOLDER of the sequence");
  app.add_option("-o,--output", arguments.output, "folder for the results (made if missing)");
  app.add_option("--layout", arguments.layout,
                 "layout of the sequence: " + options_internal::KnownNames(OdometryLayout{}) +
                     " (default: what the folder looks like)");
  app.add_option("--from", arguments.first, "first frame, counted from 0")->capture_default_str();
  app.add_option("--frames", arguments.frames, "number of frames (default: all)");
  app.add_flag("--list-residuals", arguments.list_residuals, "print the table of residuals");
  const apps::OptionFlags flags(app, apps::AlignOptions{}, {});
  return apps::RunTool(app, argc, argv, [&] { apps::RunAlign(arguments, flags); });
}
