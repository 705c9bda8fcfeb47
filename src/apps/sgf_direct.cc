// Direct sparse odometry with one camera.

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/sequence_run.h>
#include <sgf/direct/direct_odometry.h>
#include <sgf/direct/photometric_correction.h>
#include <sgf/eval/statistics.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/dso_calibration.h>
#include <sgf/io/ply.h>
#include <sgf/io/trajectory.h>
#include <sgf/odometry/rectification.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

struct DirectAppOptions {
  direct::DirectOptions odometry;
  RgbdOptions rgbd;
  SequenceChange change;

  template <class V>
  void VisitFields(V&& visit) {
    odometry.VisitFields(visit);
    visit("rgbd", rgbd, "", "what an RGB-D sequence does not say");
    visit("change", change, "", "change of light put on the images");
  }
};

struct Arguments {
  SequenceArguments run;
  std::string photometric;
  std::string preset = "default";
};

/// Points against speed.
void ApplyPreset(const std::string& name, direct::DirectOptions& options) {
  const std::map<std::string, std::pair<int, int>> presets = {
      {"fast", {600, 5}}, {"default", {1000, 7}}, {"dense", {2000, 7}}};
  const auto preset = presets.find(name);
  if (preset == presets.end())
    throw Error("--preset", fmt::format("'{}' is unknown; known: default, dense, fast", name));
  options.active_points = options.selection.points = preset->second.first;
  options.keyframes = preset->second.second;
  options.min_keyframes = std::min(options.min_keyframes, options.keyframes);
}

/// What a folder says of a camera's photometry.
struct Photometry {
  direct::PhotometricCalibration calibration;
  std::map<std::int64_t, double> exposures_ms;  ///< by time; empty where not known
};

/// TUM's monocular sequences bring theirs with them.
Photometry ReadPhotometry(const Arguments& arguments, OdometryLayout layout) {
  const std::string& given = arguments.photometric;
  const bool own = given.empty() && layout == OdometryLayout::kTumMono;
  if (given == "none" || (given.empty() && !own)) return {};
  const fs::path folder = own ? arguments.run.sequence : given;
  Photometry photometry;
  bool any = false;
  const auto has = [&](const char* name) {
    const bool there = fs::exists(folder / name);
    any = any || there;
    return there;
  };
  if (has("pcalib.txt"))
    photometry.calibration.inverse_response = ReadPcalib(folder / "pcalib.txt");
  if (has("vignette.png")) photometry.calibration.vignette = ReadVignette(folder / "vignette.png");
  if (has("times.txt"))
    for (const FrameTime& frame : ReadFrameTimes(folder / "times.txt"))
      photometry.exposures_ms[frame.time_ns] = frame.exposure_ms;
  if (!any && !own)
    throw Error(folder.string(), "has none of pcalib.txt, vignette.png and times.txt");
  return photometry;
}

/// Images of one camera of a sequence, without distortion.
class FrameSource {
 public:
  FrameSource(OdometrySequence sequence, Photometry photometry, const SequenceChange& change)
      : sequence_(std::move(sequence)),
        exposures_ms_(std::move(photometry.exposures_ms)),
        load_(change, sequence_.frames[0].time_ns),
        undistorter_(sequence_.cameras[0].camera) {
    if (photometry.calibration.any())
      correct_.emplace(photometry.calibration, cv::Size(sequence_.cameras[0].camera.width,
                                                        sequence_.cameras[0].camera.height));
    for (const OdometryFrame& frame : sequence_.frames)
      if (!exposures_ms_.empty() && !exposures_ms_.contains(frame.time_ns))
        throw Error("times.txt",
                    fmt::format("has no exposure of the frame at {} ns", frame.time_ns));
  }

  const OdometrySequence& sequence() const { return sequence_; }
  const Camera& camera() const { return undistorter_.camera(); }
  double clipped_share() const { return load_.clipped_share(); }

  std::optional<double> ExposureMs(const OdometryFrame& frame) const {
    if (exposures_ms_.empty()) return std::nullopt;
    return exposures_ms_.at(frame.time_ns);
  }

  /// Corrected before it is undistorted: interpolation is of light.
  cv::Mat Load(const OdometryFrame& frame) {
    const cv::Mat1b raw = load_(frame.left, frame.time_ns, sequence_.cameras[0].camera);
    return undistorter_.Undistort(correct_ ? cv::Mat((*correct_)(raw)) : cv::Mat(raw));
  }

 private:
  OdometrySequence sequence_;
  std::map<std::int64_t, double> exposures_ms_;
  ImageLoader load_;
  std::optional<direct::PhotometricCorrection> correct_;
  odometry::Undistorter undistorter_;
};

/// What happens to the map.
class EventLog {
 public:
  explicit EventLog(const fs::path& file) : file_(file) {}

  void operator()(int frame, const direct::DirectFrameResult& result) {
    if (result.new_map) Write(frame, result, "map", {});
    if (result.new_keyframe)
      Write(frame, result, "keyframe",
            {{"active_points", result.active_points},
             {"observations", result.window.observations},
             {"outliers", result.window.outliers},
             {"iterations", result.window.iterations},
             {"scale", result.window.scale}});
    if (result.state == direct::DirectState::kLost && state_ == direct::DirectState::kTracked)
      Write(frame, result, "lost", {});
    if (result.state == direct::DirectState::kTracked && state_ == direct::DirectState::kLost)
      Write(frame, result, "found", {});
    if (result.segment > segment_) Write(frame, result, "restart", {});
    state_ = result.state;
    segment_ = result.segment;
  }

  /// @throws Error if any line could not be written.
  void Close() { file_.Close(); }

 private:
  void Write(int frame, const direct::DirectFrameResult& result, const char* event,
             const nlohmann::ordered_json& more) {
    nlohmann::ordered_json all = {{"segment", result.segment}};
    if (!more.is_null()) all.update(more);
    file_.Write(frame, result.time_ns, event, all);
  }

  EventFile file_;
  direct::DirectState state_ = direct::DirectState::kInitialising;
  int segment_ = 0;
};

/// Points of all maps, a file each, written as they come.
class PointFiles {
 public:
  explicit PointFiles(fs::path folder) : folder_(std::move(folder)) {}

  void Add(const std::vector<direct::MapPoint>& points) {
    for (const direct::MapPoint& point : points) Of(point.segment).Add(ToPly(point));
  }

  /// Ends the file of a map. @return the number of its points.
  std::int64_t Close(int segment, const fs::path& name) {
    PointsPlyWriter& writer = Of(segment);
    writer.Commit();
    fs::rename(Temporary(segment), folder_ / name);
    return writer.count();
  }

 private:
  fs::path Temporary(int segment) const {
    return folder_ / fmt::format("points_segment_{}.ply", segment);
  }

  PointsPlyWriter& Of(int segment) {
    return writers_
        .try_emplace(segment, Temporary(segment),
                     "x right, y down, z forward of the first key-frame, units of the map; "
                     "variance: of the inverse depth over its square")
        .first->second;
  }

  fs::path folder_;
  std::map<int, PointsPlyWriter> writers_;
};

void Report(ReportClock& clock, size_t done, size_t total,
            const direct::DirectFrameResult& result) {
  if (result.state == direct::DirectState::kLost) spdlog::warn("frame {} is lost", done - 1);
  if (clock.Due(done, total))
    spdlog::info("{}/{} frames, {}, map {}, {} points, inliers {:.0f} %, {:.1f} ms", done, total,
                 EnumName(result.state), result.segment, result.active_points,
                 100 * result.inlier_share, 1e3 * result.times.total_s);
}

/// What a run has found.
struct Run {
  std::vector<direct::DirectFrameResult> frames;
  std::vector<direct::DirectPose> online, final;
  Camera camera;  ///< as it was known in the end
};

Run TrackSequence(FrameSource& source, std::span<const OdometryFrame> frames,
                  direct::DirectOdometry odometry, EventLog& events, PointFiles& points) {
  Run run;
  ReportClock clock;
  for (const OdometryFrame& frame : frames) {
    const auto result =
        odometry.Process(frame.time_ns, source.Load(frame), source.ExposureMs(frame));
    run.frames.push_back(result);
    if (result.state == direct::DirectState::kTracked)
      run.online.push_back({frame.time_ns, result.segment, result.T_world_cam});
    points.Add(odometry.TakeFinishedPoints());
    events(static_cast<int>(run.frames.size()) - 1, result);
    Report(clock, run.frames.size(), frames.size(), result);
  }
  points.Add(odometry.ActivePoints());
  run.final = odometry.Trajectory();
  run.camera = odometry.camera();
  return run;
}

/// Numbers of the maps that have poses, that with most poses first.
std::vector<int> Segments(const std::vector<direct::DirectPose>& poses) {
  std::map<int, int> counts;
  for (const direct::DirectPose& pose : poses) ++counts[pose.segment];
  std::vector<int> segments;
  for (const auto& [segment, count] : counts) segments.push_back(segment);
  std::stable_sort(segments.begin(), segments.end(),
                   [&](int a, int b) { return counts[a] > counts[b]; });
  return segments;
}

std::vector<TimedPose> OfSegment(const std::vector<direct::DirectPose>& poses, int segment) {
  std::vector<TimedPose> result;
  for (const direct::DirectPose& pose : poses)
    if (pose.segment == segment) result.push_back({pose.time_ns, pose.T_world_cam});
  return result;
}

void WriteFrames(const fs::path& file, const std::vector<direct::DirectFrameResult>& frames) {
  std::string text =
      "time_ns,state,segment,new_keyframe,inlier_share,overlap,active_points,hypotheses,"
      "brightness_a,brightness_b\n";
  for (const auto& f : frames)
    text += fmt::format("{},{},{},{:d},{:.4f},{:.4f},{},{},{:.5f},{:.4f}\n", f.time_ns,
                        EnumName(f.state), f.segment, f.new_keyframe, f.inlier_share, f.overlap,
                        f.active_points, f.hypotheses, f.brightness.a, f.brightness.b);
  WriteTextFile(file, text);
}

void WriteTimings(const fs::path& file, const std::vector<direct::DirectFrameResult>& frames) {
  std::string text = "time_ns,image_ms,tracking_ms,tracing_ms,keyframe_ms,total_ms\n";
  for (const auto& f : frames)
    text += fmt::format("{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f}\n", f.time_ns, 1e3 * f.times.image_s,
                        1e3 * f.times.tracking_s, 1e3 * f.times.tracing_s, 1e3 * f.times.keyframe_s,
                        1e3 * f.times.total_s);
  WriteTextFile(file, text);
}

void WriteSummary(const fs::path& file, const FrameSource& source, const Run& run, int segment,
                  std::int64_t points) {
  const auto& frames = run.frames;
  const Camera& c = run.camera;
  const size_t posed = OfSegment(run.final, segment).size();
  int keyframes = 0;
  std::vector<double> total_ms;
  double sum_ms = 0;
  for (const direct::DirectFrameResult& f : frames) {
    keyframes += f.new_keyframe + f.new_map;  // a map begins with two
    total_ms.push_back(1e3 * f.times.total_s);
    sum_ms += total_ms.back();
  }
  const double mean_ms = sum_ms / static_cast<double>(frames.size());
  const double most_ms = *std::max_element(total_ms.begin(), total_ms.end());
  const nlohmann::ordered_json summary = {{"sequence", source.sequence().name},
                                          {"frames", frames.size()},
                                          {"posed", posed},
                                          {"segments", Segments(run.final).size()},
                                          {"segment", segment},
                                          {"keyframes", keyframes},
                                          {"points", points},
                                          {"intrinsics_px", {c.fx, c.fy, c.cx, c.cy}},
                                          {"clipped_share", source.clipped_share()},
                                          {"median_ms", Median(total_ms)},
                                          {"mean_ms", mean_ms},
                                          {"most_ms", most_ms}};
  WriteTextFile(file, summary.dump(2) + "\n");
  spdlog::info("{} of {} frames have a pose, {} key-frames, {} points, {:.2f} % of pixels clipped",
               posed, frames.size(), keyframes, points, 100 * source.clipped_share());
  spdlog::info("a frame took {:.1f} ms in the median, {:.1f} ms in the mean, {:.1f} ms at most",
               Median(total_ms), mean_ms, most_ms);
}

void RunDirect(const Arguments& arguments, const OptionFlags& flags) {
  DirectAppOptions options;
  ApplyPreset(arguments.preset, options.odometry);
  flags.Apply(options);
  OdometrySequence sequence = arguments.run.Open(options.rgbd);
  Photometry photometry = ReadPhotometry(arguments, sequence.layout);
  FrameSource source(std::move(sequence), std::move(photometry), options.change);
  const auto frames = arguments.run.Chosen(source.sequence());
  direct::DirectOdometry odometry(source.camera(), options.odometry);
  const fs::path folder = arguments.run.output;
  MakeFolder(folder);  // before the work, which would be lost
  if (const int skipped = source.sequence().skipped_frames)
    spdlog::warn("left out: {} x frame with a missing file", skipped);
  EventLog events(folder / "events.jsonl");
  PointFiles points(folder);
  const Run run = TrackSequence(source, frames, std::move(odometry), events, points);
  std::vector<int> segments = Segments(run.final);
  if (segments.empty()) segments = {0};
  std::map<int, std::int64_t> counts;
  for (const int segment : segments) {
    const std::string suffix = segment == segments[0] ? "" : fmt::format("_segment_{}", segment);
    WriteTrajectory(folder / fmt::format("trajectory{}.txt", suffix),
                    OfSegment(run.final, segment));
    WriteTrajectory(folder / fmt::format("trajectory_online{}.txt", suffix),
                    OfSegment(run.online, segment));
    counts[segment] = points.Close(segment, fmt::format("points{}.ply", suffix));
  }
  WriteFrames(folder / "frames.csv", run.frames);
  WriteTimings(folder / "timings.csv", run.frames);
  WriteRunOptions(folder / "options.yaml", WriteOptions(options));
  events.Close();
  WriteSummary(folder / "summary.json", source, run, segments[0], counts[segments[0]]);
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  apps::Arguments arguments;
  CLI::App app(
      "Direct sparse odometry with one camera: writes trajectory.txt (TUM format: the camera's "
      "pose at each frame's time, key-frames refined; of the map with most poses, those of others "
      "in "
      "trajectory_segment_N.txt), trajectory_online.txt (as known at frame time), points.ply, "
      "events.jsonl, frames.csv, timings.csv, summary.json and options.yaml.",
      "sgf_direct");
  arguments.run.AddTo(app);
  app.add_option(
      "--photometric", arguments.photometric,
      "folder with pcalib.txt, vignette.png and times.txt, as far as there are any; none "
      "for none (default: the sequence's own in TUM's monocular layout, else none)");
  app.add_option("--preset", arguments.preset, "fast, default or dense: points against speed")
      ->capture_default_str();
  const apps::DirectAppOptions defaults;
  const apps::OptionFlags flags(app, defaults, {});
  return apps::RunTool(app, argc, argv, [&] { apps::RunDirect(arguments, flags); });
}
