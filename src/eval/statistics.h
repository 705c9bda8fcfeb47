#pragma once

#include <cstdint>
#include <span>
#include <vector>

/// Summaries of samples and how far to trust them.
namespace sgf {

/// Bounds that a value lies within at 95 % confidence.
struct Interval {
  double low, high;
};

/// Of a share, from counts (Wilson, "Probable inference, the law of succession, and statistical
/// inference", 1927). NaN without trials.
Interval WilsonInterval(int successes, int trials);

/// The mean of the two middle values of an even number, the middle one of an odd; NaN of none.
double Median(std::vector<double> values);

/// The value that a share (0 to 1) of the sorted values lies before, the nearest of them; NaN of
/// none.
double Quantile(std::vector<double> values, double share);

/// Of a median: the 2.5th and the 97.5th percentile of the medians of `resamples` (at least 1)
/// samples drawn from the values with replacement (Efron's percentile bootstrap, 1979). NaN without
/// values.
/// @param seed chooses the samples.
Interval MedianInterval(std::span<const double> values, int resamples, uint64_t seed);

}  // namespace sgf
