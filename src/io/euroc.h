#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <sgf/core/camera.h>
#include <sgf/core/inertial.h>
#include <sgf/core/se3.h>

/// Stereo-inertial sequences in the folder layout of the EuRoC MAV datasets (Burri et al., "The
/// EuRoC micro aerial vehicle datasets", IJRR 2016; "ASL dataset format"): mav0/ with body.yaml,
/// cam0/ and cam1/ (sensor.yaml, data.csv, data/), imu0/ (sensor.yaml, data.csv) and
/// state_groundtruth_estimate0/ (sensor.yaml, data.csv). The body frame is that of the inertial
/// sensor. Times are in nanoseconds.
namespace sgf {

/// A camera on the body.
struct EurocCamera {
  Camera camera;
  SE3 T_body_cam;
  double rate_hz = 20;
};

/// What the sensor.yaml files of a sequence state.
struct EurocSensors {
  std::vector<EurocCamera> cameras;  ///< cam0, cam1, ...
  double imu_rate_hz = 200;
  ImuNoise imu_noise;
};

/// An image of a camera.
struct EurocImage {
  std::int64_t time_ns = 0;
  std::filesystem::path file;
};

/// A sequence on disk. Images are left there; times increase within each list.
struct EurocSequence {
  EurocSensors sensors;
  std::vector<std::vector<EurocImage>> images;  ///< of each camera
  std::vector<ImuSample> imu;                   ///< empty where the sequence has no imu0
  std::vector<BodyState> truth;                 ///< empty where there is no ground truth
  bool truth_has_rates = false;  ///< `truth` has velocities and biases, not poses alone
};

/// Whether the images that a sequence lists have to be there.
enum class EurocFiles { kRequired, kMayBeMissing };

/// Reads a sequence. Ground truth is state_groundtruth_estimate0/data.csv or, where that is
/// missing, groundtruth_tum.txt beside it (poses: time in s, position, quaternion x y z w).
/// @param folder the sequence's folder or the mav0 folder in it.
/// @throws Error naming file and line: a missing file or key, no camera, a number that is none, a
///   wrong number of columns, times that do not increase, an image that is required and not there,
///   a list without rows, another camera or distortion model than pinhole and radial-tangential, a
///   rotation or quaternion that is none, an inertial sensor that is not the body frame.
EurocSequence ReadEuroc(const std::filesystem::path& folder,
                        EurocFiles files = EurocFiles::kRequired);

/// Makes the folders of a sequence and writes its body.yaml and sensor.yaml files, with ground
/// truth among the sensors. Numbers read back exactly, here and by other readers.
/// @param folder the sequence's folder, in which mav0 is made.
/// @throws Error naming what cannot be written. So do the functions below.
void WriteEurocSensors(const std::filesystem::path& folder, const EurocSensors& sensors);

/// File of an image, `folder/mav0/camN/data/TIME.png`.
std::filesystem::path EurocImagePath(const std::filesystem::path& folder, int camera,
                                     std::int64_t time_ns);

/// Writes a camera's data.csv. @param times_ns of the images, increasing.
void WriteEurocImageList(const std::filesystem::path& folder, int camera,
                         std::span<const std::int64_t> times_ns);

/// Writes imu0/data.csv. @param samples in the order of their times.
void WriteEurocImu(const std::filesystem::path& folder, std::span<const ImuSample> samples);

/// Writes state_groundtruth_estimate0/data.csv. @param states in the order of their times.
void WriteEurocTruth(const std::filesystem::path& folder, std::span<const BodyState> states);

}  // namespace sgf
