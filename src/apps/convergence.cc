#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include <fmt/core.h>

#include <sgf/alignment/as_extracted.h>
#include <sgf/alignment/patch_alignment.h>
#include <sgf/apps/cli.h>
#include <sgf/apps/convergence.h>
#include <sgf/apps/image_change.h>
#include <sgf/apps/image_motion.h>
#include <sgf/core/parallel.h>
#include <sgf/core/random.h>
#include <sgf/eval/statistics.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>

namespace sgf::apps {

std::span<const std::pair<const char*, PatchMotion>> EnumNames(PatchMotion) {
  static constexpr std::pair<const char*, PatchMotion> kNames[] = {
      {"translation", PatchMotion::kTranslation},
      {"se2", PatchMotion::kSe2},
      {"similarity", PatchMotion::kSimilarity}};
  return kNames;
}

namespace {

using alignment::SampleChannels;
using Vector2 = alignment::Vector2<double>;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kLost = std::numeric_limits<double>::infinity();

struct Case {
  std::string name;
  ImageChange change;
  double roll_deg = 0;
  double scale = 1;
  PatchMotion motion = PatchMotion::kTranslation;
  int levels = 1;
  std::vector<double> start_px, start_deg, start_pct;

  template <class V>
  void VisitFields(V&& visit) {
    visit("change", change, "", "of the second image; its noise goes onto both");
    visit("roll_deg", roll_deg, "deg", "by which the second image is turned");
    visit("scale", scale, "", "factor on the second image");
    visit("motion", motion, "", "of patches: translation, se2 or similarity");
    visit("levels", levels, "", "of the pyramid");
    visit("start_px", start_px, "px", "distances of start and true place");
    visit("start_deg", start_deg, "deg", "differences of start and true angle");
    visit("start_pct", start_pct, "%", "differences of start and true scale");
  }
};

struct Column {
  std::string name;
  std::string residual;
  metrics::EpsilonOptions epsilon;
  bool compared = false;

  template <class V>
  void VisitFields(V&& visit) {
    visit("residual", residual, "", "a name of the table of residuals, or one of as_extracted.h");
    visit("epsilon", epsilon, "", "normalisation of gradients, eq. 6");
    visit("compared", compared, "", "its converged tracks bound the common set");
  }
};

struct Study {
  ConvergenceOptions options;
  std::vector<Column> columns;
  std::vector<Case> cases;
};

// How far off a track starts: one of them is not 0.
struct Start {
  double px = 0, deg = 0, pct = 0;

  const char* unit() const { return deg != 0 ? "deg" : pct != 0 ? "pct" : "px"; }
  double value() const { return px + deg + pct; }
};

std::vector<Start> Starts(const Case& run) {
  std::vector<Start> starts;
  for (const double px : run.start_px) starts.push_back({.px = px});
  for (const double deg : run.start_deg) starts.push_back({.deg = deg});
  for (const double pct : run.start_pct) starts.push_back({.pct = pct});
  return starts;
}

// --- The experiment's file ---

void Require(bool good, const std::string& file, const std::string& what) {
  if (!good) throw Error(file, what);
}

void CheckCase(const Case& run, const std::string& file) {
  const auto require = [&](bool good, const char* what) {
    Require(good, file, fmt::format("cases.{}: {}", run.name, what));
  };
  CheckChange(run.change);
  require(run.scale > 0 && std::isfinite(run.scale), "scale must be finite and positive");
  require(std::isfinite(run.roll_deg), "roll_deg must be finite");
  require(run.levels >= 1 && run.levels <= 8, "levels must be in [1, 8]");
  for (const Start& start : Starts(run))
    require(start.value() > 0 && std::isfinite(start.value()), "starts must be above 0");
  require(run.start_deg.empty() || run.motion != PatchMotion::kTranslation,
          "start_deg needs motion se2 or similarity");
  require(run.start_pct.empty() || run.motion == PatchMotion::kSimilarity,
          "start_pct needs motion similarity");
}

void CheckStudy(const ConvergenceOptions& options, const std::string& file) {
  alignment::CheckOptions(options.selection);
  Require(options.points >= 1, file, "study.points must be positive");
  Require(options.resamples >= 1, file, "study.resamples must be positive");
  Require(options.converged_px > 0, file, "study.converged_px must be positive");
}

void CheckColumn(const Column& column, const std::string& file) {
  const bool trackable = alignment::VisitStudiedResidual(column.residual, [](const auto& residual) {
    return alignment::kOfSamplesAlone<std::remove_cvref_t<decltype(residual)>>;
  });
  Require(trackable, file,
          fmt::format("columns.{}: '{}' cannot be tracked here", column.name, column.residual));
}

Study ReadStudy(const std::string& file) {
  const YAML::Node root = LoadYamlFile(file);
  for (const char* key : {"study", "columns", "cases"})
    Require(root.IsMap() && root[key] && root[key].IsMap(), file,
            fmt::format("expected a map under the key '{}'", key));
  Study study;
  ReadOptions(root["study"], study.options, file);
  CheckStudy(study.options, file);
  for (const auto& entry : root["columns"]) {
    Column& column = study.columns.emplace_back();
    column.name = entry.first.Scalar();
    ReadOptions(entry.second, column, file);
    CheckColumn(column, file);
  }
  for (const auto& entry : root["cases"]) {
    Case& run = study.cases.emplace_back();
    run.name = entry.first.Scalar();
    run.start_px = study.options.start_px;
    ReadOptions(entry.second, run, file);
    CheckCase(run, file);
  }
  return study;
}

// --- Images and points ---

// An image and its copy, as grey pyramids.
struct GreyPair {
  std::vector<cv::Mat1f> first, second;
  ImageMotion motion;
};

GreyPair MakeGreyPair(const cv::Mat1b& image, const ConvergenceOptions& options, const Case& run,
                      uint64_t seed) {
  const ImageMotion motion(run.roll_deg * kDegree, run.scale, {options.shift_x, options.shift_y},
                           image.size());
  ImageChange noise_only;
  noise_only.noise = run.change.noise;
  noise_only.quantise = run.change.quantise;
  const cv::Mat first = ApplyChange(image, noise_only, Hash64(seed, 0));
  const cv::Mat second = ApplyChange(motion.Apply(image), run.change, Hash64(seed, 1));
  return {alignment::GreyPyramid(first, run.levels), alignment::GreyPyramid(second, run.levels),
          motion};
}

// The samples of both, level by level.
struct SamplePair {
  std::vector<SampleChannels> first, second;
};

std::vector<SamplePair> MakeSamples(const std::vector<GreyPair>& pairs,
                                    const alignment::LevelOptions& options, int threads) {
  std::vector<SamplePair> samples(pairs.size());
  ParallelFor(static_cast<int>(pairs.size()), threads, [&](int i) {
    for (const cv::Mat1f& level : pairs[i].first)
      samples[i].first.push_back(alignment::MakeSampleChannels(level, options));
    for (const cv::Mat1f& level : pairs[i].second)
      samples[i].second.push_back(alignment::MakeSampleChannels(level, options));
  });
  return samples;
}

struct TrackedPoint {
  size_t image;
  Vector2 place;  // in the first image
};

// How much of the image around a point has to be in view, px.
double Margin(const ConvergenceOptions& options, const Case& run) {
  double radius = 0, off_px = 0, off_scale = 1;
  for (const Eigen::Vector2f& offset : alignment::Offsets(options.pattern))
    radius = std::max(radius, double(offset.norm()));
  for (const Start& start : Starts(run)) {
    off_px = std::max(off_px, start.px);
    off_scale = std::max(off_scale, 1 + start.pct / 100);
  }
  return std::max(1.0, run.scale) * off_scale * radius + off_px + 3;
}

// Pixels whose patches lie inside both images, wherever they start.
cv::Mat1b Eligible(cv::Size size, const ImageMotion& motion, double margin) {
  const auto inside = [&](const Vector2& p) {
    return p.x() >= margin && p.y() >= margin && p.x() < size.width - 1 - margin &&
           p.y() < size.height - 1 - margin;
  };
  cv::Mat1b eligible(size, uchar{0});
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      if (const Vector2 p(x, y); inside(p) && inside(motion(p))) eligible(y, x) = 255;
  return eligible;
}

std::vector<TrackedPoint> ChoosePoints(const std::vector<GreyPair>& pairs, const Study& study,
                                       const Case& run) {
  const ConvergenceOptions& options = study.options;
  std::vector<TrackedPoint> all, chosen;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const cv::Mat1f& image = pairs[i].first.front();
    const cv::Mat1b eligible = Eligible(image.size(), pairs[i].motion, Margin(options, run));
    const SampleChannels samples =
        alignment::MakeSampleChannels(image, {.gradient = options.gradient, .epsilon = {}});
    for (const cv::Point& p : alignment::SelectPoints(samples, eligible, options.selection))
      all.push_back({i, Vector2(p.x, p.y)});
  }
  const auto wanted = static_cast<size_t>(options.points);
  Require(all.size() >= wanted, "case " + run.name,
          fmt::format("the images have {} points, {} are wanted", all.size(), wanted));
  for (size_t k = 0; k < wanted; ++k) chosen.push_back(all[k * all.size() / wanted]);
  return chosen;
}

// --- Tracking ---

template <class Warp>
Warp TrueWarp(const ImageMotion& motion, const Vector2& place) {
  Warp warp;
  warp.centre = motion(place);
  if constexpr (Warp::kParameters >= 3) warp.angle = motion.angle();
  if constexpr (Warp::kParameters == 4) warp.log_scale = std::log(motion.scale());
  return warp;
}

// The true warp made wrong; `u` in (0, 1) says in which direction, or to which side.
template <class Warp>
Warp StartWarp(Warp warp, const Start& start, double u) {
  const double direction = 2 * std::numbers::pi * u, side = u < 0.5 ? -1 : 1;
  warp.centre += start.px * Vector2(std::cos(direction), std::sin(direction));
  if constexpr (Warp::kParameters >= 3) warp.angle += side * start.deg * kDegree;
  if constexpr (Warp::kParameters == 4) warp.log_scale += side * std::log1p(start.pct / 100);
  return warp;
}

// Root mean square distance between a patch's pixels as two warps place them.
template <class Warp>
double Distance(const Warp& a, const Warp& b, std::span<const Eigen::Vector2f> offsets) {
  double sum = 0;
  typename Warp::Point at_a, at_b;
  for (const Eigen::Vector2f& offset : offsets) {
    a.At(offset.cast<double>(), at_a);
    b.At(offset.cast<double>(), at_b);
    sum += (at_a.pixel - at_b.pixel).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(offsets.size()));
}

template <class Warp>
Warp AtLevel(Warp warp, double (*convert)(double, int), int level) {
  warp.centre = {convert(warp.centre.x(), level), convert(warp.centre.y(), level)};
  return warp;
}

// Improves the warp level by level, the coarsest first; levels without room for the patch are left
// out.
// @return whether the finest level could be aligned.
template <class Residual, class Warp>
bool Track(const Residual& residual, const SamplePair& images, const ConvergenceOptions& options,
           const Vector2& place, Warp& warp) {
  const auto offsets = alignment::Offsets(options.pattern);
  const auto itself = [](const Vector2& offset) { return offset; };
  alignment::SolverSummary summary;
  for (int level = static_cast<int>(images.first.size()) - 1; level >= 0; --level) {
    const Vector2 centre(alignment::ToLevel(place.x(), level),
                         alignment::ToLevel(place.y(), level));
    alignment::Patch<Residual, Warp> patch;
    if (!alignment::MakePatch(images.first[level], centre, offsets, itself, patch)) continue;
    Warp in_level = AtLevel(warp, alignment::ToLevel, level);
    summary = alignment::AlignPatch(residual, images.second[level], patch, options.robust,
                                    options.solver, in_level);
    warp = AtLevel(in_level, alignment::FromLevel, level);
  }
  return summary.iterations > 0;
}

// The case at hand, without samples.
struct Scene {
  const Study& study;
  const Case& run;
  std::vector<GreyPair> pairs;
  std::vector<TrackedPoint> points;
  int threads;

  double DirectionOf(size_t start, int point) const {
    return Uniform01(Hash64(static_cast<uint64_t>(study.options.seed), start), point);
  }
};

using Errors = std::vector<double>;  // px, of the points; infinite where lost

template <class Warp, class Residual>
Errors TrackAll(const Residual& residual, const std::vector<SamplePair>& samples,
                const Scene& scene, const Start& start, size_t start_index) {
  Errors errors(scene.points.size());
  ParallelForBatches(static_cast<int>(errors.size()), scene.threads, [&](int k) {
    const auto& [image, place] = scene.points[k];
    const Warp truth = TrueWarp<Warp>(scene.pairs[image].motion, place);
    Warp warp = StartWarp(truth, start, scene.DirectionOf(start_index, k));
    const bool tracked = Track(residual, samples[image], scene.study.options, place, warp);
    const double error = Distance(warp, truth, alignment::Offsets(scene.study.options.pattern));
    errors[k] = tracked && std::isfinite(error) ? error : kLost;
  });
  return errors;
}

template <class F>
auto VisitMotion(PatchMotion motion, const F& f) {
  if (motion == PatchMotion::kSe2) return f(alignment::Se2Warp<double>{});
  if (motion == PatchMotion::kSimilarity) return f(alignment::SimilarityWarp<double>{});
  return f(alignment::TranslationWarp<double>{});
}

// Errors of one column, by start.
std::vector<Errors> TrackColumn(const Column& column, const std::vector<SamplePair>& samples,
                                const Scene& scene) {
  std::vector<Errors> errors;
  alignment::VisitStudiedResidual(column.residual, [&](const auto& residual) {
    if constexpr (alignment::kOfSamplesAlone<std::remove_cvref_t<decltype(residual)>>)
      VisitMotion(scene.run.motion, [&](auto warp) {
        for (const Start& start : Starts(scene.run))
          errors.push_back(
              TrackAll<decltype(warp)>(residual, samples, scene, start, errors.size()));
      });
  });
  return errors;
}

// Errors by column and start. Columns with the same epsilon share samples, which are dropped before
// those of the next.
std::vector<std::vector<Errors>> TrackColumns(const Scene& scene) {
  std::map<std::string, std::vector<size_t>> same_epsilon;
  const std::vector<Column>& columns = scene.study.columns;
  for (size_t c = 0; c < columns.size(); ++c)
    same_epsilon[YAML::Dump(WriteOptions(columns[c].epsilon))].push_back(c);
  std::vector<std::vector<Errors>> errors(columns.size());
  for (const auto& [name, members] : same_epsilon) {
    const std::vector<SamplePair> samples = MakeSamples(
        scene.pairs,
        {.gradient = scene.study.options.gradient, .epsilon = columns[members.front()].epsilon},
        scene.threads);
    for (const size_t c : members) errors[c] = TrackColumn(columns[c], samples, scene);
  }
  return errors;
}

// --- The table ---

constexpr const char* kCsvHeader =
    "case,motion,levels,unit,start,column,residual,epsilon,compared,points,converged,converged_pct,"
    "converged_low_pct,converged_high_pct,own_median_px,own_low_px,own_high_px,common,"
    "common_median_px,common_low_px,common_high_px\n";

// Errors of the points of a set.
Errors Within(const Errors& errors, const std::vector<bool>& set) {
  Errors within;
  for (size_t k = 0; k < errors.size(); ++k)
    if (set[k]) within.push_back(errors[k]);
  return within;
}

std::vector<bool> Converged(const Errors& errors, const ConvergenceOptions& options) {
  std::vector<bool> converged;
  for (const double error : errors) converged.push_back(error < options.converged_px);
  return converged;
}

// Points that all compared columns converge on, from one start.
std::vector<bool> CommonSet(const Scene& scene, const std::vector<std::vector<Errors>>& errors,
                            size_t start) {
  std::vector<bool> common(scene.points.size(), true);
  for (size_t c = 0; c < errors.size(); ++c) {
    if (!scene.study.columns[c].compared) continue;
    const std::vector<bool> own = Converged(errors[c][start], scene.study.options);
    for (size_t k = 0; k < common.size(); ++k) common[k] = common[k] && own[k];
  }
  return common;
}

std::string MedianText(const Errors& errors, const ConvergenceOptions& options) {
  const auto [low, high] =
      MedianInterval(errors, options.resamples, static_cast<uint64_t>(options.seed));
  return fmt::format("{:.6f},{:.6f},{:.6f}", Median(errors), low, high);
}

// What follows the column's name. A column that is not compared has no errors on the common set, as
// it may not have converged there.
std::string ScoreText(const Errors& errors, const std::vector<bool>& common, bool compared,
                      const ConvergenceOptions& options) {
  const Errors own = Within(errors, Converged(errors, options));
  const Errors shared = compared ? Within(errors, common) : Errors{};
  const int points = static_cast<int>(errors.size()), converged = static_cast<int>(own.size());
  const auto [low, high] = WilsonInterval(converged, points);
  return fmt::format("{},{},{:.4f},{:.4f},{:.4f},{},{},{}", points, converged,
                     100.0 * converged / points, 100 * low, 100 * high, MedianText(own, options),
                     shared.size(), MedianText(shared, options));
}

std::string CsvLines(const Scene& scene, const std::vector<std::vector<Errors>>& errors) {
  const std::vector<Column>& columns = scene.study.columns;
  const std::vector<Start> starts = Starts(scene.run);
  std::vector<std::string> lines(starts.size() * columns.size());
  ParallelFor(static_cast<int>(starts.size()), scene.threads, [&](int s) {
    const std::vector<bool> common = CommonSet(scene, errors, s);
    for (size_t c = 0; c < columns.size(); ++c)
      lines[s * columns.size() + c] =
          fmt::format("{},{},{},{},{},{},{},{},{},{}\n", scene.run.name,
                      options_internal::FormatValue(scene.run.motion), scene.run.levels,
                      starts[s].unit(), starts[s].value(), columns[c].name, columns[c].residual,
                      options_internal::FormatValue(columns[c].epsilon.scope), columns[c].compared,
                      ScoreText(errors[c][s], common, columns[c].compared, scene.study.options));
  });
  std::string text;
  for (const std::string& line : lines) text += line;
  return text;
}

std::string RunCase(const Study& study, const Case& run, const std::vector<cv::Mat1b>& images,
                    int threads) {
  Scene scene{study, run, {}, {}, threads};
  for (size_t i = 0; i < images.size(); ++i)
    scene.pairs.push_back(MakeGreyPair(images[i], study.options, run,
                                       Hash64(static_cast<uint64_t>(study.options.seed), i)));
  scene.points = ChoosePoints(scene.pairs, study, run);
  return CsvLines(scene, TrackColumns(scene));
}

}  // namespace

void RunConvergence(const ConvergenceRequest& request) {
  const Study study = ReadStudy(request.experiment);
  std::vector<cv::Mat1b> images;
  for (const std::string& file : request.images) images.push_back(ReadGrey(file));
  std::string table = kCsvHeader;
  for (const Case& run : study.cases) table += RunCase(study, run, images, request.threads);
  WriteTextFile(request.output, table);
}

}  // namespace sgf::apps
