#pragma once

#include <optional>

#include <Eigen/Core>

#include <sgf/core/se3.h>

namespace sgf::vio {

/// Inverse depth (1/m) in the first camera of a point seen along two rays (at depth 1): where the
/// ray's image in the second camera comes nearest to what is seen there.
/// @return nothing behind either camera, or where the cameras stand too near to each other to tell
///   anything: the rays differ by less than `least_angle_rad`.
std::optional<double> TriangulateInverseDepth(const Eigen::Vector2d& first,
                                              const Eigen::Vector2d& second,
                                              const SE3& T_second_first, double least_angle_rad);

}  // namespace sgf::vio
