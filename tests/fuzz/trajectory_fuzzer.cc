#include <sgf/io/trajectory.h>

#include "fuzz/fuzz_input.h"

// Trajectories in TUM's format, and covariances of states.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto file = sgf::InputFile(sgf::InputText(data, size));
  sgf::Loads([&] { sgf::ReadTrajectory(file); });
  sgf::Loads([&] { sgf::ReadPoseCovariances(file); });
  return 0;
}
