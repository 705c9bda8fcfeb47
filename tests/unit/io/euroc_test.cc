#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <sgf/core/error.h>
#include <sgf/io/euroc.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// ---- Random sequences

rc::Gen<double> Number() {
  return rc::gen::map(rc::gen::inRange<std::int64_t>(-1'000'000'000'000, 1'000'000'000'000),
                      [](std::int64_t n) { return static_cast<double>(n) / 3e10; });
}

// Of any order of magnitude, down to those that are written with an exponent.
rc::Gen<double> Positive() {
  return rc::gen::map(rc::gen::inRange(-900, 900), [](int e) { return std::exp(0.03 * e); });
}

rc::Gen<Eigen::Vector3d> Vector() {
  return rc::gen::map(rc::gen::tuple(Number(), Number(), Number()), [](const auto& t) {
    return Eigen::Vector3d(std::get<0>(t), std::get<1>(t), std::get<2>(t));
  });
}

SE3 RandomPose() { return {ExpSO3(*Vector()).normalized(), *Vector()}; }

EurocCamera RandomCamera() {
  EurocCamera sensor;
  sensor.camera = {*rc::gen::inRange(1, 5000),
                   *rc::gen::inRange(1, 5000),
                   *Positive(),
                   *Positive(),
                   *Number(),
                   *Number(),
                   *Number(),
                   *Number(),
                   *Number(),
                   *Number()};
  sensor.T_body_cam = RandomPose();
  sensor.rate_hz = *Positive();
  return sensor;
}

std::vector<std::int64_t> RandomTimes() {
  std::vector<std::int64_t> times(*rc::gen::inRange<size_t>(1, 4));
  std::int64_t time = *rc::gen::inRange<std::int64_t>(0, 2'000'000'000'000'000'000);
  for (auto& t : times) t = (time += *rc::gen::inRange(1, 100'000'000));
  return times;
}

std::vector<ImuSample> RandomImu() {
  std::vector<ImuSample> samples;
  for (const auto time : RandomTimes()) samples.push_back({time, *Vector(), *Vector()});
  return samples;
}

std::vector<BodyState> RandomStates() {
  std::vector<BodyState> states;
  for (const auto time : RandomTimes())
    states.push_back({time, RandomPose(), *Vector(), *Vector(), *Vector()});
  return states;
}

void WriteImages(const TempDir& dir, int camera, const std::vector<std::int64_t>& times) {
  for (const auto time : times)
    dir.Write(fs::relative(EurocImagePath(dir.path(), camera, time), dir.path()), "");
  WriteEurocImageList(dir.path(), camera, times);
}

void CheckCamera(const EurocCamera& a, const EurocCamera& b) {
  const auto all = [](const Camera& c) {
    return std::vector<double>{
        double(c.width), double(c.height), c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2};
  };
  RC_ASSERT(all(a.camera) == all(b.camera));
  RC_ASSERT(a.rate_hz == b.rate_hz);
  RC_ASSERT(a.T_body_cam.p == b.T_body_cam.p);
  // The file holds a matrix, which gives a quaternion up to rounding.
  RC_ASSERT(LogSO3(a.T_body_cam.R.conjugate() * b.T_body_cam.R).norm() < 1e-14);
}

void CheckImages(const std::vector<EurocImage>& images, const fs::path& folder, int camera,
                 const std::vector<std::int64_t>& times) {
  RC_ASSERT(images.size() == times.size());
  for (size_t i = 0; i < times.size(); ++i) {
    RC_ASSERT(images[i].time_ns == times[i]);
    RC_ASSERT(images[i].file == EurocImagePath(folder, camera, times[i]));
  }
}

void CheckImu(const std::vector<ImuSample>& a, const std::vector<ImuSample>& b) {
  RC_ASSERT(a.size() == b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    RC_ASSERT(a[i].time_ns == b[i].time_ns);
    RC_ASSERT(a[i].gyro == b[i].gyro);
    RC_ASSERT(a[i].accel == b[i].accel);
  }
}

void CheckStates(const std::vector<BodyState>& a, const std::vector<BodyState>& b) {
  RC_ASSERT(a.size() == b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    RC_ASSERT(a[i].time_ns == b[i].time_ns);
    RC_ASSERT(a[i].T_world_body.p == b[i].T_world_body.p);
    RC_ASSERT(a[i].T_world_body.R.coeffs() == b[i].T_world_body.R.coeffs());
    RC_ASSERT(a[i].velocity == b[i].velocity);
    RC_ASSERT(a[i].gyro_bias == b[i].gyro_bias);
    RC_ASSERT(a[i].accel_bias == b[i].accel_bias);
  }
}

RC_GTEST_PROP(EurocProperty, ReadsWhatWasWritten, ()) {
  const TempDir dir;
  const EurocSensors sensors{
      {RandomCamera()}, *Positive(), {*Positive(), *Positive(), *Positive(), *Positive()}};
  const auto times = RandomTimes();
  const auto imu = RandomImu();
  const auto truth = RandomStates();
  WriteEurocSensors(dir.path(), sensors);
  WriteImages(dir, 0, times);
  WriteEurocImu(dir.path(), imu);
  WriteEurocTruth(dir.path(), truth);

  const EurocSequence read = ReadEuroc(dir.path());
  RC_ASSERT(read.sensors.cameras.size() == 1U);
  CheckCamera(sensors.cameras[0], read.sensors.cameras[0]);
  CheckImages(read.images[0], dir.path(), 0, times);
  RC_ASSERT(read.sensors.imu_rate_hz == sensors.imu_rate_hz);
  const auto noise = [](const ImuNoise& n) {
    return std::vector{n.gyroscope_noise_density, n.gyroscope_random_walk,
                       n.accelerometer_noise_density, n.accelerometer_random_walk};
  };
  RC_ASSERT(noise(read.sensors.imu_noise) == noise(sensors.imu_noise));
  CheckImu(imu, read.imu);
  CheckStates(truth, read.truth);
  RC_ASSERT(read.truth_has_rates);
}

// ---- One sequence of known text

EurocCamera SmallCamera() {
  EurocCamera sensor;
  sensor.camera = {752, 480, 458, 457.5, 367.25, 248, -0.25, 0.0625, 1e-5, 0};
  sensor.T_body_cam.p = {0.5, -0.25, 1e-6};
  return sensor;
}

// Two images a camera, two IMU samples and two states.
void WriteSmallSequence(const TempDir& dir) {
  EurocSensors sensors;
  sensors.cameras = {SmallCamera(), SmallCamera()};
  WriteEurocSensors(dir.path(), sensors);
  for (int camera = 0; camera < 2; ++camera) WriteImages(dir, camera, {1000, 2000});
  WriteEurocImu(dir.path(), std::vector<ImuSample>{{500, {0.5, 0, -1}, {1e-5, 2, 9.81}},
                                                   {1500, {0, 0, 0}, {0, 0, 0}}});
  WriteEurocTruth(dir.path(),
                  std::vector<BodyState>{{1000, {}, {1, 2, 3}, {0.25, 0, 0}, {0, 0.5, 0}},
                                         {2000, {}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}});
}

constexpr const char* kTruthCsv = "state_groundtruth_estimate0/data.csv";
constexpr const char* kTruthTum = "state_groundtruth_estimate0/groundtruth_tum.txt";

class Euroc : public ::testing::Test {
 protected:
  Euroc() { WriteSmallSequence(dir_); }

  std::string Text(const std::string& name) const { return ReadFile(dir_.path() / "mav0" / name); }

  // The error of reading with a text in a file replaced by another one.
  std::string ErrorWith(const std::string& name, const std::string& old_text,
                        const std::string& new_text) const {
    const std::string text = Text(name);
    EXPECT_THAT(text, HasSubstr(old_text));
    std::string changed = text;
    changed.replace(changed.find(old_text), old_text.size(), new_text);
    const fs::path path = dir_.Write("mav0/" + name, changed);
    const std::string message = ErrorMessage([&] { ReadEuroc(dir_.path()); });
    dir_.Write("mav0/" + name, text);
    const std::string prefix = path.string() + ":";
    EXPECT_THAT(message, StartsWith(prefix));
    return message.starts_with(prefix) ? message.substr(prefix.size()) : message;
  }

  std::string ErrorWithout(const std::string& name) const {
    const std::string text = Text(name);
    fs::remove(dir_.path() / "mav0" / name);
    const std::string message = ErrorMessage([&] { ReadEuroc(dir_.path()); });
    dir_.Write("mav0/" + name, text);
    return message;
  }

  const TempDir dir_;
};

TEST_F(Euroc, WritesTheOfficialTables) {
  EXPECT_EQ(Text("cam1/data.csv"), "#timestamp [ns],filename\n1000,1000.png\n2000,2000.png\n");
  EXPECT_EQ(Text("imu0/data.csv"),
            "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
            "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
            "500,0.5,0,-1,1e-05,2,9.81\n1500,0,0,0,0,0,0\n");
  EXPECT_EQ(Text(kTruthCsv),
            "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
            "q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], "
            "b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], "
            "b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]\n"
            "1000,0,0,0,1,0,0,0,1,2,3,0.25,0,0,0,0.5,0\n2000,0,0,0,1,0,0,0,0,0,0,0,0,0,0,0,0\n");
}

// YAML 1.1 readers, such as Python's, take 1e-05 for a string and 458 for an integer.
TEST_F(Euroc, WritesSensorFilesWithDecimalPoints) {
  const std::string camera = Text("cam0/sensor.yaml");
  EXPECT_THAT(camera, HasSubstr("intrinsics: [458.0, 457.5, 367.25, 248.0] #fu, fv, cu, cv\n"));
  EXPECT_THAT(camera, HasSubstr("distortion_coefficients: [-0.25, 0.0625, 1.e-05, 0.0]\n"));
  EXPECT_THAT(camera, HasSubstr("rate_hz: 20\nresolution: [752, 480]\n"));
  EXPECT_THAT(camera, HasSubstr("  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.5,\n"));
  EXPECT_THAT(camera, Not(HasSubstr("%YAML")));
  EXPECT_THAT(Text("imu0/sensor.yaml"), HasSubstr("gyroscope_random_walk: 1.9393e-05 "));
  EXPECT_THAT(Text("state_groundtruth_estimate0/sensor.yaml"),
              HasSubstr("sensor_type: visual-inertial\n"));
  EXPECT_THAT(Text("body.yaml"), StartsWith("comment: "));
}

TEST_F(Euroc, ReadsTheFolderInsideTheSequenceToo) {
  EXPECT_EQ(ReadEuroc(dir_.path() / "mav0").images[1][1].file,
            EurocImagePath(dir_.path(), 1, 2000));
}

TEST_F(Euroc, ReadsFilesWithWindowsLineEndsAndBlanks) {
  dir_.Write("mav0/cam0/data.csv",
             "#timestamp [ns],filename\r\n1000, 1000.png\r\n\r\n2000,2000.png");
  const EurocSequence sequence = ReadEuroc(dir_.path());
  ASSERT_EQ(sequence.images[0].size(), 2U);
  EXPECT_EQ(sequence.images[0][1].time_ns, 2000);
}

TEST_F(Euroc, NeedsNeitherImuNorGroundTruth) {
  fs::remove_all(dir_.path() / "mav0/imu0");
  fs::remove_all(dir_.path() / "mav0/state_groundtruth_estimate0");
  const EurocSequence sequence = ReadEuroc(dir_.path());
  EXPECT_TRUE(sequence.imu.empty());
  EXPECT_TRUE(sequence.truth.empty());
  EXPECT_FALSE(sequence.truth_has_rates);
}

// A double cannot hold these times to the nanosecond.
TEST_F(Euroc, ReadsGroundTruthOfPosesWithExactTimes) {
  fs::remove(dir_.path() / "mav0" / kTruthCsv);
  dir_.Write(std::string("mav0/") + kTruthTum,
             "# timestamp(s) tx ty tz qx qy qz qw\n"
             "1403636583.76356 1 2 3 0 0 0.6 0.8\n"
             "1403636583.763560001   4 5 6 0 0 0 1\n1403636584 7 8 9 1 0 0 0\n");
  const EurocSequence sequence = ReadEuroc(dir_.path());
  ASSERT_EQ(sequence.truth.size(), 3U);
  EXPECT_FALSE(sequence.truth_has_rates);
  EXPECT_EQ(sequence.truth[0].time_ns, 1403636583763560000);
  EXPECT_EQ(sequence.truth[1].time_ns, 1403636583763560001);
  EXPECT_EQ(sequence.truth[2].time_ns, 1403636584000000000);
  EXPECT_EQ(sequence.truth[0].T_world_body.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(sequence.truth[0].T_world_body.R.coeffs(), Eigen::Vector4d(0, 0, 0.6, 0.8));
}

TEST_F(Euroc, NormalisesQuaternionsOfFewDigits) {
  EXPECT_THAT(ErrorWith(kTruthCsv, "0,1,0,0,0,1", "0,0.9,0,0,0,1"),
              HasSubstr("2: quaternion has norm 0.9, expected 1"));
  std::string text = Text(kTruthCsv);
  text.replace(text.find("0,1,0,0,0,1"), 11, "0,0.5,-0.50001,0.5,0.5,1");
  dir_.Write(std::string("mav0/") + kTruthCsv, text);
  EXPECT_NEAR(ReadEuroc(dir_.path()).truth[0].T_world_body.R.norm(), 1, 1e-15);
}

TEST_F(Euroc, ReportsBadRows) {
  EXPECT_EQ(ErrorWith("imu0/data.csv", "9.81", "9.8l"), "2: '9.8l' is no number of its column");
  EXPECT_EQ(ErrorWith("imu0/data.csv", "9.81", "nan"), "2: 'nan' is no number of its column");
  EXPECT_EQ(ErrorWith("imu0/data.csv", "9.81", ""), "2: '' is no number of its column");
  EXPECT_EQ(ErrorWith("imu0/data.csv", "500,", "500.5,"), "2: '500.5' is no number of its column");
  EXPECT_EQ(ErrorWith("imu0/data.csv", ",9.81", ""), "2: has 6 columns, expected 7");
  EXPECT_EQ(ErrorWith("imu0/data.csv", "9.81", "9.81,"), "2: has 8 columns, expected 7");
  EXPECT_EQ(ErrorWith("imu0/data.csv", "1500", "500"), "3: time 500 is not after 500");
  EXPECT_EQ(ErrorWith(kTruthCsv, "0.25", "1;2"), "2: '1;2' is no number of its column");
  EXPECT_EQ(ErrorWith(kTruthCsv, "2000", "200"), "3: time 200 is not after 1000");
  EXPECT_EQ(ErrorWith(kTruthCsv, ",0.5,0\n", "\n"), "2: has 15 columns, expected 17");
  const std::string rows = "500,0.5,0,-1,1e-05,2,9.81\n1500,0,0,0,0,0,0\n";
  EXPECT_EQ(ErrorWith("imu0/data.csv", rows, ""), " has no rows");
}

TEST_F(Euroc, ReportsBadImageLists) {
  EXPECT_EQ(ErrorWith("cam1/data.csv", "2000.png", "3000.png"),
            "3: no image '3000.png' in folder data");
  EXPECT_EQ(ErrorWith("cam1/data.csv", "2000.png", "../data/2000.png"),
            "3: no image '../data/2000.png' in folder data");
  EXPECT_EQ(ErrorWith("cam1/data.csv", "2000,", "1000,"), "3: time 1000 is not after 1000");
  EXPECT_EQ(ErrorWith("cam1/data.csv", "2000.png", ""), "3: no image '' in folder data");
}

TEST_F(Euroc, MayBeReadWithoutTheImagesThatItLists) {
  fs::remove(EurocImagePath(dir_.path(), 1, 2000));
  EXPECT_THAT(ErrorMessage([&] { ReadEuroc(dir_.path()); }), HasSubstr("no image '2000.png'"));
  EXPECT_EQ(ReadEuroc(dir_.path(), EurocFiles::kMayBeMissing).images[1].size(), 2U);
}

TEST_F(Euroc, ReportsBadTimesOfPoses) {
  fs::remove(dir_.path() / "mav0" / kTruthCsv);
  dir_.Write(std::string("mav0/") + kTruthTum, "1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0 0 0 1\n");
  for (const std::string time : {"x", ".", "1.2x", "-1.5", "1.-5", ""})
    EXPECT_THAT(ErrorWith(kTruthTum, "1.5 ", time + " "), StartsWith("1: ")) << time;
  EXPECT_EQ(ErrorWith(kTruthTum, "2.5", "1.5"), "2: time 1500000000 is not after 1500000000");
}

TEST_F(Euroc, ReportsBadSensorFiles) {
  const std::string camera = "cam1/sensor.yaml";
  EXPECT_THAT(ErrorWith(camera, "radial-tangential", "equidistant"),
              HasSubstr("19: distortion_model is 'equidistant', expected radial-tangential"));
  EXPECT_THAT(ErrorWith(camera, ": pinhole", ": omni"), HasSubstr("camera_model is 'omni'"));
  EXPECT_THAT(ErrorWith(camera, ": camera", ": imu"), HasSubstr("sensor_type is 'imu'"));
  EXPECT_THAT(ErrorWith(camera, "rate_hz: 20", "rate: 20"), HasSubstr("has no key rate_hz"));
  EXPECT_THAT(ErrorWith(camera, "rate_hz: 20", "rate_hz: 0"), HasSubstr("rate_hz is 0"));
  EXPECT_THAT(ErrorWith(camera, "rate_hz: 20", "rate_hz: -20"), HasSubstr("rate_hz is -20"));
  EXPECT_THAT(ErrorWith(camera, "rate_hz: 20", "rate_hz: .nan"), HasSubstr("rate_hz is nan"));
  EXPECT_THAT(ErrorWith(camera, "752, 480", "752"), HasSubstr("resolution is not a list of 2"));
  EXPECT_THAT(ErrorWith(camera, "752", "wide"), HasSubstr("16: resolution cannot be read"));
  EXPECT_THAT(ErrorWith(camera, "752", "0"), HasSubstr("size is 0x480 px"));
  EXPECT_THAT(ErrorWith(camera, "[458.0", "[-458.0"), HasSubstr("focal lengths are -458, 457.5"));
  EXPECT_THAT(ErrorWith(camera, "1.e-05", ".inf"), HasSubstr("a coefficient is inf"));
  EXPECT_THAT(ErrorWith(camera, "data: [1.0", "data: [1.1"), HasSubstr("is no rigid motion"));
  EXPECT_THAT(ErrorWith(camera, "data: [1.0", "data: [-1.0"), HasSubstr("is no rigid motion"));
  EXPECT_THAT(ErrorWith(camera, "data: [1.0,", "data: ["), HasSubstr("not a list of 16 numbers"));
  EXPECT_THAT(ErrorWith(camera, "rate_hz: 20", "rate_hz: [20"), HasSubstr("end of sequence flow"));
  EXPECT_THAT(ErrorWith(camera, "T_BS:\n", "T_BS: 1\nT:\n"), HasSubstr("T_BS is no map"));
}

TEST_F(Euroc, ReportsAnImuThatIsNotTheBody) {
  EXPECT_THAT(ErrorWith("imu0/sensor.yaml", "0.0, 1.0]", "0.1, 1.0]"),
              HasSubstr("is no rigid motion"));
  EXPECT_THAT(ErrorWith("imu0/sensor.yaml", "[1.0, 0.0, 0.0, 0.0,", "[1.0, 0.0, 0.0, 0.1,"),
              HasSubstr("T_BS is not the identity"));
  EXPECT_THAT(ErrorWith("imu0/sensor.yaml", "gyroscope_noise_density: 0.0", "x: 0.0"),
              HasSubstr("has no key gyroscope_noise_density"));
}

TEST_F(Euroc, ReportsMissingFiles) {
  EXPECT_THAT(ErrorWithout("cam0/sensor.yaml"), HasSubstr("cam0/sensor.yaml: file does not exist"));
  EXPECT_THAT(ErrorWithout("cam1/data.csv"), HasSubstr("cam1/data.csv: file does not exist"));
  EXPECT_THAT(ErrorWithout("imu0/data.csv"), HasSubstr("imu0/data.csv: file does not exist"));
  EXPECT_THAT(ErrorWithout(kTruthCsv), HasSubstr("data.csv: file does not exist"));
  const TempDir empty;
  EXPECT_EQ(ErrorMessage([&] { ReadEuroc(empty.path()); }),
            empty.path().string() + ": has no folder cam0");
}

TEST_F(Euroc, ReportsAFolderThatCannotBeMade) {
  const fs::path file = dir_.Write("file", "");
  EXPECT_THAT(ErrorMessage([&] { WriteEurocSensors(file, {}); }), HasSubstr("cannot be made"));
}

// Whatever stands in a file, reading gives a sequence or an Error.
RC_GTEST_PROP(EurocProperty, GivesASequenceOrAnErrorForChangedBytes, ()) {
  static const TempDir dir;
  static const bool written = (WriteSmallSequence(dir), true);
  RC_ASSERT(written);
  const auto name = *rc::gen::elementOf(std::vector<std::string>{
      "cam0/sensor.yaml", "cam0/data.csv", "imu0/sensor.yaml", "imu0/data.csv", kTruthCsv});
  const std::string text = ReadFile(dir.path() / "mav0" / name);
  std::string changed = text;
  for (int i = *rc::gen::inRange(0, 3); i >= 0; --i) {
    const auto at = *rc::gen::inRange<size_t>(0, changed.size());
    if (*rc::gen::arbitrary<bool>())
      changed[at] = *rc::gen::arbitrary<char>();
    else
      changed.erase(at, *rc::gen::inRange<size_t>(1, 20));
  }
  dir.Write("mav0/" + name, changed);
  const std::string message = ErrorMessage([&] { ReadEuroc(dir.path()); });
  dir.Write("mav0/" + name, text);
  RC_CLASSIFY(message == "no error", "read");
  RC_ASSERT(message == "no error" || message.starts_with(dir.path().string()));
}

}  // namespace
}  // namespace sgf
