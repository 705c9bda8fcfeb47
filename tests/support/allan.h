#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Dense>

namespace sgf {

/// White noise and random walk of a signal at rest.
struct AllanFit {
  double noise_density = 0;  ///< N, unit of the signal / sqrt(Hz)
  double random_walk = 0;    ///< K, unit of the signal / s / sqrt(Hz)
};

/// Overlapping Allan variance of a signal for averages over `m` samples (IEEE Std 952, annex C).
/// @param integral the signal's running sum, starting with 0.
inline double AllanVariance(const std::vector<double>& integral, size_t m) {
  double sum = 0;
  const size_t terms = integral.size() - 2 * m;
  for (size_t k = 0; k < terms; ++k) {
    const double difference = integral[k + 2 * m] - 2 * integral[k + m] + integral[k];
    sum += difference * difference;
  }
  return sum / (2.0 * m * m * terms);
}

/// Least-squares fit of N^2 / tau + K^2 tau / 3 to the mean Allan variances of signals that share
/// one N and K (the axes of a sensor), at averaging times tau of 1, 2, 4... samples up to
/// `max_tau_s`, weighted by their own accuracy: the relative variance of an estimate grows with
/// tau.
inline AllanFit FitAllanVariance(const std::vector<std::vector<double>>& signals, double rate_hz,
                                 double max_tau_s) {
  std::vector<std::vector<double>> integrals;
  for (const auto& signal : signals) {
    double mean = 0;  // taken away to keep digits; the variance does not see it
    for (const double value : signal) mean += value / signal.size();
    auto& integral = integrals.emplace_back(1, 0.0);
    for (const double value : signal) integral.push_back(integral.back() + value - mean);
  }
  Eigen::Matrix2d H = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (size_t m = 1; m <= max_tau_s * rate_hz; m *= 2) {
    double variance = 0;
    for (const auto& integral : integrals)
      variance += AllanVariance(integral, m) / integrals.size();
    const double tau_s = m / rate_hz;
    const Eigen::Vector2d model = Eigen::Vector2d(1 / tau_s, tau_s / 3) / variance;
    H += model * model.transpose() / tau_s;
    b += model / tau_s;
  }
  const Eigen::Vector2d squares = H.ldlt().solve(b);
  return {std::sqrt(squares[0]), std::sqrt(squares[1])};
}

}  // namespace sgf
