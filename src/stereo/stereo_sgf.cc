#include <algorithm>

#include <sgf/stereo/block_matcher.h>
#include <sgf/stereo/mesh_stereo.h>
#include <sgf/stereo/opencv_matcher.h>
#include <sgf/stereo/semi_global.h>
#include <sgf/stereo/stereo_sgf.h>

namespace sgf {
namespace {

class StereoSgfImpl final
    : public stereo::OpenCvMatcher<StereoSgf, stereo::BlockMatcher, stereo::BlockMatcherOptions> {
 public:
  using OpenCvMatcher::OpenCvMatcher;

  int getUniquenessRatio() const override { return static_cast<int>(options_.uniqueness_pct); }
  void setUniquenessRatio(int percent) override { options_.uniqueness_pct = percent; }
  double getTextureThreshold() const override { return options_.texture_threshold; }
  void setTextureThreshold(double threshold) override { options_.texture_threshold = threshold; }
  int getThreads() const override { return options_.threads; }
  void setThreads(int threads) override { options_.threads = threads; }
};

class StereoSgfSemiGlobalImpl final
    : public stereo::OpenCvMatcher<StereoSgfSemiGlobal, stereo::SemiGlobal,
                                   stereo::SemiGlobalOptions> {
 public:
  using OpenCvMatcher::OpenCvMatcher;

  int getP1() const override { return options_.p1; }
  void setP1(int penalty) override { options_.p1 = penalty; }
  int getP2() const override { return options_.p2; }
  void setP2(int penalty) override { options_.p2 = penalty; }
  int getUniquenessRatio() const override { return static_cast<int>(options_.uniqueness_pct); }
  void setUniquenessRatio(int percent) override { options_.uniqueness_pct = percent; }
  int getThreads() const override { return options_.threads; }
  void setThreads(int threads) override { options_.threads = threads; }
};

class StereoSgfMeshImpl final
    : public stereo::OpenCvMatcher<StereoSgfMesh, stereo::MeshStereo, stereo::MeshStereoOptions> {
 public:
  using OpenCvMatcher::OpenCvMatcher;

  int getSeed() const override { return options_.seed; }
  void setSeed(int seed) override { options_.seed = seed; }
  int getThreads() const override { return options_.threads; }
  void setThreads(int threads) override { options_.threads = threads; }
};

// The options of create(), checked.
template <class Matcher, class Options>
Options CheckedOptions(Options options, int num_disparities, int block_size) {
  if (num_disparities != 0) options.num_disparities = num_disparities;
  options.window = block_size;
  options.threads = 0;
  return Matcher(options).options();
}

}  // namespace

cv::Ptr<StereoSgf> StereoSgf::create(int num_disparities, int block_size) {
  return cv::makePtr<StereoSgfImpl>(CheckedOptions<stereo::BlockMatcher>(
      stereo::BlockMatcherOptions{}, num_disparities, block_size));
}

cv::Ptr<StereoSgfSemiGlobal> StereoSgfSemiGlobal::create(
    int min_disparity, int num_disparities, int block_size, int p1, int p2, int disp12_max_diff,
    int /*pre_filter_cap*/, int uniqueness_ratio, int speckle_window_size, int speckle_range) {
  stereo::SemiGlobalOptions options;
  options.min_disparity = min_disparity;
  if (p1 != 0) options.p1 = p1;
  if (p2 != 0) options.p2 = p2;
  if (disp12_max_diff != 0) options.left_right_max = std::max(disp12_max_diff, -1);
  options.uniqueness_pct = uniqueness_ratio;
  options.speckle_window = speckle_window_size;
  options.speckle_range = speckle_range;
  return cv::makePtr<StereoSgfSemiGlobalImpl>(
      CheckedOptions<stereo::SemiGlobal>(options, num_disparities, block_size));
}

cv::Ptr<StereoSgfMesh> StereoSgfMesh::create(int num_disparities, int block_size) {
  return cv::makePtr<StereoSgfMeshImpl>(
      CheckedOptions<stereo::MeshStereo>(stereo::MeshStereoOptions{}, num_disparities, block_size));
}

}  // namespace sgf
