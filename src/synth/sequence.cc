#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <tuple>

#include <fmt/format.h>

#include <sgf/core/error.h>
#include <sgf/core/options.h>
#include <sgf/core/parallel.h>
#include <sgf/core/require.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/dso_calibration.h>
#include <sgf/io/hash.h>
#include <sgf/io/image.h>
#include <sgf/io/manifest.h>
#include <sgf/synth/frame_exr.h>
#include <sgf/synth/sequence.h>

namespace sgf::synth {

namespace {

constexpr double kFrameRate = 20;
constexpr int kDepthEvery = 10;
constexpr double kNearest_m = 0.1;
// Time stamp of sequence time 0: some date, so that stamps have as many digits as EuRoC's.
constexpr int64_t kStart_ns = 1'600'000'000'000'000'000;
// The first frame is this late, since its exposure begins before its time stamp.
constexpr double kLead_s = 0.05;
// Inertial data begin and end this much before and after the images.
constexpr double kImuMargin_s = 1.0;

int64_t Nanoseconds(double time_s) { return kStart_ns + std::llround(time_s * 1e9); }

/// First time and number of the stereo frames of a version.
struct FrameRange {
  double from_s;
  int count;
  double rate = kFrameRate;

  double Time(int frame) const { return from_s + frame / rate; }
};

FrameRange Frames(const SequenceRecipe& recipe, SequenceVersion version) {
  if (version == SequenceVersion::kShort)
    return {std::max(recipe.short_version.from_s, kLead_s), recipe.short_version.frames};
  const double rate = version == SequenceVersion::kPreview ? 1 : kFrameRate;
  return {kLead_s, static_cast<int>((recipe.duration_s - 2 * kLead_s) * rate) + 1, rate};
}

SE3 FromMatrix(const std::array<double, 12>& rows) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> T(rows.data());
  return {Eigen::Quaterniond(Eigen::Matrix3d(T.leftCols<3>())).normalized(), T.col(3)};
}

}  // namespace

void CheckRecipe(const SequenceRecipe& recipe) {
  const ShortOptions& part = recipe.short_version;
  Require(recipe.duration_s >= 1 && recipe.duration_s <= 3600, "duration_s", recipe.duration_s,
          "1 to 3600 s");
  Require(part.frames >= 1 && part.frames <= 200, "short.frames", part.frames, "1 to 200");
  Require(part.from_s >= 0, "short.from_s", part.from_s, "0 or more");
  Require(
      Frames(recipe, SequenceVersion::kShort).Time(part.frames - 1) <= recipe.duration_s - kLead_s,
      "short.frames", part.frames, "within duration_s");
  Require(recipe.exposure.max_ms <= 1000 / kFrameRate, "exposure.max_ms", recipe.exposure.max_ms,
          "at most the time between frames, 50 ms");
  Require(recipe.blur_samples >= 1 && recipe.blur_samples % 2 == 1, "blur_samples",
          recipe.blur_samples, "odd and positive");
  Check(recipe.photometry);  // these two before Estimate() reckons with them
  Check(recipe.imu);
}

std::span<const std::pair<const char*, RigModel>> EnumNames(RigModel) {
  static constexpr std::pair<const char*, RigModel> kNames[] = {{"euroc", RigModel::kEuroc},
                                                                {"pinhole", RigModel::kPinhole}};
  return kNames;
}

std::vector<EurocCamera> RigCameras(RigModel rig) {
  // sensor.yaml of cam0 and cam1 of EuRoC's MH_01_easy.
  const SE3 T_body_cam0 =
      FromMatrix({0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,
                  0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,
                  -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949});
  const SE3 T_body_cam1 =
      FromMatrix({0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556,
                  0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024,
                  -0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038});
  Camera cam0{752, 480, 458.654, 457.296, 367.215, 248.375};
  if (rig == RigModel::kPinhole)
    return {{cam0, T_body_cam0, kFrameRate},
            {cam0, T_body_cam0 * SE3{.p = {0.11, 0, 0}}, kFrameRate}};
  Camera cam1{752, 480, 457.587, 456.134, 379.999, 255.238};
  std::tie(cam0.k1, cam0.k2, cam0.p1, cam0.p2) =
      std::tuple(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05);
  std::tie(cam1.k1, cam1.k2, cam1.p1, cam1.p2) =
      std::tuple(-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05);
  return {{cam0, T_body_cam0, kFrameRate}, {cam1, T_body_cam1, kFrameRate}};
}

SequenceEstimate Estimate(const SequenceRecipe& recipe, SequenceVersion version, bool keep_exr) {
  SequenceEstimate estimate;
  estimate.frames = Frames(recipe, version).count;
  estimate.renderings = int64_t{2} * estimate.frames * recipe.blur_samples;
  const int64_t pixels = int64_t{752} * 480;
  // Noise does not compress, and PNG adds a little to it. Depth maps hold four bytes a pixel.
  const int64_t image = pixels * recipe.photometry.bits / 8 * 101 / 100;
  estimate.bytes = 2 * estimate.frames * image + 4 * pixels * (estimate.frames / kDepthEvery + 1);
  // Lists, calibration and inertial data: two lines of at most 400 bytes a sample.
  estimate.bytes +=
      4'000'000 + static_cast<int64_t>(800 * recipe.imu.rate_hz) * (estimate.frames + 60);
  // All layers: up to six lights of three halves, three layers of three, depth and id.
  if (keep_exr) estimate.bytes += pixels * 2 * estimate.frames * (2 * 3 * (6 + 3) + 4 + 4);
  return estimate;
}

std::string RecipeHash(const SequenceRecipe& recipe, SequenceVersion version, bool keep_exr,
                       const RenderOptions& options) {
  return Sha256(fmt::format("{}version {}\nexr {}\n{}\n", RenderingKey(options),
                            static_cast<int>(version), keep_exr, YAML::Dump(WriteOptions(recipe))));
}

namespace {

/// One rendering of a recipe. Frames have to be made in order, as auto-exposure looks at the last.
class SequenceWriter {
 public:
  SequenceWriter(const Renderer& renderer, const SequenceRequest& request,
                 const std::filesystem::path& folder)
      : renderer_(renderer),
        recipe_(request.recipe),
        request_(request),
        folder_(folder),
        range_(Frames(recipe_, request.version)),
        cameras_(RigCameras(recipe_.rig)),
        sensors_(MakeSensors()),
        trajectory_(MakeTrajectory(recipe_.trajectory, cameras_[0].T_body_cam)),
        lights_(recipe_.exposure.lights, renderer.scene().LightGroups()),
        exposure_(recipe_.exposure, sensors_[0].inverse_response()) {
    RequireLongEnough();
    for (const EurocCamera& camera : cameras_)
      rays_.emplace_back(camera.camera, renderer.options().samples_per_pixel);
  }

  void Write() {
    WriteEurocSensors(folder_, {cameras_, recipe_.imu.rate_hz, recipe_.imu.noise});
    MakeFolder(folder_ / "mav0/depth0/data");
    if (request_.keep_exr)
      for (int eye : {0, 1}) MakeFolder(ExrFolder(eye));
    // First what takes no time and may fail.
    WriteCalibration();
    WriteMotion();
    for (int frame = 0; frame < range_.count; ++frame) {
      WriteFrame(frame);
      if (request_.progress) request_.progress(frame + 1, range_.count);
    }
    WriteLists();
  }

 private:
  /// What one camera receives over an exposure, and the scene at its middle.
  struct View {
    cv::Mat1f luminance;
    Frame middle;
    SE3 T_world_cam;
  };

  std::vector<PhotometricCamera> MakeSensors() const {
    std::vector<PhotometricCamera> sensors;
    for (const EurocCamera& camera : cameras_)
      sensors.emplace_back(camera.camera, recipe_.photometry, 1);
    return sensors;
  }

  std::filesystem::path ExrFolder(int eye) const {
    return folder_ / fmt::format("mav0/exr{}/data", eye);
  }

  void RequireLongEnough() const {
    if (!trajectory_.periodic() && trajectory_.duration_s() < recipe_.duration_s)
      throw Error("duration_s", fmt::format("is {} s, but the trajectory ends after {} s",
                                            recipe_.duration_s, trajectory_.duration_s()));
  }

  View Look(int eye, double time_s, double exposure_s) const {
    View view;
    const int n = recipe_.blur_samples;
    for (int k = 0; k < n; ++k) {
      const double t = time_s + ((k + 0.5) / n - 0.5) * exposure_s;
      const SE3 T_world_cam = trajectory_.At(t).T_world_body * cameras_[eye].T_body_cam;
      Frame frame = renderer_.Render(rays_[eye], T_world_cam);
      const cv::Mat1f luminance = Luminance(frame.Radiance(lights_.Strengths(t)));
      view.luminance = k == 0 ? luminance : cv::Mat1f(view.luminance + luminance);
      if (k != n / 2) continue;
      view.middle = std::move(frame);
      view.T_world_cam = T_world_cam;
    }
    if (n > 1) view.luminance /= n;
    return view;
  }

  void WriteFrame(int frame) {
    const double time_s = range_.Time(frame);
    const double exposure_ms = exposure_.ExposureMs(time_s);
    const int64_t stamp = Nanoseconds(time_s);
    std::array<View, 2> views;
    for (int eye : {0, 1}) views[eye] = Look(eye, time_s, exposure_ms / 1000);
    for (const View& view : views) RequireClearance(view, time_s);
    std::array<cv::Mat, 2> images;
    ParallelFor(2, renderer_.options().threads, [&](int eye) {
      images[eye] = sensors_[eye].Expose(views[eye].luminance, exposure_ms,
                                         FrameSeed(recipe_.seed, eye, frame));
      WritePng(EurocImagePath(folder_, eye, stamp), images[eye]);
      if (request_.keep_exr) WriteLayers(views[eye], eye, stamp);
    });
    if (frame % kDepthEvery == 0) WriteDepth(views[0], stamp);
    exposure_.Observe(images[0]);
    times_ns_.push_back(stamp);
    exposures_.push_back({fmt::format("{}", stamp), stamp, exposure_ms});
  }

  void RequireClearance(const View& view, double time_s) const {
    double nearest = 0;
    cv::minMaxLoc(view.middle.depth, &nearest);
    if (nearest < kNearest_m)
      throw Error("trajectory",
                  fmt::format("at {:.2f} s the camera is {:.3f} m from a surface; the "
                              "least distance is {} m",
                              time_s, nearest, kNearest_m));
  }

  void WriteLayers(const View& view, int eye, int64_t stamp) const {
    WriteExr(ExrFolder(eye) / fmt::format("{}.exr", stamp),
             ToExr(view.middle, cameras_[eye].camera, view.T_world_cam));
  }

  void WriteDepth(const View& view, int64_t stamp) {
    ExrImage image{.size = view.middle.depth.size(),
                   .channels = {{"Z", {view.middle.depth, ExrStorage::kFloat}}},
                   .camera = cameras_[0].camera,
                   .T_world_cam = view.T_world_cam};
    WriteExr(folder_ / fmt::format("mav0/depth0/data/{}.exr", stamp), image);
    depth_times_ns_.push_back(stamp);
  }

  void WriteCalibration() const {
    for (int eye : {0, 1}) {
      const std::filesystem::path camera = folder_ / fmt::format("mav0/cam{}", eye);
      WritePcalib(camera / "pcalib.txt", sensors_[eye].response().InverseTable(kPcalibLevels));
      WriteVignette(camera / "vignette.png", sensors_[eye].vignette());
    }
  }

  void WriteLists() const {
    for (int eye : {0, 1}) {
      WriteEurocImageList(folder_, eye, times_ns_);
      WriteFrameTimes(folder_ / fmt::format("mav0/cam{}/times.txt", eye), exposures_);
    }
    std::string list = "#timestamp [ns],filename\n";
    for (int64_t stamp : depth_times_ns_) list += fmt::format("{0},{0}.exr\n", stamp);
    WriteTextFile(folder_ / "mav0/depth0/data.csv", list);
  }

  void WriteMotion() const {
    const double end_s = trajectory_.periodic() ? recipe_.duration_s : trajectory_.duration_s();
    std::vector<BodyState> truth;
    const std::vector<ImuSample> samples =
        SimulateImu(trajectory_, std::max(0.0, range_.from_s - kImuMargin_s),
                    std::min(end_s, range_.Time(range_.count - 1) + kImuMargin_s), recipe_.imu,
                    kStart_ns, &truth);
    WriteEurocImu(folder_, samples);
    WriteEurocTruth(folder_, truth);
  }

  const Renderer& renderer_;
  const SequenceRecipe& recipe_;
  const SequenceRequest& request_;
  std::filesystem::path folder_;
  FrameRange range_;
  std::vector<EurocCamera> cameras_;
  std::vector<PhotometricCamera> sensors_;
  Trajectory trajectory_;
  LightSchedule lights_;
  ExposureControl exposure_;
  std::vector<PixelRays> rays_;
  std::vector<int64_t> times_ns_, depth_times_ns_;
  std::vector<FrameTime> exposures_;
};

}  // namespace

void RenderSequence(const Renderer& renderer, const SequenceRequest& request) {
  CheckRecipe(request.recipe);
  StagedFolder staged(request.folder);
  SequenceWriter(renderer, request, staged.path()).Write();
  WriteTextFile(staged.path() / "recipe.yaml", YAML::Dump(WriteOptions(request.recipe)) + "\n");
  staged.Commit(RecipeHash(request.recipe, request.version, request.keep_exr, renderer.options()),
                {{"frames", Frames(request.recipe, request.version).count}});
}

}  // namespace sgf::synth
