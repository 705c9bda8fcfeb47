#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include <Eigen/Core>

namespace sgf {

/// Which key-frame a window can best do without: the one that is far from the newest and near to
/// others (Engel, Koltun, Cremers, "Direct sparse odometry", 2018, eq. 20).
/// @param places of those to choose from, m or units of a map; at least one.
/// @param newest place of the newest frame.
inline size_t LeastUsefulKeyframe(std::span<const Eigen::Vector3d> places,
                                  const Eigen::Vector3d& newest) {
  constexpr double kSamePlace = 1e-5;
  size_t least = 0;
  double highest = -1;
  for (size_t k = 0; k < places.size(); ++k) {
    double near = 0;
    for (size_t j = 0; j < places.size(); ++j)
      if (j != k) near += 1 / ((places[k] - places[j]).norm() + kSamePlace);
    const double score = std::sqrt((places[k] - newest).norm()) * near;
    if (score <= highest) continue;
    highest = score;
    least = k;
  }
  return least;
}

}  // namespace sgf
