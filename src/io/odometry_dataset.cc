#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <system_error>

#include <Eigen/LU>
#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include <sgf/core/error.h>
#include <sgf/io/absolute_path.h>
#include <sgf/io/dso_calibration.h>
#include <sgf/io/exr.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/io/rows.h>
#include <sgf/io/trajectory.h>

namespace sgf {
namespace {

namespace fs = std::filesystem;

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool IsFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

std::string SequenceName(const fs::path& folder) {
  const fs::path path = internal::AbsolutePath(folder);
  return (path.filename() == "mav0" ? path.parent_path() : path).filename().string();
}

// Appends a frame, or counts it as skipped when one of the files it names is missing.
void AppendFrame(OdometrySequence& sequence, OdometryFrame frame) {
  const auto there = [](const fs::path& path) { return path.empty() || IsFile(path); };
  if (IsFile(frame.left) && there(frame.right) && there(frame.depth))
    sequence.frames.push_back(std::move(frame));
  else
    ++sequence.skipped_frames;
}

// ---- EuRoC

// Frames that both cameras list, in one pass over the two lists.
void PairImages(const fs::path& folder, const std::vector<EurocImage>& left,
                const std::vector<EurocImage>& right, OdometrySequence& sequence) {
  size_t i = 0, j = 0, pairs = 0;
  while (i < left.size() || j < right.size()) {
    const bool has_left =
        i < left.size() && (j == right.size() || left[i].time_ns <= right[j].time_ns);
    const bool has_right =
        j < right.size() && (i == left.size() || right[j].time_ns <= left[i].time_ns);
    if (has_left && has_right)
      AppendFrame(sequence, {left[i].time_ns, left[i].file, right[j].file, {}});
    else
      ++sequence.skipped_frames;
    i += has_left;
    j += has_right;
    pairs += has_left && has_right;
  }
  if (pairs == 0)
    throw Error(folder.string(), "cam0 and cam1 have no time in common: are they synchronised?");
}

void OpenEuroc(const fs::path& folder, OdometrySequence& sequence) {
  EurocSequence euroc = ReadEuroc(folder, EurocFiles::kMayBeMissing);
  if (euroc.images.empty() || euroc.images.size() > 2)
    throw Error(folder.string(),
                fmt::format("has {} camera(s), expected one or two", euroc.images.size()));
  sequence.cameras = euroc.sensors.cameras;
  if (euroc.images.size() == 2)
    PairImages(folder, euroc.images[0], euroc.images[1], sequence);
  else
    for (const EurocImage& image : euroc.images[0])
      AppendFrame(sequence, {image.time_ns, image.file, {}, {}});
  sequence.imu = std::move(euroc.imu);
  sequence.imu_noise = euroc.sensors.imu_noise;
  for (const BodyState& state : euroc.truth)
    sequence.truth.push_back({state.time_ns, state.T_world_body});
}

// ---- KITTI odometry

using Matrix34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

// The row-major 3x4 matrix in the twelve fields from `first` on.
Matrix34 MatrixFields(const Fields& fields, size_t first, const std::string& where) {
  Matrix34 m;
  for (size_t i = 0; i < 12; ++i) m.data()[i] = NumberField<double>(fields[first + i], where);
  return m;
}

SE3 RigidMotion(const Matrix34& m, const std::string& where) {
  const Eigen::Matrix3d R = m.leftCols<3>();
  if (!(R.transpose() * R).isIdentity(1e-4) || R.determinant() < 0)
    throw Error(where, "is no rigid motion");
  return {Eigen::Quaterniond(R).normalized(), m.col(3)};
}

// A camera of a rectified pair; its position is relative to camera 0.
EurocCamera KittiCamera(const Matrix34& P, cv::Size size, const std::string& where) {
  const Eigen::Matrix3d K = P.leftCols<3>();
  Eigen::Matrix3d expected = Eigen::Matrix3d::Identity();
  expected(0, 0) = K(0, 0), expected(1, 1) = K(1, 1);
  expected(0, 2) = K(0, 2), expected(1, 2) = K(1, 2);
  if (K != expected || !(K(0, 0) > 0 && K(1, 1) > 0))
    throw Error(where, "is no projection of a rectified camera");
  EurocCamera sensor;
  sensor.camera = {size.width, size.height, K(0, 0), K(1, 1), K(0, 2), K(1, 2)};
  sensor.T_body_cam.p = -K.inverse() * P.col(3);
  sensor.rate_hz = 10;
  return sensor;
}

void ReadKittiCameras(const fs::path& path, cv::Size size, OdometrySequence& sequence) {
  std::map<std::string, std::pair<Matrix34, std::string>> projections;
  ForEachRow(path, ' ', 13, [&](const Fields& fields, const std::string& where) {
    projections[std::string(fields[0])] = {MatrixFields(fields, 1, where), where};
  });
  for (const char* key : {"P0:", "P1:"}) {
    const auto it = projections.find(key);
    if (it == projections.end()) throw Error(path.string(), fmt::format("has no line {}", key));
    sequence.cameras.push_back(KittiCamera(it->second.first, size, it->second.second));
  }
}

std::vector<std::int64_t> ReadKittiTimes(const fs::path& path) {
  struct Row {
    std::int64_t time_ns;
  };
  std::vector<Row> rows;
  ForEachRow(path, ' ', 1, [&](const Fields& fields, const std::string& where) {
    AppendLater(rows, {SecondsField(fields[0], where)}, where);
  });
  std::vector<std::int64_t> times;
  for (const Row& row : rows) times.push_back(row.time_ns);
  return times;
}

// Poses of the left camera, where the sequence has them.
void ReadKittiTruth(const fs::path& path, const std::vector<std::int64_t>& times,
                    OdometrySequence& sequence) {
  if (!IsFile(path)) return;
  ForEachRow(path, ' ', 12, [&](const Fields& fields, const std::string& where) {
    const size_t i = sequence.truth.size();
    if (i == times.size())
      throw Error(where, fmt::format("has more poses than the {} times", times.size()));
    sequence.truth.push_back({times[i], RigidMotion(MatrixFields(fields, 0, where), where)});
  });
  if (sequence.truth.size() != times.size())
    throw Error(path.string(),
                fmt::format("has {} poses for {} times", sequence.truth.size(), times.size()));
}

void OpenKitti(const fs::path& folder, OdometrySequence& sequence) {
  const std::vector<std::int64_t> times = ReadKittiTimes(folder / "times.txt");
  for (size_t i = 0; i < times.size(); ++i) {
    const std::string file = fmt::format("{:06}.png", i);
    AppendFrame(sequence, {times[i], folder / "image_0" / file, folder / "image_1" / file, {}});
  }
  const fs::path poses = internal::AbsolutePath(folder).parent_path().parent_path() / "poses";
  ReadKittiTruth(poses / (sequence.name + ".txt"), times, sequence);
  if (sequence.frames.empty()) return;
  const cv::Size size = ReadGrey(sequence.frames.front().left).size();
  ReadKittiCameras(folder / "calib.txt", size, sequence);
}

// ---- TUM RGB-D and ICL-NUIM

struct TimedFile {
  std::int64_t time_ns = 0;
  fs::path file;
};

std::vector<TimedFile> ReadFileList(const fs::path& path) {
  std::vector<TimedFile> files;
  ForEachRow(path, ' ', 2, [&](const Fields& fields, const std::string& where) {
    AppendLater(files, {SecondsField(fields[0], where), path.parent_path() / fields[1]}, where);
  });
  return files;
}

// Pairs each colour image with the depth image of the nearest time.
void PairByTime(const fs::path& folder, OdometrySequence& sequence) {
  constexpr std::int64_t kMaxDifference_ns = 20'000'000;
  const std::vector<TimedFile> depth = ReadFileList(folder / "depth.txt");
  for (const TimedFile& rgb : ReadFileList(folder / "rgb.txt")) {
    const auto distance = [&](const TimedFile& d) { return std::abs(d.time_ns - rgb.time_ns); };
    const auto nearest = std::min_element(
        depth.begin(), depth.end(),
        [&](const TimedFile& a, const TimedFile& b) { return distance(a) < distance(b); });
    const bool near = nearest != depth.end() && distance(*nearest) <= kMaxDifference_ns;
    if (near)
      AppendFrame(sequence, {rgb.time_ns, rgb.file, {}, nearest->file});
    else
      ++sequence.skipped_frames;
  }
}

// Lines of associations.txt name the colour or the depth image first.
void ReadAssociations(const fs::path& path, OdometrySequence& sequence) {
  std::vector<OdometryFrame> frames;
  ForEachRow(path, ' ', 4, [&](const Fields& fields, const std::string& where) {
    const size_t rgb = fields[1].starts_with("rgb") ? 0 : 2;
    if (!fields[rgb + 1].starts_with("rgb")) throw Error(where, "names no image in folder rgb");
    AppendLater(frames,
                {SecondsField(fields[rgb], where),
                 path.parent_path() / fields[rgb + 1],
                 {},
                 path.parent_path() / fields[3 - rgb]},
                where);
  });
  for (OdometryFrame& frame : frames) AppendFrame(sequence, std::move(frame));
}

std::array<double, 4> LayoutIntrinsics(const OdometrySequence& sequence) {
  if (sequence.layout == OdometryLayout::kIclNuim) return {481.2, -480.0, 319.5, 239.5};
  if (sequence.name.find("freiburg3") != std::string::npos) return {535.4, 539.2, 320.1, 247.6};
  return {525.0, 525.0, 319.5, 239.5};
}

std::array<double, 4> Intrinsics(const OdometrySequence& sequence, const RgbdOptions& options) {
  const std::vector<double>& given = options.intrinsics;
  if (given.empty()) return LayoutIntrinsics(sequence);
  if (given.size() != 4)
    throw Error("intrinsics", fmt::format("are {} numbers, expected fx, fy, cx, cy", given.size()));
  return {given[0], given[1], given[2], given[3]};
}

// A pose as seen in coordinates whose y axis points the other way: F T F, F = diag(1, -1, 1).
SE3 MirroredInY(const SE3& T) {
  const Eigen::Quaterniond& q = T.R;
  return {Eigen::Quaterniond(q.w(), -q.x(), q.y(), -q.z()), {T.p.x(), -T.p.y(), T.p.z()}};
}

void SetRgbdCamera(const RgbdOptions& options, OdometrySequence& sequence) {
  const auto [fx, fy, cx, cy] = Intrinsics(sequence, options);
  const cv::Size size = ReadGrey(sequence.frames.front().left).size();
  EurocCamera sensor;
  sensor.camera = {size.width, size.height, fx, std::abs(fy), cx, cy};
  sensor.camera.Check();
  sensor.rate_hz = 30;
  sequence.cameras = {sensor};
  if (fy > 0) return;
  for (TimedPose& truth : sequence.truth) truth.pose = MirroredInY(truth.pose);
}

// The file of ground truth, if there is one.
fs::path RgbdTruthFile(const fs::path& folder) {
  if (IsFile(folder / "groundtruth.txt")) return folder / "groundtruth.txt";
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().string().ends_with(".gt.freiburg")) found.push_back(entry.path());
  if (found.size() > 1)
    throw Error(folder.string(), fmt::format("has {} files *.gt.freiburg", found.size()));
  return found.empty() ? fs::path() : found.front();
}

// Frame numbers, read as seconds, become times at 30 Hz.
template <class T>
void FrameNumbersToTimes(std::vector<T>& items) {
  for (T& item : items) item.time_ns /= 30;
}

void OpenRgbd(const fs::path& folder, const RgbdOptions& options, OdometrySequence& sequence) {
  if (IsFile(folder / "associations.txt") || sequence.layout == OdometryLayout::kIclNuim)
    ReadAssociations(folder / "associations.txt", sequence);
  else
    PairByTime(folder, sequence);
  if (const fs::path truth = RgbdTruthFile(folder); !truth.empty())
    sequence.truth = ReadTrajectory(truth);
  if (sequence.layout == OdometryLayout::kIclNuim) {
    FrameNumbersToTimes(sequence.frames);
    FrameNumbersToTimes(sequence.truth);
  }
  sequence.depth_levels_per_m = options.depth_levels_per_m;
  if (!sequence.frames.empty()) SetRgbdCamera(options, sequence);
}

// ---- TUM monocular

// The images in the order of their names.
std::vector<fs::path> ImagesIn(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && cv::haveImageReader(entry.path().string()))
      files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

void ReadTumMonoTruth(const fs::path& path, OdometrySequence& sequence) {
  if (!IsFile(path)) return;
  std::vector<TimedPose> poses;
  ForEachRow(path, ' ', 8, [&](const Fields& fields, const std::string& where) {
    if (fields[1] == "NaN" || fields[1] == "nan") return;
    const Eigen::Vector3d xyz = VectorField(fields, 4, where);
    const Eigen::Quaterniond q(NumberField<double>(fields[7], where), xyz.x(), xyz.y(), xyz.z());
    AppendLater(
        poses,
        {SecondsField(fields[0], where), {UnitQuaternion(q, where), VectorField(fields, 1, where)}},
        where);
  });
  sequence.truth = std::move(poses);
}

void OpenTumMono(const fs::path& folder, OdometrySequence& sequence) {
  EurocCamera sensor;
  sensor.camera = ReadCameraTxt(folder / "camera.txt");
  sensor.rate_hz = 30;
  sequence.cameras = {sensor};
  if (!IsFolder(folder / "images")) throw Error((folder / "images").string(), "is no folder");
  const std::vector<fs::path> images = ImagesIn(folder / "images");
  if (IsFile(folder / "times.txt")) {
    std::map<std::string, fs::path> by_name;
    for (const fs::path& image : images) by_name[image.stem().string()] = image;
    for (const FrameTime& frame : ReadFrameTimes(folder / "times.txt"))
      AppendFrame(sequence, {frame.time_ns, by_name[frame.id], {}, {}});
  } else {
    for (size_t i = 0; i < images.size(); ++i)
      AppendFrame(sequence, {static_cast<std::int64_t>(i) * 1'000'000'000 / 30, images[i], {}, {}});
  }
  ReadTumMonoTruth(folder / "groundtruthSync.txt", sequence);
}

// ---- Depth images

cv::Mat1f ReadDepthExr(const fs::path& path) {
  const ExrImage image = ReadExr(path);
  RequireChannels(image, {"Z"}, path.string());
  const ExrChannel& z = image.channels.at("Z");
  if (z.storage == ExrStorage::kUint) throw Error(path.string(), "depth is stored as integers");
  return z.values;
}

cv::Mat1f ReadDepthPng(const fs::path& path, double levels_per_m) {
  if (!(levels_per_m > 0 && std::isfinite(levels_per_m)))
    throw Error("depth_levels_per_m", fmt::format("is {}; it has to be positive", levels_per_m));
  const cv::Mat levels = ReadImage(path, cv::IMREAD_UNCHANGED);
  if (levels.type() != CV_16UC1)
    throw Error(path.string(), fmt::format("depth has one channel of 16 bit, this image is {}",
                                           cv::typeToString(levels.type())));
  cv::Mat1f depth;
  levels.convertTo(depth, CV_32F, 1 / levels_per_m);
  return depth;
}

// ---- Any layout

// ICL-NUIM has frame numbers where TUM has times.
bool HasFrameNumbers(const fs::path& associations) {
  bool numbers = false;
  if (IsFile(associations))
    ForEachRow(associations, ' ', 4, [&](const Fields& fields, const std::string&) {
      numbers = ParseNumber<int>(fields[0]).has_value();
    });
  return numbers;
}

OdometryLayout DetectLayout(const fs::path& folder) {
  if (IsFolder(folder / "mav0") || IsFolder(folder / "cam0")) return OdometryLayout::kEuroc;
  if (IsFolder(folder / "image_0") && IsFile(folder / "calib.txt"))
    return OdometryLayout::kKittiOdometry;
  if (IsFolder(folder / "rgb") && IsFolder(folder / "depth"))
    return HasFrameNumbers(folder / "associations.txt") ? OdometryLayout::kIclNuim
                                                        : OdometryLayout::kTumRgbd;
  if (IsFolder(folder / "images") && IsFile(folder / "camera.txt")) return OdometryLayout::kTumMono;
  throw Error(folder.string(),
              "is no sequence of a known layout: has neither mav0 or cam0, nor image_0 with "
              "calib.txt, nor rgb with depth, nor images with camera.txt");
}

}  // namespace

std::span<const std::pair<const char*, OdometryLayout>> EnumNames(OdometryLayout) {
  static constexpr std::pair<const char*, OdometryLayout> kNames[] = {
      {"euroc", OdometryLayout::kEuroc},
      {"kitti_odometry", OdometryLayout::kKittiOdometry},
      {"tum_rgbd", OdometryLayout::kTumRgbd},
      {"icl_nuim", OdometryLayout::kIclNuim},
      {"tum_mono", OdometryLayout::kTumMono}};
  return kNames;
}

OdometrySequence OpenOdometrySequence(const fs::path& folder, std::optional<OdometryLayout> layout,
                                      const RgbdOptions& rgbd) {
  if (!IsFolder(folder)) throw Error(folder.string(), "folder does not exist");
  OdometrySequence sequence;
  sequence.name = SequenceName(folder);
  sequence.layout = layout ? *layout : DetectLayout(folder);
  if (sequence.layout == OdometryLayout::kEuroc)
    OpenEuroc(folder, sequence);
  else if (sequence.layout == OdometryLayout::kKittiOdometry)
    OpenKitti(folder, sequence);
  else if (sequence.layout == OdometryLayout::kTumMono)
    OpenTumMono(folder, sequence);
  else
    OpenRgbd(folder, rgbd, sequence);
  if (sequence.frames.empty())
    throw Error(folder.string(), fmt::format("has no frame with all its files; {} lack one",
                                             sequence.skipped_frames));
  return sequence;
}

cv::Mat1f ReadDepth(const fs::path& path, double levels_per_m) {
  cv::Mat1f depth =
      path.extension() == ".exr" ? ReadDepthExr(path) : ReadDepthPng(path, levels_per_m);
  for (float& d : depth)
    if (!(d > 0 && std::isfinite(d))) d = std::numeric_limits<float>::quiet_NaN();
  return depth;
}

}  // namespace sgf
