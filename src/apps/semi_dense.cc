#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/apps/cli.h>
#include <sgf/apps/image_change.h>
#include <sgf/apps/semi_dense.h>
#include <sgf/core/error.h>
#include <sgf/core/gradient.h>
#include <sgf/core/options.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>

namespace sgf::apps {
namespace {

namespace fs = std::filesystem;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

cv::Mat1f Magnitude(const GradientImage& gradient) {
  cv::Mat1f magnitude;
  cv::magnitude(gradient.x, gradient.y, magnitude);
  return magnitude;
}

// Mean gradient magnitude over the matching window around every pixel, in units of the image's
// root mean square: an exposure of the whole image does not count as strength.
cv::Mat1f PatchStrength(const cv::Mat1b& image, const stereo::BlockMatcherOptions& options) {
  const GradientImage gradient = ComputeGradient(image, options.gradient);
  cv::Mat1f mean;
  cv::boxFilter(Magnitude(gradient), mean, CV_32F, {options.window, options.window}, {-1, -1}, true,
                cv::BORDER_REPLICATE);
  return mean / std::sqrt(MeanSquaredGradient(gradient));
}

// Whether a depth can be told from a disparity; NaN has none.
bool HasDepth(float disparity, const MiddleburyCalib& calib) { return disparity + calib.doffs > 0; }

// Index of the smallest of `count` sorted values that a share of them does not exceed.
size_t QuantileIndex(double share, size_t count) {
  const auto rank = static_cast<size_t>(std::ceil(share * static_cast<double>(count)));
  return std::max<size_t>(rank, 1) - 1;
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return kNan;
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(QuantileIndex(share, values.size()));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double Percent(size_t part, size_t whole) {
  return whole == 0 ? kNan : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

// Takes the points of one reconstruction and what their scores need.
class Reconstruction {
 public:
  Reconstruction(const StereoPair& pair, const MiddleburyCalib& calib,
                 const SemiDenseOptions& options)
      : calib_(calib),
        options_(options),
        left_(ToGrey(pair.left)),
        left_strength_(PatchStrength(left_, options.matcher)),
        right_strength_(PatchStrength(ToGrey(pair.right), options.matcher)) {}

  void AddCandidate(int x, int y, float disparity, float truth) {
    ++depth_.scores.candidates;
    if (!HasDepth(disparity, calib_)) return;
    const double z = calib_.Depth(disparity), true_z = calib_.Depth(truth);
    const auto at = [&](double ray) { return static_cast<float>(ray / calib_.f * z); };
    depth_.points.push_back({{at(x - calib_.cx), at(y - calib_.cy), static_cast<float>(z)},
                             left_(y, x),
                             static_cast<float>(z - true_z)});
    const double relative_pct = 100 * std::abs(z - true_z) / true_z;
    errors_m_.push_back(std::abs(z - true_z));
    errors_pct_.push_back(relative_pct);
    if (relative_pct <= options_.bad_pct) return;
    ++bad_;
    bad_stronger_ += MatchIsStronger(x, y, disparity);
  }

  SemiDenseDepth Finish() {
    SemiDenseScores& s = depth_.scores;
    s.kept = static_cast<int>(depth_.points.size());
    s.kept_pct = Percent(depth_.points.size(), static_cast<size_t>(s.candidates));
    s.median_m = Quantile(errors_m_, 0.5);
    s.p90_m = Quantile(errors_m_, 0.9);
    s.median_pct = Quantile(errors_pct_, 0.5);
    s.p90_pct = Quantile(errors_pct_, 0.9);
    s.bad_pct = Percent(bad_, depth_.points.size());
    s.bad_stronger_pct = Percent(bad_stronger_, bad_);
    return std::move(depth_);
  }

 private:
  bool MatchIsStronger(int x, int y, float disparity) const {
    const int x_right = std::clamp(static_cast<int>(std::lround(static_cast<float>(x) - disparity)),
                                   0, right_strength_.cols - 1);
    return right_strength_(y, x_right) > left_strength_(y, x);
  }

  MiddleburyCalib calib_;
  SemiDenseOptions options_;
  cv::Mat1b left_;
  cv::Mat1f left_strength_, right_strength_;
  SemiDenseDepth depth_;
  std::vector<double> errors_m_, errors_pct_;
  size_t bad_ = 0, bad_stronger_ = 0;
};

void RequireNotNegative(const char* option, double value) {
  if (!(value >= 0)) throw Error(option, fmt::format("must not be negative, got {}", value));
}

void CheckOptions(const SemiDenseOptions& options) {
  RequireNotNegative("min_gradient", options.min_gradient);
  RequireNotNegative("min_epipolar_gradient", options.min_epipolar_gradient);
  RequireNotNegative("bad_pct", options.bad_pct);
}

void RequireKnownScene(const StereoPair& pair, const MiddleburyCalib& calib) {
  if (pair.truth_all.empty()) throw Error(pair.name, "has no ground truth");
  if (pair.left.size() != cv::Size(calib.width, calib.height))
    throw Error(pair.name, fmt::format("images are {}x{}, calib.txt says {}x{}", pair.left.cols,
                                       pair.left.rows, calib.width, calib.height));
}

SemiDenseDepth FromDisparity(const cv::Mat1f& disparity, const StereoPair& pair,
                             const MiddleburyCalib& calib, const SemiDenseOptions& options) {
  CheckOptions(options);
  const cv::Mat1b selected = SelectPixels(ToGrey(pair.left), options);
  Reconstruction reconstruction(pair, calib, options);
  for (int y = 0; y < selected.rows; ++y)
    for (int x = 0; x < selected.cols; ++x)
      if (selected(y, x) != 0 && HasDepth(pair.truth_all(y, x), calib))
        reconstruction.AddCandidate(x, y, disparity(y, x), pair.truth_all(y, x));
  return reconstruction.Finish();
}

}  // namespace

cv::Mat1b SelectPixels(const cv::Mat1b& left, const SemiDenseOptions& options) {
  const GradientImage gradient = ComputeGradient(left, options.matcher.gradient);
  return (Magnitude(gradient) >= options.min_gradient) &
         (cv::abs(gradient.x) >= options.min_epipolar_gradient);
}

SemiDenseDepth ReconstructSemiDense(const StereoPair& pair, const MiddleburyCalib& calib,
                                    const SemiDenseOptions& options) {
  RequireKnownScene(pair, calib);
  stereo::BlockMatcherOptions matching = options.matcher;
  matching.num_disparities = calib.ndisp;
  const stereo::BlockMatcher matcher(matching);
  cv::Mat1s disparity;
  matcher.Compute(ToGrey(pair.left), ToGrey(pair.right), disparity);
  return FromDisparity(matcher.ToFloat(disparity), pair, calib, options);
}

SemiDenseDepth TrueSemiDense(const StereoPair& pair, const MiddleburyCalib& calib,
                             const SemiDenseOptions& options) {
  RequireKnownScene(pair, calib);
  return FromDisparity(pair.truth_all, pair, calib, options);
}

namespace {

void AppendFloat(std::string& bytes, float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(bits >> shift & 0xFF);
}

}  // namespace

std::string ToPly(const std::vector<SemiDensePoint>& points) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property float depth_error\nend_header\n",
      points.size());
  for (const SemiDensePoint& point : points) {
    for (const float coordinate : point.position) AppendFloat(bytes, coordinate);
    bytes.append(3, static_cast<char>(point.grey));
    AppendFloat(bytes, point.depth_error);
  }
  return bytes;
}

namespace {

struct Case {
  std::string name;
  ImageChange right;
  stereo::BlockMatcherOptions matcher;

  template <class V>
  void VisitFields(V&& visit) {
    visit("right", right, "", "change of the right image");
    visit("matcher", matcher, "", "options of the matcher, on top of the study's");
  }
};

struct Column {
  std::string name;
  stereo::BlockMatcherOptions options;
  bool extra = false;

  template <class V>
  void VisitFields(V&& visit) {
    visit("options", options, "", "options of the matcher, on top of the case's");
    visit("extra", extra, "", "only a line of the table, no points");
  }
};

struct Study {
  SemiDenseOptions options;
  YAML::Node cases, columns;
};

// Other keys of the file are about the figure.
Study ReadStudy(const SemiDenseRequest& request) {
  const std::string& file = request.experiment;
  const YAML::Node root = LoadYamlFile(file);
  if (!root.IsMap()) throw Error(file, "expected a map");
  for (const char* key : {"study", "cases", "columns"})
    if (!root[key] || !root[key].IsMap())
      throw Error(file, fmt::format("key '{}' is missing or no map", key));
  Study study{{}, root["cases"], root["columns"]};
  ReadOptions(root["study"], study.options, file);
  study.options.matcher.threads = request.threads;
  return study;
}

constexpr const char* kCsvHeader =
    "pair,case,column,candidates,kept,kept_pct,median_m,p90_m,median_pct,p90_pct,bad_pct,"
    "bad_stronger_pct\n";

std::string CsvLine(const SemiDenseScores& s) {
  return fmt::format("{},{},{:.4f},{:.6f},{:.6f},{:.4f},{:.4f},{:.4f},{:.4f}\n", s.candidates,
                     s.kept, s.kept_pct, s.median_m, s.p90_m, s.median_pct, s.p90_pct, s.bad_pct,
                     s.bad_stronger_pct);
}

// The known scene that all cases share, and what has been written of it.
class StudyRun {
 public:
  StudyRun(const SemiDenseRequest& request, const Study& study)
      : request_(request),
        study_(study),
        pair_(LoadStereoScene(FindMiddleburyScene(request.pair))),
        calib_(ReadMiddleburyCalib(fs::path(request.pair) / "calib.txt")) {
    MakeFolder(request.output);
  }

  void WriteTruth() const {
    WriteTextFile(Out("truth.ply"), ToPly(TrueSemiDense(pair_, calib_, study_.options).points));
  }

  void RunCase(const std::string& name, const YAML::Node& node) {
    Case run{name, {}, study_.options.matcher};
    ReadOptions(node, run, request_.experiment);
    CheckChange(run.right);
    MakeFolder(Out(name));
    StereoPair pair = pair_;
    pair.right = ApplyChange(ToGrey(pair_.right), run.right, kNoiseSeed);
    for (const auto& entry : study_.columns)
      RunColumn(run, pair, entry.first.Scalar(), entry.second);
  }

  void WriteScores() const {
    WriteTextFile(Out("options.yaml"), YAML::Dump(resolved_) + "\n");
    WriteTextFile(Out("scores.csv"), table_);
  }

 private:
  static constexpr uint64_t kNoiseSeed = 1;

  fs::path Out(const std::string& name) const { return fs::path(request_.output) / name; }

  void RunColumn(const Case& run, const StereoPair& pair, const std::string& name,
                 const YAML::Node& node) {
    Column column{name, run.matcher};
    ReadOptions(node, column, request_.experiment);
    SemiDenseOptions options = study_.options;
    options.matcher = column.options;
    const SemiDenseDepth depth = ReconstructSemiDense(pair, calib_, options);
    table_ += fmt::format("{},{},{},", pair.name, run.name, name) + CsvLine(depth.scores);
    resolved_[run.name]["right"] = WriteOptions(run.right);
    resolved_[run.name][name] = WriteOptions(options);
    if (!column.extra) WriteTextFile(Out(run.name) / (name + ".ply"), ToPly(depth.points));
  }

  SemiDenseRequest request_;
  Study study_;
  StereoPair pair_;
  MiddleburyCalib calib_;
  std::string table_ = kCsvHeader;
  YAML::Node resolved_;
};

}  // namespace

void RunSemiDense(const SemiDenseRequest& request) {
  const Study study = ReadStudy(request);
  StudyRun run(request, study);
  run.WriteTruth();
  for (const auto& entry : study.cases) run.RunCase(entry.first.Scalar(), entry.second);
  run.WriteScores();
}

}  // namespace sgf::apps
