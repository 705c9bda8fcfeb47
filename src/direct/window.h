#pragma once

#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <sgf/core/camera.h>
#include <sgf/direct/frame.h>
#include <sgf/direct/prior.h>

/// Joint refinement of a window of key-frames (Engel, Koltun, Cremers, "Direct sparse odometry",
/// 2018, Section II): poses, brightness, inverse depths and maybe the camera that make all points
/// look alike where they are seen, with what was marginalised as a prior.
namespace sgf::direct {

struct WindowOptions {
  std::string residual = "photo_affine";
  int max_iterations = 4;
  double max_cost = 4;
  double sigma_a = 1;
  double sigma_b = 30;
  double sigma_a_known = 0.05;
  double sigma_b_known = 2;
  double sigma_intrinsics = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("residual", residual, "", "dissimilarity that motion is estimated with");
    visit("max_iterations", max_iterations, "", "of the solver at each key-frame");
    visit("max_cost", max_cost, "squared scales of the loss",
          "mean cost of a pixel beyond which an observation is an outlier");
    visit("sigma_a", sigma_a, "", "expected standard deviation of the logarithm of the gain");
    visit("sigma_b", sigma_b, "grey levels", "expected standard deviation of the offset");
    visit("sigma_a_known", sigma_a_known, "", "the same where exposure times are known");
    visit("sigma_b_known", sigma_b_known, "grey levels", "the same where they are known");
    visit("sigma_intrinsics", sigma_intrinsics, "px",
          "expected error of focal lengths and image centre; 0: the camera is not refined");
  }
};

/// @throws Error for an option out of range, or a residual that a window cannot be refined with.
void CheckOptions(const WindowOptions& options);

/// What a refinement has done.
struct WindowSummary {
  int iterations = 0;    ///< of the solver, with that of the first look
  int observations = 0;  ///< that were kept
  int outliers = 0;      ///< that were taken out, those out of view as well
  double scale = 0;      ///< of the residuals: what "1 sigma" means in the loss
  bool usable = false;   ///< false where the solver has failed; the window is as before then
};

/// Refines windows, and holds the prior. The solver is Ceres on one thread; residuals and
/// derivatives are computed in parallel. Same bits for any number of threads.
class WindowOptimizer {
 public:
  /// @param camera without distortion.
  /// @throws Error as CheckOptions().
  WindowOptimizer(const Camera& camera, const WindowOptions& options, int threads);
  ~WindowOptimizer();

  /// Holds the pose of a map's first key-frame, and takes its derivatives where it is now.
  void Anchor(Keyframe& first);

  /// Refines poses, brightness and inverse depths; takes out observations that do not fit and
  /// points without any. Points get their variance and support.
  /// @param exposures_known chooses the priors on brightness.
  WindowSummary Refine(Window& window, bool exposures_known);

  /// Turns what is known from points into the prior; the points are left as they are.
  /// @param points pairs of host (position in the window) and point.
  void Marginalize(Window& window, std::span<const std::pair<int, const ActivePoint*>> points);

  /// Takes a key-frame out of the prior. All observations of it and by it are to be gone.
  void Marginalize(const Keyframe& frame);

  const Prior& prior() const { return prior_; }

  /// As it is known now: the one given, unless it is refined.
  const Camera& camera() const;

 private:
  class Engine;

  std::unique_ptr<Engine> engine_;
  Prior prior_;
  bool exposures_known_ = false;  ///< at the last refinement
};

}  // namespace sgf::direct
