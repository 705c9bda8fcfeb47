#include <cmath>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/eval/disparity.h>

namespace sgf {
namespace {

// Sums over the scored pixels, taken in row order: the same bits on every run.
struct ErrorSums {
  int64_t truth_px = 0;
  int64_t matched_px = 0;
  double error_px = 0;
  int64_t bad1 = 0;
  int64_t bad2 = 0;
  int64_t bad4 = 0;
  int64_t d1 = 0;

  void Add(double estimate, double truth) {
    if (!std::isfinite(truth)) return;
    ++truth_px;
    if (!std::isfinite(estimate)) return;
    ++matched_px;
    const double error = std::abs(estimate - truth);
    error_px += error;
    bad1 += error > 1;
    bad2 += error > 2;
    bad4 += error > 4;
    d1 += error > 3 && error > 0.05 * std::abs(truth);
  }
};

DisparityScores ToScores(const ErrorSums& sums) {
  const auto matched = static_cast<double>(sums.matched_px);  // 0 gives the documented NaNs
  const auto percent = [matched](int64_t count) {
    return 100 * static_cast<double>(count) / matched;
  };
  DisparityScores scores;
  scores.truth_px = sums.truth_px;
  scores.matched_px = sums.matched_px;
  scores.mean_px = sums.error_px / matched;
  scores.bad1_pct = percent(sums.bad1);
  scores.bad2_pct = percent(sums.bad2);
  scores.bad4_pct = percent(sums.bad4);
  scores.d1_pct = percent(sums.d1);
  scores.invalid_pct = 100 * static_cast<double>(sums.truth_px - sums.matched_px) /
                       static_cast<double>(sums.truth_px);
  return scores;
}

}  // namespace

DisparityScores ScoreDisparity(const cv::Mat1f& estimate, const cv::Mat1f& truth) {
  if (estimate.size() != truth.size())
    throw Error("ground truth", fmt::format("is {}x{}, but the disparity map is {}x{}", truth.cols,
                                            truth.rows, estimate.cols, estimate.rows));
  ErrorSums sums;
  for (int y = 0; y < truth.rows; ++y)
    for (int x = 0; x < truth.cols; ++x) sums.Add(estimate(y, x), truth(y, x));
  if (sums.truth_px == 0)
    throw Error("ground truth",
                fmt::format("none of {}x{} pixels has a value", truth.cols, truth.rows));
  return ToScores(sums);
}

}  // namespace sgf
