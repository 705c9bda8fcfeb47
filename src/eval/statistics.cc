#include <algorithm>
#include <cmath>
#include <limits>

#include <sgf/core/random.h>
#include <sgf/eval/statistics.h>

namespace sgf {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

Interval WilsonInterval(int successes, int trials) {
  if (trials == 0) return {kNan, kNan};
  constexpr double kZ = 1.959963984540054;  // two-sided 95 % of the normal distribution
  const double n = trials, p = successes / n, z2 = kZ * kZ;
  const double centre = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kZ / (1 + z2 / n) * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n));
  return {std::max(0.0, centre - half), std::min(1.0, centre + half)};
}

double Median(std::vector<double> values) {
  if (values.empty()) return kNan;
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return kNan;
  const auto place = std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<size_t>(place)];
}

Interval MedianInterval(std::span<const double> values, int resamples, uint64_t seed) {
  if (values.empty()) return {kNan, kNan};
  std::vector<double> medians, sample(values.size());
  for (int r = 0; r < resamples; ++r) {
    const uint64_t stream = Hash64(seed, r);
    for (size_t k = 0; k < sample.size(); ++k)
      sample[k] = values[Hash64(stream, k) % values.size()];
    medians.push_back(Median(sample));
  }
  return {Quantile(medians, 0.025), Quantile(medians, 0.975)};
}

}  // namespace sgf
