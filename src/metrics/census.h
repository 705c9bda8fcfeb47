#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/metrics/traits.h>

namespace sgf::metrics {

/// Census signatures of an image, one per pixel.
class CensusImage {
 public:
  CensusImage(int rows, int cols)
      : rows_(rows), cols_(cols), signatures_(static_cast<size_t>(rows) * cols) {}

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  uint64_t* Row(int y) { return signatures_.data() + static_cast<size_t>(y) * cols_; }
  const uint64_t* Row(int y) const { return signatures_.data() + static_cast<size_t>(y) * cols_; }

 private:
  int rows_, cols_;
  std::vector<uint64_t> signatures_;
};

/// Hamming distance of census signatures of 9 x 7 pixels, MeshStereo's cost, in [0, 62]. Unchanged
/// by any strictly increasing map of the intensities of one image.
struct Census {
  static constexpr MetricInfo kInfo{.name = "census",
                                    .alias = "",
                                    .formula = "Hamming distance of 9x7 census signatures",
                                    .equation = "-",
                                    .traits = {.kind = MetricKind::kSignature,
                                               .zero_at_equality = true,
                                               .symmetric = true,
                                               .gain_invariant = true,
                                               .offset_invariant = true}};
  static constexpr int kDim = 1;
  static constexpr int kWidth = 9;                    ///< px
  static constexpr int kHeight = 7;                   ///< px
  static constexpr int kBits = kWidth * kHeight - 1;  ///< the centre is not compared with itself

  int operator()(uint64_t i, uint64_t j) const { return std::popcount(i ^ j); }
};

/// Census signatures of a one-channel image (8-bit, 16-bit or float); the border is replicated.
/// Counted row by row from the top left without the centre, neighbour k sets bit k (the lowest is
/// bit 0) where it is darker than the centre.
/// @throws Error for an image that cannot be worked on.
CensusImage ComputeCensus(const cv::Mat& grey);

}  // namespace sgf::metrics
