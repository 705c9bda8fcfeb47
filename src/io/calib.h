#pragma once

#include <filesystem>

namespace sgf {

/// Calibration of a rectified pair as Middlebury's calib.txt states it: two pinhole cameras that
/// differ in their principal points' columns only.
struct MiddleburyCalib {
  double f = 0;           ///< focal length of both cameras, px
  double cx = 0, cy = 0;  ///< principal point of the left camera, px
  double doffs = 0;       ///< right cx minus left cx, px
  double baseline_m = 0;  ///< m; the file has mm
  int width = 0;          ///< px
  int height = 0;         ///< px
  int ndisp = 0;          ///< disparities to search

  /// Depth (m, along the optical axis) of a disparity (px) above -doffs.
  double Depth(double disparity) const { return f * baseline_m / (disparity + doffs); }
};

/// Reads a Middlebury calib.txt (Middlebury 2014 stereo datasets, "Calibration file format"); keys
/// that MiddleburyCalib does not have are not looked at.
/// @throws Error as ReadCalibNdisp(), and naming file, key and value for a value that is missing or
///   makes no sense: focal length, baseline and sizes must be positive, pixels square.
MiddleburyCalib ReadMiddleburyCalib(const std::filesystem::path& path);

/// Reads the number of disparities to search, `ndisp`, from a Middlebury calib.txt: lines of
/// key=value (Middlebury 2014 stereo datasets, "Calibration file format").
/// @throws Error naming file and line for a line without '=' or an ndisp that is not a positive
///   number, and file and key when there is no ndisp.
int ReadCalibNdisp(const std::filesystem::path& path);

}  // namespace sgf
