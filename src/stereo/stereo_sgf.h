#pragma once

#include <opencv2/calib3d.hpp>

namespace sgf {

/// Block matching on the SGF dissimilarity behind OpenCV's interface, a drop-in for cv::StereoBM:
///
///     auto matcher = sgf::StereoSgf::create(128, 9);  // was: cv::StereoBM::create(128, 9)
///     matcher->compute(left, right, disparity);       // CV_16S, 16 * disparity, as before
///
/// Inputs are rectified one-channel images of equal size (8-bit, 16-bit or float). Unlike
/// cv::StereoBM it also matches the image borders, needs no prefilter, takes any number of
/// disparities, and throws sgf::Error for bad input.
class StereoSgf : public cv::StereoMatcher {
 public:
  /// @param num_disparities number of integer disparities searched, px; 0 stands for 64 as in
  /// OpenCV.
  /// @param block_size side of the square window, px, odd.
  static cv::Ptr<StereoSgf> create(int num_disparities = 0, int block_size = 9);

  /// How much more than the winner every other candidate must cost, percent; 0 accepts all.
  virtual int getUniquenessRatio() const = 0;
  virtual void setUniquenessRatio(int percent) = 0;

  /// Least mean gradient magnitude over the window, grey levels/px; 0 accepts all.
  virtual double getTextureThreshold() const = 0;
  virtual void setTextureThreshold(double threshold) = 0;

  /// Threads over bands of rows; 0 (the default) for all cores. The result does not depend on it.
  virtual int getThreads() const = 0;
  virtual void setThreads(int threads) = 0;
};

/// Semi-global matching on the SGF dissimilarity behind OpenCV's interface, a drop-in for
/// cv::StereoSGBM:
///
///     auto matcher = sgf::StereoSgfSemiGlobal::create(128, 5);
///     matcher->compute(left, right, disparity);  // CV_16S, 16 * disparity, as before
///
/// Inputs, borders and errors are those of StereoSgf. Paths run in eight directions; memory and
/// penalties are described at stereo::SemiGlobal.
class StereoSgfSemiGlobal : public cv::StereoMatcher {
 public:
  /// @param num_disparities number of integer disparities searched, px; 0 stands for 64.
  /// @param block_size side of the square over which costs are averaged first, px, odd.
  static cv::Ptr<StereoSgfSemiGlobal> create(int num_disparities = 0, int block_size = 5);

  /// Penalties of a step of one disparity along a path and of a larger one, where the mean cost is
  /// 64: not in OpenCV's units, and independent of the block size.
  virtual int getP1() const = 0;
  virtual void setP1(int penalty) = 0;
  virtual int getP2() const = 0;
  virtual void setP2(int penalty) = 0;

  /// How much more than the winner every other candidate must cost, percent; 0 accepts all.
  virtual int getUniquenessRatio() const = 0;
  virtual void setUniquenessRatio(int percent) = 0;

  /// Threads; 0 (the default) for all cores. The result does not depend on it.
  virtual int getThreads() const = 0;
  virtual void setThreads(int threads) = 0;
};

/// Global stereo of MeshStereo's class on the SGF dissimilarity behind OpenCV's interface: every
/// pixel gets a disparity. Inputs are rectified 8-bit images of equal size, grey or BGR; see
/// stereo::MeshStereo. It has no speckle filter: those settings read as 0 and stay so.
class StereoSgfMesh : public cv::StereoMatcher {
 public:
  /// @param num_disparities number of integer disparities searched, px; 0 stands for 64.
  /// @param block_size side of the bilateral support window, px, odd, in [3, 45].
  static cv::Ptr<StereoSgfMesh> create(int num_disparities = 0, int block_size = 35);

  /// Seed of the random changes of planes.
  virtual int getSeed() const = 0;
  virtual void setSeed(int seed) = 0;

  /// Threads; 0 (the default) for all cores. The result does not depend on it.
  virtual int getThreads() const = 0;
  virtual void setThreads(int threads) = 0;
};

}  // namespace sgf
