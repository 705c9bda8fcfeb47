
#include <fmt/core.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/stereo_method.h>
#include <sgf/apps/stereo_sweep.h>
#include <sgf/eval/disparity.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>
#include <sgf/io/stereo_dataset.h>

namespace sgf::apps {
namespace {

struct Grid {
  std::vector<int> windows;
  std::vector<double> uniqueness;

  template <class V>
  void VisitFields(V&& visit) {
    visit("windows", windows, "px", "sides of the matching window");
    visit("uniqueness", uniqueness, "%", "uniqueness thresholds");
  }
};

struct Sweep {
  std::string matcher;
  YAML::Node columns, num_disparities, options;
  Grid grid;
};

Sweep ReadSweep(const std::string& file) {
  const YAML::Node root = LoadYamlFile(file);
  if (!root.IsMap()) throw Error(file, "expected a map");
  for (const char* key : {"name", "matcher", "columns", "grid"})
    if (!root[key]) throw Error(file, fmt::format("key '{}' is missing", key));
  static const std::set<std::string> kKnown{"name", "matcher",         "columns",
                                            "grid", "num_disparities", "options"};
  for (const auto& entry : root)
    if (const auto key = entry.first.as<std::string>(); !kKnown.contains(key))
      throw Error(options_internal::At(file, entry.first), fmt::format("unknown key '{}'", key));
  Sweep sweep{root["matcher"].as<std::string>(),
              root["columns"],
              root["num_disparities"],
              root["options"],
              {}};
  ReadOptions(root["grid"], sweep.grid, file);
  if (sweep.grid.windows.empty() || sweep.grid.uniqueness.empty())
    throw Error(file, "grid needs at least one window and one uniqueness");
  return sweep;
}

struct Column {
  std::string implementation = "block_matcher";
  stereo::BlockMatcherOptions options;
  bool extra = false;  // for the tables

  template <class V>
  void VisitFields(V&& visit) {
    visit("implementation", implementation, "", "block_matcher or opencv_bm");
    visit("options", options, "", "options of the matcher, on top of the sweep's");
    visit("extra", extra, "", "not a column of the paper");
  }
};

Column ReadColumn(const Sweep& sweep, const StereoSweepRequest& request) {
  const YAML::Node node = sweep.columns[request.column];
  if (!node) throw Error(request.experiment, fmt::format("has no column '{}'", request.column));
  Column column;
  ReadOptions(sweep.options, column.options, request.experiment);
  ReadOptions(node, column, request.experiment);
  column.options.threads = request.threads;
  return column;
}

int NumDisparities(const Sweep& sweep, const StereoSweepRequest& request, const StereoPair& pair) {
  if (pair.num_disparities > 0) return pair.num_disparities;
  const YAML::Node node =
      sweep.num_disparities ? sweep.num_disparities[request.dataset] : YAML::Node();
  if (!node || !node.IsDefined())
    throw Error(request.experiment,
                fmt::format("num_disparities of {} is missing, and scene {} does not state it",
                            request.dataset, pair.name));
  return node.as<int>();
}

// The CSV lines of one scene and window.
std::string ScoreWindow(const Sweep& sweep, const StereoSweepRequest& request,
                        const StereoPair& pair, StereoMethod& method, int window) {
  std::string lines;
  method.SetPair(ToGrey(pair.left), ToGrey(pair.right));
  for (const double uniqueness : sweep.grid.uniqueness) {
    const cv::Mat1f disparity = method.Disparity(uniqueness);
    for (const auto& [region, truth] :
         {std::pair{"all", pair.truth_all}, std::pair{"noc", pair.truth_noc}}) {
      if (truth.empty()) continue;
      const DisparityScores s = ScoreDisparity(disparity, truth);
      lines += fmt::format("{},{},{},{},{},{},{},{},{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f}\n",
                           request.dataset, pair.name, region, sweep.matcher, request.column,
                           window, uniqueness, s.truth_px, s.matched_px, s.mean_px, s.bad1_pct,
                           s.bad2_pct, s.bad4_pct, s.d1_pct, s.invalid_pct);
    }
  }
  return lines;
}

void RunSweep(const StereoSweepRequest& request, const CatalogueEntry& entry,
              const std::filesystem::path& folder) {
  const Sweep sweep = ReadSweep(request.experiment);
  Column column = ReadColumn(sweep, request);
  std::string table =
      "dataset,scene,region,matcher,column,window,uniqueness,truth_px,matched_px,mean_px,"
      "bad1_pct,bad2_pct,bad4_pct,d1_pct,invalid_pct\n";
  YAML::Node resolved;  // "options" are those of the first scene and window
  resolved["implementation"] = column.implementation;
  resolved["windows"] = sweep.grid.windows;
  resolved["uniqueness"] = sweep.grid.uniqueness;
  for (const StereoScene& scene : ListStereoScenes(folder, entry.layout)) {
    const StereoPair pair = LoadStereoScene(scene);
    column.options.num_disparities = NumDisparities(sweep, request, pair);
    for (const int window : sweep.grid.windows) {
      column.options.window = window;
      const auto method = MakeStereoMethod(column.implementation, column.options);
      if (!resolved["options"]) resolved["options"] = method->Options();
      table += ScoreWindow(sweep, request, pair, *method, window);
    }
    resolved["num_disparities"][pair.name] = column.options.num_disparities;
  }
  AtomicFile file(request.output);
  file.Write(table);
  file.Commit();
  if (request.options_output.empty()) return;
  AtomicFile options(request.options_output);
  options.Write(YAML::Dump(resolved) + "\n");
  options.Commit();
}

}  // namespace

void RunStereoSweep(const StereoSweepRequest& request, const CatalogueEntry& entry,
                    const std::filesystem::path& folder) {
  try {
    RunSweep(request, entry, folder);
  } catch (const YAML::Exception& error) {  // a value of the wrong kind
    throw Error(fmt::format("{}:{}", request.experiment, error.mark.line + 1), error.msg);
  }
}

}  // namespace sgf::apps
