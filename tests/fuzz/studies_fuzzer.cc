#include <string>

#include <CLI/CLI.hpp>

#include <sgf/apps/cli.h>
#include <sgf/apps/convergence.h>
#include <sgf/apps/self_match.h>
#include <sgf/apps/semi_dense.h>
#include <sgf/apps/sequence_change.h>
#include <sgf/apps/shift_profile.h>
#include <sgf/apps/stereo_sweep.h>

#include "fuzz/fuzz_input.h"

namespace {

namespace apps = sgf::apps;

// As with --config FILE.
void ReadConfig(const std::string& file) {
  apps::SequenceChange change;
  CLI::App app;
  const apps::OptionFlags flags(app, change, {});
  app.parse("program --config " + file, true);
  flags.Given();
  flags.Apply(change);
  CheckChange(change);
}

}  // namespace

// What the programs read of an experiment and of their options. The images of the studies are
// missing, which ends them when all else was read.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string file = sgf::InputFile(sgf::InputText(data, size)), missing = file + ".missing";
  sgf::Loads([&] { apps::RunStereoSweep({file, "d", "c", missing, "", file, "x"}, {}, missing); });
  sgf::Loads([&] { apps::RunStereoSweep({file, "d", "c", missing, "", "", ""}, {}, missing); });
  sgf::Loads([&] { apps::RunSelfMatch({file, missing, "image", missing, "", 1}); });
  sgf::Loads([&] { apps::RunConvergence({file, {missing}, missing, 1}); });
  sgf::Loads([&] { apps::RunSemiDense({file, missing, missing, 1}); });
  sgf::Loads([&] { apps::ReadShiftStudy(file); });
  sgf::Loads([&] { ReadConfig(file); });
  return 0;
}
