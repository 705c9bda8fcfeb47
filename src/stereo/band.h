#pragma once

// Internal to sgf::stereo: what the row kernels of band.cc work on.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/core/gradient.h>
#include <sgf/core/parallel.h>
#include <sgf/stereo/matches.h>
#include <sgf/stereo/sgf_image.h>

namespace sgf::stereo::internal {

/// Runs body(y_begin, y_end) on bands that make up rows [begin, end): one a thread, but none of
/// fewer than `least_rows` unless it is the only one.
template <class Body>
void ForEachBand(int begin, int end, int least_rows, int threads, const Body& body) {
  const int count = ResolveThreads(threads), rows = end - begin;
  const int bands = std::min(count, std::max(1, rows / least_rows));
  ParallelFor(bands, count, [&](int i) {
    body(begin + static_cast<int>(int64_t{rows} * i / bands),
         begin + static_cast<int>(int64_t{rows} * (i + 1) / bands));
  });
}

/// One band of output rows and what is wanted of them.
struct BandTask {
  int width, height;                   ///< of the images, px
  int y_begin, y_end;                  ///< rows to write
  int min_disparity, num_disparities;  ///< px
  int window;                          ///< px, odd
  int uniqueness_q16;                  ///< required margin over the winner's cost * 2^16; 0 is off
  Subpixel subpixel;
  int left_right_max;    ///< px; negative is off
  cv::Mat1s* disparity;  ///< output, 1/16 px
  cv::Mat1i* best;       ///< output or null
  cv::Mat1i* second;     ///< output or null
};

/// Costs of one image row against all disparities. One object serves one band and is asked for rows
/// in increasing order.
class CostRows {
 public:
  virtual ~CostRows() = default;

  /// Writes costs[x * stride + d] for x in [0, width), d in [0, num_disparities).
  virtual void Row(int y, int stride, uint16_t* costs) = 0;
};

/// Stands in Matches::second where a pixel has no such candidate.
constexpr int kNoSecond = std::numeric_limits<int>::max();

/// Cost of a dissimilarity of 1: at most 63, and as large as lets a window's sum of costs fit 16
/// bits (63 up to 21 px, 11 at 51 px). tau is effectively at least this over 32767.
int SgfCostScale(int window);

/// Sum over rows [begin, end) of squared gradient magnitudes of an 8-bit image, exact in units of
/// (1/32 grey level/px)^2.
int64_t SumSquaredGradient(const cv::Mat1b& image, GradientOperator op, int begin, int end);

/// Matches a band on sgf in 16-bit fixed point (sgf.inc on int16 lanes).
void MatchSgfBand(const BandTask& task, const SgfImage& left, const SgfImage& right);

/// The same fixed-point costs pixel by pixel, SgfCostScale(1) for a dissimilarity of 1.
std::unique_ptr<CostRows> MakeSgfCostRows(int width, const CostOptions& options,
                                          std::shared_ptr<const SgfImage> left,
                                          std::shared_ptr<const SgfImage> right);

/// Matches a band on any other cost.
void MatchCostBand(const BandTask& task, CostRows& costs);

}  // namespace sgf::stereo::internal
