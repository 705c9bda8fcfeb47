// Stereo-inertial odometry.

#include <algorithm>
#include <cmath>
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
#include <sgf/eval/statistics.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/ply.h>
#include <sgf/io/trajectory.h>
#include <sgf/vio/stereo_inertial_odometry.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

struct VioAppOptions {
  vio::VioOptions odometry;
  SequenceChange change;

  template <class V>
  void VisitFields(V&& visit) {
    odometry.VisitFields(visit);
    visit("change", change, "", "change of light put on the images");
  }
};

struct Arguments {
  SequenceArguments run;
  bool real_time = false;
};

/// One of the cameras: tells once that it has shown too little for some frames.
class Eye {
 public:
  static constexpr int kPatience = 10;

  template <class Tell>
  void Look(bool sees, const Tell& tell) {
    blind_ = sees ? 0 : blind_ + 1;
    if (blind_ == kPatience) tell();
  }

 private:
  int blind_ = 0;
};

/// What happens to the state.
class EventLog {
 public:
  explicit EventLog(const fs::path& file) : file_(file) {}

  void operator()(int frame, const vio::VioFrameResult& result) {
    if (result.new_keyframe)
      Write(frame, result, "keyframe",
            {{"tracks", result.tracks}, {"landmarks", result.landmarks}});
    if (result.state != state_) Write(frame, result, EnumName(result.state), {});
    if (result.problem != problem_ && result.problem != vio::InitialisationProblem::kNone) {
      Write(frame, result, inertial_ ? "left_out" : "no_start",
            {{"problem", EnumName(result.problem)}});
      spdlog::warn("frame {}: the inertial sensor takes no part {}: {}", frame,
                   inertial_ ? "any more" : "yet", vio::Explain(result.problem));
    }
    const bool left_sees = result.tracks >= kLeastTracks;
    left_.Look(left_sees, [&] { Blind(frame, result, "left", "nothing to follow"); });
    right_.Look(!left_sees || result.stereo_tracks >= kLeastMatched * result.tracks, [&] {
      Blind(frame, result, "right", "next to nothing of what the left one does");
    });
    if (result.inertial != inertial_)
      Write(frame, result, result.inertial ? "inertial" : "visual", {});
    problem_ = result.problem;
    inertial_ = result.inertial;
    state_ = result.state;
  }

  void Dropped(int frame, std::int64_t time_ns) {
    file_.Write(frame, time_ns, "dropped", nlohmann::ordered_json::object());
  }

  /// @throws Error if any line could not be written.
  void Close() { file_.Close(); }

 private:
  void Write(int frame, const vio::VioFrameResult& result, const std::string& event,
             const nlohmann::ordered_json& more) {
    nlohmann::ordered_json all = {{"segment", result.segment}};
    if (!more.is_null()) all.update(more);
    file_.Write(frame, result.time_ns, event, all);
  }

  void Blind(int frame, const vio::VioFrameResult& result, const std::string& camera,
             const char* sees) {
    Write(frame, result, camera + "_blind", {});
    spdlog::warn("frame {}: for {} frames the {} camera has shown {}: covered, dark, out of step?",
                 frame, Eye::kPatience, camera, sees);
  }

  static constexpr int kLeastTracks = 10;
  static constexpr double kLeastMatched = 0.1;

  EventFile file_;
  Eye left_, right_;
  std::optional<vio::VioState> state_;
  vio::InitialisationProblem problem_ = vio::InitialisationProblem::kNone;
  bool inertial_ = false;
};

class PointFile {
 public:
  explicit PointFile(const fs::path& file)
      : writer_(
            file,
            "z up, world of trajectory.txt, m; variance: of the inverse depth over its square") {}

  void Add(const std::vector<vio::VioPoint>& points) {
    for (const vio::VioPoint& point : points) writer_.Add(ToPly(point));
  }

  /// @return the number of points.
  std::int64_t Close() {
    writer_.Commit();
    return writer_.count();
  }

 private:
  PointsPlyWriter writer_;
};

/// What a run has found.
struct Run {
  std::vector<vio::VioFrameResult> frames;
  int dropped = 0;
  double clipped_share = 0;
  vio::ImuHealth imu;
};

bool HasState(const vio::VioFrameResult& frame) {
  return frame.state == vio::VioState::kTracked || frame.state == vio::VioState::kPredicted;
}

void Report(ReportClock& clock, size_t done, size_t total, const vio::VioFrameResult& result) {
  if (result.state == vio::VioState::kLost) spdlog::warn("frame {} is lost", done - 1);
  if (clock.Due(done, total))
    spdlog::info("{}/{} frames, {}, {} tracks, {} landmarks, {:.1f} ms", done, total,
                 EnumName(result.state), result.tracks, result.landmarks,
                 1e3 * result.times.total_s);
}

/// Frames that come while another is worked on are dropped but for the last one, as on a robot.
class RealTime {
 public:
  explicit RealTime(bool on) : on_(on) {}

  bool Drops(std::span<const OdometryFrame> frames, size_t k) const {
    return on_ && k + 1 < frames.size() &&
           1e-9 * static_cast<double>(frames[k + 1].time_ns - frames[0].time_ns) <= busy_until_s_;
  }

  void Took(const OdometryFrame& first, const OdometryFrame& frame, double seconds) {
    const double came_s = 1e-9 * static_cast<double>(frame.time_ns - first.time_ns);
    busy_until_s_ = std::max(busy_until_s_, came_s) + seconds;
  }

 private:
  bool on_;
  double busy_until_s_ = 0;
};

Run TrackSequence(const OdometrySequence& sequence, std::span<const OdometryFrame> frames,
                  const Arguments& arguments, const VioAppOptions& options, EventLog& events,
                  PointFile& points) {
  const auto& cameras = sequence.cameras;
  const flow::StereoRig rig{cameras[0].camera, cameras[1].camera,
                            cameras[0].T_body_cam.Inverse() * cameras[1].T_body_cam};
  vio::StereoInertialOdometry odometry(rig, cameras[0].T_body_cam, sequence.imu_noise,
                                       options.odometry);
  ImageLoader load(options.change, sequence.frames[0].time_ns);
  Run run;
  ReportClock clock;
  RealTime real_time(arguments.real_time);
  size_t next_imu = 0;
  for (size_t k = 0; k < frames.size(); ++k) {
    const OdometryFrame& frame = frames[k];
    // One sample after the frame, to interpolate at its time.
    for (bool after = false; next_imu < sequence.imu.size() && !after; ++next_imu) {
      odometry.AddImu(sequence.imu[next_imu]);
      after = sequence.imu[next_imu].time_ns >= frame.time_ns;
    }
    if (real_time.Drops(frames, k)) {
      ++run.dropped;
      events.Dropped(static_cast<int>(k), frame.time_ns);
      continue;
    }
    const auto result =
        odometry.Process(frame.time_ns, load(frame.left, frame.time_ns, cameras[0].camera),
                         load(frame.right, frame.time_ns, cameras[1].camera));
    real_time.Took(frames[0], frame, result.times.total_s);
    run.frames.push_back(result);
    points.Add(odometry.TakeFinishedPoints());
    events(static_cast<int>(k), result);
    Report(clock, k + 1, frames.size(), result);
  }
  points.Add(odometry.ActivePoints());
  run.imu = odometry.imu_health();
  run.clipped_share = load.clipped_share();
  return run;
}

std::vector<TimedPose> Trajectory(const Run& run) {
  std::vector<TimedPose> poses;
  for (const vio::VioFrameResult& frame : run.frames)
    if (HasState(frame)) poses.push_back({frame.time_ns, frame.body.T_world_body});
  return poses;
}

void WriteStates(const fs::path& file, const Run& run) {
  std::string text =
      "time_ns,state,segment,vx_m_s,vy_m_s,vz_m_s,bgx_rad_s,bgy_rad_s,bgz_rad_s,bax_m_s2,bay_m_s2,"
      "baz_m_s2,sigma_rotation_rad,sigma_position_m,sigma_velocity_m_s,sigma_gyro_bias_rad_s,"
      "sigma_accel_bias_m_s2,keyframe,tracks,stereo_tracks,landmarks,outliers,iterations\n";
  for (const vio::VioFrameResult& f : run.frames) {
    text += fmt::format("{},{},{}", f.time_ns, EnumName(f.state), f.segment);
    for (const Eigen::Vector3d& v : {f.body.velocity, f.body.gyro_bias, f.body.accel_bias})
      text += fmt::format(",{:.9g},{:.9g},{:.9g}", v.x(), v.y(), v.z());
    for (int block = 0; block < vio::kStateSize; block += 3)
      text += fmt::format(",{:.6g}", std::sqrt(f.covariance.block<3, 3>(block, block).trace()));
    text += fmt::format(",{:d},{},{},{},{},{}\n", f.new_keyframe, f.tracks, f.stereo_tracks,
                        f.landmarks, f.window.outliers, f.window.iterations);
  }
  WriteTextFile(file, text);
}

void WriteCovariances(const fs::path& file, const Run& run) {
  std::string text =
      "# time_ns, then the lower triangle, row by row, of the covariance of: rotation (rad, on the "
      "right), position (m), velocity (m/s), bias of the gyroscope (rad/s), of the accelerometer "
      "(m/s^2)\n";
  for (const vio::VioFrameResult& f : run.frames) {
    if (!HasState(f)) continue;
    text += fmt::format("{}", f.time_ns);
    for (int row = 0; row < vio::kStateSize; ++row)
      for (int column = 0; column <= row; ++column)
        text += fmt::format(",{:.7g}", f.covariance(row, column));
    text += "\n";
  }
  WriteTextFile(file, text);
}

void WriteCalibration(const fs::path& file, const Run& run) {
  std::string text =
      "time_ns,time_offset_s,rx_rad,ry_rad,rz_rad,px_m,py_m,pz_m,sigma_time_offset_s,"
      "sigma_rotation_rad,sigma_position_m\n";
  for (const vio::VioFrameResult& f : run.frames) {
    if (!HasState(f)) continue;
    const auto& covariance = f.calibration_covariance;
    const Eigen::Vector3d r = LogSO3(f.calibration.T_body_rig.R), &p = f.calibration.T_body_rig.p;
    text += fmt::format(
        "{},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.7g},{:.4g},{:.4g},{:.4g}\n", f.time_ns,
        f.calibration.time_offset_s, r.x(), r.y(), r.z(), p.x(), p.y(), p.z(),
        std::sqrt(covariance(6, 6)), std::sqrt(covariance.topLeftCorner<3, 3>().trace()),
        std::sqrt(covariance.block<3, 3>(3, 3).trace()));
  }
  WriteTextFile(file, text);
}

void WriteTimings(const fs::path& file, const Run& run) {
  std::string text =
      "time_ns,pyramid_ms,tracking_ms,stereo_ms,detection_ms,flow_ms,refinement_ms,"
      "marginalization_ms,total_ms\n";
  for (const vio::VioFrameResult& f : run.frames)
    text += fmt::format("{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f}\n", f.time_ns,
                        1e3 * f.flow.pyramid_s, 1e3 * f.flow.tracking_s, 1e3 * f.flow.stereo_s,
                        1e3 * f.flow.detection_s, 1e3 * f.times.flow_s, 1e3 * f.times.refinement_s,
                        1e3 * f.times.marginalization_s, 1e3 * f.times.total_s);
  WriteTextFile(file, text);
}

void WriteSummary(const fs::path& file, const OdometrySequence& sequence, size_t frames,
                  const Run& run, std::int64_t points) {
  std::map<std::string, int> states;
  std::vector<double> total_ms;
  int keyframes = 0;
  for (const vio::VioFrameResult& f : run.frames) {
    ++states[EnumName(f.state)];
    keyframes += f.new_keyframe;
    total_ms.push_back(1e3 * f.times.total_s);
  }
  const size_t posed = Trajectory(run).size();
  const nlohmann::ordered_json summary = {
      {"sequence", sequence.name},
      {"frames", frames},
      {"posed", posed},
      {"states", states},
      {"segments", run.frames.empty() ? 0 : run.frames.back().segment + 1},
      {"dropped", run.dropped},
      {"skipped", sequence.skipped_frames},
      {"keyframes", keyframes},
      {"points", points},
      {"clipped_share", run.clipped_share},
      {"imu",
       {{"taken", run.imu.taken},
        {"duplicates", run.imu.duplicates},
        {"backwards", run.imu.backwards},
        {"not_finite", run.imu.not_finite},
        {"saturated", run.imu.saturated},
        {"gaps", run.imu.gaps},
        {"longest_gap_s", run.imu.longest_gap_s}}}};
  WriteTextFile(file, summary.dump(2) + "\n");
  spdlog::log(posed > 0 ? spdlog::level::info : spdlog::level::warn,
              "{} of {} frames have a pose, {} dropped, {} key-frames, {} points", posed, frames,
              run.dropped, keyframes, points);
  if (total_ms.empty()) return;
  spdlog::info("a frame took {:.1f} ms in the median, {:.1f} ms at the 99th percentile",
               Median(total_ms), Quantile(total_ms, 0.99));
}

void WarnOfImu(const vio::ImuHealth& imu) {
  const auto warn = [&](std::int64_t count, const std::string& what) {
    if (count > 0) spdlog::warn("inertial measurements: {} {}, {} taken", count, what, imu.taken);
  };
  warn(imu.duplicates + imu.backwards, "not after the one before");
  warn(imu.not_finite, "that are no numbers");
  warn(imu.saturated, "saturated");
  warn(imu.gaps, fmt::format("gaps of up to {:.3g} s", imu.longest_gap_s));
}

void RunVio(const Arguments& arguments, const OptionFlags& flags) {
  VioAppOptions options;
  flags.Apply(options);
  const OdometrySequence sequence = arguments.run.Open({});
  if (!sequence.stereo()) throw Error(sequence.name, "is no stereo sequence");
  if (sequence.imu.empty() && options.odometry.inertial) {
    spdlog::warn("no inertial measurements: images alone");
    options.odometry.inertial = false;
  }
  const auto frames = arguments.run.Chosen(sequence);
  const fs::path folder = arguments.run.output;
  MakeFolder(folder);  // before the work, which would be lost
  if (const int skipped = sequence.skipped_frames)
    spdlog::warn("left out: {} x frame without one of its images", skipped);
  EventLog events(folder / "events.jsonl");
  PointFile points(folder / "points.ply");
  const Run run = TrackSequence(sequence, frames, arguments, options, events, points);
  WriteTrajectory(folder / "trajectory.txt", Trajectory(run));
  WriteStates(folder / "states.csv", run);
  WriteCovariances(folder / "covariances.csv", run);
  if (!options.odometry.calibration.IsHeld()) WriteCalibration(folder / "calibration.csv", run);
  WriteTimings(folder / "timings.csv", run);
  WriteRunOptions(folder / "options.yaml", WriteOptions(options));
  events.Close();
  WarnOfImu(run.imu);
  WriteSummary(folder / "summary.json", sequence, frames.size(), run, points.Close());
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  apps::Arguments arguments;
  CLI::App app(
      "Stereo-inertial odometry: writes trajectory.txt (TUM format: the body's pose at each "
      "frame's "
      "time, as known then), states.csv (velocity, biases and deviations), "
      "covariances.csv, points.ply, "
      "events.jsonl, timings.csv, summary.json, options.yaml and, if it is estimated, "
      "calibration.csv (the cameras' clock and place against the inertial sensor).",
      "sgf_vio");
  arguments.run.AddTo(app);
  app.add_flag("--real-time", arguments.real_time,
               "drop frames that come while another is worked on, as a robot has to");
  const apps::VioAppOptions defaults;
  const apps::OptionFlags flags(app, defaults, {});
  return apps::RunTool(app, argc, argv, [&] { apps::RunVio(arguments, flags); });
}
