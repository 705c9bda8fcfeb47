#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include <Eigen/Eigenvalues>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/vio/window.h>

#include "unit/vio/tracks.h"

namespace sgf::vio {
namespace {

using Eigen::MatrixXd, Eigen::Vector3d, Eigen::VectorXd;

constexpr int kPoints = 250;

const Flight& TestFlight(bool noisy) {
  const auto fly = [](bool with_noise) {
    synth::ImuOptions options = NoiseFree();
    options.noisy = with_noise;
    return Flight(LivelyRide(), 0, 4, options);
  };
  static const Flight flights[] = {fly(false), fly(true)};
  return flights[noisy];
}

SimulatedWindow MakeWindow(double sigma_px, const SimulatedWindow::Options& options = {},
                           bool noisy_imu = true) {
  return {TestFlight(noisy_imu), Sightings(TestRig(), WallPoints(kPoints, 1), sigma_px, 7),
          options};
}

/// Biases are found again, so that those of the simulation may be no surprise.
StateVector WideSigmas() {
  StateVector sigmas = AnchorSigmas();
  sigmas.head<2>().setConstant(1e-4);
  sigmas.segment<3>(kVelocity).setConstant(1);
  sigmas.segment<3>(kGyroBias).setConstant(1);
  sigmas.segment<3>(kAccelBias).setConstant(1);
  return sigmas;
}

/// Largest error of position (m), rotation (rad) and velocity (m/s) in a window.
struct Errors {
  double position = 0, rotation = 0, velocity = 0;
};

Errors ErrorsOf(const SimulatedWindow& simulated) {
  Errors errors;
  for (const Frame& frame : simulated.window.frames) {
    const StateVector d = Minus(frame.state, simulated.TruthOf(frame.id));
    errors.rotation = std::max(errors.rotation, d.segment<3>(kRotation).norm());
    errors.position = std::max(errors.position, d.segment<3>(kPosition).norm());
    if (frame.inertial) errors.velocity = std::max(errors.velocity, d.segment<3>(kVelocity).norm());
  }
  return errors;
}

/// Mean over the frames but the first of the squared errors in deviations, for each number.
double NeesOf(const SimulatedWindow& simulated) {
  double sum = 0;
  for (const Frame& frame : simulated.window.frames) {
    if (frame.id == 0) continue;
    const int size = frame.inertial ? kStateSize : kPoseParameters;
    const VectorXd d = Minus(frame.state, simulated.TruthOf(frame.id)).head(size);
    const StateMatrix covariance = simulated.window.CovarianceOf(frame).state;
    sum += d.dot(covariance.topLeftCorner(size, size).ldlt().solve(d)) / size;
  }
  return sum / (static_cast<double>(simulated.window.frames.size()) - 1);
}

void Disturb(SimulatedWindow& simulated, double scale) {
  StateVector sigmas = StateVector::Zero();
  sigmas.head<3>().setConstant(0.02 * scale);
  sigmas.segment<3>(kPosition).setConstant(0.05 * scale);
  sigmas.segment<3>(kVelocity).setConstant(0.1 * scale);
  for (size_t k = 1; k < simulated.window.frames.size(); ++k) {
    Frame& frame = simulated.window.frames[k];
    frame.state = Disturbed(simulated.TruthOf(frame.id), sigmas, k);
  }
  for (auto& [id, landmark] : simulated.window.landmarks)
    landmark.inverse_depth *= 1 + 0.1 * scale * Gaussian(9, id);
}

TEST(Window, RecoversStatesFromExactMeasurements) {
  SimulatedWindow simulated = MakeWindow(0, {}, false);
  for (int k = 0; k < 8; ++k) {
    simulated.Push();
    if (k == 0) Anchor(simulated.window.frames[0], WideSigmas(), simulated.window);
  }
  simulated.window.frames[0].state = simulated.TruthOf(0);
  Disturb(simulated, 1);
  EXPECT_GT(ErrorsOf(simulated).position, 0.05);
  const WindowSummary summary = simulated.window.Refine();
  EXPECT_TRUE(summary.usable);
  EXPECT_GT(summary.sights, 500);
  EXPECT_LT(summary.cost, 0.1);
  const Errors errors = ErrorsOf(simulated);
  EXPECT_LT(errors.position, 1e-4);
  EXPECT_LT(errors.rotation, 1e-4);
  EXPECT_LT(errors.velocity, 1e-3);
  const Frame& last = simulated.window.frames.back();
  EXPECT_LT((last.state.gyro_bias - simulated.TruthOf(last.id).gyro_bias).norm(), 1e-3);
  EXPECT_LT((last.state.accel_bias - simulated.TruthOf(last.id).accel_bias).norm(), 0.05);
  EXPECT_EQ(last.state.time_ns, simulated.window.frames.back().since_last->to_ns());
  for (const auto& [id, landmark] : simulated.window.landmarks) {
    const Vector3d p = simulated.window.PoseOf(*simulated.window.Find(landmark.host), 0) *
                       (landmark.ray.homogeneous() / landmark.inverse_depth);
    EXPECT_LT((p - WallPoints(kPoints, 1)[id]).norm(), 2e-3) << id;
    EXPECT_GT(landmark.inverse_depth_variance, 0);
  }
}

TEST(Window, RecoversStatesFromNoisyMeasurements) {
  SimulatedWindow simulated = MakeWindow(0.5);
  for (int k = 0; k < 10; ++k) {
    simulated.Push();
    if (k == 0) Anchor(simulated.window.frames[0], WideSigmas(), simulated.window);
  }
  Disturb(simulated, 1);
  const WindowSummary summary = simulated.window.Refine();
  const Errors errors = ErrorsOf(simulated);
  EXPECT_LT(errors.position, 0.02);
  EXPECT_LT(errors.rotation, 0.003);
  EXPECT_LT(errors.velocity, 0.05);
  EXPECT_LT(NeesOf(simulated), 2);
  // Half the squared errors in deviations: one for each sight, less what landmarks and states take.
  const double degrees = 2 * summary.sights - 3. * simulated.window.landmarks.size() - 6 * 9;
  EXPECT_NEAR(2 * summary.cost / degrees, 1, 0.1);
}

TEST(Window, TellsWhetherTheInertialSensorMeasuredWhatTheImagesShow) {
  SimulatedWindow simulated = MakeWindow(0.5);
  Window& window = simulated.window;
  for (int k = 0; k < 6; ++k) {
    simulated.Push();
    if (k == 0) Anchor(window.frames[0], AnchorSigmas(), window);
  }
  EXPECT_GT(window.Refine().inertial_error, 0);
  EXPECT_LT(window.Refine().inertial_error, 1.2);
  Flight upside = TestFlight(true);
  for (ImuSample& sample : upside.samples) sample.accel = -sample.accel;
  for (size_t k = 1; k < window.frames.size(); ++k)
    window.frames[k].since_last =
        upside.Integrate(SimulatedWindow::SampleOf(window.frames[k - 1].id),
                         SimulatedWindow::SampleOf(window.frames[k].id), {});
  EXPECT_GT(window.Refine().inertial_error, 2);

  // Without it, the images have it right again.
  window.DropInertial(AnchorSigmas().head<kPoseParameters>());
  const WindowSummary alone = window.Refine();
  EXPECT_EQ(alone.inertial_error, 0);
  EXPECT_LT(ErrorsOf(simulated).position, 0.1);
  for (const Frame& frame : window.frames) {
    EXPECT_FALSE(frame.inertial);
    EXPECT_EQ(frame.state.gyro_bias.norm(), 0);
  }
}

TEST(Window, IsAtTheMinimumAfterTheDefaultsIterations) {
  // Tilt and biases are hard to tell apart, and must not lag behind for that.
  SimulatedWindow quick = MakeWindow(0.5, {.window = {}}), patient = MakeWindow(0.5);
  for (SimulatedWindow* simulated : {&quick, &patient})
    for (int k = 0; k < 10; ++k) {
      simulated->Push();
      if (k == 0) {
        Frame& first = simulated->window.frames[0];
        first.state = Disturbed(first.state, AnchorSigmas(), 4);
        Anchor(first, AnchorSigmas(), simulated->window);
      }
      simulated->window.Refine();
    }
  const Frame &a = patient.window.frames.back(), &b = quick.window.frames.back();
  const StateVector d = Minus(b.state, a.state);
  EXPECT_LT(d.dot(patient.window.CovarianceOf(a).state.ldlt().solve(d)), 0.05);
}

TEST(Window, RecoversPosesWithoutInertialSensor) {
  SimulatedWindow simulated = MakeWindow(0.5);
  for (int k = 0; k < 8; ++k) {
    simulated.Push();
    Frame& frame = simulated.window.frames.back();
    frame.inertial = false;
    frame.since_last.reset();
    if (k == 0) Anchor(frame, StateVector::Constant(1e-4), simulated.window);
  }
  Disturb(simulated, 1);
  EXPECT_TRUE(simulated.window.Refine().usable);
  const Errors errors = ErrorsOf(simulated);
  EXPECT_LT(errors.position, 0.03);
  EXPECT_LT(errors.rotation, 0.004);
  EXPECT_LT(NeesOf(simulated), 2);
}

TEST(Window, AnchorsRotationsAboutTheAxesOfTheWorld) {
  SimulatedWindow simulated = MakeWindow(0.5);
  simulated.Push();
  StateVector sigmas = AnchorSigmas();
  sigmas.head<3>() << 0.1, 0.2, 1e-3;
  Frame& frame = simulated.window.frames[0];
  Anchor(frame, sigmas, simulated.window);
  const StateMatrix covariance = simulated.window.CovarianceOf(frame).state;
  const Eigen::Matrix3d R = frame.state.T_world_body.R.toRotationMatrix();
  const Eigen::Matrix3d world = R * covariance.topLeftCorner<3, 3>() * R.transpose();
  EXPECT_LT((world - Eigen::Matrix3d(Vector3d(1e-2, 4e-2, 1e-6).asDiagonal())).norm(), 1e-6);
  for (int k = 3; k < kStateSize; ++k)
    EXPECT_NEAR(covariance(k, k) / (sigmas(k) * sigmas(k)), 1, 1e-3) << k;
}

TEST(Window, TakesOutWrongSights) {
  SimulatedWindow simulated = MakeWindow(0.3);
  for (int k = 0; k < 8; ++k) {
    simulated.Push();
    if (k == 0) Anchor(simulated.window.frames[0], WideSigmas(), simulated.window);
  }
  Window& window = simulated.window;
  window.Refine();
  EXPECT_EQ(window.RemoveOutliers(), 0) << "where all is well";
  std::set<std::int64_t> wrong;
  int wrong_sights = 0, all = 0;
  for (auto& [id, landmark] : window.landmarks) {
    all += static_cast<int>(landmark.sights.size());
    if (id % 7 != 0 || landmark.sights.size() < 6) continue;
    LandmarkSight& sight = landmark.sights[4];
    sight.ray += Eigen::Vector2d(12, id % 2 ? 12 : -12) / window.rig().focal_px;
    wrong.insert(id);
    ++wrong_sights;
  }
  ASSERT_GT(wrong_sights, 5);
  window.Refine();
  const int removed = window.RemoveOutliers();
  EXPECT_GE(removed, wrong_sights);
  EXPECT_LE(removed, wrong_sights + all / 200);
  for (const std::int64_t id : wrong) {
    ASSERT_TRUE(window.landmarks.contains(id));
    const auto truth = Sightings(TestRig(), WallPoints(kPoints, 1), 0.3, 7);
    for (const LandmarkSight& sight : window.landmarks.at(id).sights) {
      const auto right = truth.See(static_cast<int>(id), sight.camera, sight.frame,
                                   simulated.TruthOf(sight.frame).T_world_body);
      EXPECT_EQ(sight.ray, right->ray) << "only the wrong one leaves";
    }
  }
  window.Refine();
  EXPECT_LT(ErrorsOf(simulated).position, 0.015);
  EXPECT_LT(NeesOf(simulated), 2);
}

TEST(Window, TakesOutLandmarksWithoutSights) {
  SimulatedWindow simulated = MakeWindow(0);
  simulated.Push();
  Window& window = simulated.window;
  ASSERT_GT(window.landmarks.size(), 4u);
  auto it = window.landmarks.begin();
  const auto wrong = it->first, behind = std::next(it)->first, none = std::next(it, 2)->first;
  window.landmarks.at(wrong).ray += Eigen::Vector2d(0.1, 0);
  window.landmarks.at(behind).inverse_depth = -1;
  window.landmarks.at(none).sights.clear();
  const size_t before = window.landmarks.size();
  EXPECT_GE(window.RemoveOutliers(), 2);
  EXPECT_EQ(window.landmarks.size(), before - 3);
  for (const auto id : {wrong, behind, none}) EXPECT_FALSE(window.landmarks.contains(id));
}

TEST(Window, KeepsWhatMarginalizedFramesSaid) {
  // The whole batch against one where half of the frames have left.
  SimulatedWindow batch = MakeWindow(0.5), sliding = MakeWindow(0.5);
  for (SimulatedWindow* simulated : {&batch, &sliding}) {
    for (int k = 0; k < 12; ++k) {
      simulated->Push();
      if (k == 0) Anchor(simulated->window.frames[0], AnchorSigmas(), simulated->window);
      simulated->window.Refine();
    }
    // Gone are frame 0 with all of its landmarks, frame 1, and motions of 2 and 3.
    if (simulated == &sliding) simulated->window.Marginalize(std::vector{0, 1}, std::vector{2, 3});
    simulated->window.Refine();
  }
  EXPECT_EQ(sliding.window.Find(0), nullptr);
  EXPECT_FALSE(sliding.window.Find(3)->inertial);
  for (const auto& [id, landmark] : sliding.window.landmarks) {
    EXPECT_NE(landmark.host, 0);
    for (const LandmarkSight& sight : landmark.sights) EXPECT_NE(sight.frame, 0);
  }
  const Frame &a = batch.window.frames.back(), &b = sliding.window.frames.back();
  const StateMatrix covariance = batch.window.CovarianceOf(a).state;
  const StateVector d = Minus(b.state, a.state);
  // In deviations of the batch's estimate: nearly nothing.
  EXPECT_LT(d.dot(covariance.ldlt().solve(d)), 0.1);
  const StateMatrix left = sliding.window.CovarianceOf(b).state;
  for (int k = 0; k < kStateSize; ++k)
    EXPECT_NEAR(std::sqrt(left(k, k) / covariance(k, k)), 1, 0.05) << k;
}

TEST(Window, ForgetsNoUncertaintyThroughManyMarginalizations) {
  SimulatedWindow simulated = MakeWindow(0.5);
  double before = 0;
  for (int k = 0; k < 30; ++k) {
    simulated.Push();
    Window& window = simulated.window;
    if (k == 0) Anchor(window.frames[0], AnchorSigmas(), window);
    window.Refine();
    window.RemoveOutliers();
    simulated.Marginalize(3, 3);
    const StateMatrix covariance = window.CovarianceOf(window.frames.back()).state;
    EXPECT_TRUE(covariance.allFinite());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<StateMatrix>(covariance).eigenvalues()(0), 0) << k;
    EXPECT_LT((covariance - covariance.transpose()).norm(), 1e-9 * covariance.norm());
    if (k % 10 == 9) {
      // Position drifts: the deviation grows from ten frames to the next.
      const double now = std::sqrt(covariance.block<3, 3>(kPosition, kPosition).trace());
      EXPECT_GT(now, before) << k;
      EXPECT_LT(now, 0.2);
      before = now;
    }
  }
  EXPECT_LE(simulated.window.frames.size(), 6u);
  const Errors errors = ErrorsOf(simulated);
  EXPECT_LT(errors.position, 0.1);
  EXPECT_LT(errors.rotation, 0.02);
}

/// How all parameters of a prior change with a motion of the world, to first order.
MatrixXd GaugeOf(const Window& window) {
  // Turns about the world's axes x, y and z, then moves along them.
  int size = 0;
  for (const BlockId block : window.prior().blocks()) size += block.size();
  MatrixXd gauge = MatrixXd::Zero(size, 6);
  for (const BlockId block : window.prior().blocks()) {
    const int row = window.prior().OffsetOf(block);
    const BodyState& at = window.Find(block.frame)->linearization;
    if (block.part == Part::kMotion) {
      gauge.block<3, 3>(row, 0) = -HatSO3(at.velocity);
      continue;
    }
    gauge.block<3, 3>(row, 0) = at.T_world_body.R.conjugate().toRotationMatrix();
    gauge.block<3, 3>(row + 3, 0) = -HatSO3(at.T_world_body.p);
    gauge.block<3, 3>(row + 3, 3).setIdentity();
  }
  return gauge;
}

/// A window that slides over images of a rig and a clock that are off.
struct Miscalibrated {
  static constexpr double kOffset_s = 0.005;  // one inertial sample
  const SE3 off{ExpSO3({0.012, -0.008, 0.01}), {0.02, -0.015, 0.01}};
  SimulatedWindow simulated;

  explicit Miscalibrated(double sigma_px, std::uint64_t seed = 7)
      : simulated(TestFlight(true), Sightings(TrueRig(), WallPoints(kPoints, 1), sigma_px, seed),
                  {.late_samples = 1}) {}

  VioRig TrueRig() const {
    VioRig rig = TestRig();
    for (SE3& T : rig.T_body_cam) T = off * T;
    return rig;
  }

  /// @param sigmas of the calibration; nothing to leave it as it is.
  void Fly(int frames, const std::optional<CalibrationVector>& sigmas) {
    for (int k = 0; k < frames; ++k) {
      simulated.Push();
      if (k == 0) Anchor(simulated.window.frames[0], AnchorSigmas(), simulated.window);
      if (k == 0 && sigmas) simulated.window.AnchorCalibration(*sigmas);
      simulated.window.Refine();
      if (k + 1 < frames) simulated.Marginalize(3, 5);
    }
  }

  CalibrationVector Error() const {
    return Minus(simulated.window.calibration(), {off, kOffset_s});
  }
};

CalibrationVector Unsure() {
  CalibrationVector sigmas;
  sigmas << Vector3d::Constant(0.02), Vector3d::Constant(0.03), 0.01;
  return sigmas;
}

TEST(Window, FindsTheCalibration) {
  Miscalibrated flight(0.3);
  flight.Fly(35, Unsure());
  const CalibrationVector error = flight.Error();
  EXPECT_LT(error.head<3>().norm(), 2e-3);
  EXPECT_LT(error.segment<3>(3).norm(), 0.02);  // the least observable part
  EXPECT_LT(std::abs(error(6)), 5e-4);
  EXPECT_TRUE(flight.simulated.window.calibrates());
  // It is known as well as the covariance says, and better than at first.
  const CalibrationMatrix covariance =
      flight.simulated.window.CovarianceOf(flight.simulated.window.frames.back()).calibration;
  EXPECT_LT(error.dot(covariance.ldlt().solve(error)), 24);  // 99.9 % of chi-square with 7 degrees
  for (int k = 0; k < kCalibrationParameters; ++k)
    EXPECT_LT(std::sqrt(covariance(k, k)), 0.5 * Unsure()(k)) << k;
}

TEST(Window, WithTheCalibrationFollowsWhatItWouldNotWithout) {
  Miscalibrated without(0.3), with(0.3);
  without.Fly(35, std::nullopt);
  with.Fly(35, Unsure());
  EXPECT_TRUE(without.simulated.window.calibration().IsIdentity());
  EXPECT_FALSE(without.simulated.window.calibrates());
  EXPECT_LT(ErrorsOf(with.simulated).rotation, 0.5 * ErrorsOf(without.simulated).rotation);
  EXPECT_LT(ErrorsOf(with.simulated).velocity, 0.5 * ErrorsOf(without.simulated).velocity);
}

TEST(Window, HoldsWhatOfTheCalibrationIsCertain) {
  Miscalibrated flight(0.3);
  CalibrationVector sigmas = CalibrationVector::Zero();
  sigmas(6) = 0.01;
  flight.Fly(15, sigmas);
  const Calibration& found = flight.simulated.window.calibration();
  EXPECT_LT(Minus(found, {}).head<6>().norm(), 1e-6);
  EXPECT_GT(found.time_offset_s, 1e-3);
}

// It is kept, and taken as it is, when all else that is known is dropped.
TEST(Window, KeepsTheCalibrationWithoutThePrior) {
  Miscalibrated flight(0.3);
  flight.Fly(20, Unsure());
  Window& window = flight.simulated.window;
  const Calibration before = window.calibration();
  window.DropPrior();
  EXPECT_FALSE(window.calibrates());
  Anchor(window.frames.front(), AnchorSigmas(), window);
  EXPECT_TRUE(window.Refine().usable);
  EXPECT_EQ(Minus(window.calibration(), before).norm(), 0);
  EXPECT_LT(ErrorsOf(flight.simulated).position, 0.1);
}

TEST(Window, PriorLeavesPositionAndYawAlone) {
  // Without an anchor nothing is known of position and yaw, and marginalisation must not make
  // anything up: the more so while states move away from where they were linearised.
  SimulatedWindow simulated = MakeWindow(0.5);
  Window& window = simulated.window;
  for (int k = 0; k < 30; ++k) {
    simulated.Push();
    window.Refine();
    simulated.Marginalize(3, 3);
    if (window.prior().blocks().empty()) continue;
    const MatrixXd gauge = GaugeOf(window);
    const MatrixXd along = window.prior().S() * gauge;
    // Against what a turn of one frame alone would cost.
    const double scale = window.prior().S().norm();
    for (const int direction : {2, 3, 4, 5})
      ASSERT_LT(along.col(direction).norm(), 1e-6 * scale) << k << ", " << direction;
    if (k < 10) continue;
    for (const int direction : {0, 1})
      ASSERT_GT(along.col(direction).norm(), 10) << "gravity tells roll and pitch, " << k;
  }
}

TEST(Window, IsTheSameForAnyNumberOfThreads) {
  std::vector<std::vector<StateVector>> runs;
  for (const int threads : {1, 2}) {
    SimulatedWindow simulated = MakeWindow(0.5, {.threads = threads});
    auto& states = runs.emplace_back();
    for (int k = 0; k < 12; ++k) {
      simulated.Push();
      if (k == 0) Anchor(simulated.window.frames[0], AnchorSigmas(), simulated.window);
      simulated.window.Refine();
      simulated.Marginalize(3, 2);
      states.push_back(Minus(simulated.window.frames.back().state, {}));
    }
  }
  EXPECT_EQ(runs[0], runs[1]);
}

TEST(Window, RefusesOptionsOutOfRange) {
  const auto refusal = [](const auto& change) {
    WindowOptions options;
    change(options);
    return ErrorMessage([&] { Window(TestRig(), options, 1); });
  };
  using testing::HasSubstr;
  EXPECT_THAT(refusal([](auto& o) { o.max_iterations = 0; }), HasSubstr("window.max_iterations"));
  EXPECT_THAT(refusal([](auto& o) { o.sigma_px = 0; }), HasSubstr("window.sigma_px"));
  EXPECT_THAT(refusal([](auto& o) { o.huber_sigmas = NAN; }), HasSubstr("window.huber_sigmas"));
  EXPECT_THAT(refusal([](auto& o) { o.outlier_px = -1; }), HasSubstr("window.outlier_px"));
  EXPECT_THAT(refusal([](auto& o) { o.tolerance = -1; }), HasSubstr("window.tolerance"));
  EXPECT_THAT(refusal([](auto& o) { o.gravity = 0; }), HasSubstr("window.gravity"));
  EXPECT_EQ(refusal([](auto&) {}), "no error");
}

}  // namespace
}  // namespace sgf::vio
