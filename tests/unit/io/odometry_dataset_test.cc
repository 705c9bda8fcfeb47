#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/io/exr.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

namespace fs = std::filesystem;
using ::testing::EndsWith;
using ::testing::HasSubstr;

std::string OpenError(const fs::path& folder) {
  return ErrorMessage([&] { OpenOdometrySequence(folder); });
}

void WriteImage(const fs::path& path, int type = CV_8UC1) {
  WritePng(path, cv::Mat(4, 6, type, cv::Scalar(7)));
}

std::vector<std::int64_t> Times(const OdometrySequence& sequence) {
  std::vector<std::int64_t> times;
  for (const OdometryFrame& frame : sequence.frames) times.push_back(frame.time_ns);
  return times;
}

// ---- EuRoC

class EurocOdometry : public ::testing::Test {
 protected:
  EurocOdometry() {
    EurocSensors sensors;
    sensors.cameras.resize(2);
    for (EurocCamera& sensor : sensors.cameras)
      sensor.camera = {6, 4, 5, 5.5, 2.5, 1.5, -0.1, 0, 0, 0};
    sensors.cameras[0].T_body_cam.p = {0.25, 0, 0};
    sensors.cameras[1].T_body_cam.p = {0.375, 0, 0};
    WriteEurocSensors(folder_, sensors);
    SetImages(0, {10, 20, 30});
    SetImages(1, {10, 20, 30});
    WriteEurocImu(folder_, std::vector<ImuSample>{{5, {1, 2, 3}, {4, 5, 6}}});
    WriteEurocTruth(folder_, std::vector<BodyState>{{8, {{1, 0, 0, 0}, {1, 2, 3}}}});
  }

  void SetImages(int camera, const std::vector<std::int64_t>& times) {
    for (const auto time : times) WriteImage(EurocImagePath(folder_, camera, time));
    WriteEurocImageList(folder_, camera, times);
  }

  const TempDir dir_;
  const fs::path folder_ = dir_.path() / "MH_09";
};

TEST_F(EurocOdometry, HasPairsImuAndTruthOfTheBody) {
  const OdometrySequence sequence = OpenOdometrySequence(folder_);
  EXPECT_EQ(sequence.name, "MH_09");
  EXPECT_EQ(sequence.layout, OdometryLayout::kEuroc);
  EXPECT_TRUE(sequence.stereo());
  EXPECT_EQ(Times(sequence), (std::vector<std::int64_t>{10, 20, 30}));
  EXPECT_EQ(sequence.skipped_frames, 0);
  EXPECT_EQ(sequence.frames[1].left, EurocImagePath(folder_, 0, 20));
  EXPECT_EQ(sequence.frames[1].right, EurocImagePath(folder_, 1, 20));
  EXPECT_TRUE(sequence.frames[1].depth.empty());
  EXPECT_EQ(sequence.cameras[1].T_body_cam.p.x(), 0.375);
  ASSERT_EQ(sequence.imu.size(), 1U);
  ASSERT_EQ(sequence.truth.size(), 1U);
  EXPECT_EQ(sequence.truth[0].time_ns, 8);
  EXPECT_EQ(sequence.truth[0].pose.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(OpenOdometrySequence(folder_ / "mav0/").name, "MH_09");
}

TEST_F(EurocOdometry, SkipsAndCountsFramesWithOneEye) {
  SetImages(0, {10, 20, 30, 50});
  SetImages(1, {5, 10, 30, 40});
  fs::remove(EurocImagePath(folder_, 1, 30));
  const OdometrySequence sequence = OpenOdometrySequence(folder_);
  EXPECT_EQ(Times(sequence), std::vector<std::int64_t>{10});
  EXPECT_EQ(sequence.skipped_frames, 5) << "at 5, 20, 30, 40 and 50";
}

TEST_F(EurocOdometry, ReportsCamerasThatNeverLookTogether) {
  SetImages(1, {11});
  EXPECT_EQ(OpenError(folder_),
            folder_.string() + ": cam0 and cam1 have no time in common: are they synchronised?");
}

TEST_F(EurocOdometry, MayHaveOneCamera) {
  fs::remove_all(folder_ / "mav0/cam1");
  const OdometrySequence sequence = OpenOdometrySequence(folder_);
  EXPECT_EQ(sequence.cameras.size(), 1U);
  EXPECT_EQ(sequence.frames.size(), 3U);
  EXPECT_TRUE(sequence.frames[0].right.empty());
}

// ---- KITTI

class KittiOdometry : public ::testing::Test {
 protected:
  KittiOdometry() {
    for (const char* eye : {"image_0", "image_1"})
      for (const char* name : {"000000.png", "000001.png", "000002.png"})
        WriteImage(dir_.File(relative_ / eye / name));
    WriteCalib(kP1);
    dir_.Write(relative_ / "times.txt", "0.000000e+00\n1.036224e-01\n2.5e-01\n");
    WritePoses(std::string(kPose) + kPose + "0 0 1 4 0 1 0 5 -1 0 0 6\n");
  }

  void WriteCalib(const std::string& second) {
    dir_.Write(relative_ / "calib.txt",
               "P0: 700 0 600 0 0 700 180 0 0 0 1 0\n" + second + "Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  }

  void WritePoses(const std::string& text) { dir_.Write("dataset/poses/07.txt", text); }

  static constexpr const char* kP1 = "P1: 700 0 600 -350 0 700 180 0 0 0 1 0\n";
  static constexpr const char* kPose = "1 0 0 1 0 1 0 2 0 0 1 3\n";
  const fs::path relative_ = "dataset/sequences/07";
  const TempDir dir_;
  const fs::path folder_ = dir_.path() / relative_;
};

TEST_F(KittiOdometry, HasRectifiedPairsAndTruthOfTheLeftCamera) {
  // A slash at the end and a way round change nothing.
  for (const fs::path& folder : {folder_, folder_ / "", folder_ / "../07"}) {
    const OdometrySequence sequence = OpenOdometrySequence(folder);
    EXPECT_EQ(sequence.name, "07");
    EXPECT_EQ(sequence.layout, OdometryLayout::kKittiOdometry);
    EXPECT_EQ(Times(sequence), (std::vector<std::int64_t>{0, 103'622'400, 250'000'000}));
    EXPECT_EQ(sequence.frames[2].right, folder / "image_1/000002.png");
    const Camera& camera = sequence.cameras[1].camera;
    EXPECT_EQ(camera.width, 6);
    EXPECT_EQ(camera.fx, 700);
    EXPECT_EQ(camera.cy, 180);
    EXPECT_EQ(sequence.cameras[0].T_body_cam.p.norm(), 0);
    EXPECT_NEAR((sequence.cameras[1].T_body_cam.p - Eigen::Vector3d(0.5, 0, 0)).norm(), 0, 1e-15);
    ASSERT_EQ(sequence.truth.size(), 3U);
    EXPECT_EQ(sequence.truth[2].time_ns, 250'000'000);
    EXPECT_EQ(sequence.truth[2].pose.p, Eigen::Vector3d(4, 5, 6));
    EXPECT_NEAR((sequence.truth[2].pose.R * Eigen::Vector3d::UnitZ()).x(), 1, 1e-15);
  }
}

TEST_F(KittiOdometry, NeedsNoTruth) {
  fs::remove_all(dir_.path() / "dataset/poses");
  EXPECT_TRUE(OpenOdometrySequence(folder_).truth.empty());
}

TEST_F(KittiOdometry, KeepsTheTimesOfFramesAfterASkippedOne) {
  fs::remove(folder_ / "image_0/000000.png");
  const OdometrySequence sequence = OpenOdometrySequence(folder_);
  EXPECT_EQ(sequence.skipped_frames, 1);
  EXPECT_EQ(Times(sequence), (std::vector<std::int64_t>{103'622'400, 250'000'000}));
  EXPECT_EQ(sequence.truth.size(), 3U);
}

TEST_F(KittiOdometry, ReportsBadFiles) {
  WriteCalib("");
  EXPECT_THAT(OpenError(folder_), EndsWith("calib.txt: has no line P1:"));
  WriteCalib("P1: 700 0 600 -350 0 700 180 0 0 0 1\n");
  EXPECT_THAT(OpenError(folder_), EndsWith("calib.txt:2: has 12 columns, expected 13"));
  WriteCalib("P1: 700 9 600 -350 0 700 180 0 0 0 1 0\n");
  EXPECT_THAT(OpenError(folder_), EndsWith("calib.txt:2: is no projection of a rectified camera"));
  WriteCalib(kP1);
  WritePoses(kPose);
  EXPECT_THAT(OpenError(folder_), EndsWith("poses/07.txt: has 1 poses for 3 times"));
  WritePoses(std::string(kPose) + kPose + kPose + kPose);
  EXPECT_THAT(OpenError(folder_), EndsWith("poses/07.txt:4: has more poses than the 3 times"));
  WritePoses(std::string(kPose) + "2 0 0 1 0 1 0 2 0 0 1 3\n");
  EXPECT_THAT(OpenError(folder_), EndsWith("poses/07.txt:2: is no rigid motion"));
  dir_.Write(relative_ / "times.txt", "0\n0\n");
  EXPECT_THAT(OpenError(folder_), EndsWith("times.txt:2: time 0 is not after 0"));
}

// ---- TUM RGB-D and ICL-NUIM

class RgbdOdometry : public ::testing::Test {
 protected:
  void WriteImages(const std::vector<std::string>& rgb, const std::vector<std::string>& depth) {
    for (const auto& name : rgb) WriteImage(dir_.File(name_ + "/rgb/" + name), CV_8UC3);
    for (const auto& name : depth) WriteImage(dir_.File(name_ + "/depth/" + name), CV_16UC1);
  }

  void Write(const std::string& file, const std::string& text) {
    dir_.Write(name_ + "/" + file, text);
  }

  OdometrySequence Open(const RgbdOptions& options = {}) {
    return OpenOdometrySequence(dir_.path() / name_, std::nullopt, options);
  }

  std::string Error(const RgbdOptions& options = {}) {
    return ErrorMessage([&] { Open(options); });
  }

  void WriteIcl() {
    WriteImages({"1.png", "2.png"}, {"1.png", "2.png"});
    Write("associations.txt", "1 depth/1.png 1 rgb/1.png\n2 depth/2.png 2 rgb/2.png\n");
    Write("groundtruth.txt", "1 1 2 3 0.1 0.3 0.5 0.8062257748298549\n2 0 0 0 0 0 0 1\n");
  }

  std::string name_ = "sequence";
  const TempDir dir_;
};

TEST_F(RgbdOdometry, TumAssociationsNameEitherImageFirst) {
  WriteImages({"a.png", "b.png"}, {"c.png", "d.png"});
  Write("associations.txt", "1.5 rgb/a.png 1.51 depth/c.png\n1.61 depth/d.png 1.6 rgb/b.png\n");
  Write("groundtruth.txt", "# mocap\n1.2345 1 2 3 0 0 0 1\n");
  const OdometrySequence sequence = Open();
  EXPECT_EQ(sequence.layout, OdometryLayout::kTumRgbd);
  EXPECT_FALSE(sequence.stereo());
  EXPECT_EQ(Times(sequence), (std::vector<std::int64_t>{1'500'000'000, 1'600'000'000}));
  EXPECT_EQ(sequence.frames[1].left, dir_.path() / "sequence/rgb/b.png");
  EXPECT_EQ(sequence.frames[1].depth, dir_.path() / "sequence/depth/d.png");
  EXPECT_EQ(sequence.truth[0].time_ns, 1'234'500'000);
  EXPECT_EQ(sequence.truth[0].pose.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(sequence.depth_levels_per_m, 5000);
}

TEST_F(RgbdOdometry, TumListsArePairedByTime) {
  WriteImages({"a.png", "b.png", "c.png"}, {"d.png", "e.png"});
  Write("rgb.txt", "# list\n1.0 rgb/a.png\n1.1 rgb/b.png\n1.2 rgb/c.png\n");
  Write("depth.txt", "1.09 depth/d.png\n1.115 depth/e.png\n1.219 depth/e.png\n");
  const OdometrySequence sequence = Open();
  EXPECT_EQ(Times(sequence), (std::vector<std::int64_t>{1'100'000'000, 1'200'000'000}));
  EXPECT_EQ(sequence.skipped_frames, 1) << "no depth near 1.0 s";
  EXPECT_EQ(sequence.frames[0].depth.filename(), "d.png") << "10 ms off rather than 15 ms";
}

TEST_F(RgbdOdometry, TumCameraIsKnownByTheFolder) {
  const auto fx_of = [&](const std::string& name) {
    name_ = name;
    WriteImages({"a.png"}, {"b.png"});
    Write("associations.txt", "1.5 rgb/a.png 1.5 depth/b.png\n");
    const Camera camera = Open().cameras.at(0).camera;
    EXPECT_EQ(camera.width, 6);
    return camera.fx;
  };
  EXPECT_EQ(fx_of("rgbd_dataset_freiburg1_xyz"), 525);
  EXPECT_EQ(fx_of("rgbd_dataset_freiburg3_office"), 535.4);
}

TEST_F(RgbdOdometry, GivenIntrinsicsComeFirst) {
  WriteIcl();
  RgbdOptions options{{500, 501, 320, 240}, 1000};
  const OdometrySequence sequence = Open(options);
  EXPECT_EQ(sequence.cameras[0].camera.fy, 501);
  EXPECT_EQ(sequence.depth_levels_per_m, 1000);
  EXPECT_EQ(sequence.truth[0].pose.p, Eigen::Vector3d(1, 2, 3)) << "fy > 0: nothing is mirrored";
  options.intrinsics.pop_back();
  EXPECT_EQ(Error(options), "intrinsics: are 3 numbers, expected fx, fy, cx, cy");
  options.intrinsics = {500, 0, 320, 240};
  EXPECT_THAT(Error(options), HasSubstr("focal lengths are 500, 0 px"));
}

TEST_F(RgbdOdometry, IclNuimHasFrameNumbersAndAnAxisThatPointsUp) {
  WriteIcl();
  const OdometrySequence sequence = Open();
  EXPECT_EQ(sequence.layout, OdometryLayout::kIclNuim);
  EXPECT_EQ(Times(sequence), (std::vector<std::int64_t>{33'333'333, 66'666'666}));
  EXPECT_EQ(sequence.truth[1].time_ns, 66'666'666);
  EXPECT_EQ(sequence.cameras[0].camera.fx, 481.2);
  EXPECT_EQ(sequence.cameras[0].camera.fy, 480);
  const SE3& pose = sequence.truth[0].pose;
  const Eigen::DiagonalMatrix<double, 3> F(1, -1, 1);
  const Eigen::Quaterniond stored(0.8062257748298549, 0.1, 0.3, 0.5);
  const Eigen::Matrix3d expected = F * stored.toRotationMatrix() * F;
  EXPECT_LT((pose.R.toRotationMatrix() - expected).norm(), 1e-14);
  EXPECT_EQ(pose.p, Eigen::Vector3d(1, -2, 3));
}

TEST_F(RgbdOdometry, IclNuimTruthMayHaveItsOfficialName) {
  WriteIcl();
  fs::rename(dir_.path() / "sequence/groundtruth.txt",
             dir_.path() / "sequence/livingRoom2.gt.freiburg");
  EXPECT_EQ(Open().truth.size(), 2U);
  Write("traj.gt.freiburg", "");
  EXPECT_THAT(Error(), EndsWith("sequence: has 2 files *.gt.freiburg"));
  fs::remove(dir_.path() / "sequence/traj.gt.freiburg");
  fs::remove(dir_.path() / "sequence/livingRoom2.gt.freiburg");
  EXPECT_TRUE(Open().truth.empty());
}

TEST_F(RgbdOdometry, ReportsBadFiles) {
  WriteIcl();
  Write("associations.txt", "1 depth/1.png 1 colour/1.png\n");
  EXPECT_THAT(Error(), EndsWith("associations.txt:1: names no image in folder rgb"));
  Write("associations.txt", "1 depth/1.png 1\n");
  EXPECT_THAT(Error(), EndsWith("associations.txt:1: has 3 columns, expected 4"));
  Write("associations.txt", "1 depth/7.png 1 rgb/1.png\n");
  EXPECT_THAT(Error(), EndsWith("sequence: has no frame with all its files; 1 lack one"));
}

// ---- Any

TEST(OdometryDataset, ReportsFoldersOfNoKnownLayout) {
  const TempDir dir;
  EXPECT_EQ(OpenError(dir.path() / "none"),
            (dir.path() / "none").string() + ": folder does not exist");
  EXPECT_THAT(OpenError(dir.path()), HasSubstr(": is no sequence of a known layout"));
}

TEST(OdometryDataset, ReadsALayoutThatIsNamed) {
  const TempDir dir;
  EXPECT_THAT(
      ErrorMessage([&] { OpenOdometrySequence(dir.path(), OdometryLayout::kKittiOdometry); }),
      EndsWith("times.txt: file does not exist"));
}

// ---- TUM monocular

class TumMono : public ::testing::Test {
 protected:
  TumMono() {
    for (const char* name : {"00000", "00001", "00002"})
      WriteImage(dir_.File(std::string("mono/images/") + name + ".png"));
    dir_.Write("mono/camera.txt", "0.5 0.75 0.5 0.5 0.9\n6 4\ncrop\n6 4\n");
  }

  const TempDir dir_;
  const fs::path folder_ = dir_.path() / "mono";
};

TEST_F(TumMono, HasImagesTimesAndTruth) {
  dir_.Write("mono/times.txt", "00000 1.5 0.2\n00001 1.55 0.3\n00002 1.6 0.4\n");
  dir_.Write("mono/groundtruthSync.txt", "1.5 1 2 3 0 0 0 1\n1.55 NaN NaN NaN NaN NaN NaN NaN\n");
  const OdometrySequence sequence = OpenOdometrySequence(folder_);
  EXPECT_EQ(sequence.layout, OdometryLayout::kTumMono);
  EXPECT_EQ(sequence.name, "mono");
  EXPECT_FALSE(sequence.stereo() || sequence.has_depth());
  EXPECT_EQ(Times(sequence),
            (std::vector<std::int64_t>{1'500'000'000, 1'550'000'000, 1'600'000'000}));
  EXPECT_EQ(sequence.frames[2].left, folder_ / "images/00002.png");
  EXPECT_EQ(sequence.cameras[0].camera.omega, 0.9);
  ASSERT_EQ(sequence.truth.size(), 1U);
  EXPECT_EQ(sequence.truth[0].pose.p, Eigen::Vector3d(1, 2, 3));
}

TEST_F(TumMono, WithoutTimesHasThirtyImagesASecond) {
  EXPECT_EQ(Times(OpenOdometrySequence(folder_)),
            (std::vector<std::int64_t>{0, 33'333'333, 66'666'666}));
}

TEST_F(TumMono, NeedsImages) {
  fs::remove_all(folder_ / "images");
  EXPECT_THAT(ErrorMessage([&] { OpenOdometrySequence(folder_, OdometryLayout::kTumMono); }),
              EndsWith("images: is no folder"));
}

TEST_F(TumMono, LeavesOutTimesWithoutAnImage) {
  dir_.Write("mono/times.txt", "00001 1.55 0.3\n00007 1.6 0.4\n");
  const OdometrySequence sequence = OpenOdometrySequence(folder_);
  EXPECT_EQ(sequence.frames.size(), 1U);
  EXPECT_EQ(sequence.skipped_frames, 1);
}

void WriteChannel(const fs::path& path, const char* name, const ExrChannel& channel) {
  ExrImage image;
  image.size = channel.values.size();
  image.channels[name] = channel;
  WriteExr(path, image);
}

TEST(ReadDepth, GivesMetresAndNanWhereUnknown) {
  const TempDir dir;
  const auto png = dir.path() / "d.png";
  WritePng(png, (cv::Mat_<uint16_t>(1, 3) << 0, 5000, 65535));
  const cv::Mat1f depth = ReadDepth(png, 5000);
  EXPECT_TRUE(std::isnan(depth(0, 0)));
  EXPECT_EQ(depth(0, 1), 1);
  EXPECT_FLOAT_EQ(depth(0, 2), 13.107F);

  const auto exr = dir.path() / "d.exr";
  const cv::Mat1f z =
      (cv::Mat1f(1, 4) << 1.5F, std::numeric_limits<float>::infinity(), 0, -1);
  WriteChannel(exr, "Z", {z, ExrStorage::kFloat});
  const cv::Mat1f read = ReadDepth(exr, 5000);
  EXPECT_EQ(read(0, 0), 1.5F);
  for (int x = 1; x < 4; ++x) EXPECT_TRUE(std::isnan(read(0, x))) << x;
}

TEST(ReadDepth, ReportsWhatIsNoDepth) {
  const TempDir dir;
  const auto message = [&](const char* name, double levels) {
    return ErrorMessage([&] { ReadDepth(dir.path() / name, levels); });
  };
  WriteImage(dir.path() / "grey.png");
  EXPECT_THAT(message("grey.png", 5000),
              EndsWith("grey.png: depth has one channel of 16 bit, this image is CV_8UC1"));
  EXPECT_EQ(message("grey.png", 0), "depth_levels_per_m: is 0; it has to be positive");
  EXPECT_THAT(message("none.png", 5000), EndsWith("file does not exist"));
  WriteChannel(dir.path() / "n.exr", "N", {cv::Mat1f(1, 1, 2.F), ExrStorage::kFloat});
  EXPECT_THAT(message("n.exr", 5000), HasSubstr("n.exr"));
  WriteChannel(dir.path() / "z.exr", "Z", {cv::Mat1i(1, 1, 2), ExrStorage::kUint});
  EXPECT_THAT(message("z.exr", 5000), EndsWith("z.exr: depth is stored as integers"));
}

}  // namespace
}  // namespace sgf
