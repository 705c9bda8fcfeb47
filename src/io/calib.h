#pragma once

#include <filesystem>

namespace sgf {

/// Reads the number of disparities to search, `ndisp`, from a Middlebury calib.txt: lines of
/// key=value (Middlebury 2014 stereo datasets, "Calibration file format").
/// @throws Error naming file and line for a line without '=' or an ndisp that is not a positive
///   number, and file and key when there is no ndisp.
int ReadCalibNdisp(const std::filesystem::path& path);

}  // namespace sgf
