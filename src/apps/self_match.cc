#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include <fmt/core.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/image_change.h>
#include <sgf/apps/self_match.h>
#include <sgf/core/parallel.h>
#include <sgf/core/random.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr double kTied = 1e-9;

struct PixelErrors {
  float mean_px, first_px;  // over tied disparities; of the first of them
  bool tied;
};

PixelErrors ScorePixel(const double* costs, const DisparityRange& range) {
  const double least = *std::min_element(costs, costs + range.count);
  int tied = 0, first = 0, sum = 0;
  for (int k = 0; k < range.count; ++k) {
    if (costs[k] > least + kTied) continue;
    const int error = std::abs(range.first + k);
    if (tied++ == 0) first = error;
    sum += error;
  }
  return {static_cast<float>(sum) / static_cast<float>(tied), static_cast<float>(first), tied > 1};
}

// The pixels that are scored.
cv::Rect ScoredArea(const SampleField& image, int window, const DisparityRange& range) {
  const int margin = window / 2 + 1;
  const cv::Point from(margin + std::max(0, range.last()), margin);
  const cv::Point to(image.cols() - margin + std::min(0, range.first), image.rows() - margin);
  if (from.x >= to.x || from.y >= to.y)
    throw Error("image", fmt::format("{}x{} pixels are too few for disparities {} to {} px",
                                     image.cols(), image.rows(), range.first, range.last()));
  return {from, to};
}

// Rows that are matched together, so that most pixel pairs are compared once.
constexpr int kBandRows = 8;

// Costs of a band of windows at all disparities.
template <class Cost>
class CostBand {
 public:
  CostBand(const Cost& cost, const SampleField& left, const SampleField& right, int window,
           const DisparityRange& range)
      : cost_(cost), left_(left), right_(right), window_(window), range_(range) {}

  const DisparityRange& range() const { return range_; }

  // Costs of the windows centred on the pixels of the area, row by row, all disparities of a pixel
  // together.
  std::vector<double> At(const cv::Rect& area) const {
    std::vector<double> costs(static_cast<size_t>(area.area()) * range_.count);
    for (int k = 0; k < range_.count; ++k) {
      const std::vector<Sums> pairs = Pairs(area, range_.first + k);
      for (int y = 0; y < area.height; ++y)
        SumWindows(pairs, area.width, y,
                   costs.data() + static_cast<size_t>(y) * area.width * range_.count + k);
    }
    return costs;
  }

 private:
  using Sums = typename Cost::Sums;

  // All pixel pairs that the windows of the area see.
  std::vector<Sums> Pairs(const cv::Rect& area, int disparity) const {
    const int radius = window_ / 2, width = area.width + 2 * radius;
    std::vector<Sums> pairs(static_cast<size_t>(width) * (area.height + 2 * radius));
    Sums* pair = pairs.data();
    for (int y = area.y - radius; y < area.y + area.height + radius; ++y, pair += width) {
      const metrics::Sample<double>* left = &left_.At(y, area.x - radius);
      const metrics::Sample<double>* right = &right_.At(y, area.x - radius - disparity);
      for (int x = 0; x < width; ++x) pair[x] = cost_.Pair(left[x], right[x]);
    }
    return pairs;
  }

  // Costs of one row of windows, `range.count` apart.
  void SumWindows(const std::vector<Sums>& pairs, int width, int row, double* costs) const {
    const int stride = width + window_ - 1;
    std::vector<Sums> columns(pairs.begin() + static_cast<ptrdiff_t>(row) * stride,
                              pairs.begin() + static_cast<ptrdiff_t>(row + 1) * stride);
    for (int w = 1; w < window_; ++w)
      for (int c = 0; c < stride; ++c) columns[c] += pairs[(row + w) * stride + c];
    for (int x = 0; x < width; ++x, costs += range_.count) {
      Sums sums = columns[x];
      for (int w = 1; w < window_; ++w) sums += columns[x + w];
      *costs = cost_.Value(sums);
    }
  }

  const Cost& cost_;
  const SampleField& left_;
  const SampleField& right_;
  int window_;
  DisparityRange range_;
};

// Per scored pixel.
struct ErrorMaps {
  cv::Mat1f mean_px, first_px;
  cv::Mat1b tied;

  explicit ErrorMaps(cv::Size size) : mean_px(size), first_px(size), tied(size) {}
};

template <class Cost>
ErrorMaps MatchArea(const CostBand<Cost>& cost_band, const cv::Rect& area, int threads) {
  const DisparityRange range = cost_band.range();
  ErrorMaps maps(area.size());
  ParallelFor((area.height + kBandRows - 1) / kBandRows, threads, [&](int band) {
    const int begin = band * kBandRows, end = std::min(begin + kBandRows, area.height);
    const std::vector<double> costs =
        cost_band.At({area.x, area.y + begin, area.width, end - begin});
    const double* pixel = costs.data();
    for (int y = begin; y < end; ++y)
      for (int x = 0; x < area.width; ++x, pixel += range.count) {
        const PixelErrors errors = ScorePixel(pixel, range);
        maps.mean_px(y, x) = errors.mean_px;
        maps.first_px(y, x) = errors.first_px;
        maps.tied(y, x) = errors.tied;
      }
  });
  return maps;
}

SelfMatchScores Summarise(const ErrorMaps& maps) {
  SelfMatchScores scores;
  scores.pixels = static_cast<int>(maps.mean_px.total());
  scores.mean_px = cv::mean(maps.mean_px)[0];
  scores.first_px = cv::mean(maps.first_px)[0];
  scores.bad1_pct = 100.0 * cv::countNonZero(maps.mean_px > 1) / scores.pixels;
  scores.ties_pct = 100.0 * cv::countNonZero(maps.tied) / scores.pixels;
  std::vector<float> errors(maps.mean_px.begin(), maps.mean_px.end());
  const auto middle = errors.begin() + (scores.pixels - 1) / 2;
  std::nth_element(errors.begin(), middle, errors.end());
  scores.median_px = *middle;
  return scores;
}

// The study as its file describes it.
struct Study {
  struct Matching {
    int window = 3;
    std::vector<std::vector<int>> ranges{{0, 20}};
    int seed = 1;

    template <class V>
    void VisitFields(V&& visit) {
      visit("window", window, "px", "side of the square window, odd");
      visit("ranges", ranges, "px", "disparities searched: pairs of first and last + 1");
      visit("seed", seed, "", "chooses the noise");
    }
  };
  struct Column {
    std::string name;
    std::string metric;
    SampleOptions samples;
    stereo::PmOptions pm;
    bool extra = false;  // for the tables

    template <class V>
    void VisitFields(V&& visit) {
      visit("metric", metric, "", "dissimilarity, one of the name table");
      visit("samples", samples, "", "gradients and their normalisation");
      visit("pm", pm, "", "parameters of pm, eq. 4");
      visit("extra", extra, "", "not a column of the paper");
    }
  };
  struct Variant {
    std::string change;  // name of the case, or the option that a curve varies
    std::string value;   // of that option, as the file has it; empty for a case
    ImageChange image;

    bool is_case() const { return value.empty(); }
  };

  Matching matching;
  std::vector<DisparityRange> ranges;
  std::vector<Column> columns;
  std::vector<Variant> variants;
};

void AddVariant(const std::string& change, const std::string& value, const YAML::Node& options,
                const std::string& file, Study& study) {
  Study::Variant variant{change, value, {}};
  ReadOptions(options, variant.image, file);
  try {
    CheckChange(variant.image);
  } catch (const Error& error) {
    throw Error(file, fmt::format("{}: {}", change, error.what()));
  }
  study.variants.push_back(variant);
}

void ReadVariants(const YAML::Node& root, const std::string& file, Study& study) {
  for (const auto& entry : root["cases"])
    AddVariant(entry.first.Scalar(), "", entry.second, file, study);
  for (const auto& entry : root["curves"]) {
    const std::string& option = entry.first.Scalar();
    if (!entry.second.IsSequence())
      throw Error(options_internal::At(file, entry.second),
                  fmt::format("curves.{}: expected a list of values", option));
    for (const YAML::Node& value : entry.second) {
      YAML::Node options;
      options[option] = value;
      AddVariant(option, value.Scalar(), options, file, study);
    }
  }
}

void ReadColumns(const YAML::Node& root, const std::string& file, Study& study) {
  for (const auto& entry : root["columns"]) {
    Study::Column column;
    column.name = entry.first.Scalar();
    ReadOptions(entry.second, column, file);
    study.columns.push_back(column);
  }
  if (study.columns.empty()) throw Error(file, "columns: expected at least one");
}

void ReadMatching(const YAML::Node& root, const std::string& file, Study& study) {
  ReadOptions(root["matching"], study.matching, file);
  for (const std::vector<int>& range : study.matching.ranges) {
    if (range.size() != 2 || range[0] >= range[1])
      throw Error(file, "ranges: expected pairs of a first disparity and a larger end");
    study.ranges.push_back({range[0], range[1] - range[0]});
  }
  if (study.ranges.empty()) throw Error(file, "ranges: expected at least one");
}

Study ReadStudy(const std::string& file) {
  const YAML::Node root = LoadYamlFile(file);
  for (const char* key : {"matching", "columns", "cases", "curves"})
    if (!root.IsMap() || !root[key] || !root[key].IsMap())
      throw Error(file, fmt::format("expected a map under the key '{}'", key));
  Study study;
  ReadMatching(root, file, study);
  ReadColumns(root, file, study);
  ReadVariants(root, file, study);
  return study;
}

// Both images of a variant, as matched.
struct ImagePair {
  cv::Mat left, right;
};

// The left image gets noise, of its own, and nothing else.
ImagePair MakePair(const cv::Mat1b& image, const ImageChange& change, int seed) {
  ImageChange noise_only;
  noise_only.noise = change.noise;
  noise_only.quantise = change.quantise;
  return {ApplyChange(image, noise_only, Hash64(seed, 0)),
          ApplyChange(image, change, Hash64(seed, 1))};
}

void WriteGreyPng(const fs::path& path, const cv::Mat& image) {
  cv::Mat1b levels;
  image.convertTo(levels, CV_8U);
  WritePng(path, levels);
}

void WriteErrorPng(const fs::path& path, const cv::Mat1f& error_px) {
  constexpr float kLevelsPerPx = 10, kLargest = 254;
  cv::Mat1b levels(error_px.size(), uchar{255});
  for (int y = 0; y < levels.rows; ++y)
    for (int x = 0; x < levels.cols; ++x)
      if (const float error = error_px(y, x); !std::isnan(error))
        levels(y, x) = cv::saturate_cast<uchar>(std::min(kLargest, kLevelsPerPx * error));
  WritePng(path, levels);
}

// Both images' samples; columns with the same options share them.
class FieldPairs {
 public:
  struct Fields {
    SampleField left, right;
  };

  explicit FieldPairs(ImagePair images) : images_(std::move(images)) {}

  const Fields& Get(const SampleOptions& options) {
    const std::string key = YAML::Dump(WriteOptions(options));
    const auto it = fields_.find(key);
    if (it != fields_.end()) return it->second;
    return fields_.emplace(key, Fields{{images_.left, options}, {images_.right, options}})
        .first->second;
  }

 private:
  ImagePair images_;
  std::map<std::string, Fields> fields_;
};

// Where the pictures of a case go; empty where none are wanted.
fs::path MapsFolder(const Study::Variant& variant, const std::string& maps) {
  if (!variant.is_case() || maps.empty()) return {};
  fs::path folder = fs::path(maps) / variant.change;
  MakeFolder(folder);
  return folder;
}

// The CSV lines of one variant.
std::string MatchVariant(const Study& study, const Study::Variant& variant, const cv::Mat1b& image,
                         const SelfMatchRequest& request) {
  const ImagePair images = MakePair(image, variant.image, study.matching.seed);
  const fs::path folder = MapsFolder(variant, request.maps);
  if (!folder.empty()) WriteGreyPng(folder / "left.png", images.left);
  if (!folder.empty()) WriteGreyPng(folder / "right.png", images.right);
  FieldPairs pairs(images);
  std::string lines;
  // Curves are drawn for the first range only.
  const size_t num_ranges = variant.is_case() ? study.ranges.size() : 1;
  for (size_t r = 0; r < num_ranges; ++r)
    for (const Study::Column& column : study.columns) {
      const DisparityRange& range = study.ranges[r];
      const auto& [left, right] = pairs.Get(column.samples);
      const auto [error_px, s] = MatchSelf(left, right, column.metric, column.pm,
                                           study.matching.window, range, request.threads);
      if (!folder.empty() && r == 0) WriteErrorPng(folder / (column.name + ".png"), error_px);
      lines +=
          fmt::format("{},{},{},{},{},{},{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f}\n", request.name,
                      variant.change, variant.value, column.name, range.first, range.last() + 1,
                      s.pixels, s.mean_px, s.first_px, s.median_px, s.bad1_pct, s.ties_pct);
    }
  return lines;
}

}  // namespace

SelfMatchResult MatchSelf(const SampleField& left, const SampleField& right,
                          const std::string& metric, const stereo::PmOptions& pm, int window,
                          const DisparityRange& range, int threads) {
  if (window < 1 || window % 2 == 0)
    throw Error("window", fmt::format("must be odd and positive, got {}", window));
  if (left.rows() != right.rows() || left.cols() != right.cols())
    throw Error("image", "the two sides differ in size");
  const cv::Rect area = ScoredArea(left, window, range);
  const ErrorMaps maps = VisitWindowCost(metric, pm, [&](const auto& cost) {
    return MatchArea(CostBand(cost, left, right, window, range), area, threads);
  });
  SelfMatchResult result{cv::Mat1f(left.rows(), left.cols(), kNone), Summarise(maps)};
  maps.mean_px.copyTo(result.error_px(area));
  return result;
}

void RunSelfMatch(const SelfMatchRequest& request) {
  const Study study = ReadStudy(request.experiment);
  const cv::Mat1b image = ReadGrey(request.image);
  std::string table =
      "image,change,value,column,first_disparity,end_disparity,pixels,mean_px,first_px,median_px,"
      "bad1_pct,ties_pct\n";
  for (const Study::Variant& variant : study.variants)
    table += MatchVariant(study, variant, image, request);
  AtomicFile file(request.output);
  file.Write(table);
  file.Commit();
}

}  // namespace sgf::apps
