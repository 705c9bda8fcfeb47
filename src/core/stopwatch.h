#pragma once

#include <chrono>

namespace sgf {

/// Wall time between events.
class Stopwatch {
 public:
  /// Seconds since the start or the last call.
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> elapsed = now - start_;
    start_ = now;
    return elapsed.count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace sgf
