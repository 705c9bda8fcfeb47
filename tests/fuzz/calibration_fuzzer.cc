#include <sgf/io/calib.h>
#include <sgf/io/dso_calibration.h>

#include "fuzz/fuzz_input.h"

// Middlebury's calib.txt and DSO's camera.txt, pcalib.txt and times.txt.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto file = sgf::InputFile(sgf::InputText(data, size));
  sgf::Loads([&] { sgf::ReadMiddleburyCalib(file); });
  sgf::Loads([&] { sgf::ReadCalibNdisp(file); });
  sgf::Loads([&] { sgf::ReadCameraTxt(file); });
  sgf::Loads([&] { sgf::ReadPcalib(file); });
  sgf::Loads([&] { sgf::ReadFrameTimes(file); });
  return 0;
}
