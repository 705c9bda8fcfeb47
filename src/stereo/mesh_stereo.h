#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/stereo/cost_options.h>
#include <sgf/stereo/mesh.h>

namespace sgf::stereo {

/// Parameters of MeshStereo. Costs are in units in which the mean cost over a pair's pixels and
/// disparities is 64, whatever the dissimilarity, so that one set of parameters serves all.
///
/// Defaults without a source were found on the quarter-size Middlebury 2014 pairs with census_sobel
/// as the cost.
struct MeshStereoOptions : CostOptions {
  int window = 35;      // MeshStereo's public implementation
  double gamma = 20;    // between PatchMatch Stereo's 10 and MeshStereo's 30
  int cost_window = 9;  // that of block matching
  double outside_share = 0.5;
  MeshOptions mesh;
  int rounds = 5;
  int passes = 6;
  int global_trials = 2;
  int random_trials = 8;  // from random_disparity_px down to 1/32 px
  double random_disparity_px = 4;
  double random_slope = 1;
  double smoothness = 14;
  double split_px = 2;
  double split_gamma = 30;
  double split_least = 0.2;
  double alignment_weight = 0.5;
  double island_share = 1.0 / 30;
  double left_right_max = 1;  // as in block matching
  int median_window = 35;     // MeshStereo's public implementation
  int seed = 1;

  template <class V>
  void VisitFields(V&& visit) {
    CostOptions::VisitFields(visit);
    visit("window", window, "px", "side of the bilateral support window, odd");
    visit("gamma", gamma, "grey levels",
          "colour difference, summed over three channels, at which a weight falls to 1/e");
    visit("cost_window", cost_window, "px",
          "side of the window of dissimilarities that have one of their own, odd");
    visit("outside_share", outside_share, "",
          "cost of a match outside the other image, as a share of the pixel's mean cost");
    visit("mesh", mesh, "", "the triangulation");
    visit("rounds", rounds, "", "alternations of PatchMatch and mesh alignment");
    visit("passes", passes, "", "propagations from neighbour to neighbour in a round");
    visit("global_trials", global_trials, "", "random planes of any disparity in a round");
    visit("random_trials", random_trials, "", "random changes of a plane in a round");
    visit("random_disparity_px", random_disparity_px, "px",
          "largest first random change of a disparity; halved with each trial");
    visit("random_slope", random_slope, "px/px", "the same of a slope");
    visit("smoothness", smoothness, "mean cost / 64 / px^2", "weight of gaps between neighbours");
    visit("split_px", split_px, "px", "gap at which neighbours of one colour come apart");
    visit("split_gamma", split_gamma, "grey levels",
          "colour difference, summed over three channels, that makes a split cheaper by e");
    visit("split_least", split_least, "", "share of its price that a split always costs");
    visit("alignment_weight", alignment_weight, "",
          "pull of a triangle's own plane against a full connection, in the least-squares step");
    visit("island_share", island_share, "",
          "largest share of the triangles that a group may have to be dissolved");
    visit("left_right_max", left_right_max, "px",
          "largest difference to the disparity found from the right image");
    visit("median_window", median_window, "px",
          "side of the weighted median's window, odd; 0 for no median");
    visit("seed", seed, "", "of the random changes");
  }
};

/// @throws Error for an option out of range, with its name and value.
void CheckOptions(const MeshStereoOptions& options);

/// A mesh in three dimensions: image coordinates (see TriangleMesh) and disparity.
struct DisparityMesh {
  std::vector<cv::Point3f> vertices;          ///< x, y and disparity, px
  std::vector<std::array<int, 3>> triangles;  ///< vertices of each
};

/// What MeshStereo finds.
struct MeshStereoResult {
  cv::Mat1f disparity;  ///< of every pixel of the left image, px
  cv::Mat1b valid;      ///< 255 where the right image confirms it; elsewhere it is filled in
  DisparityMesh mesh;   ///< of the left image; a vertex stands once for each group of triangles
};

/// Global stereo of MeshStereo's class (Zhang, Li, Cheng, Cai, Chao, Rui: "MeshStereo: A Global
/// Stereo Model with Mesh Alignment Regularization for View Interpolation", ICCV 2015), with any
/// dissimilarity as its data cost. Written from the publication, and going beyond it: planes start
/// from semi-global matching over the same cost instead of at random, groups of triangles that are
/// split from all around them are re-considered as a whole, and what the left-right check refutes
/// is filled triangle by triangle over the least change of colour.
///
/// Memory: height * disparities * (width + disparities) bytes for the costs, 2 kB a triangle for
/// the windows. The same seed gives the same bits for any number of threads and any instruction
/// set. One matcher may serve several threads at once.
class MeshStereo {
 public:
  /// @throws Error for an option out of range, with its name and value.
  explicit MeshStereo(MeshStereoOptions options);

  const MeshStereoOptions& options() const { return options_; }

  /// Matches two rectified 8-bit images of equal size, both grey or both BGR. Costs are taken of
  /// grey levels; colours, where there are any, guide segments and weights.
  /// @throws Error for images that do not fit each other or the options.
  MeshStereoResult Match(const cv::Mat& left, const cv::Mat& right) const;

  /// Match() as OpenCV's matchers give disparities.
  /// @param[out] disparity 16 * disparity of every pixel.
  void Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const;

 private:
  MeshStereoOptions options_;
};

}  // namespace sgf::stereo
