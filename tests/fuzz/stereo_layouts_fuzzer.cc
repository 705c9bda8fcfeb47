#include <sgf/io/stereo_layouts.h>

#include "fuzz/fuzz_input.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto file = sgf::InputFile(sgf::InputText(data, size));
  sgf::Loads([&] {
    for (const sgf::StereoDatasetEntry& entry : sgf::ReadStereoLayouts(file))
      sgf::FindDataset(entry, file.parent_path());
  });
  return 0;
}
