#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/camera.h>

/// Files of a calibration as DSO reads them (Engel, Usenko and Cremers, "A
/// photometrically calibrated benchmark for monocular visual odometry", 2016;
/// https://github.com/JakobEngel/dso). An image I = G(t V B) of irradiance B, exposure time t and
/// vignette V is corrected by t B = G^-1(I) / V.
namespace sgf {

/// Levels of the images that pcalib.txt is for.
inline constexpr int kPcalibLevels = 256;

/// Writes pcalib.txt: one line with G^-1 at all 256 levels.
/// @param inverse_response irradiance of each level, strictly increasing from 0 at the first to 1
/// at
///   the last; the file has 0 to 255.
/// @throws Error naming the file for another number of values, values that do not increase, or a
/// file
///   that cannot be written.
void WritePcalib(const std::filesystem::path& path, const std::vector<double>& inverse_response);

/// Reads pcalib.txt, scaled and shifted to run from 0 to 1, as DSO does.
/// @throws Error naming file and line for a missing file, what is not a number, a number of values
///   other than 256, values that are not strictly increasing, and more than one line.
std::vector<double> ReadPcalib(const std::filesystem::path& path);

/// Writes vignette.png: 16 bit, grey, 65535 for V = 1.
/// @param vignette V in (0, 1] at every pixel.
/// @throws Error naming the file for an empty image, for V that is not in (0, 1] or would round to
///   0, and for a file that cannot be written.
void WriteVignette(const std::filesystem::path& path, const cv::Mat1f& vignette);

/// Reads vignette.png: V in (0, 1].
/// @throws Error naming the file when it is no complete 16-bit grey PNG or is 0 somewhere.
cv::Mat1f ReadVignette(const std::filesystem::path& path);

/// Reads the camera of camera.txt: "fx fy cx cy omega", or these names and numbers: "Pinhole fx fy
/// cx cy 0", "FOV fx fy cx cy omega", "RadTan fx fy cx cy k1 k2 p1 p2"; then a line with width and
/// height. Focal lengths and centre are shares of these sizes where the centre is below 1, as TUM's
/// are (the image's upper left corner is (0, 0) then). Further lines, on the images DSO makes, do not
/// count.
/// @throws Error naming file and line for a missing file, another model, what is no number, and as
///   Camera::Check().
Camera ReadCameraTxt(const std::filesystem::path& path);

/// A line of times.txt.
struct FrameTime {
  std::string id;          ///< name or number of the image; digits
  int64_t time_ns = 0;     ///< not negative; in the file in seconds
  double exposure_ms = 0;  ///< positive

  bool operator==(const FrameTime&) const = default;
};

/// Writes times.txt: a line "id seconds milliseconds" per image.
/// @throws Error naming the file for an id, time or exposure out of range, times that do not
/// increase,
///   or a file that cannot be written.
void WriteFrameTimes(const std::filesystem::path& path, const std::vector<FrameTime>& times);

/// Reads times.txt. What WriteFrameTimes() wrote reads back exactly.
/// @throws Error naming file and line for a missing file, another number of fields, a time of more
///   than nine decimals, and what WriteFrameTimes() refuses.
std::vector<FrameTime> ReadFrameTimes(const std::filesystem::path& path);

}  // namespace sgf
