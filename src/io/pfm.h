#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

namespace sgf {

/// Reads a one-channel portable float map ("Pf"), top row first.
///
/// The file holds its rows bottom up; the sign of its scale field tells the byte order (negative:
/// little endian). The magnitude of the scale is ignored and values are taken as stored, which is
/// Middlebury's convention: its quarter-size ground truth carries a scale of -0.003922 and
/// disparities in pixels, where OpenCV's reader would multiply them by 255. Infinities and NaNs are
/// kept.
/// @throws Error naming the file when it is missing, a colour map ("PF") or no PFM, has a size that
///   is not positive, a zero or non-finite scale, or more or fewer bytes than its size asks for.
cv::Mat1f ReadPfm(const std::filesystem::path& path);

/// Writes a one-channel portable float map: little endian, scale -1; the file appears complete or
/// not at all.
/// @throws Error naming the file for an empty image or a file that cannot be written.
void WritePfm(const std::filesystem::path& path, const cv::Mat1f& image);

}  // namespace sgf
