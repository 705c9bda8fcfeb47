#pragma once

#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

namespace sgf::synth {

/// What auto-exposure looks at in an image.
enum class ExposureStatistic {
  kMean,
  kPercentile,
};

std::span<const std::pair<const char*, ExposureStatistic>> EnumNames(ExposureStatistic);

struct AutoExposureOptions {
  bool enabled = false;
  ExposureStatistic statistic = ExposureStatistic::kMean;
  double percentile = 90;
  double target = 0.2;
  double time_constant_frames = 5;

  template <class V>
  void VisitFields(V&& visit) {
    visit("enabled", enabled, "", "whether the exposure time follows the images");
    visit("statistic", statistic, "", "of the linear signal of an image: mean or percentile");
    visit("percentile", percentile, "%", "which one, for statistic percentile");
    visit("target", target, "", "that statistic's wanted value; 1 is saturation");
    visit("time_constant_frames", time_constant_frames, "frames",
          "lag: after as many frames, 1/e of a deviation is left; 0 for none");
  }
};

/// A sudden change of the exposure time, from a time on or within a window.
struct ExposureJump {
  double from_s = 0;
  double to_s = std::numeric_limits<double>::infinity();
  double factor = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("from_s", from_s, "s", "begin, in sequence time");
    visit("to_s", to_s, "s", "end, itself outside of the window");
    visit("factor", factor, "", "multiplies the exposure time meanwhile");
  }
};

/// Another strength of a group of lights, from a time on or within a window, with ramps of `ramp_s`
/// that begin at its begin and its end. Strengths are relative to the light as the scene defines
/// it: 0 is off.
struct LightChange {
  std::string group;
  double from_s = -std::numeric_limits<double>::infinity();
  double to_s = std::numeric_limits<double>::infinity();
  double strength = 1;
  double ramp_s = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("group", group, "", "light group of the scene");
    visit("from_s", from_s, "s", "begin, in sequence time");
    visit("to_s", to_s, "s", "end");
    visit("strength", strength, "", "multiplies the light meanwhile; 0 is off");
    visit("ramp_s", ramp_s, "s", "time that a change takes, linearly");
  }
};

/// Exposure times and lights over a sequence.
struct ExposureOptions {
  double base_ms = 5;
  double min_ms = 0.02;
  double max_ms = 20;
  AutoExposureOptions automatic;
  std::vector<ExposureJump> jumps;
  std::vector<LightChange> lights;

  template <class V>
  void VisitFields(V&& visit) {
    visit("base_ms", base_ms, "ms", "exposure time of the first frame, and of all without control");
    visit("min_ms", min_ms, "ms", "least exposure time");
    visit("max_ms", max_ms, "ms", "longest exposure time");
    visit("automatic", automatic, "", "auto-exposure");
    visit("jumps", jumps, "", "sudden changes of the exposure time");
    visit("lights", lights, "", "light groups that are switched or dimmed; see LightSchedule");
  }
};

/// Value of the statistic over an image, of the irradiance that its levels stand for.
/// @param image 8 or 16 bit, one channel, not empty.
/// @param inverse_response irradiance of every level (256 or 65536); see PhotometricCamera.
/// @throws Error for an image that does not go with the table.
double SignalLevel(const cv::Mat& image, const std::vector<double>& inverse_response,
                   const AutoExposureOptions& options);

/// Exposure time of the frames of one sequence. Auto-exposure multiplies its time after each frame
/// by (target / level)^a with a = 1 - exp(-1 / time_constant_frames): a proportional controller of
/// the logarithm, which sees images as delivered, saturated and noisy. Jumps multiply what it asks
/// for, and it then works against them, as a camera's would. The limits hold for the product.
///
///     ExposureControl control(options, camera.inverse_response());
///     for (each frame) {
///       const double exposure_ms = control.ExposureMs(time_s);
///       ... expose both eyes of a stereo rig alike ...
///       control.Observe(left_image);
///     }
class ExposureControl {
 public:
  /// @param inverse_response as for SignalLevel().
  /// @throws Error naming the option and its value: times and factors that are not positive, limits
  ///   in the wrong order, a base outside of them, a window that ends before it begins, or a
  ///   target, percentile or time constant out of range.
  ExposureControl(ExposureOptions options, std::vector<double> inverse_response);

  /// Exposure time of the next frame.
  /// @param time_s sequence time of the frame.
  double ExposureMs(double time_s) const;

  /// Takes note of the frame just exposed. @throws Error as SignalLevel().
  void Observe(const cv::Mat& image);

 private:
  ExposureOptions options_;
  std::vector<double> inverse_response_;
  double automatic_ms_;  // before jumps
};

/// Strengths of all light groups of a scene over time.
class LightSchedule {
 public:
  /// @param groups of the scene; strengths come in this order.
  /// @throws Error naming the change at fault: an unknown group, a negative strength or ramp, or a
  ///   window that ends before it begins.
  LightSchedule(std::vector<LightChange> changes, std::vector<std::string> groups);

  /// Strength of each group at a sequence time; 1 without a change. Changes of one group multiply.
  std::vector<float> Strengths(double time_s) const;

 private:
  std::vector<LightChange> changes_;
  std::vector<std::string> groups_;
};

}  // namespace sgf::synth
