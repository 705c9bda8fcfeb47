#include <sgf/io/exr.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/synth/frame_exr.h>

#include "fuzz/fuzz_input.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto file = sgf::InputFile(sgf::InputText(data, size), "input.exr");
  sgf::ExrImage image;
  if (!sgf::Loads([&] { image = sgf::ReadExr(file); })) return 0;
  sgf::Loads([&] { sgf::synth::FromExr(image, file.string()); });
  sgf::Loads([&] { sgf::ReadDepth(file, 1); });
  return 0;
}
