#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>
#include <support/imu_integration.h>

#include <sgf/core/random.h>
#include <sgf/vio/preintegration.h>

#include "unit/vio/flights.h"

namespace sgf::vio {
namespace {

using ::testing::HasSubstr;

constexpr double kGravity = 9.81;

StateVector RandomTangent(std::uint64_t seed, double scale) {
  StateVector d;
  for (int k = 0; k < kStateSize; ++k) d(k) = scale * Gaussian(seed, k);
  return d;
}

BodyState RandomState(std::uint64_t seed) { return Plus(BodyState(), RandomTangent(seed, 0.5)); }

void ExpectClose(const BodyState& a, const BodyState& b, double tolerance) {
  EXPECT_LT(Minus(a, b).lpNorm<Eigen::Infinity>(), tolerance);
}

TEST(Tangent, PlusAndMinusAreInverse) {
  for (std::uint64_t i = 0; i < 20; ++i) {
    const BodyState a = RandomState(2 * i), b = RandomState(2 * i + 1);
    const StateVector d = RandomTangent(i, 0.3);
    EXPECT_LT((Minus(Plus(a, d), a) - d).norm(), 1e-14);
    ExpectClose(Plus(a, Minus(b, a)), b, 1e-14);
  }
}

TEST(Tangent, TurnsAboutTheBodysAxesAndMovesAlongTheWorlds) {
  BodyState state;
  state.T_world_body.R = ExpSO3({0, 0, 1});
  StateVector d = StateVector::Zero();
  d << 0.1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12;
  const BodyState moved = Plus(state, d);
  EXPECT_LT(LogSO3(moved.T_world_body.R.conjugate() * (state.T_world_body.R * ExpSO3({0.1, 0, 0})))
                .norm(),
            1e-15);
  EXPECT_EQ(moved.T_world_body.p, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(moved.velocity, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(moved.gyro_bias, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(moved.accel_bias, Eigen::Vector3d(10, 11, 12));
}

// Half a second at 200 Hz, beginning at an even sample so that IntegrateImu() can follow.
constexpr size_t kHalfSecond = 100;

TEST(Preintegration, OfHalfASecondOfAggressiveFlightIsThatOfNumericalIntegrationAndTheTruth) {
  const Flight flight(AggressiveRide(), 0, 3.5, NoiseFree());
  double position = 0, rotation = 0, velocity = 0, against_reference = 0;
  for (size_t from = 0; from + kHalfSecond < flight.samples.size(); from += 20) {
    const size_t to = from + kHalfSecond;
    const BodyState end =
        flight.Integrate(from, to, flight.BiasAt(from)).Predict(flight.truth[from], kGravity);
    const std::vector<ImuSample> part(flight.samples.begin() + from,
                                      flight.samples.begin() + to + 1);
    const BodyState reference = IntegrateImu(part, flight.truth[from], kGravity);
    EXPECT_EQ(end.time_ns, reference.time_ns);
    const StateVector error = Minus(end, flight.truth[to]);
    rotation = std::max(rotation, error.segment<3>(kRotation).norm());
    position = std::max(position, error.segment<3>(kPosition).norm());
    velocity = std::max(velocity, error.segment<3>(kVelocity).norm());
    against_reference =
        std::max(against_reference, Minus(end, reference).head<6>().lpNorm<Eigen::Infinity>());
  }
  RecordProperty("rotation_urad", std::to_string(rotation * 1e6));
  RecordProperty("position_um", std::to_string(position * 1e6));
  RecordProperty("velocity_um_s", std::to_string(velocity * 1e6));
  RecordProperty("against_reference_u", std::to_string(against_reference * 1e6));
  EXPECT_LT(rotation, 1e-4);
  EXPECT_LT(position, 1e-4);
  EXPECT_LT(velocity, 2e-4);
  EXPECT_LT(against_reference, 1e-4);
}

TEST(Preintegration, BiasJacobianIsTheDerivativeOfReintegration) {
  const Flight flight(AggressiveRide(), 0, 0.5, NoiseFree());
  const ImuBias bias = flight.BiasAt(0);
  const Preintegration sum = flight.Integrate(0, kHalfSecond, bias);
  constexpr double kStep = 1e-5;
  Eigen::Matrix<double, 9, 6> numeric;
  for (int k = 0; k < 6; ++k) {
    const auto at = [&](double step) {
      ImuBias moved = bias;
      (k < 3 ? moved.gyro : moved.accel)(k % 3) += step;
      return flight.Integrate(0, kHalfSecond, moved);
    };
    const Preintegration low = at(-kStep), high = at(kStep);
    numeric.col(k) << LogSO3(low.delta_R().conjugate() * high.delta_R()),
        high.delta_p() - low.delta_p(), high.delta_v() - low.delta_v();
  }
  numeric /= 2 * kStep;
  for (int row = 0; row < 9; row += 3)
    for (int col = 0; col < 6; col += 3) {
      const Eigen::Matrix3d expected = numeric.block<3, 3>(row, col);
      EXPECT_LT((sum.BiasJacobian().block<3, 3>(row, col) - expected).norm(),
                1e-7 * std::max(expected.norm(), 0.1))
          << row << ", " << col;
    }
}

TEST(Preintegration, SmallChangesOfBiasNeedNoReintegration) {
  const Flight flight(AggressiveRide(), 0, 0.5, NoiseFree());
  const ImuBias bias = flight.BiasAt(0);
  const ImuBias off = {bias.gyro + Eigen::Vector3d(2e-3, -1e-3, 1e-3),
                       bias.accel + Eigen::Vector3d(0.02, 0.01, -0.03)};
  const BodyState exact = flight.Integrate(0, kHalfSecond, bias).Predict(flight.truth[0], kGravity);
  const BodyState corrected =
      flight.Integrate(0, kHalfSecond, off).Predict(flight.truth[0], kGravity);
  EXPECT_LT(Minus(exact, corrected).head<9>().lpNorm<Eigen::Infinity>(), 3e-5);
}

// Residuals of states some way off, with biases off the linearisation's.
TEST(Preintegration, ResidualsJacobiansAreCentralDifferences) {
  const Flight flight(AggressiveRide(), 0, 0.5, NoiseFree());
  const Preintegration sum = flight.Integrate(0, kHalfSecond, flight.BiasAt(0));
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const BodyState from = Plus(flight.truth[0], RandomTangent(2 * seed, 0.3));
    const BodyState to = Plus(flight.truth[kHalfSecond], RandomTangent(2 * seed + 1, 0.3));
    StateMatrix J_from, J_to, numeric_from, numeric_to;
    sum.Residual(from, to, kGravity, &J_from, &J_to);
    constexpr double kStep = 1e-5;
    for (int k = 0; k < kStateSize; ++k) {
      const StateVector d = kStep * StateVector::Unit(k);
      numeric_from.col(k) =
          sum.Residual(Plus(from, d), to, kGravity) - sum.Residual(Plus(from, -d), to, kGravity);
      numeric_to.col(k) =
          sum.Residual(from, Plus(to, d), kGravity) - sum.Residual(from, Plus(to, -d), kGravity);
    }
    numeric_from /= 2 * kStep;
    numeric_to /= 2 * kStep;
    for (int row = 0; row < kStateSize; row += 3)
      for (int col = 0; col < kStateSize; col += 3)
        for (const auto& [J, numeric] :
             {std::pair(&J_from, &numeric_from), std::pair(&J_to, &numeric_to)}) {
          const Eigen::Matrix3d expected = numeric->block<3, 3>(row, col);
          EXPECT_LT((J->block<3, 3>(row, col) - expected).norm(),
                    1e-6 * std::max(expected.norm(), 1e-2))
              << row << ", " << col;
        }
  }
}

TEST(Preintegration, ResidualOfThePredictionIsZero) {
  const Flight flight(AggressiveRide(), 0, 0.5, NoiseFree());
  const Preintegration sum = flight.Integrate(0, kHalfSecond, {});
  const BodyState from = Plus(flight.truth[0], RandomTangent(3, 0.2));
  EXPECT_LT(sum.Residual(from, sum.Predict(from, kGravity), kGravity).norm(), 1e-13);
}

TEST(Preintegration, TwoStretchesAreOne) {
  const Flight flight(AggressiveRide(), 0, 0.5, NoiseFree());
  const ImuBias bias = flight.BiasAt(0);
  const Preintegration first = flight.Integrate(0, 40, bias),
                       second = flight.Integrate(40, 100, bias),
                       both = flight.Integrate(0, 100, bias);
  const BodyState& from = flight.truth[0];
  const BodyState middle = first.Predict(from, kGravity), to = second.Predict(middle, kGravity);
  // The second has no sample before its first one to draw a parabola through.
  ExpectClose(to, both.Predict(from, kGravity), 5e-5);

  // The error of the end is what the second makes of the first one's, and its own: to first order,
  // r_both = A r_first + r_second with A from the second residual's derivatives.
  StateMatrix J_first_to, J_from, J_to, J_both_to;
  first.Residual(from, middle, kGravity, nullptr, &J_first_to);
  second.Residual(middle, to, kGravity, &J_from, &J_to);
  both.Residual(from, to, kGravity, nullptr, &J_both_to);
  const auto covariance = [](const Preintegration& p) {
    const StateMatrix W = p.SquareRootInformation();
    return StateMatrix((W.transpose() * W).inverse());
  };
  const StateMatrix to_end = J_both_to * J_to.inverse();
  const StateMatrix A = -to_end * J_from * J_first_to.inverse();
  const StateMatrix sum =
      A * covariance(first) * A.transpose() + to_end * covariance(second) * to_end.transpose();
  const StateVector unit = covariance(both).diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT(
      (unit.asDiagonal() * (sum - covariance(both)) * unit.asDiagonal()).lpNorm<Eigen::Infinity>(),
      1e-3);
}

// Residuals of the true states over noisy measurements, biases walking, whitened: their covariance
// is the identity. Of 500 runs, a variance has standard deviation sqrt(2 / 500) = 0.063 and a
// covariance 0.045; the bounds are 4 and 5 of them.
TEST(Preintegration, CovarianceIsThatOfMonteCarlo) {
  constexpr int kRuns = 500;
  synth::ImuOptions options = NoiseFree();
  options.noisy = true;
  StateMatrix sum = StateMatrix::Zero();
  Preintegration::Covariance9 sum9 = Preintegration::Covariance9::Zero(), predicted;
  for (int run = 0; run < kRuns; ++run) {
    options.seed = run;
    const Flight flight(AggressiveRide(), 1, 1.5, options);
    const Preintegration p = flight.Integrate(0, kHalfSecond, flight.BiasAt(0));
    const StateVector r = p.Residual(flight.truth[0], flight.truth[kHalfSecond], kGravity);
    const StateVector white = p.SquareRootInformation() * r;
    sum += white * white.transpose() / kRuns;
    sum9 += r.head<9>() * r.head<9>().transpose() / kRuns;
    predicted = p.covariance();
  }
  const StateMatrix off = sum - StateMatrix::Identity();
  RecordProperty("largest_variance_error", std::to_string(off.diagonal().cwiseAbs().maxCoeff()));
  EXPECT_LT(off.diagonal().cwiseAbs().maxCoeff(), 4 * 0.063);
  EXPECT_LT((off - StateMatrix(off.diagonal().asDiagonal())).cwiseAbs().maxCoeff(), 5 * 0.045);
  for (int k = 0; k < 9; ++k) EXPECT_NEAR(sum9(k, k) / predicted(k, k), 1, 4 * 0.063) << k;
}

// White noise of density s over h seconds moves a body by s sqrt(h^3 / 12) more or less than half
// the change of its velocity says.
TEST(Preintegration, InformationOfASingleStepIsThatOfContinuousNoise) {
  const Flight flight(SmoothRide(), 0, 0.01, NoiseFree());
  const StateMatrix W = flight.Integrate(0, 1, {}).SquareRootInformation();
  const double sd = ImuNoise().accelerometer_noise_density * std::sqrt(1.25e-7 / 12);
  EXPECT_NEAR(W.col(kPosition).norm() * sd, 1, 1e-3);
}

TEST(Preintegration, RaisesTheNoiseOfAStretchAsTold) {
  const Flight flight(SmoothRide(), 0, 0.01, NoiseFree());
  const auto variance = [&](const NoiseFactors& factors) {
    Preintegration sum(flight.samples[0].time_ns, {}, {});
    sum.Integrate(flight.samples[0], flight.samples[1], factors);
    return Eigen::Matrix<double, 9, 1>(sum.covariance().diagonal());
  };
  EXPECT_NEAR(variance({10, 1})(kRotation) / variance({})(kRotation), 100, 1e-6);
  EXPECT_NEAR(variance({1, 10})(kVelocity) / variance({})(kVelocity), 100, 0.1);
  EXPECT_NEAR(variance({1, 10})(kRotation) / variance({})(kRotation), 1, 1e-9);
}

TEST(Preintegration, NamesWhatIsWrong) {
  const auto error = [](const ImuSample& begin, const ImuSample& end) {
    return ErrorMessage([&] { Preintegration(100, {}, {}).Integrate(begin, end); });
  };
  EXPECT_EQ(error({100}, {200}), "no error");
  EXPECT_THAT(error({101}, {200}), HasSubstr("from 101 ns cannot follow 100 ns"));
  EXPECT_THAT(error({100}, {100}), HasSubstr("from 100 ns ends at 100 ns"));
  ImuSample bad{200};
  bad.accel.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error({100}, bad), HasSubstr("not finite"));
  ImuNoise noise;
  noise.gyroscope_random_walk = 0;
  EXPECT_THAT(ErrorMessage([&] { Preintegration(0, {}, noise); }),
              HasSubstr("gyroscope_random_walk is 0"));
  EXPECT_THAT(ErrorMessage([&] { Preintegration(0, {}, {}).SquareRootInformation(); }),
              HasSubstr("no measurements"));
}

}  // namespace
}  // namespace sgf::vio
