#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/synth/exposure.h>

namespace sgf::synth {
namespace {

// Darker images count as this level. It bounds the answer to a black one.
constexpr double kLeastLevel = 1e-3;

void Require(bool condition, const std::string& key, double value, const char* rule) {
  if (!condition) throw Error(key, fmt::format("is {}; it {}", value, rule));
}

void RequireWindow(const std::string& key, double from_s, double to_s) {
  if (!(from_s <= to_s))
    throw Error(key, fmt::format("begins at {} s and ends at {} s", from_s, to_s));
}

bool IsPositive(double value) { return value > 0 && std::isfinite(value); }

void CheckAutoExposure(const AutoExposureOptions& o) {
  Require(o.percentile >= 0 && o.percentile <= 100, "automatic.percentile", o.percentile,
          "has to be from 0 to 100");
  Require(o.target > 0 && o.target < 1, "automatic.target", o.target, "has to be between 0 and 1");
  Require(o.time_constant_frames >= 0, "automatic.time_constant_frames", o.time_constant_frames,
          "must not be negative");
}

ExposureOptions Checked(ExposureOptions o) {
  Require(IsPositive(o.base_ms), "base_ms", o.base_ms, "has to be positive");
  Require(IsPositive(o.min_ms), "min_ms", o.min_ms, "has to be positive");
  Require(o.max_ms >= o.min_ms && std::isfinite(o.max_ms), "max_ms", o.max_ms,
          "must not be below min_ms");
  Require(o.base_ms >= o.min_ms && o.base_ms <= o.max_ms, "base_ms", o.base_ms,
          "has to be from min_ms to max_ms");
  CheckAutoExposure(o.automatic);
  for (size_t i = 0; i < o.jumps.size(); ++i) {
    const std::string key = fmt::format("jumps[{}]", i);
    RequireWindow(key, o.jumps[i].from_s, o.jumps[i].to_s);
    Require(IsPositive(o.jumps[i].factor), key + ".factor", o.jumps[i].factor,
            "has to be positive");
  }
  return o;
}

template <class Level>
std::vector<int64_t> Histogram(const cv::Mat& image, size_t levels) {
  std::vector<int64_t> counts(levels);
  for (int y = 0; y < image.rows; ++y) {
    const auto* row = image.ptr<Level>(y);
    for (int x = 0; x < image.cols; ++x) ++counts[row[x]];
  }
  return counts;
}

double Mean(const std::vector<int64_t>& counts, const std::vector<double>& values, int64_t total) {
  double sum = 0;
  for (size_t i = 0; i < counts.size(); ++i) sum += static_cast<double>(counts[i]) * values[i];
  return sum / static_cast<double>(total);
}

// Least value that at least `percentile` % of the pixels do not exceed.
double Percentile(const std::vector<int64_t>& counts, const std::vector<double>& values,
                  int64_t total, double percentile) {
  const double wanted = percentile / 100 * static_cast<double>(total);
  int64_t below = 0;
  size_t level = 0;
  while (level + 1 < counts.size()) {
    below += counts[level];
    if (below > 0 && static_cast<double>(below) >= wanted) break;
    ++level;
  }
  return values[level];
}

void RequireGroup(const std::string& group, const std::vector<std::string>& groups,
                  const std::string& key) {
  if (std::find(groups.begin(), groups.end(), group) != groups.end()) return;
  std::string known;
  for (const std::string& name : groups) known += (known.empty() ? "" : ", ") + name;
  throw Error(key + ".group", fmt::format("is '{}'; the scene has {}", group, known));
}

// Share in [0, 1] of a change that begins at `begin_s` and is whole `ramp_s` later.
double Ramp(double time_s, double begin_s, double ramp_s) {
  if (ramp_s == 0 || std::isinf(begin_s)) return time_s >= begin_s ? 1 : 0;
  return std::clamp((time_s - begin_s) / ramp_s, 0., 1.);
}

}  // namespace

std::span<const std::pair<const char*, ExposureStatistic>> EnumNames(ExposureStatistic) {
  static constexpr std::array<std::pair<const char*, ExposureStatistic>, 2> kNames{
      {{"mean", ExposureStatistic::kMean}, {"percentile", ExposureStatistic::kPercentile}}};
  return kNames;
}

double SignalLevel(const cv::Mat& image, const std::vector<double>& inverse_response,
                   const AutoExposureOptions& options) {
  const size_t levels = image.type() == CV_8UC1 ? 256 : image.type() == CV_16UC1 ? 65536 : 0;
  if (image.empty() || levels != inverse_response.size())
    throw Error("auto-exposure",
                fmt::format("image is {}x{} {}, the response has {} levels", image.cols, image.rows,
                            cv::typeToString(image.type()), inverse_response.size()));
  const auto counts =
      levels == 256 ? Histogram<uint8_t>(image, levels) : Histogram<uint16_t>(image, levels);
  const auto total = static_cast<int64_t>(image.total());
  return options.statistic == ExposureStatistic::kMean
             ? Mean(counts, inverse_response, total)
             : Percentile(counts, inverse_response, total, options.percentile);
}

ExposureControl::ExposureControl(ExposureOptions options, std::vector<double> inverse_response)
    : options_(Checked(std::move(options))),
      inverse_response_(std::move(inverse_response)),
      automatic_ms_(options_.base_ms) {}

double ExposureControl::ExposureMs(double time_s) const {
  double exposure_ms = automatic_ms_;
  for (const ExposureJump& jump : options_.jumps)
    if (time_s >= jump.from_s && time_s < jump.to_s) exposure_ms *= jump.factor;
  return std::clamp(exposure_ms, options_.min_ms, options_.max_ms);
}

void ExposureControl::Observe(const cv::Mat& image) {
  const AutoExposureOptions& automatic = options_.automatic;
  if (!automatic.enabled) return;
  const double level = std::max(SignalLevel(image, inverse_response_, automatic), kLeastLevel);
  const double share = 1 - std::exp(-1 / automatic.time_constant_frames);
  automatic_ms_ = std::clamp(automatic_ms_ * std::pow(automatic.target / level, share),
                             options_.min_ms, options_.max_ms);
}

LightSchedule::LightSchedule(std::vector<LightChange> changes, std::vector<std::string> groups)
    : changes_(std::move(changes)), groups_(std::move(groups)) {
  for (size_t i = 0; i < changes_.size(); ++i) {
    const LightChange& change = changes_[i];
    const std::string key = fmt::format("lights[{}]", i);
    RequireGroup(change.group, groups_, key);
    RequireWindow(key, change.from_s, change.to_s);
    Require(change.strength >= 0 && std::isfinite(change.strength), key + ".strength",
            change.strength, "must not be negative");
    Require(change.ramp_s >= 0 && std::isfinite(change.ramp_s), key + ".ramp_s", change.ramp_s,
            "must not be negative");
  }
}

std::vector<float> LightSchedule::Strengths(double time_s) const {
  std::vector<float> strengths(groups_.size(), 1.F);
  for (const LightChange& change : changes_) {
    const double share = std::min(Ramp(time_s, change.from_s, change.ramp_s),
                                  1 - Ramp(time_s, change.to_s, change.ramp_s));
    const auto group = std::find(groups_.begin(), groups_.end(), change.group) - groups_.begin();
    strengths[group] *= static_cast<float>(1 + (change.strength - 1) * share);
  }
  return strengths;
}

}  // namespace sgf::synth
