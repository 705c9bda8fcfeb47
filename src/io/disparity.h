#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

namespace sgf {

/// Largest disparity that a 16-bit PNG holds, in px.
inline constexpr double kMaxDisparityPng16 = 65535 / 256.0;

/// Reads a disparity map in px; NaN where there is no value. By the content of the file:
///   - PFM: values as stored; infinities and NaNs (unknown) become NaN;
///   - 16-bit PNG or PGM: value / 256, 0 = none (KITTI);
///   - 8-bit PNG or PGM: value / scale, 0 = none (Middlebury 2001 to 2006).
/// @param scale grey levels per px of an 8-bit map; not used for the other kinds.
/// @throws Error naming the file when it cannot be read (see ReadPfm(), ReadImage()) or has more
/// than
///   one channel, and for a scale that is not positive and finite.
cv::Mat1f ReadDisparity(const std::filesystem::path& path, double scale = 1);

/// Writes a disparity map as PFM; values that are not finite (none) become infinity.
/// @throws Error as WritePfm().
void WriteDisparityPfm(const std::filesystem::path& path, const cv::Mat1f& disparity);

/// Writes a disparity map as KITTI's 16-bit PNG: round(256 d), 0 = none. Disparities in [0, 1/512)
/// would round to "none" and are stored as 1/256 px, as KITTI's development kit does.
/// @param disparity values in [0, kMaxDisparityPng16], or not finite for none.
/// @throws Error naming file, pixel and value for a disparity outside; and as WritePng().
void WriteDisparityPng16(const std::filesystem::path& path, const cv::Mat1f& disparity);

}  // namespace sgf
