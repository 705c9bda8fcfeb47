#include <algorithm>
#include <filesystem>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/apps/cli.h>
#include <sgf/apps/image_change.h>
#include <sgf/apps/shift_profile.h>
#include <sgf/core/random.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>
#include <sgf/io/pfm.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

void RequireLevels(const char* option, const std::vector<double>& levels) {
  if (levels.size() < 2) throw Error(option, "expected at least two grey levels");
  for (const double level : levels)
    if (!(level >= 0 && level <= 255))
      throw Error(option, fmt::format("must be in [0, 255], got {}", level));
}

void RequireAtLeast(const char* option, int least, int value) {
  if (value < least) throw Error(option, fmt::format("must be at least {}, got {}", least, value));
}

void CheckToy(const ToyOptions& o) {
  RequireLevels("levels", o.levels);
  RequireLevels("small_levels", o.small_levels);
  if (o.reference_edge < 0 || o.reference_edge + 1 >= static_cast<int>(o.levels.size()))
    throw Error("reference_edge",
                fmt::format("{} boxes have no edge {}", o.levels.size(), o.reference_edge));
  RequireAtLeast("box_width", 1, o.box_width);
  RequireAtLeast("box_height", 1, o.box_height);
  RequireAtLeast("small_box", 1, o.small_box);
  RequireAtLeast("small_rows", 0, o.small_rows);
  if (!(o.blur >= 0 && o.blur <= 100))
    throw Error("blur", fmt::format("must be in [0, 100], got {}", o.blur));
}

void CheckProfile(const ProfileOptions& o) {
  RequireAtLeast("minimum_distance", 1, o.minimum_distance);
  if (!(o.minimum_share > 0 && o.minimum_share <= 1))
    throw Error("minimum_share", fmt::format("must be in (0, 1], got {}", o.minimum_share));
}

// Grey level before the blur.
double ToyLevel(const ToyOptions& o, int x, int y) {
  const int strip = o.small_rows * o.small_box;
  if (y >= strip && y < strip + o.box_height) return o.levels[x / o.box_width];
  // Below the strip rows are counted upwards, so that the image is symmetric about the line.
  const int from_border = y < strip ? y : 2 * strip + o.box_height - 1 - y;
  return o.small_levels[(x / o.small_box + from_border / o.small_box) % o.small_levels.size()];
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void WriteGradient(const fs::path& folder, const std::string& row, const SampleField& field) {
  cv::Mat1f ax(field.rows(), field.cols()), ay(field.rows(), field.cols());
  for (int y = 0; y < field.rows(); ++y)
    for (int x = 0; x < field.cols(); ++x) {
      ax(y, x) = static_cast<float>(field.At(y, x).ax);
      ay(y, x) = static_cast<float>(field.At(y, x).ay);
    }
  WritePfm(folder / (row + "_ax.pfm"), ax);
  WritePfm(folder / (row + "_ay.pfm"), ay);
}

struct Tables {
  std::string profiles = "row,metric,shift_px,error\n";
  std::string minima = "row,metric,shift_px,error,least\n";
};

void AddProfile(const std::string& row, const std::string& metric, const Profile& profile,
                const ProfileOptions& options, Tables& tables) {
  for (size_t k = 0; k < profile.errors.size(); ++k)
    tables.profiles += fmt::format("{},{},{},{:.6f}\n", row, metric,
                                   profile.first + static_cast<int>(k), profile.errors[k]);
  const double least = *std::min_element(profile.errors.begin(), profile.errors.end());
  for (const Minimum& m : FindMinima(profile, options))
    tables.minima += fmt::format("{},{},{},{:.6f},{}\n", row, metric, m.shift, m.error,
                                 m.error == least ? 1 : 0);
}

void WriteRow(const ShiftStudy& study, const std::string& name, const ShiftRow& row,
              const fs::path& folder, Tables& tables) {
  for (size_t m = 0; m < row.profiles.size(); ++m)
    AddProfile(name, study.profile.metrics[m], row.profiles[m], study.profile, tables);
  WritePng(folder / (name + ".png"), row.image);
  WriteGradient(folder, name, row.samples);
}

}  // namespace

Toy MakeToy(const ToyOptions& options) {
  CheckToy(options);
  const int num_boxes = static_cast<int>(options.levels.size());
  cv::Mat1d image(2 * options.small_rows * options.small_box + options.box_height,
                  num_boxes * options.box_width);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) image(y, x) = ToyLevel(options, x, y);
  if (options.blur > 0) cv::GaussianBlur(image, image, cv::Size(), options.blur);
  Toy toy;
  image.convertTo(toy.image, CV_8U);
  toy.reference = {options.box_width * (options.reference_edge + 1), image.rows / 2};
  for (int edge = 0; edge + 1 < num_boxes; ++edge)
    toy.edges.push_back((edge - options.reference_edge) * options.box_width);
  return toy;
}

Profile ShiftPatch(const SampleField& reference, const SampleField& image, cv::Point centre,
                   const std::string& metric, const ProfileOptions& options) {
  const int rx = options.patch_width / 2, ry = options.patch_height / 2;
  if (options.patch_width < 1 || options.patch_width % 2 == 0 || options.patch_height < 1 ||
      options.patch_height % 2 == 0)
    throw Error("patch", fmt::format("sides must be odd and positive, got {} x {} px",
                                     options.patch_width, options.patch_height));
  const int first = rx + 1, end = image.cols() - rx - 1;
  if (centre.x < first || centre.x >= end || centre.y <= ry || centre.y >= image.rows() - ry - 1)
    throw Error("patch",
                fmt::format("{} x {} px do not fit into the image around ({}, {})",
                            options.patch_width, options.patch_height, centre.x, centre.y));
  Profile profile;
  profile.first = first - centre.x;
  VisitWindowCost(metric, options.pm, [&](const auto& cost) {
    for (int shift = profile.first; centre.x + shift < end; ++shift) {
      auto sums = cost.Pair(reference.At(centre.y - ry, centre.x - rx),
                            image.At(centre.y - ry, centre.x - rx + shift));
      for (int k = 1; k < options.patch_width * options.patch_height; ++k) {
        const int y = centre.y - ry + k / options.patch_width;
        const int x = centre.x - rx + k % options.patch_width;
        sums += cost.Pair(reference.At(y, x), image.At(y, x + shift));
      }
      const int pixels = cost.kGrowsWithWindow ? options.patch_width * options.patch_height : 1;
      profile.errors.push_back(cost.Value(sums) / pixels);
    }
  });
  return profile;
}

std::vector<Minimum> FindMinima(const Profile& profile, const ProfileOptions& options) {
  const std::vector<double>& e = profile.errors;
  std::vector<Minimum> minima;
  if (e.empty()) return minima;
  const double least = *std::min_element(e.begin(), e.end());
  const double limit = least + options.minimum_share * (Median(e) - least);
  const int count = static_cast<int>(e.size());
  for (int k = 1; k + 1 < count; ++k) {
    const auto from = e.begin() + std::max(0, k - options.minimum_distance);
    const auto to = e.begin() + std::min(count, k + options.minimum_distance + 1);
    if (e[k] <= limit && std::min_element(from, to) == e.begin() + k)
      minima.push_back({profile.first + k, e[k]});
  }
  return minima;
}

ShiftStudy ReadShiftStudy(const std::string& file) {
  const YAML::Node root = LoadYamlFile(file);
  if (!root.IsMap() || !root["study"]) throw Error(file, "key 'study' is missing");
  ShiftStudy study;
  ReadOptions(root["study"], study, file);
  return study;
}

ShiftRow MakeShiftRow(const ShiftStudy& study, const Toy& toy, double noise) {
  ImageChange change;
  change.noise = noise;
  const SampleField reference(ApplyChange(toy.image, change, Hash64(study.seed, 0)),
                              study.profile.samples);
  const cv::Mat1b image = ApplyChange(toy.image, change, Hash64(study.seed, 1));
  ShiftRow row{image, SampleField(image, study.profile.samples), {}};
  for (const std::string& metric : study.profile.metrics)
    row.profiles.push_back(
        ShiftPatch(reference, row.samples, toy.reference, metric, study.profile));
  return row;
}

void RunShiftProfile(const ShiftProfileRequest& request) {
  const ShiftStudy study = ReadShiftStudy(request.experiment);
  CheckProfile(study.profile);
  const Toy toy = MakeToy(study.toy);
  const fs::path folder = request.output;
  MakeFolder(folder);
  Tables tables;
  WriteRow(study, "noise_free", MakeShiftRow(study, toy, 0), folder, tables);
  WriteRow(study, "noisy", MakeShiftRow(study, toy, study.noise), folder, tables);
  std::string edges = "shift_px,step\n";
  for (size_t k = 0; k < toy.edges.size(); ++k)
    edges += fmt::format("{},{:g}\n", toy.edges[k], study.toy.levels[k + 1] - study.toy.levels[k]);
  WriteTextFile(folder / "edges.csv", edges);
  WriteTextFile(folder / "minima.csv", tables.minima);
  WriteTextFile(folder / "profiles.csv", tables.profiles);
}

}  // namespace sgf::apps
