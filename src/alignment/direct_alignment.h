#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/alignment/level.h>
#include <sgf/alignment/pattern.h>
#include <sgf/alignment/robust.h>
#include <sgf/alignment/solver.h>
#include <sgf/core/camera.h>
#include <sgf/core/se3.h>

/// Direct image alignment: the motion between two views from the patches around pixels of known
/// depth (eq. 18).
namespace sgf::alignment {

/// Where the derivative is taken.
enum class Linearization {
  kForward,  ///< at the current image, anew in every iteration, with the exact image Hessian
  kInverse,  ///< at the reference, once (Baker and Matthews, 2004); where the residual allows it
};
std::span<const std::pair<const char*, Linearization>> EnumNames(Linearization);

struct AlignmentOptions {
  std::string residual = "sgf";
  Linearization linearization = Linearization::kForward;
  Pattern pattern = Pattern::kDso8;
  int levels = 6;
  int smallest_side_px = 20;
  RobustKind loss = RobustKind::kStudentT;
  SolverOptions solver = {};
  LevelOptions image = {};
  double inlier_correlation = 0.6;
  double min_inlier_share = 0.4;
  double min_overlap = 0.15;
  int min_points = 30;
  double max_condition = 1e8;
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("residual", residual, "", "dissimilarity that is minimised, or a baseline");
    visit("linearization", linearization, "", "forward or inverse");
    visit("pattern", pattern, "", "pixels that make a patch");
    visit("levels", levels, "", "pyramid levels, at most");
    visit("smallest_side_px", smallest_side_px, "px", "no level is smaller");
    visit("loss", loss, "", "none, huber or student_t");
    visit("solver", solver, "", "iterations");
    visit("image", image, "", "gradients and their normalisation");
    visit("inlier_correlation", inlier_correlation, "",
          "a patch is an inlier when its gradients correlate with the reference's by this much");
    visit("min_inlier_share", min_inlier_share, "", "of the points in view, else it has failed");
    visit("min_overlap", min_overlap, "", "share of the points in view, else it has failed");
    visit("min_points", min_points, "", "points in view, else it has failed");
    visit("max_condition", max_condition, "", "of the normal equations, else it has failed");
    visit("threads", threads, "", "threads; 0 for all cores. The result does not depend on it");
  }
};

/// @throws Error for an option out of range, or a residual that is unknown or cannot be linearised
/// at the reference.
void CheckOptions(const AlignmentOptions& options);

/// The levels of an image as the chosen residual needs them.
struct Pyramid {
  cv::Size size = {};
  std::vector<SampleChannels> samples = {};  ///< the finest alone if the residual is bit_planes
  std::vector<BitPlanes> bit_planes = {};    ///< empty unless the residual is bit_planes
};

/// A pixel of a reference image whose depth is known.
struct ReferencePoint {
  Eigen::Vector2f pixel;                            ///< px
  float inverse_depth = 0;                          ///< 1/m, along the optical axis
  Eigen::Vector2f slope = Eigen::Vector2f::Zero();  ///< of the inverse depth, 1/m per px
};

/// Why an alignment is not to be believed.
enum class AlignmentFailure {
  kNone,
  kFewPoints,       ///< fewer points in view than min_points
  kLittleOverlap,   ///< less of the reference in view than min_overlap
  kFewInliers,      ///< less than min_inlier_share
  kIllConditioned,  ///< some motion is not observable
};
std::span<const std::pair<const char*, AlignmentFailure>> EnumNames(AlignmentFailure);

struct AlignmentResult {
  SE3 T_cur_ref;
  AlignmentFailure failure = AlignmentFailure::kNone;
  /// Of the left perturbation T <- (exp(w), v) T, v (m) before w (rad). From the scatter of whole
  /// patches' contributions (the sandwich of Liang and Zeger, 1986), since the pixels of a patch
  /// share an error of depth. It knows of no systematic error, and is too small where noise reaches
  /// the image's second derivatives: by a factor of six in variance at a noise of 6 grey levels.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double overlap = 0;       ///< share of the reference's points that are in view
  double inlier_share = 0;  ///< of the points in view
  double condition = 0;     ///< of the normal equations, with motions in units of the median depth
  double mean_cost = 0;     ///< of a residual at the finest level
  int iterations = 0;       ///< over all levels
  double alpha = 0, beta = 0;  ///< brightness of photo_affine: I_ref = exp(alpha) I_cur + beta

  bool ok() const { return failure == AlignmentFailure::kNone; }
};

/// Aligns images of one pinhole camera. Results are the same bits for any number of threads. Const
/// calls may run at once; where they are tasks of TBB, with `threads` 1.
class DirectAligner {
 public:
  /// What is kept of a reference image.
  class Reference {
   public:
    virtual ~Reference() = default;
  };

  /// @param camera without distortion.
  /// @throws Error for a camera with distortion, or as CheckOptions().
  DirectAligner(const Camera& camera, const AlignmentOptions& options);
  ~DirectAligner();
  DirectAligner(DirectAligner&&) noexcept;
  DirectAligner& operator=(DirectAligner&&) noexcept;

  /// @param grey one channel, of the camera's size. @throws Error for any other image.
  Pyramid MakePyramid(const cv::Mat& grey) const;

  /// The same into a pyramid whose memory is used again.
  void MakePyramid(const cv::Mat& grey, Pyramid& pyramid) const;

  /// @param points of the image; patches that reach out of it are left out.
  std::shared_ptr<const Reference> MakeReference(const Pyramid& pyramid,
                                                 std::span<const ReferencePoint> points) const;

  /// Finds the motion from the reference's camera to the current one.
  /// @throws Error for no level at all.
  /// @param reference made by an aligner of the same options.
  /// @param guess of T_cur_ref.
  /// @param levels to start with, the finest among them, where the guess is good; else all.
  AlignmentResult Align(const Reference& reference, const Pyramid& current, const SE3& guess,
                        std::optional<int> levels = std::nullopt) const;

 private:
  class Engine;
  template <class Residual>
  class EngineOf;

  Camera camera_;
  AlignmentOptions options_;
  std::unique_ptr<const Engine> engine_;
};

}  // namespace sgf::alignment
