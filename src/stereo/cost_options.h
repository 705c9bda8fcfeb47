#pragma once

#include <span>
#include <string>
#include <string_view>
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

/// MeshStereo's own cost, a stereo cost beyond the name table: 2 * Hamming distance of the census
/// signatures + |difference of the 8-bit horizontal Sobel responses|.
inline constexpr std::string_view kCensusSobel = "census_sobel";

/// What all matchers ask: which dissimilarity of which pixels, over which disparities.
struct CostOptions {
  std::string metric = "sgf";
  int min_disparity = 0;
  int num_disparities = 64;
  Prefilter prefilter = Prefilter::kNone;
  int prefilter_window = 9;
  int prefilter_cap = 31;
  GradientOperator gradient = GradientOperator::kScharr;
  metrics::EpsilonOptions epsilon;
  double tau = metrics::kTau;
  PmOptions pm;
  int threads = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("metric", metric, "", "dissimilarity, one of the name table, or census_sobel");
    visit("min_disparity", min_disparity, "px", "smallest disparity searched");
    visit("num_disparities", num_disparities, "px", "number of integer disparities searched");
    visit("prefilter", prefilter, "", "image transform before matching");
    visit("prefilter_window", prefilter_window, "px", "side of normalized_response's window, odd");
    visit("prefilter_cap", prefilter_cap, "grey levels", "prefilter response is clipped to +-cap");
    visit("gradient", gradient, "", "derivative operator");
    visit("epsilon", epsilon, "", "normalisation of gradients, eq. 6");
    visit("tau", tau, "",
          "lower bound of the denominator of sgf, eq. 10 (metric sgf: at least 0.002)");
    visit("pm", pm, "", "parameters of pm, eq. 4");
    visit("threads", threads, "", "threads; 0 for all cores. The result does not depend on it");
  }
};

/// @throws Error for an option out of range, with its name and value.
void CheckCostOptions(const CostOptions& options);

/// @throws Error for two images that do not fit each other or the options.
void CheckPair(const cv::Mat& left, const cv::Mat& right, const CostOptions& options);

/// @throws Error naming the option unless it is odd.
void RequireOdd(const char* option, int value);

inline constexpr int kLargestDisparity = 2047;  ///< px; 16 times it fits 16 bits

}  // namespace sgf::stereo
