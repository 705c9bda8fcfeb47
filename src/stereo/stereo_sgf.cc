#include <sgf/core/error.h>
#include <sgf/stereo/block_matcher.h>
#include <sgf/stereo/stereo_sgf.h>

namespace sgf {
namespace {

class StereoSgfImpl final : public StereoSgf {
 public:
  explicit StereoSgfImpl(const stereo::BlockMatcherOptions& options) : options_(options) {}

  void compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity) override {
    const stereo::BlockMatcher matcher(options_);
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
  int getSpeckleWindowSize() const override { return options_.speckle_window; }
  void setSpeckleWindowSize(int value) override { options_.speckle_window = value; }
  int getSpeckleRange() const override { return static_cast<int>(options_.speckle_range); }
  void setSpeckleRange(int value) override { options_.speckle_range = value; }
  int getDisp12MaxDiff() const override { return options_.left_right_max; }
  void setDisp12MaxDiff(int value) override { options_.left_right_max = value; }
  int getUniquenessRatio() const override { return static_cast<int>(options_.uniqueness_pct); }
  void setUniquenessRatio(int percent) override { options_.uniqueness_pct = percent; }
  double getTextureThreshold() const override { return options_.texture_threshold; }
  void setTextureThreshold(double threshold) override { options_.texture_threshold = threshold; }
  int getThreads() const override { return options_.threads; }
  void setThreads(int threads) override { options_.threads = threads; }

 private:
  stereo::BlockMatcherOptions options_;
};

}  // namespace

cv::Ptr<StereoSgf> StereoSgf::create(int num_disparities, int block_size) {
  stereo::BlockMatcherOptions options;
  if (num_disparities != 0) options.num_disparities = num_disparities;
  options.window = block_size;
  options.threads = 0;
  stereo::BlockMatcher validated(options);
  return cv::makePtr<StereoSgfImpl>(validated.options());
}

}  // namespace sgf
