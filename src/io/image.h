#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

namespace sgf {

/// Reads a PNG, JPEG or binary PGM or PPM image.
/// @param imread_flags cv::ImreadModes; cv::IMREAD_ANYCOLOR gives 8-bit BGR or grey as stored,
///   cv::IMREAD_UNCHANGED also keeps 16-bit values and an alpha plane.
/// @throws Error naming the file when it is missing, of another format, truncated or corrupt: never
///   a partly filled image (see RequireCompleteImage() for the limit of this with JPEG).
cv::Mat ReadImage(const std::filesystem::path& path, int imread_flags);

/// An 8-bit grey or BGR image as grey levels, by the luma weights of ITU-R BT.601
/// (cv::COLOR_BGR2GRAY). A grey image is returned as it is.
cv::Mat1b ToGrey(const cv::Mat& image);

/// Reads an image as 8-bit grey levels. Colour is converted after decoding, by ToGrey(), so that
/// every file format gives the same grey levels.
/// @throws Error as ReadImage().
cv::Mat1b ReadGrey(const std::filesystem::path& path);

/// Writes an 8-bit or 16-bit image of one, three (BGR) or four (BGRA) channels; the file appears
/// complete or not at all.
/// @throws Error naming the file for another type, an empty image or a file that cannot be written.
void WritePng(const std::filesystem::path& path, const cv::Mat& image);

}  // namespace sgf
