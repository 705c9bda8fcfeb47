#include <sgf/io/disparity.h>
#include <sgf/io/pfm.h>
#include <sgf/io/ply.h>

#include "fuzz/fuzz_input.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto file = sgf::InputFile(sgf::InputText(data, size));
  sgf::Loads([&] { sgf::ReadPfm(file); });
  sgf::Loads([&] { sgf::ReadDisparity(file); });
  sgf::Loads([&] { sgf::ReadPointsPly(file); });
  return 0;
}
