#include <optional>

#include <sgf/io/euroc.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>

#include "fuzz/fuzz_input.h"

namespace {

void OpenAs(std::optional<sgf::OdometryLayout> layout, const std::filesystem::path& folder) {
  sgf::Loads([&] {
    const sgf::OdometrySequence sequence = sgf::OpenOdometrySequence(folder, layout);
    const sgf::OdometryFrame& frame = sequence.frames.front();
    sgf::ReadGrey(frame.left);
    if (sequence.has_depth()) sgf::ReadDepth(frame.depth, sequence.depth_levels_per_m);
  });
}

}  // namespace

// The input is a folder that has the sequence in sequences/00, where KITTI's lie, opened as what it
// looks like and as each of the layouts.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const sgf::InputFolder folder(sgf::InputText(data, size));
  const auto sequence = folder / "sequences/00";
  OpenAs(std::nullopt, sequence);
  for (const auto& [name, layout] : EnumNames(sgf::OdometryLayout())) OpenAs(layout, sequence);
  sgf::Loads([&] { sgf::ReadEuroc(sequence); });
  return 0;
}
