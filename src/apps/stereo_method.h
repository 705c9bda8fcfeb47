#pragma once

#include <memory>
#include <string>

#include <opencv2/core.hpp>
#include <yaml-cpp/yaml.h>

#include <sgf/stereo/block_matcher.h>

namespace sgf::apps {

/// A stereo method that the tools can run: ours, or OpenCV's as the baseline.
class StereoMethod {
 public:
  virtual ~StereoMethod() = default;

  /// Takes a pair of 8-bit grey images; the next calls are about it.
  virtual void SetPair(const cv::Mat1b& left, const cv::Mat1b& right) = 0;

  /// Disparities of the left image, px, NaN where there is none, with this uniqueness in place of
  /// the option's.
  virtual cv::Mat1f Disparity(double uniqueness_pct) = 0;

  /// Every parameter, those that stay at their defaults too.
  virtual YAML::Node Options() const = 0;
};

/// A method by name: "bm" (BlockMatcher, also "block_matcher") or "opencv_bm" (cv::StereoBM with
/// the options' disparities, window and uniqueness, all else at OpenCV's defaults; it rounds the
/// number of disparities up to a multiple of 16, as it must).
/// @throws Error for an unknown name or options out of range.
std::unique_ptr<StereoMethod> MakeStereoMethod(const std::string& name,
                                               const stereo::BlockMatcherOptions& options);

}  // namespace sgf::apps
