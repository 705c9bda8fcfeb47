#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/inertial.h>
#include <sgf/core/timed_pose.h>
#include <sgf/io/euroc.h>

/// Sequences for visual odometry, whatever their layout on disk.
namespace sgf {

/// How a sequence lies on disk.
enum class OdometryLayout {
  /// EuRoC MAV (see euroc.h): raw stereo images, inertial sensor, truth of the body. Rendered
  /// sequences have it too.
  kEuroc,
  /// KITTI odometry: dataset/sequences/NN with image_0, image_1, calib.txt and times.txt; truth of
  /// the left camera in dataset/poses/NN.txt. Rectified grey stereo images, no inertial sensor.
  kKittiOdometry,
  /// TUM RGB-D: rgb/ and depth/ with associations.txt or, as downloaded, rgb.txt and depth.txt,
  /// which are then paired by the nearest time within 20 ms; truth of the camera in
  /// groundtruth.txt. Times are those of the colour images.
  kTumRgbd,
  /// ICL-NUIM in TUM's form: associations.txt with frame numbers for times, at 30 Hz (frame n is at
  /// n/30 s); truth in groundtruth.txt or a single file *.gt.freiburg, by frame number too.
  kIclNuim,
  /// TUM's monocular benchmark, and any folder as DSO takes it: images/ with a file per frame,
  /// camera.txt and, if there, times.txt (see dso_calibration.h; without it frames are 1/30 s
  /// apart); truth of the camera in groundtruthSync.txt, where lines with NaN do not count.
  kTumMono,
};
std::span<const std::pair<const char*, OdometryLayout>> EnumNames(OdometryLayout);

/// A frame of a sequence: files of a stereo pair, of a grey (or colour) image with its depth, or of
/// an image alone.
struct OdometryFrame {
  std::int64_t time_ns = 0;
  std::filesystem::path left;   ///< the left or only image; ReadGrey() reads it
  std::filesystem::path right;  ///< the right image; empty where there is one camera
  std::filesystem::path depth;  ///< ReadDepth() reads it; empty where there is none
};

/// A sequence on disk. Images are left there.
struct OdometrySequence {
  std::string name;  ///< of its folder
  OdometryLayout layout = OdometryLayout::kEuroc;
  /// Left and right camera, or the only one. The body is the inertial sensor in EuRoC's layout and
  /// the left (or only) camera in the others.
  std::vector<EurocCamera> cameras;
  std::vector<OdometryFrame> frames;  ///< times increase; never none
  int skipped_frames = 0;             ///< left out since one of their files is missing
  std::vector<ImuSample> imu;         ///< in body coordinates; empty where there is no sensor
  ImuNoise imu_noise = {};            ///< of that sensor
  std::vector<TimedPose> truth;       ///< T_world_body; empty where there is none
  double depth_levels_per_m = 5000;   ///< of 16-bit depth images

  bool stereo() const { return cameras.size() == 2; }
  bool has_depth() const { return !frames.front().depth.empty(); }
};

/// What the files of RGB-D sequences do not say.
struct RgbdOptions {
  /// fx, fy, cx, cy (px); none for the layout's own. Those are for ICL-NUIM 481.2, -480, 319.5,
  /// 239.5; for TUM, by a folder name with "freiburg3" 535.4, 539.2, 320.1, 247.6 and else the ROS
  /// defaults 525, 525, 319.5, 239.5, which TUM recommends without undistortion for the others.
  std::vector<double> intrinsics;
  double depth_levels_per_m = 5000;

  template <class V>
  void VisitFields(V&& visit) {
    visit("intrinsics", intrinsics, "px",
          "fx, fy, cx, cy of an RGB-D camera; empty for those of its layout");
    visit("depth_levels_per_m", depth_levels_per_m, "1/m", "levels of 16-bit depth images");
  }
};

/// Reads all but the images of a sequence.
///
/// A negative fy, as ICL-NUIM has, says that the camera's y axis points up: its coordinates, and
/// the world of its ground truth, are left-handed. Both are mirrored along y here, F T F with
/// F = diag(1, -1, 1, 1), so that the camera has a positive fy and truth is right-handed. Images
/// stay as they are.
/// @param layout found by looking into the folder where none is given.
/// @throws Error naming file and line, or the folder: a layout that cannot be told, a missing or
///   damaged file, times that do not increase, a number of poses other than that of times (KITTI),
///   cameras that are no stereo pair, no frame with all its files.
OdometrySequence OpenOdometrySequence(const std::filesystem::path& folder,
                                      std::optional<OdometryLayout> layout = std::nullopt,
                                      const RgbdOptions& rgbd = {});

/// Reads a depth image: 16-bit PNG, or channel Z of a file *.exr as rendered sequences have it (m).
/// @param levels_per_m of a PNG, whose level 0 is "unknown".
/// @return depth along the optical axis in m; NaN where unknown.
/// @throws Error as ReadImage() or ReadExr(); for another type of image, and for levels_per_m not
///   positive.
cv::Mat1f ReadDepth(const std::filesystem::path& path, double levels_per_m);

}  // namespace sgf
