#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include <sgf/core/parallel.h>
#include <sgf/vio/visual_equations.h>

namespace sgf::vio {
namespace {

using Eigen::Matrix3d, Eigen::MatrixXd, Eigen::Vector2d, Eigen::Vector3d, Eigen::VectorXd;
using Matrix26 = Eigen::Matrix<double, 2, kPoseParameters>;

constexpr int kBatch = 16;  // landmarks whose sums are taken together, in order

}  // namespace

/// A sight of a landmark with its derivatives, in deviations.
struct VisualEquations::Seen {
  Vector2d r;
  Matrix26 by_host, by_target;
  Eigen::Matrix<double, 2, 3> by_landmark;
};

VisualEquations::VisualEquations(const VioRig& rig, const WindowOptions& options, int threads)
    : rig_(rig),
      weight_(rig.focal_px / options.sigma_px),
      huber_(options.huber_sigmas),
      sigma_px_(options.sigma_px),
      threads_(threads) {
  for (const SE3& T : rig.T_body_cam) T_cam_body_.push_back(T.Inverse());
}

/// All in units of the landmark's depth, so that it may be at infinity: with d = (x, y, 1) and the
/// inverse depth rho, b = R_bc d + rho t_bc in the host's body, q = R_h b + rho (p_h - p_t) from
/// the target's body in world axes, P = R_cb R_t^T q + rho t_cb in the target's camera.
bool VisualEquations::See(std::span<const PoseState> poses, const LandmarkItem& item, size_t sight,
                          bool derivatives, Seen& seen) const {
  const LandmarkSight& at = item.landmark->sights[sight];
  const SE3& T_bc = rig_.T_body_cam[0];
  const SE3& T_cb = T_cam_body_[at.camera];
  const PoseState &host = poses[item.host], &target = poses[item.frames[sight]];
  const double rho = item.value.z();
  const Vector3d d(item.value.x(), item.value.y(), 1);
  const Vector3d b = T_bc.R * d + rho * T_bc.p;
  const auto project = [&](const SE3& T_h, const SE3& T_t) -> Vector3d {
    return T_cb.R * (T_t.R.conjugate() * (T_h.R * b + rho * (T_h.p - T_t.p))) + rho * T_cb.p;
  };
  const Vector3d P = project(host.T_world_body, target.T_world_body);
  constexpr double kLeastDepth = 1e-2;  // of that in the host
  if (!(P.z() > kLeastDepth)) return false;
  seen.r = weight_ * (P.head<2>() / P.z() - at.ray);
  if (!derivatives) return true;
  const SE3 &T_h = host.linearization, &T_t = target.linearization;
  const Vector3d L = project(T_h, T_t);
  if (!(L.z() > kLeastDepth)) {  // an error, but no slope
    seen.by_host.setZero();
    seen.by_target.setZero();
    seen.by_landmark.setZero();
    return true;
  }
  const double s = weight_ / L.z();
  Eigen::Matrix<double, 2, 3> by_P;
  by_P << s, 0, -s * L.x() / L.z(), 0, s, -s * L.y() / L.z();
  const Eigen::Matrix<double, 2, 3> to_world =
      by_P * (T_cb.R * T_t.R.conjugate()).toRotationMatrix();
  const Matrix3d R_h = T_h.R.toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> to_host = to_world * R_h;
  seen.by_host.leftCols<3>() = -to_host * HatSO3(b) * host.turn;
  seen.by_host.rightCols<3>() = rho * to_world;
  const Vector3d m = T_t.R.conjugate() * (T_h.R * b + rho * (T_h.p - T_t.p));
  seen.by_target.leftCols<3>() = by_P * T_cb.R.toRotationMatrix() * HatSO3(m) * target.turn;
  seen.by_target.rightCols<3>() = -rho * to_world;
  seen.by_landmark.leftCols<2>() = to_host * T_bc.R.toRotationMatrix().leftCols<2>();
  seen.by_landmark.col(2) = to_host * T_bc.p + to_world * (T_h.p - T_t.p) + by_P * T_cb.p;
  return true;
}

double VisualEquations::Cost(std::span<const PoseState> poses,
                             std::span<const LandmarkItem> items) const {
  std::vector<double> costs(items.size());
  ParallelForBatches(static_cast<int>(items.size()), threads_, [&](int k) {
    Seen seen;
    for (size_t i = 0; i < items[k].frames.size(); ++i) {
      if (!See(poses, items[k], i, false, seen)) continue;
      const double norm = seen.r.norm();
      costs[k] += norm > huber_ ? huber_ * (norm - 0.5 * huber_) : 0.5 * norm * norm;
    }
  });
  double sum = 0;
  for (const double cost : costs) sum += cost;
  return sum;
}

double VisualEquations::LinearizeItem(std::span<const PoseState> poses, LandmarkItem& item,
                                      ReducedEquations& part) const {
  Matrix3d H = Matrix3d::Zero();
  item.b.setZero();
  item.across.clear();
  const auto across = [&](int frame) -> auto& {
    for (auto& a : item.across)
      if (a.frame == frame) return a.H;
    item.across.push_back({frame, Eigen::Matrix<double, 3, kPoseParameters>::Zero()});
    return item.across.back().H;
  };
  across(item.host);
  double cost = 0;
  Seen seen;
  for (size_t i = 0; i < item.frames.size(); ++i) {
    if (!See(poses, item, i, true, seen)) continue;
    const double norm = seen.r.norm();
    const double w = norm > huber_ ? huber_ / norm : 1;
    cost += norm > huber_ ? huber_ * (norm - 0.5 * huber_) : 0.5 * norm * norm;
    const Eigen::Matrix<double, 3, 2> weighted = w * seen.by_landmark.transpose();
    H.noalias() += weighted * seen.by_landmark;
    item.b.noalias() += weighted * seen.r;
    const int h = kPoseParameters * item.host, t = kPoseParameters * item.frames[i];
    if (h == t) continue;  // the right image of the host says nothing of its pose
    across(item.host).noalias() += weighted * seen.by_host;
    across(item.frames[i]).noalias() += weighted * seen.by_target;
    const Eigen::Matrix<double, kPoseParameters, 2> host = w * seen.by_host.transpose(),
                                                    target = w * seen.by_target.transpose();
    constexpr int n = kPoseParameters;
    part.H.block<n, n>(h, h).noalias() += host * seen.by_host;
    part.H.block<n, n>(t, t).noalias() += target * seen.by_target;
    if (h > t)
      part.H.block<n, n>(h, t).noalias() += host * seen.by_target;
    else
      part.H.block<n, n>(t, h).noalias() += target * seen.by_host;
    part.b.segment<n>(h).noalias() += host * seen.r;
    part.b.segment<n>(t).noalias() += target * seen.r;
  }
  // A direction that no sight fixes stays where it is.
  constexpr double kLeastShare = 1e-9;
  H.diagonal().array() += kLeastShare * H.trace() + 1e-12;
  item.H_inverse = H.inverse();
  return cost;
}

double VisualEquations::Linearize(std::span<const PoseState> poses, std::span<LandmarkItem> items,
                                  ReducedEquations& reduced) const {
  const Eigen::Index size = kPoseParameters * static_cast<Eigen::Index>(poses.size());
  const int count = static_cast<int>(items.size()), batches = (count + kBatch - 1) / kBatch;
  std::vector<ReducedEquations> parts(batches);
  std::vector<double> costs(batches);
  ParallelFor(batches, threads_, [&](int batch) {
    constexpr int n = kPoseParameters;
    ReducedEquations& part = parts[batch];
    part = {MatrixXd::Zero(size, size), VectorXd::Zero(size)};
    for (int k = batch * kBatch; k < std::min(count, (batch + 1) * kBatch); ++k) {
      LandmarkItem& item = items[k];
      item.linearization = item.value;
      costs[batch] += LinearizeItem(poses, item, part);
      const Vector3d solved = item.H_inverse * item.b;
      for (const auto& row : item.across) {
        part.b.segment<n>(n * row.frame).noalias() -= row.H.transpose() * solved;
        const Eigen::Matrix<double, n, 3> weighted = row.H.transpose() * item.H_inverse;
        for (const auto& col : item.across)
          if (col.frame <= row.frame)
            part.H.block<n, n>(n * row.frame, n * col.frame).noalias() -= weighted * col.H;
      }
    }
  });
  reduced = {MatrixXd::Zero(size, size), VectorXd::Zero(size)};
  double cost = 0;
  for (int batch = 0; batch < batches; ++batch) {
    reduced.H += parts[batch].H;
    reduced.b += parts[batch].b;
    cost += costs[batch];
  }
  reduced.H = reduced.H.selfadjointView<Eigen::Lower>();
  return cost;
}

void VisualEquations::MoveLandmarks(const VectorXd& step, std::span<LandmarkItem> items) const {
  for (LandmarkItem& item : items) {
    Vector3d b = item.b;
    for (const auto& across : item.across)
      b += across.H * step.segment<kPoseParameters>(kPoseParameters * across.frame);
    item.value = item.linearization - item.H_inverse * b;
    constexpr double kLeastShare = 0.1;  // an inverse depth stays positive
    item.value.z() = std::max(item.value.z(), kLeastShare * item.linearization.z());
  }
}

double VisualEquations::ErrorPx(std::span<const PoseState> poses, const LandmarkItem& item,
                                size_t sight) const {
  Seen seen;
  return See(poses, item, sight, false, seen) ? sigma_px_ * seen.r.norm() : INFINITY;
}

}  // namespace sgf::vio
