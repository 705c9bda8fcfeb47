#pragma once

#include <cstdint>

#include <sgf/core/se3.h>

namespace sgf {

/// A pose at a time: an element of a trajectory. Which frames it relates is said where it is used.
struct TimedPose {
  std::int64_t time_ns = 0;
  SE3 pose;  ///< m
};

}  // namespace sgf
