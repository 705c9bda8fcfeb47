#include <array>
#include <cmath>
#include <concepts>
#include <limits>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

#include <sgf/apps/stereo_method.h>
#include <sgf/core/error.h>
#include <sgf/core/options.h>
#include <sgf/core/require.h>
#include <sgf/io/image.h>
#include <sgf/io/ply.h>

namespace sgf::apps {
namespace {

// In the order of StereoOptions.
constexpr std::array<const char*, std::variant_size_v<StereoOptions>> kMethodNames{
    "bm", "mesh", "sgm", "opencv_bm", "opencv_sgbm"};

template <size_t... I>
StereoOptions DefaultOf(size_t method, std::index_sequence<I...>) {
  StereoOptions options;
  ((I == method ? void(options.emplace<I>()) : void()), ...);
  return options;
}

// A matcher of ours whose uniqueness filter runs on its own.
template <class Matcher>
class FilteredMatching final : public StereoMethod {
 public:
  template <class Options>
  explicit FilteredMatching(const Options& options) : matcher_(options) {}

  void SetPair(const cv::Mat& left, const cv::Mat& right) override {
    left_ = ToGrey(left);
    matches_ = matcher_.Match(left_, ToGrey(right));
  }

  cv::Mat1f Disparity(std::optional<double> uniqueness_pct) override {
    const double threshold = uniqueness_pct.value_or(matcher_.options().uniqueness_pct);
    if constexpr (std::is_same_v<Matcher, stereo::BlockMatcher>)  // filters by texture too
      return matcher_.ToFloat(matcher_.Filter(matches_, left_, threshold));
    else
      return matcher_.ToFloat(matcher_.Filter(matches_, threshold));
  }

  YAML::Node Options() const override { return WriteOptions(matcher_.options()); }

 private:
  Matcher matcher_;
  cv::Mat1b left_;
  stereo::Matches matches_;
};

class MeshMatching final : public StereoMethod {
 public:
  explicit MeshMatching(const stereo::MeshStereoOptions& options) : matcher_(options) {}

  void SetPair(const cv::Mat& left, const cv::Mat& right) override {
    result_ = matcher_.Match(left, right);
  }

  cv::Mat1f Disparity(std::optional<double> uniqueness_pct) override {
    if (uniqueness_pct.value_or(0) != 0)
      throw Error("uniqueness",
                  fmt::format("mesh has none, so it can only be 0, got {}", *uniqueness_pct));
    return result_.disparity.clone();
  }

  YAML::Node Options() const override { return WriteOptions(matcher_.options()); }

  void WriteMore(const std::filesystem::path& folder) const override {
    WritePng(folder / "valid.png", result_.valid);
    WriteMeshPly(
        folder / "mesh.ply", result_.mesh.vertices, result_.mesh.triangles,
        "x and y: image coordinates of the left image, px, pixel centres at .5; z: disparity, px");
  }

 private:
  stereo::MeshStereo matcher_;
  stereo::MeshStereoResult result_;
};

// The checks of our own matchers, which OpenCV's do not all make, on what both kinds have.
stereo::CostOptions ToCostOptions(const OpenCvOptions& o) {
  stereo::CostOptions options;
  options.min_disparity = o.min_disparity;
  options.num_disparities = o.num_disparities;
  options.threads = o.threads;
  return options;
}

void CheckOptions(const OpenCvOptions& o, int smallest_window) {
  constexpr int kLargestWindow = 255, kLargestUniqueness = 99;
  stereo::CheckCostOptions(ToCostOptions(o));
  RequireRange("window", o.window, smallest_window, kLargestWindow);
  stereo::RequireOdd("window", o.window);
  RequireRange("uniqueness_pct", o.uniqueness_pct, 0, kLargestUniqueness);
}

int WholePercent(double uniqueness_pct) {
  if (uniqueness_pct != std::floor(uniqueness_pct))
    throw Error("uniqueness_pct",
                fmt::format("OpenCV takes whole percents, got {}", uniqueness_pct));
  return static_cast<int>(uniqueness_pct);
}

// Both matchers require it.
int RoundUpTo16(int num_disparities) { return (num_disparities + 15) / 16 * 16; }

cv::Ptr<cv::StereoBM> Create(const OpenCvBmOptions& o) {
  constexpr int kSmallestWindow = 5;
  CheckOptions(o, kSmallestWindow);
  auto matcher = cv::StereoBM::create(RoundUpTo16(o.num_disparities), o.window);
  matcher->setMinDisparity(o.min_disparity);
  return matcher;
}

cv::Ptr<cv::StereoSGBM> Create(const OpenCvSgbmOptions& o) {
  constexpr int kSmallestWindow = 1;
  CheckOptions(o, kSmallestWindow);
  const int pixels = o.window * o.window;
  constexpr int kLeftRightMax = 1, kPrefilterCap = 63;
  return cv::StereoSGBM::create(o.min_disparity, RoundUpTo16(o.num_disparities), o.window,
                                8 * pixels, 32 * pixels, kLeftRightMax, kPrefilterCap);
}

YAML::Node CommonOptions(const cv::StereoMatcher& matcher) {
  YAML::Node node;
  node["min_disparity"] = matcher.getMinDisparity();
  node["num_disparities"] = matcher.getNumDisparities();
  node["block_size"] = matcher.getBlockSize();
  node["speckle_window_size"] = matcher.getSpeckleWindowSize();
  node["speckle_range"] = matcher.getSpeckleRange();
  node["disp12_max_diff"] = matcher.getDisp12MaxDiff();
  return node;
}

YAML::Node Describe(const cv::StereoBM& matcher) {
  const bool x_sobel = matcher.getPreFilterType() == cv::StereoBM::PREFILTER_XSOBEL;
  YAML::Node node = CommonOptions(matcher);
  node["prefilter_type"] = x_sobel ? "xsobel" : "normalized_response";
  node["prefilter_size"] = matcher.getPreFilterSize();
  node["prefilter_cap"] = matcher.getPreFilterCap();
  node["texture_threshold"] = matcher.getTextureThreshold();
  node["uniqueness_ratio"] = matcher.getUniquenessRatio();
  return node;
}

YAML::Node Describe(const cv::StereoSGBM& matcher) {
  YAML::Node node = CommonOptions(matcher);
  node["p1"] = matcher.getP1();
  node["p2"] = matcher.getP2();
  node["prefilter_cap"] = matcher.getPreFilterCap();
  node["uniqueness_ratio"] = matcher.getUniquenessRatio();
  node["mode"] = matcher.getMode() == cv::StereoSGBM::MODE_SGBM ? "sgbm" : "other";
  return node;
}

// A matcher of OpenCV's, made by Create() of its options.
template <class O>
class OpenCvMatching final : public StereoMethod {
 public:
  explicit OpenCvMatching(const O& options) : options_(options), matcher_(Create(options)) {
    matcher_->setUniquenessRatio(WholePercent(options.uniqueness_pct));
  }

  void SetPair(const cv::Mat& left, const cv::Mat& right) override {
    left_ = ToGrey(left);
    right_ = ToGrey(right);
    stereo::CheckPair(left_, right_, ToCostOptions(options_));
    if (options_.window >= std::min(left_.cols, left_.rows))
      throw Error("window", fmt::format("{} does not fit into the image of {}x{}", options_.window,
                                        left_.cols, left_.rows));
  }

  cv::Mat1f Disparity(std::optional<double> uniqueness_pct) override {
    constexpr int kScale = cv::StereoMatcher::DISP_SCALE;
    matcher_->setUniquenessRatio(WholePercent(uniqueness_pct.value_or(options_.uniqueness_pct)));
    cv::setNumThreads(options_.threads == 0 ? -1 : options_.threads);  // -1: all cores
    cv::Mat1s disparity;
    matcher_->compute(left_, right_, disparity);
    cv::Mat1f result;
    disparity.convertTo(result, CV_32F, 1.0 / kScale);
    const int invalid = (matcher_->getMinDisparity() - 1) * kScale;
    result.setTo(std::numeric_limits<float>::quiet_NaN(), disparity == invalid);
    return result;
  }

  YAML::Node Options() const override { return Describe(*matcher_); }

 private:
  O options_;
  decltype(Create(std::declval<O>())) matcher_;
  cv::Mat1b left_, right_;
};

std::unique_ptr<StereoMethod> Make(const stereo::BlockMatcherOptions& options) {
  return std::make_unique<FilteredMatching<stereo::BlockMatcher>>(options);
}

std::unique_ptr<StereoMethod> Make(const stereo::MeshStereoOptions& options) {
  return std::make_unique<MeshMatching>(options);
}

std::unique_ptr<StereoMethod> Make(const stereo::SemiGlobalOptions& options) {
  return std::make_unique<FilteredMatching<stereo::SemiGlobal>>(options);
}

template <std::derived_from<OpenCvOptions> Options>
std::unique_ptr<StereoMethod> Make(const Options& options) {
  return std::make_unique<OpenCvMatching<Options>>(options);
}

}  // namespace

StereoOptions DefaultStereoOptions(const std::string& method) {
  for (size_t i = 0; i < kMethodNames.size(); ++i)
    if (method == kMethodNames[i])
      return DefaultOf(i, std::make_index_sequence<kMethodNames.size()>());
  throw Error("method",
              fmt::format("'{}' is unknown; known: {}", method, fmt::join(kMethodNames, ", ")));
}

std::string StereoMethodName(const StereoOptions& options) { return kMethodNames[options.index()]; }

std::span<const char* const> StereoMethodNames() { return kMethodNames; }

std::unique_ptr<StereoMethod> MakeStereoMethod(const StereoOptions& options) {
  return std::visit([](const auto& o) { return Make(o); }, options);
}

}  // namespace sgf::apps
