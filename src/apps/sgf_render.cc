// Renders the synthetic world: scenes as EXR images with all layers, stereo pairs, stereo-inertial
// sequences, and camera images of layers rendered before; finds how far points lie off a scene.

#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <sgf/apps/cli.h>
#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>
#include <sgf/io/manifest.h>
#include <sgf/io/ply.h>
#include <sgf/synth/frame_exr.h>
#include <sgf/synth/sequence.h>
#include <sgf/synth/stereo_pair.h>
#include <sgf/synth/surface_finder.h>

namespace sgf::apps {
namespace {

using synth::Renderer;

constexpr double kGigabyte = 1e9;

/// What all ways of rendering share.
struct Quality {
  synth::RenderOptions options;
  bool preview = false;

  void AddTo(CLI::App& app) {
    app.add_flag("--preview", preview, "quick and coarse: one ray a pixel, rough light");
    app.add_option("--threads", options.threads, "threads; 0 for all cores")->capture_default_str();
  }

  synth::RenderOptions Options() const {
    synth::RenderOptions chosen = options;
    if (!preview) return chosen;
    chosen.samples_per_pixel = 1;
    chosen.light_texels = 30000;
    chosen.light_samples = 16;
    chosen.bounce_samples = 16;
    return chosen;
  }
};

/// Renderers of scenes, made when first asked for and then kept: baking light takes seconds.
class Renderers {
 public:
  explicit Renderers(const synth::RenderOptions& options) : options_(options) {}

  const Renderer& Of(const std::string& scene) {
    std::unique_ptr<Renderer>& renderer = renderers_[scene];
    if (!renderer) {
      spdlog::info("baking the light of {}", scene);
      renderer = std::make_unique<Renderer>(synth::BuildScene(scene), options_);
    }
    return *renderer;
  }

 private:
  synth::RenderOptions options_;
  std::map<std::string, std::unique_ptr<Renderer>> renderers_;
};

/// Strengths of light groups by name, from "lamp=0.5".
std::vector<float> Strengths(const std::vector<std::string>& settings,
                             const std::vector<std::string>& groups) {
  std::vector<float> strengths(groups.size(), 1.0f);
  for (const std::string& setting : settings) {
    const size_t equals = setting.find('=');
    const auto group = std::find(groups.begin(), groups.end(), setting.substr(0, equals));
    if (group == groups.end())
      throw Error("--light", fmt::format("no light group in '{}'; known: {}", setting,
                                         fmt::join(groups, ", ")));
    float& strength = strengths[group - groups.begin()];
    const char* end = setting.data() + setting.size();
    const char* begin = equals == std::string::npos ? end : setting.data() + equals + 1;
    const auto [rest, code] = std::from_chars(begin, end, strength);
    if (code != std::errc() || rest != end || !(strength >= 0 && std::isfinite(strength)))
      throw Error("--light",
                  fmt::format("'{}' is not name=strength with a strength of 0 or more", setting));
  }
  return strengths;
}

struct ViewsRequest {
  std::string scene, view = "all";
  std::filesystem::path out;
  std::vector<std::string> lights;
  int width = 752, height = 480;
  double focal_px = 458;
  bool exr = false;
  Quality quality;
};

void AddViews(CLI::App& app, ViewsRequest& r) {
  app.add_option("--scene", r.scene, "name of the scene (see scenes)")->required();
  app.add_option("--view", r.view, "name of a view, or all")->capture_default_str();
  app.add_option("--out", r.out, "folder for <scene>_<view>.png")->required();
  app.add_option("--light", r.lights, "strength of a light group in the PNG image: name=0.5");
  app.add_option("--width", r.width, "px")->capture_default_str();
  app.add_option("--height", r.height, "px")->capture_default_str();
  app.add_option("--focal-px", r.focal_px, "focal length, px")->capture_default_str();
  app.add_flag("--exr", r.exr, "also write all layers, as <scene>_<view>.exr");
  r.quality.AddTo(app);
}

void RenderViews(const ViewsRequest& r) {
  const synth::RenderOptions options = r.quality.Options();
  const Camera camera{.width = r.width,
                      .height = r.height,
                      .fx = r.focal_px,
                      .fy = r.focal_px,
                      .cx = 0.5 * (r.width - 1),
                      .cy = 0.5 * (r.height - 1)};
  const synth::PixelRays rays(camera, options.samples_per_pixel);
  const Renderer renderer(synth::BuildScene(r.scene), options);
  const std::vector<float> strengths = Strengths(r.lights, renderer.scene().LightGroups());
  MakeFolder(r.out);
  int count = 0;
  for (const synth::View& view : renderer.scene().views) {
    if (r.view != "all" && r.view != view.name) continue;
    const SE3 T_world_cam = synth::LookAt(view.eye.cast<double>(), view.target.cast<double>());
    const synth::Frame frame = renderer.Render(rays, T_world_cam);
    const std::string name = r.scene + "_" + view.name;
    WritePng(r.out / (name + ".png"), synth::ForScreen(frame.Radiance(strengths)));
    if (r.exr) {
      ExrImage layers = synth::ToExr(frame, camera, T_world_cam);
      layers.attributes = {{"scene", r.scene}, {"view", view.name}};
      WriteExr(r.out / (name + ".exr"), layers);
    }
    ++count;
  }
  if (count == 0) throw Error("--view", fmt::format("scene {} has no view '{}'", r.scene, r.view));
}

/// The pairs of a recipe file.
struct PairList {
  std::vector<synth::PairOptions> pairs;

  template <class V>
  void VisitFields(V&& visit) {
    visit("pairs", pairs, "", "stereo pairs to render");
  }
};

struct PairsRequest {
  std::string recipe;
  std::filesystem::path out;
  bool exr = false;
  Quality quality;
};

void AddPairs(CLI::App& app, PairsRequest& r) {
  app.add_option("--recipe", r.recipe, "YAML file with a list `pairs`")->required();
  app.add_option("--out", r.out, "folder for <scene>_<view>/, in Middlebury's layout and view.png")
      ->required();
  app.add_flag("--exr", r.exr, "also write all layers, as left.exr and right.exr");
  r.quality.AddTo(app);
}

void RenderPairs(const PairsRequest& r) {
  PairList list;
  ReadOptions(LoadYamlFile(r.recipe), list, r.recipe);
  const synth::RenderOptions options = r.quality.Options();
  Renderers renderers(options);
  std::set<std::filesystem::path> folders;
  for (const synth::PairOptions& pair : list.pairs) {
    const std::filesystem::path folder = r.out / (pair.scene + "_" + pair.view);
    if (!folders.insert(folder).second)
      throw Error(r.recipe, fmt::format("two pairs of scene {}, view {}", pair.scene, pair.view));
    const std::string hash = synth::RecipeHash(pair, options, r.exr);
    if (IsComplete(folder, hash)) continue;
    const synth::RenderedPair rendered = synth::RenderPair(renderers.Of(pair.scene), pair);
    StagedFolder staged(folder);
    WriteMiddleburyScene(staged.path(), synth::Expose(rendered, pair, options.threads),
                         rendered.calib);
    WritePng(staged.path() / "view.png", synth::ForScreen(rendered.left.Radiance()));
    if (r.exr) {
      WriteExr(staged.path() / "left.exr",
               synth::ToExr(rendered.left, rendered.camera, rendered.T_world_left));
      WriteExr(staged.path() / "right.exr",
               synth::ToExr(rendered.right, rendered.camera, rendered.T_world_right));
    }
    staged.Commit(hash, {{"images", 2}});
    spdlog::info("{}", folder.string());
  }
}

struct SequencesRequest {
  std::vector<std::string> recipes;
  std::filesystem::path out;
  bool full = false, keep_exr = false;
  double limit_gb = 0;
  Quality quality;

  synth::SequenceVersion Version() const {
    if (quality.preview) return synth::SequenceVersion::kPreview;
    return full ? synth::SequenceVersion::kFull : synth::SequenceVersion::kShort;
  }

  /// Most that may be written (bytes).
  double Limit() const {
    if (limit_gb > 0) return limit_gb * kGigabyte;
    return (full ? 15 : 2) * kGigabyte;
  }
};

void AddSequences(CLI::App& app, SequencesRequest& r) {
  app.add_option("recipes", r.recipes, "YAML files; a sequence is called as its file")->required();
  app.add_option("--out", r.out, "folder for the sequences, each in EuRoC's layout")->required();
  app.add_flag("--full", r.full, "the full version instead of the short one");
  app.add_flag("--keep-exr", r.keep_exr, "also keep all layers of every frame");
  app.add_option(
      "--limit-gb", r.limit_gb,
      "most to write; default: 2, with --full 15; --keep-exr takes up to 45 MB a stereo frame");
  r.quality.AddTo(app);
}

/// A sequence to render, and whether it is there already.
struct SequenceJob {
  synth::SequenceRequest request;
  bool up_to_date = false;
};

/// States what will be written and refuses what does not fit: all sequences the limit, those that
/// are not there yet the disk.
void CheckSpace(const SequencesRequest& r, const std::vector<SequenceJob>& jobs) {
  double all = 0, missing = 0;
  int64_t frames = 0, renderings = 0;
  for (const SequenceJob& job : jobs) {
    const auto estimate =
        synth::Estimate(job.request.recipe, job.request.version, job.request.keep_exr);
    all += static_cast<double>(estimate.bytes);
    if (job.up_to_date) continue;
    missing += static_cast<double>(estimate.bytes);
    frames += estimate.frames;
    renderings += estimate.renderings;
  }
  spdlog::info("to render: {} stereo frames, {} views to trace, at most {:.2f} GB", frames,
               renderings, missing / kGigabyte);
  if (all > r.Limit())
    throw Error("--limit-gb", fmt::format("the sequences may take {:.2f} GB, the limit is {:.2f}",
                                          all / kGigabyte, r.Limit() / kGigabyte));
  const auto free = static_cast<double>(std::filesystem::space(r.out).available);
  if (missing > free)
    throw Error(r.out.string(), fmt::format("{:.2f} GB are free, the sequences may take {:.2f} GB",
                                            free / kGigabyte, missing / kGigabyte));
}

/// Reads all recipes before anything is rendered.
std::vector<SequenceJob> ReadJobs(const SequencesRequest& r, const synth::RenderOptions& options) {
  std::vector<SequenceJob> jobs;
  std::set<std::filesystem::path> folders;
  for (const std::string& file : r.recipes) {
    SequenceJob& job = jobs.emplace_back();
    synth::SequenceRequest& request = job.request;
    request.version = r.Version();
    request.keep_exr = r.keep_exr;
    ReadOptions(LoadYamlFile(file), request.recipe, file);
    synth::CheckRecipe(request.recipe);
    request.folder = r.out / std::filesystem::path(file).stem();
    if (!folders.insert(request.folder).second)
      throw Error(file, fmt::format("two recipes for {}", request.folder.string()));
    job.up_to_date = IsComplete(request.folder, synth::RecipeHash(request.recipe, request.version,
                                                                  request.keep_exr, options));
    if (job.up_to_date) spdlog::info("{} is up to date", request.folder.string());
  }
  return jobs;
}

void RenderSequences(const SequencesRequest& r) {
  const synth::RenderOptions options = r.quality.Options();
  std::vector<SequenceJob> jobs = ReadJobs(r, options);
  MakeFolder(r.out);
  CheckSpace(r, jobs);
  Renderers renderers(options);
  for (SequenceJob& job : jobs) {
    if (job.up_to_date) continue;
    const std::string name = job.request.folder.filename().string();
    const synth::SequenceRecipe& recipe = job.request.recipe;
    const synth::MotionSummary motion = synth::SummarizeMotion(
        synth::MakeTrajectory(recipe.trajectory, synth::RigCameras(recipe.rig)[0].T_body_cam));
    spdlog::info("{}: {:.1f} m in {} s, at most {:.2f} m/s, {:.1f} m/s^2 and {:.2f} rad/s", name,
                 motion.length_m, recipe.duration_s, motion.max_speed, motion.max_acceleration,
                 motion.max_angular_rate);
    job.request.progress = [&](int frame, int frames) {
      if (frame % 20 == 0 || frame == frames) spdlog::info("{} {}/{}", name, frame, frames);
    };
    synth::RenderSequence(renderers.Of(job.request.recipe.scene), job.request);
  }
}

struct PhotometryRequest {
  std::filesystem::path in, out;
  std::string options;
  double exposure_ms = 10;
  uint64_t seed = 0;
  std::vector<std::string> lights;
};

void AddPhotometry(CLI::App& app, PhotometryRequest& r) {
  app.add_option("--in", r.in, "EXR image with the layers of a rendered frame")->required();
  app.add_option("--out", r.out, "PNG image to write, grey")->required();
  app.add_option("--camera", r.options, "YAML file with the camera's photometry");
  app.add_option("--exposure-ms", r.exposure_ms, "exposure time, ms")->capture_default_str();
  app.add_option("--light", r.lights, "strength of a light group: name=0.5");
  app.add_option("--seed", r.seed, "seed of the noise")->capture_default_str();
}

void ApplyPhotometry(const PhotometryRequest& r) {
  synth::PhotometryOptions options;
  if (!r.options.empty()) ReadOptions(LoadYamlFile(r.options), options, r.options);
  const ExrImage layers = ReadExr(r.in);
  if (!layers.camera) throw Error(r.in.string(), "the header has no camera");
  const synth::Frame frame = synth::FromExr(layers, r.in.string());
  const synth::PhotometricCamera camera(*layers.camera, options);
  const cv::Mat1f luminance = synth::Luminance(frame.Radiance(Strengths(r.lights, frame.groups)));
  WritePng(r.out, camera.Expose(luminance, r.exposure_ms, r.seed));
}

struct OffsetsRequest {
  std::string scene;
  std::filesystem::path points, out;
};

void AddOffsets(CLI::App& app, OffsetsRequest& r) {
  app.add_option("--scene", r.scene, "name of the scene (see scenes)")->required();
  app.add_option("--points", r.points, "PLY file as sgf_direct writes it, in the scene's world, m")
      ->required();
  app.add_option("--out", r.out,
                 "CSV file to write, a line per point: offset_m (negative behind a surface), the "
                 "nearest place x, y, z (m) and the id of its object (0: a lamp)")
      ->required();
}

void WriteOffsets(const OffsetsRequest& r) {
  const std::vector<PlyPoint> points = ReadPointsPly(r.points);
  const synth::SurfaceFinder finder(synth::BuildScene(r.scene));
  std::string lines = "offset_m,x,y,z,object\n";
  for (const PlyPoint& point : points) {
    const cv::Point3d p = point.position;
    const synth::NearestSurface near = finder.Nearest({p.x, p.y, p.z});
    lines += fmt::format("{:.6f},{:.4f},{:.4f},{:.4f},{}\n", near.offset_m, near.place.x(),
                         near.place.y(), near.place.z(), near.object);
  }
  WriteTextFile(r.out, lines);
}

void CheckFolders(const std::vector<std::string>& folders) {
  for (const std::string& folder : folders) {
    CheckManifest(folder);
    spdlog::info("{}: all files are there and as they were written", folder);
  }
}

void ListScenes(bool with_views) {
  for (const synth::SceneInfo& scene : synth::AllScenes()) {
    if (!with_views) fmt::print("{:<14} {}\n", scene.name, scene.text);
    if (with_views)
      for (const synth::View& view : scene.build().views)
        fmt::print("{} {}\n", scene.name, view.name);
  }
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  CLI::App app("Renders synthetic scenes, stereo pairs and stereo-inertial sequences.",
               "sgf_render");
  app.require_subcommand(1);
  apps::ViewsRequest views;
  apps::PairsRequest pairs;
  apps::SequencesRequest sequences;
  apps::PhotometryRequest photometry;
  apps::OffsetsRequest off;
  bool list_views = false;
  CLI::App* list = app.add_subcommand("scenes", "list the scenes");
  list->add_flag("--views", list_views, "list `scene view` for every view instead");
  CLI::App* scene = app.add_subcommand("scene", "views of a scene");
  CLI::App* pair = app.add_subcommand("pair", "stereo pairs with ground truth");
  CLI::App* sequence = app.add_subcommand("sequence", "stereo-inertial sequences");
  CLI::App* apply = app.add_subcommand("photometry", "a camera's image of layers rendered before");
  CLI::App* offsets =
      app.add_subcommand("offsets", "how far points lie off the surfaces of a scene");
  std::vector<std::string> checked;
  CLI::App* check = app.add_subcommand("check", "compare rendered folders with their manifests");
  check->add_option("folders", checked, "of pairs or sequences")->required();
  apps::AddViews(*scene, views);
  apps::AddPairs(*pair, pairs);
  apps::AddSequences(*sequence, sequences);
  apps::AddPhotometry(*apply, photometry);
  apps::AddOffsets(*offsets, off);

  return apps::RunTool(app, argc, argv, [&] {
    if (*list) apps::ListScenes(list_views);
    if (*scene) apps::RenderViews(views);
    if (*pair) apps::RenderPairs(pairs);
    if (*sequence) apps::RenderSequences(sequences);
    if (*apply) apps::ApplyPhotometry(photometry);
    if (*offsets) apps::WriteOffsets(off);
    if (*check) apps::CheckFolders(checked);
  });
}
