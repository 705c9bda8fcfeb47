#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include <sgf/core/options.h>
#include <sgf/synth/sequence.h>
#include <sgf/synth/stereo_pair.h>

#include "fuzz/fuzz_input.h"

namespace {

namespace synth = sgf::synth;

struct Pairs {
  std::vector<synth::PairOptions> pairs;

  template <class V>
  void VisitFields(V&& visit) {
    visit("pairs", pairs, "", "");
  }
};

void ReadPairs(const YAML::Node& node) {
  Pairs list;
  sgf::ReadOptions(node, list, "input");
  YAML::Dump(sgf::WriteOptions(list));
}

void ReadRecipe(const YAML::Node& node) {
  synth::SequenceRecipe recipe;
  sgf::ReadOptions(node, recipe, "input");
  YAML::Dump(sgf::WriteOptions(recipe));
  synth::CheckRecipe(recipe);
  for (const auto version : {synth::SequenceVersion::kShort, synth::SequenceVersion::kFull,
                             synth::SequenceVersion::kPreview})
    synth::Estimate(recipe, version, true);
  sgf::Loads([&] { synth::CameraResponse(recipe.photometry.response); });
  const auto trajectory = synth::MakeTrajectory(recipe.trajectory, {});
  synth::SimulateImu(trajectory, 0, 0.05, recipe.imu, 0);
}

}  // namespace

// Options of all kinds that there are: the recipes of rendered pairs and sequences.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  YAML::Node node;
  try {
    node = YAML::Load(std::string(sgf::InputText(data, size)));
  } catch (const YAML::Exception&) {  // as LoadYamlFile() of the programs
    return 0;
  }
  sgf::Loads([&] { ReadPairs(node); });
  sgf::Loads([&] { ReadRecipe(node); });
  return 0;
}
