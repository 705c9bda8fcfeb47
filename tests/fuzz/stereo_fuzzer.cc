#include <vector>

#include <sgf/io/stereo_dataset.h>

#include "fuzz/fuzz_input.h"

namespace {

void LoadAs(sgf::StereoLayout layout, const std::filesystem::path& folder) {
  std::vector<sgf::StereoScene> scenes;
  sgf::Loads([&] { scenes = sgf::ListStereoScenes(folder, layout); });
  for (const sgf::StereoScene& scene : scenes) sgf::Loads([&] { sgf::LoadStereoScene(scene); });
}

}  // namespace

// The input is the folder of a dataset, listed and loaded as each of the layouts.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const sgf::InputFolder folder(sgf::InputText(data, size));
  for (const auto& [name, layout] : EnumNames(sgf::StereoLayout())) LoadAs(layout, folder / "");
  sgf::Loads([&] { sgf::FindMiddleburyScene(folder / "scene"); });
  return 0;
}
