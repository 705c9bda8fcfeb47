#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <sgf/vio/visual_equations.h>

#include "unit/vio/tracks.h"

namespace sgf::vio {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::Vector3d, Eigen::VectorXd;

constexpr int kPoses = 4;

/// A few poses and landmarks whose rays are off by some pixels; ids are positions.
struct Scene {
  explicit Scene(const WindowOptions& window_options, double error_px = 2, int count = 40)
      : options(window_options) {
    for (int k = 0; k < kPoses; ++k) {
      const SE3 T{ExpSO3({0.05 * k, -0.08 * k, 0.1 * k}), {0.3 * k, -0.1 * k, 0.05 * k * k}};
      poses.push_back({T, T, Eigen::Matrix3d::Identity()});
    }
    for (int k = 0; k < count; ++k) {
      Landmark& landmark = landmarks.emplace_back();
      landmark.host = k % kPoses;
      landmark.ray = {0.8 * Uniform01(1, 2 * k) - 0.4, 0.8 * Uniform01(1, 2 * k + 1) - 0.4};
      landmark.inverse_depth = 0.05 + Uniform01(2, k);
      for (int target = 0; target < kPoses; ++target)
        for (const int camera : {0, 1}) landmark.sights.push_back({.frame = target, .camera = camera});
    }
    for (int k = 0; k < count; ++k) items.push_back(ItemOf(landmarks[k]));
    for (int k = 0; k < count; ++k)
      for (size_t i = 0; i < landmarks[k].sights.size(); ++i) {
        const std::uint64_t n = 100 * k + 2 * i;
        landmarks[k].sights[i].ray =
            Project(k, i).head<2>() / Project(k, i).z() +
            error_px / rig.focal_px * Eigen::Vector2d(Gaussian(3, n), Gaussian(3, n + 1));
      }
  }

  static LandmarkItem ItemOf(Landmark& landmark) {
    LandmarkItem item{.landmark = &landmark, .host = landmark.host};
    for (const LandmarkSight& sight : landmark.sights) item.frames.push_back(sight.frame);
    item.value << landmark.ray, landmark.inverse_depth;
    return item;
  }

  /// The landmark in the camera that sees it, in units of its depth in the host: by transforms
  /// alone, where the code under test is written for points at infinity.
  Vector3d Project(int k, size_t sight) const {
    const LandmarkSight& at = landmarks[k].sights[sight];
    const SE3 host = poses[items[k].host].T_world_body * rig.T_body_cam[0];
    const SE3 target = poses[at.frame].T_world_body * rig.T_body_cam[at.camera];
    const Vector3d& v = items[k].value;
    return v.z() * (target.Inverse() * (host * (Vector3d(v.x(), v.y(), 1) / v.z())));
  }

  VisualEquations Equations(int threads = 1) const { return {rig, options, threads}; }

  void MovePoses(const VectorXd& step) {
    for (int k = 0; k < kPoses; ++k) {
      SE3& T = poses[k].T_world_body;
      T.R = T.R * ExpSO3(step.segment<3>(6 * k));
      T.p += step.segment<3>(6 * k + 3);
    }
  }

  double CostAt(const VectorXd& step, const VectorXd& landmark_steps) const {
    Scene moved = *this;
    moved.MovePoses(step);
    for (size_t k = 0; k < items.size(); ++k)
      moved.items[k].value += landmark_steps.segment<3>(3 * k);
    return Equations().Cost(moved.poses, moved.items);
  }

  /// Errors of all sights in deviations, by Project().
  VectorXd Residuals() const {
    std::vector<double> all;
    for (size_t k = 0; k < items.size(); ++k)
      for (size_t i = 0; i < landmarks[k].sights.size(); ++i) {
        const Vector3d p = Project(static_cast<int>(k), i);
        const Eigen::Vector2d r =
            rig.focal_px / options.sigma_px * (p.head<2>() / p.z() - landmarks[k].sights[i].ray);
        all.insert(all.end(), {r.x(), r.y()});
      }
    return Eigen::Map<VectorXd>(all.data(), static_cast<Index>(all.size()));
  }

  VioRig rig = TestRig();
  WindowOptions options;
  std::vector<PoseState> poses;
  std::vector<Landmark> landmarks;
  std::vector<LandmarkItem> items;
};

constexpr double kNoHuber = 1e9;

/// Derivatives of Scene::Residuals() by poses and landmarks, by central differences.
MatrixXd DenseJacobian(const Scene& scene) {
  const Index poses = 6 * kPoses, size = poses + 3 * static_cast<Index>(scene.items.size());
  MatrixXd J(scene.Residuals().size(), size);
  constexpr double kStep = 1e-5;
  for (Index c = 0; c < size; ++c) {
    VectorXd r[2];
    for (const int side : {0, 1}) {
      Scene moved = scene;
      const double h = side ? kStep : -kStep;
      if (c < poses)
        moved.MovePoses(h * VectorXd::Unit(poses, c));
      else
        moved.items[(c - poses) / 3].value((c - poses) % 3) += h;
      r[side] = moved.Residuals();
    }
    J.col(c) = (r[1] - r[0]) / (2 * kStep);
  }
  return J;
}

TEST(VisualEquations, CostIsThatOfTransformedPoints) {
  const Scene scene({.sigma_px = 0.7, .huber_sigmas = kNoHuber});
  const double cost = scene.Equations().Cost(scene.poses, scene.items);
  EXPECT_GT(cost, 100);
  EXPECT_NEAR(cost, 0.5 * scene.Residuals().squaredNorm(), 1e-9 * cost);
  double huber = 0;
  for (Index k = 0; k < scene.Residuals().size(); k += 2) {
    const double norm = scene.Residuals().segment<2>(k).norm();
    huber += norm > 2 ? 2 * norm - 2 : 0.5 * norm * norm;
  }
  const Scene robust({.sigma_px = 0.7, .huber_sigmas = 2});
  EXPECT_NEAR(robust.Equations().Cost(robust.poses, robust.items), huber, 1e-9 * huber);
  EXPECT_NEAR(scene.Equations().ErrorPx(scene.poses, scene.items[3], 5),
              0.7 * scene.Residuals().segment<2>(2 * (3 * 2 * kPoses + 5)).norm(), 1e-9);
}

TEST(VisualEquations, SlopesAreThoseOfTheCost) {
  // Of the cost with landmarks held: b of the poses before elimination. The landmarks' own slope is
  // taken back from b.
  for (const double huber : {kNoHuber, 2.}) {
    Scene scene({.huber_sigmas = huber});
    ReducedEquations reduced;
    const double cost = scene.Equations().Linearize(scene.poses, scene.items, reduced);
    const VectorXd still = VectorXd::Zero(3 * static_cast<Index>(scene.items.size()));
    EXPECT_NEAR(cost, scene.CostAt(VectorXd::Zero(6 * kPoses), still), 1e-12 * cost);
    VectorXd b = reduced.b;
    for (const LandmarkItem& item : scene.items)
      for (const auto& a : item.across)
        b.segment<6>(6 * a.frame) += a.H.transpose() * item.H_inverse * item.b;
    constexpr double kStep = 1e-6;
    for (int c = 0; c < 6 * kPoses; ++c) {
      const VectorXd d = kStep * VectorXd::Unit(6 * kPoses, c);
      const double slope = (scene.CostAt(d, still) - scene.CostAt(-d, still)) / (2 * kStep);
      EXPECT_NEAR(b(c), slope, 1e-5 * b.norm()) << c;
    }
    for (Index c = 0; c < still.size(); ++c) {
      const VectorXd d = kStep * VectorXd::Unit(still.size(), c);
      const VectorXd none = VectorXd::Zero(6 * kPoses);
      const double slope = (scene.CostAt(none, d) - scene.CostAt(none, -d)) / (2 * kStep);
      EXPECT_NEAR(scene.items[c / 3].b(c % 3), slope, 1e-5 * scene.items[c / 3].b.norm()) << c;
    }
  }
}

TEST(VisualEquations, ReduceToTheDenseSchurComplement) {
  Scene scene({.huber_sigmas = kNoHuber});
  const MatrixXd J = DenseJacobian(scene);
  const VectorXd r = scene.Residuals();
  const MatrixXd H = J.transpose() * J;
  const VectorXd b = J.transpose() * r;
  constexpr Index n = 6 * kPoses;
  const Index m = H.cols() - n;
  const MatrixXd inverse = H.bottomRightCorner(m, m).inverse();
  const MatrixXd expected =
      H.topLeftCorner(n, n) - H.topRightCorner(n, m) * inverse * H.bottomLeftCorner(m, n);
  const VectorXd expected_b = b.head(n) - H.topRightCorner(n, m) * inverse * b.tail(m);
  ReducedEquations reduced;
  scene.Equations().Linearize(scene.poses, scene.items, reduced);
  EXPECT_LT((reduced.H - expected).norm(), 1e-5 * expected.norm());
  EXPECT_LT((reduced.b - expected_b).norm(), 1e-5 * expected_b.norm());

  // MoveLandmarks() leads to the minimum over the landmarks of the linearisation.
  const VectorXd step = 1e-3 * VectorXd::LinSpaced(n, -1, 1);
  scene.Equations().MoveLandmarks(step, scene.items);
  const VectorXd solved = -inverse * (b.tail(m) + H.bottomLeftCorner(m, n) * step);
  for (size_t k = 0; k < scene.items.size(); ++k) {
    const LandmarkItem& item = scene.items[k];
    const Vector3d moved = item.value - item.linearization;
    const Vector3d should = solved.segment<3>(3 * static_cast<Index>(k));
    if (item.linearization.z() + should.z() < 0.1 * item.linearization.z()) continue;
    EXPECT_LT((moved - should).norm(), 1e-4 * should.norm() + 1e-9) << k;
  }
}

TEST(VisualEquations, TakeDerivativesWhereTheyAreToldTo) {
  // First estimates: residuals are those of the poses, derivatives those of the linearisation.
  Scene scene({.huber_sigmas = kNoHuber}), there({.huber_sigmas = kNoHuber});
  const MatrixXd J = DenseJacobian(scene);
  scene.MovePoses(1e-2 * VectorXd::LinSpaced(6 * kPoses, -1, 1));
  const VectorXd r = scene.Residuals();
  ReducedEquations reduced;
  scene.Equations().Linearize(scene.poses, scene.items, reduced);
  VectorXd b = reduced.b;
  for (const LandmarkItem& item : scene.items)
    for (const auto& a : item.across)
      b.segment<6>(6 * a.frame) += a.H.transpose() * item.H_inverse * item.b;
  const VectorXd expected = (J.transpose() * r).head(6 * kPoses);
  EXPECT_LT((b - expected).norm(), 1e-5 * expected.norm());
  // A common motion of all poses changes nothing, wherever they are now.
  MatrixXd gauge = MatrixXd::Zero(6 * kPoses, 6);
  for (int k = 0; k < kPoses; ++k) {
    const SE3& T = scene.poses[k].linearization;
    gauge.block<3, 3>(6 * k, 0) = T.R.conjugate().toRotationMatrix();
    gauge.block<3, 3>(6 * k + 3, 0) = -HatSO3(T.p);
    gauge.block<3, 3>(6 * k + 3, 3).setIdentity();
  }
  EXPECT_LT((reduced.H * gauge).norm(), 1e-7 * reduced.H.norm());
}

TEST(VisualEquations, TurnParametersIntoTheLocalTangent) {
  Scene plain({}), turned({});
  const Eigen::Matrix3d turn = RightJacobianSO3({0.3, -0.2, 0.5});
  for (PoseState& pose : turned.poses) pose.turn = turn;
  ReducedEquations a, b;
  plain.Equations().Linearize(plain.poses, plain.items, a);
  turned.Equations().Linearize(turned.poses, turned.items, b);
  MatrixXd by = MatrixXd::Identity(6 * kPoses, 6 * kPoses);
  for (int k = 0; k < kPoses; ++k) by.block<3, 3>(6 * k, 6 * k) = turn;
  EXPECT_LT((b.H - by.transpose() * a.H * by).norm(), 1e-9 * a.H.norm());
  EXPECT_LT((b.b - by.transpose() * a.b).norm(), 1e-9 * a.b.norm());
}

TEST(VisualEquations, TheHostsRightImageTellsTheDepthAndNothingOfPoses) {
  Scene scene({}, 0, 1);
  Landmark& landmark = scene.landmarks[0];
  std::erase_if(landmark.sights, [](const LandmarkSight& sight) { return sight.frame != 0; });
  scene.items = {Scene::ItemOf(landmark)};
  const Vector3d truth = scene.items[0].value;
  scene.items[0].value.z() *= 1.05;
  ReducedEquations reduced;
  for (int k = 0; k < 10; ++k) {
    scene.Equations().Linearize(scene.poses, scene.items, reduced);
    EXPECT_EQ(reduced.H.norm(), 0);
    EXPECT_EQ(reduced.b.norm(), 0);
    scene.Equations().MoveLandmarks(VectorXd::Zero(6 * kPoses), scene.items);
  }
  EXPECT_LT((scene.items[0].value - truth).norm(), 1e-6);
  const double sigma = std::sqrt(scene.items[0].H_inverse(2, 2));
  // Inverse depth by disparity: the two rays share its error.
  const double expected = std::sqrt(2.) * scene.options.sigma_px / scene.rig.focal_px / 0.11;
  EXPECT_NEAR(sigma, expected, 0.1 * expected);
}

TEST(VisualEquations, LandmarksNearInfinityTellOfRotations) {
  for (const double rho : {1e-3, 1e-6, 1e-12}) {
    Scene scene({.huber_sigmas = kNoHuber}, 0);
    for (size_t k = 0; k < scene.items.size(); ++k) {
      scene.landmarks[k].inverse_depth = scene.items[k].value.z() = rho;
      for (size_t i = 0; i < scene.landmarks[k].sights.size(); ++i) {
        const Vector3d p = scene.Project(static_cast<int>(k), i);
        scene.landmarks[k].sights[i].ray = p.head<2>() / p.z();
      }
    }
    ReducedEquations reduced;
    EXPECT_LT(scene.Equations().Linearize(scene.poses, scene.items, reduced), 1e-6);
    EXPECT_TRUE(reduced.H.allFinite());
    // With the first pose held, rotations are known and translations are not.
    const auto rotation = reduced.H.block<3, 3>(6, 6);
    const auto position = reduced.H.block<3, 3>(9, 9);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(rotation).eigenvalues()(0), 1e4);
    EXPECT_LT(position.norm(), 1e9 * rho * rho);
    scene.Equations().MoveLandmarks(1e-4 * VectorXd::Ones(6 * kPoses), scene.items);
    for (const LandmarkItem& item : scene.items) {
      EXPECT_TRUE(item.value.allFinite());
      EXPECT_GT(item.value.z(), 0) << "stays before the camera";
    }
  }
}

TEST(VisualEquations, PointsBehindACameraCountForNothing) {
  Scene scene({}, 0, 8);
  scene.poses[2].T_world_body.R = scene.poses[2].T_world_body.R * ExpSO3({0, M_PI, 0});
  scene.poses[2].linearization = scene.poses[2].T_world_body;
  for (LandmarkItem& item : scene.items) item.host = 0;
  ReducedEquations reduced;
  const double cost = scene.Equations().Linearize(scene.poses, scene.items, reduced);
  EXPECT_EQ(cost, scene.Equations().Cost(scene.poses, scene.items));
  EXPECT_TRUE(std::isfinite(cost));
  EXPECT_EQ(reduced.H.middleRows(12, 6).norm(), 0);
  EXPECT_EQ(reduced.b.segment(12, 6).norm(), 0);
  for (size_t i = 0; i < scene.items[0].frames.size(); ++i)
    EXPECT_EQ(std::isinf(scene.Equations().ErrorPx(scene.poses, scene.items[0], i)),
              scene.items[0].frames[i] == 2);
}

TEST(VisualEquations, HaveTheCostOfWhereThePosesAreBehindTheLinearisationAsWell) {
  Scene scene({}, 2, 8);
  scene.poses[2].linearization.R = scene.poses[2].linearization.R * ExpSO3({0, M_PI, 0});
  ReducedEquations reduced;
  const double cost = scene.Equations().Linearize(scene.poses, scene.items, reduced);
  EXPECT_NEAR(cost, scene.Equations().Cost(scene.poses, scene.items), 1e-12 * cost);
  EXPECT_TRUE(reduced.H.allFinite());
}

TEST(VisualEquations, GiveTheSameBitsForAnyNumberOfThreads) {
  std::vector<ReducedEquations> all;
  std::vector<double> costs;
  for (const int threads : {1, 2, 0}) {
    Scene scene({}, 2, 333);
    costs.push_back(
        scene.Equations(threads).Linearize(scene.poses, scene.items, all.emplace_back()));
    costs.push_back(scene.Equations(threads).Cost(scene.poses, scene.items));
  }
  for (size_t k = 1; k < all.size(); ++k) {
    EXPECT_EQ(all[k].H, all[0].H);
    EXPECT_EQ(all[k].b, all[0].b);
    EXPECT_EQ(costs[2 * k], costs[0]);
    EXPECT_EQ(costs[2 * k + 1], costs[1]);
  }
}

}  // namespace
}  // namespace sgf::vio
