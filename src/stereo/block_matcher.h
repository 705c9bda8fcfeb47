#pragma once

#include <span>
#include <string>
#include <utility>

#include <opencv2/core.hpp>

#include <sgf/core/gradient.h>
#include <sgf/metrics/epsilon.h>
#include <sgf/metrics/point_metrics.h>
#include <sgf/metrics/sample.h>

namespace sgf::stereo {

/// What happens to both images before a cost is taken.
enum class Prefilter {
  kNone,
  kNormalizedResponse,  ///< OpenCV's PREFILTER_NORMALIZED_RESPONSE: contrast against a local mean
  kXSobel,              ///< OpenCV's PREFILTER_XSOBEL: horizontal Sobel response, clipped
};
std::span<const std::pair<const char*, Prefilter>> EnumNames(Prefilter);

/// Curve through the winner's cost and its two neighbours whose minimum is the sub-pixel disparity.
enum class Subpixel {
  kNone,
  kEquiangular,  ///< two lines of opposite slope (as cv::StereoBM)
  kParabola,
};
std::span<const std::pair<const char*, Subpixel>> EnumNames(Subpixel);

/// Parameters of the dissimilarity pm (eq. 4), for which the paper gives no values.
struct PmOptions {
  double alpha = metrics::Pm{}.alpha;
  double tau_c = metrics::Pm{}.tau_c;
  double tau_g = metrics::Pm{}.tau_g;

  template <class V>
  void VisitFields(V&& visit) {
    visit("alpha", alpha, "", "weight of the gradient part");
    visit("tau_c", tau_c, "grey levels", "limit of the photometric part; .inf for none");
    visit("tau_g", tau_g, "grey levels/px", "limit of the gradient part; .inf for none");
  }
};

/// Parameters of BlockMatcher. Where a default has a counterpart in cv::StereoBM, it is named.
struct BlockMatcherOptions {
  std::string metric = "sgf";
  int min_disparity = 0;
  int num_disparities = 64;
  int window = 9;
  Prefilter prefilter = Prefilter::kNone;
  int prefilter_window = 9;
  int prefilter_cap = 31;
  GradientOperator gradient = GradientOperator::kScharr;
  metrics::EpsilonOptions epsilon;
  double tau = metrics::kTau;
  PmOptions pm;
  Subpixel subpixel = Subpixel::kEquiangular;
  double uniqueness_pct = 10;
  double texture_threshold = 0;
  int left_right_max = 1;
  int speckle_window = 0;
  double speckle_range = 1;
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("metric", metric, "", "dissimilarity, one of the name table");
    visit("min_disparity", min_disparity, "px", "smallest disparity searched");
    visit("num_disparities", num_disparities, "px", "number of integer disparities searched");
    visit("window", window, "px", "side of the square matching window, odd");
    visit("prefilter", prefilter, "", "image transform before matching");
    visit("prefilter_window", prefilter_window, "px", "side of normalized_response's window, odd");
    visit("prefilter_cap", prefilter_cap, "grey levels", "prefilter response is clipped to +-cap");
    visit("gradient", gradient, "", "derivative operator");
    visit("epsilon", epsilon, "", "normalisation of gradients, eq. 6");
    visit("tau", tau, "",
          "lower bound of the denominator of sgf, eq. 10 (metric sgf: at least 0.002)");
    visit("pm", pm, "", "parameters of pm, eq. 4");
    visit("subpixel", subpixel, "", "interpolation of the winner's cost");
    visit(
        "uniqueness_pct", uniqueness_pct, "%",
        "a match is dropped unless every candidate other than the winner and its neighbours costs "
        "more than (1 + this) times the winner; 0 keeps all");
    visit("texture_threshold", texture_threshold, "grey levels/px",
          "a match is dropped where the mean gradient magnitude over the window is below; 0 keeps "
          "all");
    visit("left_right_max", left_right_max, "px",
          "largest difference to the disparity found from the right image; -1 turns the check off");
    visit("speckle_window", speckle_window, "px",
          "connected regions up to this size are dropped; 0 keeps all");
    visit("speckle_range", speckle_range, "px", "largest step inside a connected region");
    visit("threads", threads, "", "threads over bands of rows; 0 for all cores");
  }
};

/// @throws Error for an option out of range, with its name and value.
void CheckOptions(const BlockMatcherOptions& options);

/// @throws Error for two images that do not fit each other or the options.
void CheckPair(const cv::Mat& left, const cv::Mat& right, const BlockMatcherOptions& options);

/// Disparities of the left image in 1/16 px, as cv::StereoBM gives them, with what the filters that
/// drop matches need.
struct Matches {
  cv::Mat1s disparity;  ///< 16 * disparity; InvalidDisparity() where there is no match
  cv::Mat1i best;       ///< window cost of the winner, in the matcher's integer units
  cv::Mat1i second;     ///< least window cost outside the winner and its two neighbours
};

/// Local stereo matching of rectified images: window sums of a dissimilarity, winner-take-all over
/// the disparities, sub-pixel interpolation and checks (eqs. 16, 17 of the paper). Works row by
/// row: memory grows with width * disparities * window, never with height * disparities.
///
/// Disparity d pairs left pixel x with right pixel x - d. A pixel's candidates are the disparities
/// whose right pixel lies inside the image. Windows are cut at the border of the left image; where
/// one reaches out of the right image, the right image's border column is repeated.
///
/// Results are the same bits for any number of threads and any instruction set.
class BlockMatcher {
 public:
  /// @throws Error for an option out of range, with its name and value.
  explicit BlockMatcher(BlockMatcherOptions options);

  const BlockMatcherOptions& options() const { return options_; }

  /// The marker of pixels without a match: 16 * (min_disparity - 1), as in OpenCV.
  short InvalidDisparity() const { return static_cast<short>(16 * (options_.min_disparity - 1)); }

  /// Matches two rectified images of equal size and type (one channel; 8-bit, 16-bit or float).
  /// @param[out] disparity 16 * disparity, InvalidDisparity() where a check dropped the match; its
  ///   memory is used again if it has the right size.
  /// @throws Error for images that do not fit each other or the options.
  void Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const;

  /// Compute() without the filters on uniqueness, texture and speckles but with what they need, so
  /// that a threshold can be swept without matching anew.
  Matches Match(const cv::Mat& left, const cv::Mat& right) const;

  /// Applies uniqueness, texture and speckle filters: Compute() is Filter(Match(...)).
  /// @param uniqueness_pct stands in for the option of that name.
  /// @throws Error when it is out of range.
  cv::Mat1s Filter(const Matches& matches, const cv::Mat& left, double uniqueness_pct) const;

  /// CV_16S disparities in 1/16 px as float in px, NaN where there is no match.
  cv::Mat1f ToFloat(const cv::Mat1s& disparity) const;

 private:
  void DropTexturelessAndSpeckles(const cv::Mat& left, cv::Mat1s& disparity) const;

  BlockMatcherOptions options_;
};

}  // namespace sgf::stereo
