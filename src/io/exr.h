#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

namespace sgf {

/// How a file stores the values of a channel.
enum class ExrStorage {
  kHalf,   ///< 16-bit float: 11 significant bits, magnitude up to 65504 or infinite
  kFloat,  ///< 32-bit float
  kUint,   ///< 32-bit integer; values of at least 2^31 have no place in a matrix and are refused
};

/// One channel of an image.
struct ExrChannel {
  cv::Mat values;  ///< of the image's size; CV_32FC1 for kHalf and kFloat, CV_32SC1 for kUint
  ExrStorage storage = ExrStorage::kHalf;
};

/// An image with named channels, and the camera that took it. A channel of a layer is named
/// "layer.suffix", such as "N.X" or "light.lamp.R".
struct ExrImage {
  cv::Size size;  ///< px
  std::map<std::string, ExrChannel> channels;
  std::map<std::string, std::string> attributes = {};  ///< text in the header, by name
  std::optional<Camera> camera;
  std::optional<SE3> T_world_cam;  ///< pose of the camera (x right, y down, z forward), m
};

/// Writes an OpenEXR file: one part, scan lines, ZIP compression. Equal images give equal bytes.
/// The file appears whole or not at all. Camera and pose go into the header as text that reads back
/// exactly (`cameraModel`, `intrinsics`: fx fy cx cy, `distortion`: k1 k2 p1 p2, `worldFromCamera`:
/// px py pz qx qy qz qw), the pose also as OpenEXR's standard attribute `worldToCamera` (row
/// vectors; y up).
/// @throws Error naming the file: no channel, a channel of another size or type, a finite value
///   beyond the range of its storage, a name that OpenEXR does not take, a file not writable.
void WriteExr(const std::filesystem::path& path, const ExrImage& image);

/// Reads an OpenEXR file of one part in scan lines, all channels, with any compression. Header
/// attributes that are not text are left out, but for those of WriteExr.
/// @throws Error naming the file: missing, no OpenEXR file, truncated or damaged, tiled, deep or of
///   several parts, a part of a larger image, sub-sampled channels.
ExrImage ReadExr(const std::filesystem::path& path);

/// @param where what error messages call the image: its path.
/// @throws Error naming the first of the channels that the image does not have, and those it has.
void RequireChannels(const ExrImage& image, const std::vector<std::string>& names,
                     const std::string& where);

/// Puts a layer of three channels into an image, which takes on its size when it has no channel
/// yet; "" names the layer of the channels without a dot.
/// @param suffixes names of the planes in the layer, a letter each: "RGB" or "XYZ".
void SetLayer(ExrImage& image, const std::string& layer, const cv::Mat3f& planes,
              std::string_view suffixes = "RGB", ExrStorage storage = ExrStorage::kHalf);

/// The inverse of SetLayer.
/// @throws Error as RequireChannels; for a channel that is not of floating-point numbers.
cv::Mat3f GetLayer(const ExrImage& image, const std::string& layer, const std::string& where,
                   std::string_view suffixes = "RGB");

}  // namespace sgf
