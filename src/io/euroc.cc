#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/euroc.h>
#include <sgf/io/read_file.h>
#include <sgf/io/rows.h>
#include <sgf/io/trajectory.h>

namespace sgf {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTruthFolder = "state_groundtruth_estimate0";

constexpr const char* kImageHeader = "#timestamp [ns],filename";
constexpr const char* kImuHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]";
constexpr const char* kTruthHeader =
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], "
    "q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], "
    "b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], "
    "b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]";

std::string CameraFolder(int camera) { return fmt::format("cam{}", camera); }

// A list that has to have rows.
template <class T>
std::vector<T> NotEmpty(std::vector<T> items, const fs::path& path) {
  if (items.empty()) throw Error(path.string(), "has no rows");
  return items;
}

// ---- Reading the lists

std::vector<EurocImage> ReadImageList(const fs::path& folder, EurocFiles files) {
  const fs::path path = folder / "data.csv";
  std::vector<EurocImage> images;
  ForEachRow(path, ',', 2, [&](const Fields& fields, const std::string& where) {
    const fs::path name(fields[1]);
    const fs::path file = folder / "data" / name;
    std::error_code ignored;
    const bool missing = files == EurocFiles::kRequired && !fs::is_regular_file(file, ignored);
    if (name.empty() || name != name.filename() || missing)
      throw Error(where, fmt::format("no image {} in folder data", Printable(fields[1])));
    AppendLater(images, {NumberField<std::int64_t>(fields[0], where), file}, where);
  });
  return NotEmpty(std::move(images), path);
}

std::vector<ImuSample> ReadImu(const fs::path& path) {
  std::vector<ImuSample> samples;
  ForEachRow(path, ',', 7, [&](const Fields& fields, const std::string& where) {
    AppendLater(samples,
                {NumberField<std::int64_t>(fields[0], where), VectorField(fields, 1, where),
                 VectorField(fields, 4, where)},
                where);
  });
  return NotEmpty(std::move(samples), path);
}

std::vector<BodyState> ReadTruthCsv(const fs::path& path) {
  std::vector<BodyState> states;
  ForEachRow(path, ',', 17, [&](const Fields& fields, const std::string& where) {
    const Eigen::Quaterniond q(
        NumberField<double>(fields[4], where), NumberField<double>(fields[5], where),
        NumberField<double>(fields[6], where), NumberField<double>(fields[7], where));
    AppendLater(states,
                {NumberField<std::int64_t>(fields[0], where),
                 {UnitQuaternion(q, where), VectorField(fields, 1, where)},
                 VectorField(fields, 8, where),
                 VectorField(fields, 11, where),
                 VectorField(fields, 14, where)},
                where);
  });
  return NotEmpty(std::move(states), path);
}

std::vector<BodyState> ReadTruthTum(const fs::path& path) {
  std::vector<BodyState> states;
  for (const TimedPose& truth : NotEmpty(ReadTrajectory(path), path)) {
    states.emplace_back();
    states.back().time_ns = truth.time_ns;
    states.back().T_world_body = truth.pose;
  }
  return states;
}

// ---- Reading the sensors

/// A sensor.yaml file, whose errors name it and the line.
class SensorFile {
 public:
  explicit SensorFile(const fs::path& path) : path_(path.string()) {
    try {
      root_ = YAML::Load(ReadFile(path));
    } catch (const YAML::Exception& error) {
      throw Error(At(error.mark), error.msg);
    }
    if (!root_.IsMap()) throw Error(path_, "expected a map of keys");
  }

  template <class T>
  T Get(const std::string& key) const {
    return As<T>(Find(root_, key), key);
  }

  double GetNotNegative(const std::string& key) const {
    const auto value = Get<double>(key);
    if (!(value >= 0 && std::isfinite(value))) Fail(key, fmt::format("{} is {}", key, value));
    return value;
  }

  double GetPositive(const std::string& key) const {
    const double value = GetNotNegative(key);
    if (value == 0) Fail(key, fmt::format("{} is 0", key));
    return value;
  }

  template <class T, size_t N>
  std::array<T, N> GetArray(const std::string& key) const {
    return AsArray<T, N>(Find(root_, key), key);
  }

  void Require(const std::string& key, const std::string& expected) const {
    if (const auto value = Get<std::string>(key); value != expected)
      Fail(key, fmt::format("{} is {}, expected {}", key, Printable(value), expected));
  }

  /// T_BS: from sensor to body coordinates.
  SE3 GetPose() const {
    const YAML::Node node = Find(root_, "T_BS");
    if (!node.IsMap()) Fail("T_BS", "T_BS is no map");
    const auto data = AsArray<double, 16>(Find(node, "data"), "T_BS");
    const Eigen::Matrix4d matrix =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(data.data());
    const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
    if (!matrix.allFinite() || !(R.transpose() * R).isIdentity(1e-6) || R.determinant() < 0 ||
        matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
      Fail("T_BS", "T_BS is no rigid motion");
    return {Eigen::Quaterniond(R).normalized(), matrix.topRightCorner<3, 1>()};
  }

  void RequireBodyFrame() const {
    const SE3 pose = GetPose();
    if (pose.p.norm() > 1e-9 || LogSO3(pose.R).norm() > 1e-9)
      Fail("T_BS", "T_BS is not the identity: the sensor is not the body frame");
  }

  [[noreturn]] void Fail(const std::string& key, const std::string& what) const {
    throw Error(At(root_[key].Mark()), what);
  }

 private:
  std::string At(const YAML::Mark& mark) const {
    return mark.is_null() ? path_ : fmt::format("{}:{}", path_, mark.line + 1);
  }

  YAML::Node Find(const YAML::Node& map, const std::string& key) const {
    YAML::Node node = map[key];
    if (!node) throw Error(At(map.Mark()), fmt::format("has no key {}", key));
    return node;
  }

  template <class T>
  T As(const YAML::Node& node, const std::string& key) const {
    try {
      return node.as<T>();
    } catch (const YAML::Exception&) {
      throw Error(At(node.Mark()), fmt::format("{} cannot be read", key));
    }
  }

  template <class T, size_t N>
  std::array<T, N> AsArray(const YAML::Node& node, const std::string& key) const {
    if (!node.IsSequence() || node.size() != N)
      throw Error(At(node.Mark()), fmt::format("{} is not a list of {} numbers", key, N));
    std::array<T, N> values;
    for (size_t i = 0; i < N; ++i) values[i] = As<T>(node[i], key);
    return values;
  }

  std::string path_;
  YAML::Node root_;
};

Camera ReadCamera(const SensorFile& file) {
  file.Require("sensor_type", "camera");
  file.Require("camera_model", "pinhole");
  file.Require("distortion_model", "radial-tangential");
  const auto [width, height] = file.GetArray<int, 2>("resolution");
  const auto [fx, fy, cx, cy] = file.GetArray<double, 4>("intrinsics");
  const auto [k1, k2, p1, p2] = file.GetArray<double, 4>("distortion_coefficients");
  const Camera camera{width, height, fx, fy, cx, cy, k1, k2, p1, p2};
  for (const double value : {fx, fy, cx, cy, k1, k2, p1, p2})
    if (!std::isfinite(value)) file.Fail("intrinsics", fmt::format("a coefficient is {}", value));
  try {
    camera.Check();
  } catch (const Error& error) {
    file.Fail("intrinsics", error.what());
  }
  return camera;
}

void ReadCameraFolder(const fs::path& folder, EurocFiles files, EurocSequence& sequence) {
  const SensorFile file(folder / "sensor.yaml");
  sequence.sensors.cameras.push_back(
      {ReadCamera(file), file.GetPose(), file.GetPositive("rate_hz")});
  sequence.images.push_back(ReadImageList(folder, files));
}

void ReadImuFolder(const fs::path& folder, EurocSequence& sequence) {
  const SensorFile file(folder / "sensor.yaml");
  file.Require("sensor_type", "imu");
  file.RequireBodyFrame();
  sequence.sensors.imu_rate_hz = file.GetPositive("rate_hz");
  sequence.sensors.imu_noise = {file.GetNotNegative("gyroscope_noise_density"),
                                file.GetNotNegative("gyroscope_random_walk"),
                                file.GetNotNegative("accelerometer_noise_density"),
                                file.GetNotNegative("accelerometer_random_walk")};
  sequence.imu = ReadImu(folder / "data.csv");
}

void ReadTruthFolder(const fs::path& folder, EurocSequence& sequence) {
  SensorFile(folder / "sensor.yaml").RequireBodyFrame();
  const fs::path tum = folder / "groundtruth_tum.txt";
  sequence.truth_has_rates = fs::exists(folder / "data.csv") || !fs::exists(tum);
  sequence.truth = sequence.truth_has_rates ? ReadTruthCsv(folder / "data.csv") : ReadTruthTum(tum);
}

// ---- Writing

fs::path Mav0(const fs::path& folder) { return folder / "mav0"; }

// With a decimal point in every number: YAML 1.1 takes "1e-05" for a string.
template <class Range>
std::string YamlList(const Range& values) {
  return fmt::format("[{:#}]", fmt::join(values, ", "));
}

std::string YamlPose(const SE3& T_body_sensor) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> m = T_body_sensor.Matrix();
  std::string rows;
  for (int i = 0; i < 4; ++i)
    rows += fmt::format("{}{:#}, {:#}, {:#}, {:#}", i == 0 ? "" : ",\n         ", m(i, 0), m(i, 1),
                        m(i, 2), m(i, 3));
  return fmt::format(
      "# Sensor extrinsics wrt. the body-frame.\n"
      "T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n",
      rows);
}

std::string CameraYaml(const EurocCamera& sensor, int index) {
  const Camera& c = sensor.camera;
  return fmt::format(
      "# General sensor definitions.\nsensor_type: camera\ncomment: simulated cam{}\n\n{}\n"
      "# Camera specific definitions.\nrate_hz: {}\nresolution: [{}, {}]\n"
      "camera_model: pinhole\nintrinsics: {} #fu, fv, cu, cv\n"
      "distortion_model: radial-tangential\ndistortion_coefficients: {}\n",
      index, YamlPose(sensor.T_body_cam), sensor.rate_hz, c.width, c.height,
      YamlList(std::array{c.fx, c.fy, c.cx, c.cy}), YamlList(std::array{c.k1, c.k2, c.p1, c.p2}));
}

std::string ImuYaml(const EurocSensors& sensors) {
  const ImuNoise& noise = sensors.imu_noise;
  return fmt::format(
      "# General sensor definitions.\nsensor_type: imu\ncomment: simulated IMU\n\n{}rate_hz: {}\n\n"
      "# inertial sensor noise model parameters (static)\n"
      "gyroscope_noise_density: {:#}     # [ rad / s / sqrt(Hz) ]   ( gyro \"white noise\" )\n"
      "gyroscope_random_walk: {:#}       # [ rad / s^2 / sqrt(Hz) ] ( gyro bias diffusion )\n"
      "accelerometer_noise_density: {:#}  # [ m / s^2 / sqrt(Hz) ]   ( accel \"white noise\" )\n"
      "accelerometer_random_walk: {:#}    # [ m / s^3 / sqrt(Hz) ].  ( accel bias diffusion )\n",
      YamlPose({}), sensors.imu_rate_hz, noise.gyroscope_noise_density, noise.gyroscope_random_walk,
      noise.accelerometer_noise_density, noise.accelerometer_random_walk);
}

std::string TruthYaml() {
  return "# General sensor definitions.\nsensor_type: visual-inertial\n"
         "comment: simulated states of the body\n\n" +
         YamlPose({});
}

}  // namespace

EurocSequence ReadEuroc(const fs::path& folder, EurocFiles files) {
  const fs::path root = fs::is_directory(Mav0(folder)) ? Mav0(folder) : folder;
  EurocSequence sequence;
  for (int i = 0; fs::is_directory(root / CameraFolder(i)); ++i)
    ReadCameraFolder(root / CameraFolder(i), files, sequence);
  if (sequence.images.empty()) throw Error(root.string(), "has no folder cam0");
  if (fs::is_directory(root / "imu0")) ReadImuFolder(root / "imu0", sequence);
  if (fs::is_directory(root / kTruthFolder)) ReadTruthFolder(root / kTruthFolder, sequence);
  return sequence;
}

void WriteEurocSensors(const fs::path& folder, const EurocSensors& sensors) {
  const fs::path root = Mav0(folder);
  for (int i = 0; i < static_cast<int>(sensors.cameras.size()); ++i) {
    MakeFolder(root / CameraFolder(i) / "data");
    WriteTextFile(root / CameraFolder(i) / "sensor.yaml", CameraYaml(sensors.cameras[i], i));
  }
  MakeFolder(root / "imu0");
  WriteTextFile(root / "imu0" / "sensor.yaml", ImuYaml(sensors));
  MakeFolder(root / kTruthFolder);
  WriteTextFile(root / kTruthFolder / "sensor.yaml", TruthYaml());
  WriteTextFile(root / "body.yaml", "comment: simulated body\n");
}

fs::path EurocImagePath(const fs::path& folder, int camera, std::int64_t time_ns) {
  return Mav0(folder) / CameraFolder(camera) / "data" / fmt::format("{}.png", time_ns);
}

void WriteEurocImageList(const fs::path& folder, int camera,
                         std::span<const std::int64_t> times_ns) {
  std::string text = fmt::format("{}\n", kImageHeader);
  for (const std::int64_t time : times_ns)
    fmt::format_to(std::back_inserter(text), "{0},{0}.png\n", time);
  WriteTextFile(Mav0(folder) / CameraFolder(camera) / "data.csv", text);
}

void WriteEurocImu(const fs::path& folder, std::span<const ImuSample> samples) {
  std::string text = fmt::format("{}\n", kImuHeader);
  for (const ImuSample& s : samples)
    fmt::format_to(std::back_inserter(text), "{},{},{}\n", s.time_ns, fmt::join(s.gyro, ","),
                   fmt::join(s.accel, ","));
  WriteTextFile(Mav0(folder) / "imu0" / "data.csv", text);
}

void WriteEurocTruth(const fs::path& folder, std::span<const BodyState> states) {
  std::string text = fmt::format("{}\n", kTruthHeader);
  for (const BodyState& s : states) {
    const Eigen::Quaterniond& q = s.T_world_body.R;
    fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{},{},{}\n", s.time_ns,
                   fmt::join(s.T_world_body.p, ","), q.w(), q.x(), q.y(), q.z(),
                   fmt::join(s.velocity, ","), fmt::join(s.gyro_bias, ","),
                   fmt::join(s.accel_bias, ","));
  }
  WriteTextFile(Mav0(folder) / kTruthFolder / "data.csv", text);
}

}  // namespace sgf
