#include <algorithm>
#include <optional>
#include <type_traits>

#include <fmt/core.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/image_change.h>
#include <sgf/apps/stereo_method.h>
#include <sgf/apps/stereo_sweep.h>
#include <sgf/eval/disparity.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/stereo_dataset.h>
#include <sgf/stereo/refine.h>

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

struct ColumnFields {
  std::string implementation = "bm";
  YAML::Node options;
  bool fill = false;
  bool extra = false;  // for the tables

  template <class V>
  void VisitFields(V&& visit) {
    visit("implementation", implementation, "", "name of a stereo method");
    visit("options", options, "", "options of the method, on top of the sweep's if it is ours");
    visit("fill", fill, "", "fill holes of the disparity maps before they are scored");
    visit("extra", extra, "", "not a column of the paper");
  }
};

struct Column {
  StereoOptions options;
  bool fill;
};

Column ReadColumn(const Sweep& sweep, const StereoSweepRequest& request) {
  const YAML::Node node = sweep.columns[request.column];
  if (!node) throw Error(request.experiment, fmt::format("has no column '{}'", request.column));
  ColumnFields fields;
  ReadOptions(node, fields, request.experiment);
  Column column{DefaultStereoOptions(fields.implementation), fields.fill};
  const auto read = [&](auto& options) {
    constexpr bool kOpenCv = std::is_base_of_v<OpenCvOptions, std::decay_t<decltype(options)>>;
    if (!kOpenCv) ReadOptions(sweep.options, options, request.experiment);
    ReadOptions(fields.options, options, request.experiment);
    options.threads = request.threads;
  };
  std::visit(read, column.options);
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

// What is done to the right images, if anything.
std::optional<ImageChange> ReadChange(const StereoSweepRequest& request) {
  if (request.change.empty()) return {};
  const YAML::Node root = LoadYamlFile(request.changes);
  if (!root.IsMap() || !root["changes"] || !root["changes"].IsMap())
    throw Error(request.changes, "expected a map with a map 'changes'");
  const YAML::Node node = root["changes"][request.change];
  if (!node) throw Error(request.changes, fmt::format("has no change '{}'", request.change));
  ImageChange change;
  ReadOptions(node, change, request.changes);
  if (!change.quantise)
    throw Error(request.changes, "quantise must be true: stereo methods take 8-bit images");
  return change;
}

StereoPair LoadPair(const StereoScene& scene, const std::optional<ImageChange>& change) {
  constexpr uint64_t kNoiseSeed = 1;
  StereoPair pair = LoadStereoScene(scene);
  if (change) pair.right = ApplyChange(pair.right, *change, kNoiseSeed);
  return pair;
}

// The grid's windows that are asked for.
std::vector<int> Windows(const Sweep& sweep, const StereoSweepRequest& request) {
  const std::vector<int>& windows = sweep.grid.windows;
  if (request.window == 0) return windows;
  if (std::find(windows.begin(), windows.end(), request.window) == windows.end())
    throw Error(request.experiment, fmt::format("has no window {} in its grid", request.window));
  return {request.window};
}

// The CSV lines of one scene and window.
std::string ScoreWindow(const Sweep& sweep, const StereoSweepRequest& request,
                        const StereoPair& pair, bool fill, StereoMethod& method, int window) {
  std::string lines;
  method.SetPair(pair.left, pair.right);
  for (const double uniqueness : sweep.grid.uniqueness) {
    cv::Mat1f disparity = method.Disparity(uniqueness);
    if (fill) stereo::FillHoles(disparity);
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

void SetPairOptions(StereoOptions& options, int num_disparities, int window) {
  const auto set = [&](auto& o) {
    o.num_disparities = num_disparities;
    o.window = window;
  };
  std::visit(set, options);
}

void RunSweep(const StereoSweepRequest& request, const StereoDatasetEntry& entry,
              const std::filesystem::path& folder) {
  const Sweep sweep = ReadSweep(request.experiment);
  Column column = ReadColumn(sweep, request);
  const std::optional<ImageChange> change = ReadChange(request);
  const std::vector<int> windows = Windows(sweep, request);
  std::string table =
      "dataset,scene,region,matcher,column,window,uniqueness,truth_px,matched_px,mean_px,"
      "bad1_pct,bad2_pct,bad4_pct,d1_pct,invalid_pct\n";
  YAML::Node resolved;  // "options" are those of the first scene and window
  resolved["implementation"] = StereoMethodName(column.options);
  resolved["fill"] = column.fill;
  if (change) resolved["change"] = WriteOptions(*change);
  resolved["windows"] = windows;
  resolved["uniqueness"] = sweep.grid.uniqueness;
  for (const StereoScene& scene : ListStereoScenes(folder, entry.layout)) {
    const StereoPair pair = LoadPair(scene, change);
    const int num_disparities = NumDisparities(sweep, request, pair);
    for (const int window : windows) {
      SetPairOptions(column.options, num_disparities, window);
      const auto method = MakeStereoMethod(column.options);
      if (!resolved["options"]) resolved["options"] = method->Options();
      table += ScoreWindow(sweep, request, pair, column.fill, *method, window);
    }
    resolved["num_disparities"][pair.name] = num_disparities;
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

void RunStereoSweep(const StereoSweepRequest& request, const StereoDatasetEntry& entry,
                    const std::filesystem::path& folder) {
  try {
    RunSweep(request, entry, folder);
  } catch (const YAML::Exception& error) {  // a value of the wrong kind
    throw Error(fmt::format("{}:{}", request.experiment, error.mark.line + 1), error.msg);
  }
}

}  // namespace sgf::apps
