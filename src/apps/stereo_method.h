#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>

#include <opencv2/core.hpp>
#include <yaml-cpp/yaml.h>

#include <sgf/stereo/block_matcher.h>
#include <sgf/stereo/mesh_stereo.h>
#include <sgf/stereo/semi_global.h>

namespace sgf::apps {

/// What a run sets of OpenCV's matchers.
struct OpenCvOptions {
  int min_disparity = 0;
  int num_disparities = 64;
  int window;
  double uniqueness_pct;
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("min_disparity", min_disparity, "px", "smallest disparity searched");
    visit("num_disparities", num_disparities, "px",
          "number of integer disparities searched; rounded up to a multiple of 16");
    visit("window", window, "px", "side of the square matching window, odd");
    visit("uniqueness_pct", uniqueness_pct, "%",
          "by how much every other candidate must cost more than the winner, a whole number");
    visit("threads", threads, "", "threads; 0 for all cores");
  }
};

/// cv::StereoBM; what is not here stays at OpenCV's default, as do the two values here.
struct OpenCvBmOptions : OpenCvOptions {
  OpenCvBmOptions() : OpenCvOptions{.window = 21, .uniqueness_pct = 15} {}
};

/// cv::StereoSGBM over 5 directions. Uniqueness and all that is not here are those of OpenCV's
/// sample program stereo_match: P1 = 8 window^2, P2 = 32 window^2, left-right check within 1 px,
/// prefilter cap 63, no speckle filter.
struct OpenCvSgbmOptions : OpenCvOptions {
  OpenCvSgbmOptions() : OpenCvOptions{.window = 5, .uniqueness_pct = 10} {}
};

/// Options of a stereo method; the type says which method.
using StereoOptions = std::variant<stereo::BlockMatcherOptions, stereo::MeshStereoOptions,
                                   stereo::SemiGlobalOptions, OpenCvBmOptions, OpenCvSgbmOptions>;

/// The defaults of a method by name. @throws Error for an unknown name, with the known ones.
StereoOptions DefaultStereoOptions(const std::string& method);

/// The name of the method whose options these are.
std::string StereoMethodName(const StereoOptions& options);

/// Names of all methods, our own first.
std::span<const char* const> StereoMethodNames();
inline constexpr size_t kOwnMethods = 3;

/// A stereo method that the tools can run: ours, or OpenCV's as the baseline.
class StereoMethod {
 public:
  virtual ~StereoMethod() = default;

  /// Takes a pair of 8-bit images, grey or BGR; the next calls are about it. MeshStereo uses the
  /// colours, the other methods match grey levels.
  /// @throws Error for images that do not fit each other or the options.
  virtual void SetPair(const cv::Mat& left, const cv::Mat& right) = 0;

  /// Disparities of the left image, px, NaN where there is none.
  /// @param uniqueness_pct stands in for the option of that name.
  /// @throws Error when it is out of range, or not 0 for a method without that option.
  virtual cv::Mat1f Disparity(std::optional<double> uniqueness_pct = {}) = 0;

  /// Every parameter, those that stay at their defaults too.
  virtual YAML::Node Options() const = 0;

  /// Writes what the method has besides disparities into an existing folder. Comes after
  /// Disparity().
  virtual void WriteMore(const std::filesystem::path& /*folder*/) const {}
};

/// @throws Error for options out of range.
std::unique_ptr<StereoMethod> MakeStereoMethod(const StereoOptions& options);

}  // namespace sgf::apps
