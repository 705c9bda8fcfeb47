#pragma once

// Internal to sgf::synth: directions of the lines that surfaces are made of.

#include <algorithm>

#include <Eigen/Core>

namespace sgf::synth {

/// Tangent of a line at its point k of n + 1, where at(k) gives the points, of second order in the
/// unequal steps about it.
template <class At>
Eigen::Vector3f TangentAt(const At& at, int k, int n, bool closed) {
  using Eigen::Vector3f;
  const auto from = [&](int a, int b) -> Vector3f { return at(b) - at(a); };
  const auto weighted = [](const Vector3f& a, float weight_a, const Vector3f& b, float weight_b) {
    return Vector3f(a.normalized() * weight_a + b.normalized() * weight_b);
  };
  const auto one_sided = [&](const Vector3f& near, const Vector3f& far) {
    const float ratio = near.norm() / std::max(near.norm() + far.norm(), 1e-20f);
    return weighted(near, 1 + ratio, far, -ratio);
  };
  if (n == 1) return from(0, 1);
  if (k == 0 && !closed) return one_sided(from(0, 1), from(1, 2));
  if (k == n && !closed) return one_sided(from(n - 1, n), from(n - 2, n - 1));
  const Vector3f before = k > 0 ? from(k - 1, k) : from(n - 1, n);
  const Vector3f after = k < n ? from(k, k + 1) : from(0, 1);
  return weighted(before, after.norm(), after, before.norm());
}

}  // namespace sgf::synth
