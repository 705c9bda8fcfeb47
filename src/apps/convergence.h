#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sgf/alignment/level.h>
#include <sgf/alignment/pattern.h>
#include <sgf/alignment/point_selection.h>
#include <sgf/alignment/robust.h>
#include <sgf/alignment/solver.h>

namespace sgf::apps {

/// How a tracked patch may move.
enum class PatchMotion {
  kTranslation,  ///< x, y
  kSe2,          ///< and angle
  kSimilarity,   ///< and scale
};
std::span<const std::pair<const char*, PatchMotion>> EnumNames(PatchMotion);

/// What all cases of a convergence study share.
struct ConvergenceOptions {
  int points = 2000;
  alignment::SelectionOptions selection;
  GradientOperator gradient = GradientOperator::kScharr;
  alignment::Pattern pattern = alignment::Pattern::kBasalt52;
  alignment::RobustKind robust = alignment::RobustKind::kHuber;
  alignment::SolverOptions solver;
  std::vector<double> start_px{0.5, 1, 2, 3, 4};
  double shift_x = 0.375;
  double shift_y = 0.3125;
  double converged_px = 0.5;
  int resamples = 200;
  int seed = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("points", points, "", "to track, evenly from those selected in all images");
    visit("selection", selection, "", "of points");
    visit("gradient", gradient, "", "derivative operator");
    visit("pattern", pattern, "", "pixels of a patch");
    visit("robust", robust, "", "loss of residuals");
    visit("solver", solver, "", "minimiser");
    visit("start_px", start_px, "px", "distances of start and true place");
    visit("shift_x", shift_x, "px", "of the second image against the first, columns");
    visit("shift_y", shift_y, "px", "the same, rows");
    visit("converged_px", converged_px, "px", "a track has converged when its error is below");
    visit("resamples", resamples, "", "of the bootstrap of medians");
    visit("seed", seed, "", "chooses directions of starts, noise and resamples");
  }
};

/// What `sgf_study convergence` is asked for.
struct ConvergenceRequest {
  std::string experiment;           ///< YAML file of the study
  std::vector<std::string> images;  ///< files
  std::string output;               ///< CSV file
  int threads = 0;
};

/// Tracks patches from every image into a moved and changed copy of it, from starts off the true
/// place, and writes one CSV line per case, start and column: how many tracks converge, and their
/// errors on each column's own converged tracks and on those that all compared columns converge on.
/// A track's error is the root mean square distance (px) of the found and the true places of the
/// patch's pixels. Of the experiment's keys it reads `study` (ConvergenceOptions), `columns` (by
/// name: `residual`, as alignment::VisitStudiedResidual() knows it, `epsilon` and whether it is
/// `compared`) and `cases` (by name: `change`, an ImageChange of the second image whose noise goes
/// onto both; `roll_deg` and `scale` about the image's centre; `motion` of patches; pyramid
/// `levels`; `start_px`, `start_deg` and `start_pct`, how far off place, angle and scale start,
/// each alone).
/// @throws Error for a file, name or option that is not as it should be, and for too few points.
void RunConvergence(const ConvergenceRequest& request);

}  // namespace sgf::apps
