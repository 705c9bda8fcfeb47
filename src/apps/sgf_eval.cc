// Runs experiments over datasets and writes their raw scores.

#include <fmt/core.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/stereo_sweep.h>
#include <sgf/apps/trajectory_scores.h>
#include <sgf/io/stereo_dataset.h>
#include <sgf/io/stereo_layouts.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

struct DataArguments {
  std::string layouts = "datasets/stereo_layouts.yaml";
  std::string data;
  std::string generated = "datasets/generated";
};

void AddDataArguments(CLI::App& app, DataArguments& data) {
  app.add_option("--layouts", data.layouts, "list of known stereo datasets")->capture_default_str();
  app.add_option("--data", data.data, "folder with downloaded datasets")->envname("SGF_DATA");
  app.add_option("--generated", data.generated, "folder with datasets made from packages")
      ->capture_default_str();
}

std::optional<fs::path> Find(const StereoDatasetEntry& entry, const DataArguments& data) {
  const std::string& root = entry.generated ? data.generated : data.data;
  return root.empty() ? std::nullopt : FindDataset(entry, root);
}

void ListDatasets(const DataArguments& data) {
  for (const StereoDatasetEntry& entry : ReadStereoLayouts(data.layouts))
    if (const auto folder = Find(entry, data))
      fmt::print("{}\t{}\t{}\n", entry.name, folder->string(),
                 ListStereoScenes(*folder, entry.layout).size());
}

void SweepDataset(const DataArguments& data, const StereoSweepRequest& request) {
  for (const StereoDatasetEntry& entry : ReadStereoLayouts(data.layouts)) {
    if (entry.name != request.dataset) continue;
    const auto folder = Find(entry, data);
    if (!folder) throw Error(request.dataset, "is not in the data folders");
    return RunStereoSweep(request, entry, *folder);
  }
  throw Error(data.layouts, fmt::format("has no dataset '{}'", request.dataset));
}

// The subcommand `trajectory`: its arguments, and what runs it.
struct TrajectoryCommand {
  explicit TrajectoryCommand(CLI::App& parent)
      : app(*parent.add_subcommand("trajectory", "score a trajectory against ground truth")),
        flags(app, request.options, {}) {
    app.add_option("estimate", request.estimate, "TUM file: time_s tx ty tz qx qy qz qw")
        ->required();
    CLI::Option_group& truth = *app.add_option_group("ground truth");
    truth.add_option("--sequence", request.sequence,
                     "folder of a sequence, which also tells the frames and the camera's place");
    truth.add_option("--truth", request.truth, "TUM file with poses of the estimate's frame");
    truth.require_option(1);
    app.add_option("--common", request.common,
                   "TUM files of other estimates: compare only poses at times that all have");
    app.add_option("--covariances", request.covariances,
                   "covariances.csv of sgf_vio: how well the errors agree with it");
    app.add_option("--out", request.output, "file to write: *.json, or else CSV");
    app.add_option("--aligned", request.aligned,
                   "TUM file to write: poses of the body in the world of the ground truth");
    CLI::Option& points =
        *app.add_option("--points", request.points,
                        "PLY file as sgf_direct writes it, to be moved as the estimate");
    CLI::Option& aligned_points =
        *app.add_option("--aligned-points", request.aligned_points,
                        "PLY file to write: these points in the world of the ground truth");
    points.needs(&aligned_points);
    aligned_points.needs(&points);
  }

  void Run() {
    flags.Apply(request.options);
    if (request.sequence.empty() && flags.Given().contains("frame"))
      throw Error("--frame",
                  "needs --sequence: poses in --truth are those of the estimate's frame");
    ScoreTrajectoryFile(request);
  }

  TrajectoryScoreRequest request;
  CLI::App& app;
  OptionFlags flags;
};

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  CLI::App app("Runs experiments over datasets and writes their raw scores.", "sgf_eval");
  app.require_subcommand(1);
  apps::DataArguments data;
  apps::StereoSweepRequest request;

  CLI::App* datasets = app.add_subcommand(
      "datasets", "print name, folder and number of scenes of the datasets at hand");
  apps::AddDataArguments(*datasets, data);

  CLI::App* stereo =
      app.add_subcommand("stereo", "score one column of a stereo sweep on all scenes of a dataset");
  apps::AddDataArguments(*stereo, data);
  stereo->add_option("--experiment", request.experiment, "YAML file of the sweep")->required();
  stereo->add_option("--dataset", request.dataset, "name in the list of --layouts")->required();
  stereo->add_option("--column", request.column, "name in the sweep")->required();
  stereo->add_option("--out", request.output, "CSV file to write")->required();
  stereo->add_option("--options-out", request.options_output, "YAML file for every parameter");
  stereo->add_option("--window", request.window, "only this window of the sweep, px; 0 for all")
      ->capture_default_str();
  CLI::Option* changes = stereo->add_option("--changes", request.changes,
                                            "YAML file with changes of the right images");
  stereo->add_option("--change", request.change, "name in that file of the change to make")
      ->needs(changes);
  stereo->add_option("--threads", request.threads, "threads; 0 for all cores")
      ->capture_default_str();

  apps::TrajectoryCommand trajectory(app);

  CLI::App* build =
      app.add_subcommand("build", "print what was built and the instruction set it runs on here");

  return apps::RunTool(app, argc, argv, [&] {
    if (*datasets) apps::ListDatasets(data);
    if (*stereo) apps::SweepDataset(data, request);
    if (*build) fmt::print("{}\n", YAML::Dump(apps::DescribeBuild()));
    if (trajectory.app) trajectory.Run();
  });
}
