#include <Eigen/Geometry>

#include <sgf/vio/triangulation.h>

namespace sgf::vio {

std::optional<double> TriangulateInverseDepth(const Eigen::Vector2d& first,
                                              const Eigen::Vector2d& second,
                                              const SE3& T_second_first, double least_angle_rad) {
  const Eigen::Vector3d d = T_second_first.R * first.homogeneous(), s = second.homogeneous();
  const Eigen::Vector3d normal = s.cross(d);
  if (!(normal.norm() > least_angle_rad * s.norm() * d.norm())) return std::nullopt;
  // s x (d + rho p) = 0 in least squares over rho.
  const Eigen::Vector3d baseline = s.cross(T_second_first.p);
  const double rho = -baseline.dot(normal) / baseline.squaredNorm();
  if (!(rho > 0) || !((d + rho * T_second_first.p).z() > 0)) return std::nullopt;
  return rho;
}

}  // namespace sgf::vio
