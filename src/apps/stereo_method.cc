#include <cmath>
#include <limits>

#include <fmt/core.h>
#include <opencv2/calib3d.hpp>

#include <sgf/apps/stereo_method.h>
#include <sgf/core/error.h>
#include <sgf/core/options.h>

namespace sgf::apps {
namespace {

class BlockMatching final : public StereoMethod {
 public:
  explicit BlockMatching(const stereo::BlockMatcherOptions& options) : matcher_(options) {}

  void SetPair(const cv::Mat1b& left, const cv::Mat1b& right) override {
    left_ = left;
    matches_ = matcher_.Match(left, right);
  }

  cv::Mat1f Disparity(double uniqueness_pct) override {
    return matcher_.ToFloat(matcher_.Filter(matches_, left_, uniqueness_pct));
  }

  YAML::Node Options() const override { return WriteOptions(matcher_.options()); }

 private:
  stereo::BlockMatcher matcher_;
  cv::Mat1b left_;
  stereo::Matches matches_;
};

class OpenCvBlockMatching final : public StereoMethod {
 public:
  explicit OpenCvBlockMatching(const stereo::BlockMatcherOptions& o) : options_(o) {
    stereo::CheckOptions(o);
    constexpr int kMultiple = 16, kSmallestBlock = 5;
    if (o.window % 2 == 0 || o.window < kSmallestBlock)
      throw Error("window", fmt::format("cv::StereoBM takes odd ones from {}, got {}",
                                        kSmallestBlock, o.window));
    matcher_ =
        cv::StereoBM::create((o.num_disparities + kMultiple - 1) / kMultiple * kMultiple, o.window);
    matcher_->setMinDisparity(o.min_disparity);
  }

  void SetPair(const cv::Mat1b& left, const cv::Mat1b& right) override {
    stereo::CheckPair(left, right, options_);
    left_ = left;
    right_ = right;
  }

  cv::Mat1f Disparity(double uniqueness_pct) override {
    constexpr int kScale = cv::StereoMatcher::DISP_SCALE;
    if (uniqueness_pct != std::floor(uniqueness_pct))
      throw Error("uniqueness_pct",
                  fmt::format("cv::StereoBM takes whole percents, got {}", uniqueness_pct));
    matcher_->setUniquenessRatio(static_cast<int>(uniqueness_pct));
    cv::Mat1s disparity;
    matcher_->compute(left_, right_, disparity);
    cv::Mat1f result;
    disparity.convertTo(result, CV_32F, 1.0 / kScale);
    const int invalid = (matcher_->getMinDisparity() - 1) * kScale;
    result.setTo(std::numeric_limits<float>::quiet_NaN(), disparity == invalid);
    return result;
  }

  YAML::Node Options() const override {
    YAML::Node node;
    node["min_disparity"] = matcher_->getMinDisparity();
    node["num_disparities"] = matcher_->getNumDisparities();
    node["block_size"] = matcher_->getBlockSize();
    node["prefilter_type"] = matcher_->getPreFilterType() == cv::StereoBM::PREFILTER_XSOBEL
                                 ? "xsobel"
                                 : "normalized_response";
    node["prefilter_size"] = matcher_->getPreFilterSize();
    node["prefilter_cap"] = matcher_->getPreFilterCap();
    node["texture_threshold"] = matcher_->getTextureThreshold();
    node["uniqueness_ratio"] = matcher_->getUniquenessRatio();
    node["speckle_window_size"] = matcher_->getSpeckleWindowSize();
    node["speckle_range"] = matcher_->getSpeckleRange();
    node["disp12_max_diff"] = matcher_->getDisp12MaxDiff();
    return node;
  }

 private:
  stereo::BlockMatcherOptions options_;
  cv::Ptr<cv::StereoBM> matcher_;
  cv::Mat1b left_, right_;
};

}  // namespace

std::unique_ptr<StereoMethod> MakeStereoMethod(const std::string& name,
                                               const stereo::BlockMatcherOptions& options) {
  if (name == "bm" || name == "block_matcher") return std::make_unique<BlockMatching>(options);
  if (name == "opencv_bm") return std::make_unique<OpenCvBlockMatching>(options);
  throw Error("method", fmt::format("'{}' is unknown; known: bm, opencv_bm", name));
}

}  // namespace sgf::apps
