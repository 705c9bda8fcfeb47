#pragma once

#include <utility>

namespace sgf::synth {

template <class F>
Patch MakePatch(int nu, int nv, F&& f) {
  std::vector<Eigen::Vector3f> points;
  points.reserve(static_cast<size_t>(nu + 1) * (nv + 1));
  for (int j = 0; j <= nv; ++j)
    for (int i = 0; i <= nu; ++i)
      points.push_back(f(static_cast<float>(i) / nu, static_cast<float>(j) / nv));
  return PatchFromPoints(nu, nv, std::move(points));
}

}  // namespace sgf::synth
