#pragma once

#include <opencv2/calib3d.hpp>

namespace sgf::stereo {

/// A matcher of this library behind OpenCV's interface: what cv::StereoMatcher asks for, over the
/// matcher's options struct. Options that the struct does not have read as 0 and cannot be set.
/// Each call of compute() makes a matcher of the options that are set then.
/// @tparam Interface cv::StereoMatcher or an abstract class derived from it.
/// @tparam Matcher has options(), and Compute(left, right, cv::Mat1s&) in 1/16 px; its constructor
///   checks the options.
/// @tparam Options has min_disparity, num_disparities and window.
template <class Interface, class Matcher, class Options>
class OpenCvMatcher : public Interface {
 public:
  explicit OpenCvMatcher(const Options& options) : options_(options) {}

  /// @throws Error for bad options or images.
  void compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity) override {
    const Matcher matcher(options_);
    disparity.create(left.size(), CV_16S);
    cv::Mat1s result = disparity.getMat();
    matcher.Compute(left.getMat(), right.getMat(), result);
  }

  int getMinDisparity() const override { return options_.min_disparity; }
  void setMinDisparity(int value) override { options_.min_disparity = value; }
  int getNumDisparities() const override { return options_.num_disparities; }
  void setNumDisparities(int value) override { options_.num_disparities = value; }
  int getBlockSize() const override { return options_.window; }
  void setBlockSize(int value) override { options_.window = value; }

  int getSpeckleWindowSize() const override {
    if constexpr (kHasSpeckles) return options_.speckle_window;
    return 0;
  }
  void setSpeckleWindowSize(int value) override {
    if constexpr (kHasSpeckles) options_.speckle_window = value;
  }
  int getSpeckleRange() const override {
    if constexpr (kHasSpeckles) return static_cast<int>(options_.speckle_range);
    return 0;
  }
  void setSpeckleRange(int value) override {
    if constexpr (kHasSpeckles) options_.speckle_range = value;
  }
  int getDisp12MaxDiff() const override {
    if constexpr (kHasLeftRight) return static_cast<int>(options_.left_right_max);
    return 0;
  }
  void setDisp12MaxDiff(int value) override {
    if constexpr (kHasLeftRight) options_.left_right_max = value;
  }

 protected:
  Options options_;

 private:
  static constexpr bool kHasSpeckles = requires(Options o) {
    o.speckle_window;
    o.speckle_range;
  };
  static constexpr bool kHasLeftRight = requires(Options o) { o.left_right_max; };
};

}  // namespace sgf::stereo
