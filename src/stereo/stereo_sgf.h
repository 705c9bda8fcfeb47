#pragma once

#include <opencv2/calib3d.hpp>

namespace sgf {

/// Block matching on the SGF dissimilarity behind OpenCV's interface, a drop-in for cv::StereoBM:
///
///     auto matcher = sgf::StereoSgf::create(128, 9);  // was: cv::StereoBM::create(128, 9)
///     matcher->compute(left, right, disparity);       // CV_16S, 16 * disparity, as before
///
/// Inputs are rectified images of equal size. What is not as in cv::StereoBM of OpenCV 4:
///
/// |                             | cv::StereoBM                 | StereoSgf                    |
/// |-----------------------------|------------------------------|------------------------------|
/// | block size, if not given    | 21                           | 9                            |
/// | number of disparities       | a multiple of 16             | any                          |
/// | disp12MaxDiff, if not set   | off                          | 1 px; -1 turns the check off |
/// | uniquenessRatio, if not set | 15                           | 10                           |
/// | textureThreshold            | 10, of a sum over the window | 0 (off), of a mean           |
/// | speckleRange                | in 1/16 px                   | in px                        |
/// | prefilter and its setters   | always                       | not needed, not there        |
/// | images                      | 8-bit grey                   | 8-bit, 16-bit or float grey  |
/// | their borders               | without disparities          | matched                      |
/// | threads                     | cv::setNumThreads()          | setThreads(); all if not set |
/// | bad input                   | throws cv::Exception         | throws sgf::Error            |
///
/// compute() may run in several threads at once, on one object too, while no parameter is set.
class StereoSgf : public cv::StereoMatcher {
 public:
  /// Parameters in the order of cv::StereoBM::create().
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
///     // was: cv::StereoSGBM::create(0, 128, 5)
///     auto matcher = sgf::StereoSgfSemiGlobal::create(0, 128, 5);
///     matcher->compute(left, right, disparity);  // CV_16S, 16 * disparity, as before
///
/// Inputs are rectified images of equal size. Memory and penalties are described at
/// stereo::SemiGlobal. What is not as in cv::StereoSGBM of OpenCV 4:
///
/// |                               | cv::StereoSGBM               | StereoSgfSemiGlobal           |
/// |-------------------------------|------------------------------|-------------------------------|
/// | number of disparities         | 16, or a multiple of it      | 64 if not given; any          |
/// | block size, if not given      | 3                            | 5                             |
/// | P1 and P2                     | sums over the block          | such that 64 is the mean cost |
/// | P1 and P2, 0 in create()      | 2 and 5                      | 24 and 120                    |
/// | setDisp12MaxDiff(0)           | 1 px                         | disparities have to be equal  |
/// | disp12MaxDiff, negative       | 1 px                         | no check                      |
/// | uniquenessRatio, if not given | 0                            | 10                            |
/// | preFilterCap                  | of horizontal gradients      | without effect                |
/// | mode                          | 5 directions; 8 with MODE_HH | 8 directions; no parameter    |
/// | median filter of the result   | 3 x 3 px                     | none                          |
/// | images                        | 8-bit, grey or colour        | 8-bit, 16-bit or float grey   |
/// | their borders                 | left without disparities     | matched                       |
/// | threads                       | one, or by the mode          | setThreads(); two if not set  |
/// | bad input                     | throws cv::Exception         | throws sgf::Error             |
///
/// compute() may run in several threads at once, on one object too, while no parameter is set.
class StereoSgfSemiGlobal : public cv::StereoMatcher {
 public:
  /// Parameters in the order of cv::StereoSGBM::create(), and with its meanings but for the units
  /// of p1 and p2.
  /// @param min_disparity smallest disparity searched, px.
  /// @param num_disparities number of integer disparities searched, px; 0 stands for 64.
  /// @param block_size side of the square over which costs are averaged first, px, odd.
  /// @param p1, p2 see setP1(); 0 stands for the defaults, 24 and 120. OpenCV's usual values, such
  ///   as 8 and 32 times the block's area, are out of range.
  /// @param disp12_max_diff largest difference to the disparity found from the right image, px; 0
  ///   stands for 1, as it does in OpenCV, and a negative number turns the check off.
  /// @param pre_filter_cap without effect: it keeps the parameters behind it in their places.
  /// @param uniqueness_ratio see setUniquenessRatio().
  /// @param speckle_window_size connected regions up to this size are dropped, px; 0 keeps all.
  /// @param speckle_range largest step inside a connected region, px.
  /// @throws Error for a parameter out of range.
  static cv::Ptr<StereoSgfSemiGlobal> create(int min_disparity = 0, int num_disparities = 0,
                                             int block_size = 5, int p1 = 0, int p2 = 0,
                                             int disp12_max_diff = 0, int pre_filter_cap = 0,
                                             int uniqueness_ratio = 10, int speckle_window_size = 0,
                                             int speckle_range = 1);

  /// Penalties of a step of one disparity along a path and of a larger one, in [0, 127] with P1 no
  /// larger than P2, where the mean cost is 64: not in OpenCV's units, and independent of the block
  /// size.
  virtual int getP1() const = 0;
  virtual void setP1(int penalty) = 0;
  virtual int getP2() const = 0;
  virtual void setP2(int penalty) = 0;

  /// How much more than the winner every other candidate must cost, percent; 0 accepts all.
  virtual int getUniquenessRatio() const = 0;
  virtual void setUniquenessRatio(int percent) = 0;

  /// Threads; 0 (the default) for all cores, of which two at most have work. The result does not
  /// depend on it.
  virtual int getThreads() const = 0;
  virtual void setThreads(int threads) = 0;
};

/// Global stereo of MeshStereo's class on the SGF dissimilarity behind OpenCV's interface: every
/// pixel gets a disparity. Inputs are rectified 8-bit images of equal size, grey or BGR; see
/// stereo::MeshStereo. It has no speckle filter: those settings read as 0 and stay so.
/// compute() may run in several threads at once, on one object too, while no parameter is set.
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
