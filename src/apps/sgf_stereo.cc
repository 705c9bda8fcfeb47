// Stereo matching of one rectified pair, or of all pairs of a dataset folder.

#include <filesystem>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <spdlog/spdlog.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/stereo_method.h>
#include <sgf/core/simd.h>
#include <sgf/eval/disparity.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/io/stereo_dataset.h>
#include <sgf/metrics/registry.h>
#include <sgf/stereo/refine.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

// Defaults of a method's options by name, the outer ones of nested options.
std::map<std::string, std::string> DefaultsOf(const StereoOptions& options) {
  std::map<std::string, std::string> defaults;
  const auto note = [&](const char* name, auto& value, const char*, const char*) {
    defaults[name] = options_internal::FormatValue(value);
  };
  std::visit([&](auto o) { o.VisitFields(note); }, options);
  return defaults;
}

// Which methods have an option, where not all of ours do, and their defaults, where they differ.
std::string MethodsWith(const std::string& name) {
  std::vector<std::string> methods, with_default;
  std::set<std::string> values;
  for (const char* method : StereoMethodNames()) {
    const auto defaults = DefaultsOf(DefaultStereoOptions(method));
    const auto it = defaults.find(name);
    if (it == defaults.end()) continue;
    methods.push_back(method);
    with_default.push_back(fmt::format("{} {}", method, it->second));
    values.insert(it->second);
  }
  if (values.size() > 1) return fmt::format(" [{}]", fmt::join(with_default, ", "));
  return methods.size() < kOwnMethods ? fmt::format(" [{}]", fmt::join(methods, ", ")) : "";
}

// The options of all methods, each name once: what the flags are made of.
struct AllOptions {
  template <class V>
  void VisitFields(V&& visit) {
    std::set<std::string> seen;
    const auto once = [&](const char* name, auto& value, const char* unit, const char* text) {
      if (seen.insert(name).second) visit(name, value, unit, (text + MethodsWith(name)).c_str());
    };
    for (const char* method : StereoMethodNames()) {
      StereoOptions options = DefaultStereoOptions(method);
      std::visit([&](auto& o) { o.VisitFields(once); }, options);
    }
  }
};

struct Arguments {
  std::vector<std::string> inputs;
  std::string output;
  std::string method = "bm";
  std::string truth;
  std::optional<double> truth_scale;
  std::string layout;
  std::string isa;
  bool fill = false;
  bool list_metrics = false;
};

void ListMetrics() {
  fmt::print("{:10} {:6} {:5} {}\n", "name", "alias", "eq.", "formula");
  for (const auto& metric : metrics::AllMetrics())
    fmt::print("{:10} {:6} {:5} {}\n", metric.name, metric.alias, metric.equation, metric.formula);
}

struct SearchRange {
  int min_disparity, num_disparities;
};

SearchRange RangeOf(const StereoOptions& options) {
  return std::visit(
      [](const auto& o) {
        return SearchRange{o.min_disparity, o.num_disparities};
      },
      options);
}

// Turbo from the smallest to the largest disparity searched; black where there is none.
cv::Mat Colour(const cv::Mat1f& disparity, const SearchRange& range) {
  cv::Mat1b levels;
  const double scale = 255.0 / std::max(1, range.num_disparities - 1);
  cv::Mat1f known = disparity.clone();
  const cv::Mat unknown = disparity != disparity;
  known.setTo(range.min_disparity, unknown);
  known.convertTo(levels, CV_8U, scale, -scale * range.min_disparity);
  cv::Mat colour;
  cv::applyColorMap(levels, colour, cv::COLORMAP_TURBO);
  colour.setTo(cv::Scalar::all(0), unknown);
  return colour;
}

nlohmann::json ToJson(const DisparityScores& scores) {
  return {{"truth_px", scores.truth_px}, {"matched_px", scores.matched_px},
          {"mean_px", scores.mean_px},   {"bad1_pct", scores.bad1_pct},
          {"bad2_pct", scores.bad2_pct}, {"bad4_pct", scores.bad4_pct},
          {"d1_pct", scores.d1_pct},     {"invalid_pct", scores.invalid_pct}};
}

void WriteDisparity(const fs::path& folder, const cv::Mat1f& disparity, const SearchRange& range) {
  WriteDisparityPfm(folder / "disparity.pfm", disparity);
  const int largest = range.min_disparity + range.num_disparities;
  if (range.min_disparity >= 0 && largest <= kMaxDisparityPng16)
    WriteDisparityPng16(folder / "disparity.png", disparity);
  else
    spdlog::warn("no 16-bit PNG: it cannot hold disparities from {} to {} px", range.min_disparity,
                 largest);
  WritePng(folder / "colour.png", Colour(disparity, range));
}

// OpenCV's matchers have parameters that are no options of ours: those of a run are noted beside.
void WriteRunOptions(const fs::path& folder, const Arguments& arguments,
                     const StereoOptions& options, const StereoMethod& method) {
  YAML::Node node;
  node["method"] = arguments.method;
  node["fill"] = arguments.fill;
  node["options"] = std::visit([](const auto& o) { return WriteOptions(o); }, options);
  if (options.index() >= kOwnMethods) node["opencv"] = method.Options();
  node["build"] = DescribeBuild();
  WriteTextFile(folder / "options.yaml", YAML::Dump(node) + "\n");
}

// Matches a pair and writes what belongs to it into a folder.
// @param truths regions to score in, by name; empty maps are left out.
void MatchPair(const Arguments& arguments, const StereoOptions& options, const cv::Mat& left,
               const cv::Mat& right, const std::map<std::string, cv::Mat1f>& truths,
               const fs::path& folder) {
  const auto method = MakeStereoMethod(options);
  method->SetPair(left, right);
  cv::Mat1f disparity = method->Disparity();
  if (arguments.fill) stereo::FillHoles(disparity);
  nlohmann::json scores;
  for (const auto& [region, truth] : truths)
    if (!truth.empty()) scores[region] = ToJson(ScoreDisparity(disparity, truth));
  MakeFolder(folder);
  WriteDisparity(folder, disparity, RangeOf(options));
  method->WriteMore(folder);
  WriteRunOptions(folder, arguments, options, *method);
  if (scores.empty()) return;
  WriteTextFile(folder / "scores.json", scores.dump(2) + "\n");
  for (const auto& [region, s] : scores.items())
    fmt::print(
        "{}: {} mean {:.3f} px, bad1 {:.2f} %, bad2 {:.2f} %, bad4 {:.2f} %, invalid {:.2f} %\n",
        folder.string(), region, s["mean_px"].get<double>(), s["bad1_pct"].get<double>(),
        s["bad2_pct"].get<double>(), s["bad4_pct"].get<double>(), s["invalid_pct"].get<double>());
}

void MatchFiles(const Arguments& arguments, const StereoOptions& options) {
  std::map<std::string, cv::Mat1f> truths;
  if (!arguments.truth.empty())
    truths["all"] = ReadDisparity(arguments.truth, arguments.truth_scale.value_or(1));
  MatchPair(arguments, options, ReadImage(arguments.inputs[0], cv::IMREAD_ANYCOLOR),
            ReadImage(arguments.inputs[1], cv::IMREAD_ANYCOLOR), truths, arguments.output);
}

// @param own_disparities the command line's number of disparities goes before the scenes' own.
void MatchFolder(const Arguments& arguments, StereoOptions options, bool own_disparities) {
  StereoLayout layout{};
  if (!arguments.layout.empty())
    options_internal::ParseValue(YAML::Node(arguments.layout), "layout", "command line", layout);
  const int default_disparities = RangeOf(options).num_disparities;
  for (const StereoScene& scene : ListStereoScenes(arguments.inputs[0], layout)) {
    const StereoPair pair = LoadStereoScene(scene);
    const bool use_scene = pair.num_disparities > 0 && !own_disparities;
    const int count = use_scene ? pair.num_disparities : default_disparities;
    std::visit([&](auto& o) { o.num_disparities = count; }, options);
    MatchPair(arguments, options, pair.left, pair.right,
              {{"all", pair.truth_all}, {"noc", pair.truth_noc}},
              fs::path(arguments.output) / pair.name);
  }
}

// What is given must have an effect.
void RequireEffect(const Arguments& arguments) {
  const bool folder = arguments.inputs.size() == 1;
  if (folder && !arguments.truth.empty())
    throw Error("--gt", "goes with a pair of images; a dataset folder brings its own");
  if (!folder && !arguments.layout.empty()) throw Error("--layout", "goes with a dataset folder");
  if (arguments.truth_scale && arguments.truth.empty()) throw Error("--gt-scale", "goes with --gt");
}

// An option of other methods only is named with the method at hand; ReadOptions() names the others.
void RequireOptionsOfMethod(const std::set<std::string>& given, const StereoOptions& options) {
  const auto own = DefaultsOf(options);
  for (const std::string& name : given)
    for (const char* other : StereoMethodNames())
      if (!own.contains(name) && DefaultsOf(DefaultStereoOptions(other)).contains(name))
        throw Error(name, fmt::format("is not an option of {}", StereoMethodName(options)));
}

void RequireOutput(const fs::path& folder) {
  if (folder.empty()) throw Error("--output", "is missing: name a folder for the results");
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_directory(folder, ignored))
    throw Error(folder.string(), "is not a folder");
}

// What the command line does not say is as in the run whose options.yaml --config names.
void TakeChoices(const CLI::App& app, const OptionFlags& flags, Arguments& arguments) {
  if (app.count("--method") == 0) flags.ApplyChoice("method", arguments.method);
  if (app.count("--fill") == 0) flags.ApplyChoice("fill", arguments.fill);
}

void Run(const Arguments& arguments, const OptionFlags& flags) {
  if (arguments.list_metrics) return ListMetrics();
  if (arguments.inputs.empty() || arguments.inputs.size() > 2)
    throw Error("", "expected a left and a right image, or one dataset folder; see --help");
  RequireOutput(arguments.output);
  const std::set<std::string> given = flags.Given();
  RequireEffect(arguments);
  StereoOptions options = DefaultStereoOptions(arguments.method);
  RequireOptionsOfMethod(given, options);
  const auto apply = [&](auto& o) {
    o.threads = 0;
    flags.Apply(o);
  };
  std::visit(apply, options);
  RestrictSimd(arguments.isa);
  if (arguments.inputs.size() == 2)
    MatchFiles(arguments, options);
  else
    MatchFolder(arguments, options, given.contains("num_disparities"));
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  apps::Arguments arguments;
  CLI::App app(
      "Matches a rectified stereo pair, or every pair of a dataset folder: writes "
      "disparity.pfm, disparity.png (16 bit, 256 levels a pixel), colour.png, options.yaml, "
      "with ground truth scores.json, and with --method mesh mesh.ply and valid.png (255: "
      "confirmed by the right image).",
      "sgf_stereo");
  app.add_option("inputs", arguments.inputs, "LEFT RIGHT, or one dataset FOLDER");
  app.add_option("-o,--output", arguments.output, "folder for the results (made if missing)");
  app.add_option("--method", arguments.method,
                 "bm (block matching), mesh (MeshStereo), sgm (semi-global matching), opencv_bm "
                 "(cv::StereoBM) or opencv_sgbm (cv::StereoSGBM)")
      ->capture_default_str();
  app.add_flag("--fill", arguments.fill, "fill the holes of the result from their background");
  app.add_option("--gt", arguments.truth, "true disparities of the left image (PFM, PNG, PGM)");
  app.add_option("--gt-scale", arguments.truth_scale,
                 "grey levels per px of an 8-bit --gt (default 1)");
  app.add_option("--layout", arguments.layout,
                 "layout of a dataset FOLDER: " + options_internal::KnownNames(StereoLayout{}) +
                     " (default the first)");
  app.add_option("--isa", arguments.isa,
                 "use only this SIMD instruction set (results are the same)");
  app.add_flag("--list-metrics", arguments.list_metrics, "print the table of dissimilarities");
  const apps::OptionFlags flags(
      app, apps::AllOptions{},
      {{"num_disparities", "--max-disp"}, {"uniqueness_pct", "--uniqueness"}},
      {"method", "fill", "opencv"});
  return apps::RunTool(app, argc, argv, [&] {
    apps::TakeChoices(app, flags, arguments);
    apps::Run(arguments, flags);
  });
}
