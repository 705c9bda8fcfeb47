#pragma once

// Internal to sgf::stereo: what the row kernels of semi_global_rows.cc work on.

#include <cstddef>
#include <cstdint>

#include <sgf/stereo/band.h>
#include <sgf/stereo/cost_rows.h>

namespace sgf::stereo::internal {

/// Costs averaged over the window are cut at this. With p2 no larger, path costs fit 8 bits.
constexpr int kLargestPathCost = 127;
constexpr int kLargestPenalty = 127;

/// Sums of a window of byte costs, doubled, fit 16 bits up to this side.
constexpr int kLargestAverageWindow = 11;

/// What is wanted of a pair.
struct SemiGlobalTask {
  BandTask band;  ///< of all rows; its window is the one that costs are averaged over
  int p1, p2;     ///< penalties in byte costs, at most kLargestPenalty
  int threads;
};

/// Average of n byte costs with sum s: s * AverageFactor(n) >> 15.
constexpr uint32_t AverageFactor(uint32_t n) { return ((1U << 15) + n - 1) / n; }

/// Writes the disparities, and the costs that uniqueness needs, of a whole pair.
void MatchSemiGlobal(const SemiGlobalTask& task, const CostRowsFactory& factory);

}  // namespace sgf::stereo::internal
