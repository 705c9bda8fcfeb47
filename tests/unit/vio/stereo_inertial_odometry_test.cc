#include <algorithm>
#include <cmath>
#include <map>
#include <ostream>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/vio/stereo_inertial_odometry.h>

#include "unit/vio/flights.h"

namespace sgf::vio {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

const Camera kCamera{.width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 160, .cy = 120};
constexpr std::int64_t kPeriod = 50'000'000;  // ns
constexpr int kImuPerFrame = 10;

flow::StereoRig Rig() { return {kCamera, kCamera, {Eigen::Quaterniond::Identity(), {0.11, 0, 0}}}; }

SE3 BodyLeft() { return {ExpSO3({0.02, -0.03, 0.05}), {0.03, 0.01, -0.02}}; }

/// Before the corner of CornerWorld, whose z is the y of a world with z up.
synth::TrajectoryOptions Ride() {
  synth::TrajectoryOptions o;
  o.waypoints = {{0, 0, 0, 90, 0, 0},         {0.4, 0.2, 0.1, 85, 4, 3},
                 {0.5, 0.5, -0.2, 95, -3, 0}, {0.1, 0.3, -0.3, 97, 2, -4},
                 {-0.4, 0, 0.1, 88, 0, 2},    {-0.2, -0.3, 0.2, 84, -4, 0}};
  o.knot_interval_s = 1;
  o.periodic = true;
  return o;
}

/// CornerWorld's coordinates to the world's: z forwards to y, y down to -z.
SE3 CornerPose() {
  Eigen::Matrix3d R;
  R << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return {Eigen::Quaterniond(R), Vector3d::Zero()};
}

VioOptions Options() {
  VioOptions options;
  options.flow.cell_px = 30;
  options.flow.levels = 3;
  options.keyframes = 5;
  return options;
}

const Flight& TestFlight() {
  static const Flight flight(Ride(), 0, 6, [] {
    synth::ImuOptions options;
    options.initial_gyroscope_bias = {0.01, -0.02, 0.03};
    options.initial_accelerometer_bias = {0.05, -0.03, 0.04};
    return options;
  }());
  return flight;
}

/// Images of a frame; rendered once.
const std::pair<cv::Mat1b, cv::Mat1b>& ImagesAt(int k) {
  static std::map<int, std::pair<cv::Mat1b, cv::Mat1b>> cache;
  if (!cache.contains(k)) {
    const test::CornerWorld world(kCamera);
    const SE3 left =
        CornerPose().Inverse() * TestFlight().truth[k * kImuPerFrame].T_world_body * BodyLeft();
    cache[k] = {world.Render(left).grey, world.Render(left * Rig().T_left_right).grey};
  }
  return cache.at(k);
}

/// A stereo camera and an inertial sensor on TestFlight().
struct Ridden {
  explicit Ridden(const VioOptions& options = Options())
      : odometry(Rig(), BodyLeft(), ImuNoise(), options) {}

  StereoInertialOdometry odometry;
  std::vector<VioFrameResult> results = {};
  size_t next_sample = 0;

  std::int64_t TimeOf(int k) const { return TestFlight().truth[k * kImuPerFrame].time_ns; }

  /// Samples up to a frame; `change` may spoil one, or leave it out by returning false.
  template <class Change>
  void Feed(int k, const Change& change) {
    for (; next_sample <= static_cast<size_t>(k * kImuPerFrame); ++next_sample) {
      ImuSample sample = TestFlight().samples[next_sample];
      if (change(sample)) odometry.AddImu(sample);
    }
  }
  void Feed(int k) {
    Feed(k, [](ImuSample&) { return true; });
  }

  const VioFrameResult& Show(int k, const cv::Mat& left, const cv::Mat& right) {
    results.push_back(odometry.Process(TimeOf(k), left, right));
    const VioFrameResult& r = results.back();
    EXPECT_TRUE(Minus(r.body, {}).allFinite()) << k;
    EXPECT_TRUE(r.covariance.allFinite()) << k;
    EXPECT_GE(r.covariance.diagonal().minCoeff(), 0) << k;
    EXPECT_EQ(r.time_ns, TimeOf(k));
    return r;
  }
  const VioFrameResult& Look(int k) { return Show(k, ImagesAt(k).first, ImagesAt(k).second); }
  const VioFrameResult& Fly(int k) {
    Feed(k);
    return Look(k);
  }
  const VioFrameResult& FlyBlind(int k) {
    Feed(k);
    const cv::Mat1b black(kCamera.height, kCamera.width, uint8_t{0});
    return Show(k, black, black);
  }
};

/// Error of the motion from one result to another, m: a common motion of the world aside.
double MotionError(const Ridden& flight, size_t from, size_t to) {
  const auto pose = [&](size_t k, bool truth) {
    const VioFrameResult& r = flight.results[k];
    if (!truth) return r.body.T_world_body;
    const auto n = (r.time_ns - Flight::kStart_ns + 2'500'000) / 5'000'000;
    return TestFlight().truth[n].T_world_body;
  };
  const SE3 found = pose(from, false).Inverse() * pose(to, false);
  const SE3 truth = pose(from, true).Inverse() * pose(to, true);
  return (found.p - truth.p).norm();
}

/// When the inertial sensor has taken part for a while.
constexpr size_t kSettled = 20;

/// Which way is up, in body coordinates.
Vector3d UpOf(const VioFrameResult& r) {
  return r.body.T_world_body.R.conjugate() * r.R_gravity_world.conjugate() * Vector3d::UnitZ();
}

void ExpectTracked(const Ridden& flight, double tolerance_m) {
  for (size_t k = 0; k < flight.results.size(); ++k) {
    EXPECT_EQ(flight.results[k].state, VioState::kTracked) << k;
    EXPECT_LT(MotionError(flight, kSettled, k), k < kSettled ? 0.1 : tolerance_m) << k;
  }
}

class FlightWith : public testing::TestWithParam<const char*> {};

TEST_P(FlightWith, IsFollowed) {
  VioOptions options = Options();
  options.flow.residual = GetParam();
  Ridden flight(options);
  for (int k = 0; k < 60; ++k) flight.Fly(k);
  ExpectTracked(flight, 0.04);
  const VioFrameResult& last = flight.results.back();
  EXPECT_TRUE(last.inertial);
  const BodyState& truth = TestFlight().truth[59 * kImuPerFrame];
  EXPECT_LT((UpOf(last) - truth.T_world_body.R.conjugate() * Vector3d::UnitZ()).norm(), 0.02);
  EXPECT_LT((last.body.T_world_body.R.conjugate() * last.body.velocity -
             truth.T_world_body.R.conjugate() * truth.velocity)
                .norm(),
            0.05);
  EXPECT_LT((last.body.gyro_bias - truth.gyro_bias).norm(), 0.01);
  EXPECT_GT(last.landmarks, 20);
  EXPECT_GT(last.stereo_tracks, 20);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<StateMatrix>(last.covariance).eigenvalues()(0), 0);
  int keyframes = 0;
  for (const VioFrameResult& r : flight.results) keyframes += r.new_keyframe;
  EXPECT_GT(keyframes, 2);
  EXPECT_LT(keyframes, 30);
  // Landmarks lie on the walls, in the world of the first frame.
  const SE3 T_corner_world = CornerPose().Inverse() * TestFlight().truth[0].T_world_body *
                             flight.results[0].body.T_world_body.Inverse();
  const auto points = flight.odometry.ActivePoints();
  ASSERT_GT(points.size(), 30u);
  int on_wall = 0;
  for (const VioPoint& point : points) {
    const Vector3d p = T_corner_world * point.position;
    on_wall += std::abs(p.z() - 4 + 0.5 * std::abs(p.x())) < 0.15;
    EXPECT_GT(point.support, 0);
  }
  EXPECT_GT(on_wall, 0.8 * static_cast<double>(points.size()));
}

INSTANTIATE_TEST_SUITE_P(Dissimilarities, FlightWith, testing::Values("lssd", "ngv"));

TEST(StereoInertialOdometry, FollowsImagesAlone) {
  VioOptions options = Options();
  options.inertial = false;
  Ridden flight(options);
  for (int k = 0; k < 40; ++k) flight.Look(k);
  ExpectTracked(flight, 0.04);
  EXPECT_EQ(flight.results.back().covariance.bottomRightCorner(9, 9).norm(), 0);
  EXPECT_GT(flight.results.back().covariance(0, 0), 0);
}

TEST(StereoInertialOdometry, LooksAtTheSameImagesForLong) {
  VioOptions options = Options();
  options.inertial = false;
  Ridden flight(options);
  for (int k = 0; k < 300; ++k) {
    flight.results.clear();
    const std::int64_t time_ns = Flight::kStart_ns + k * kPeriod;
    const VioFrameResult r =
        flight.odometry.Process(time_ns, ImagesAt(0).first, ImagesAt(0).second);
    EXPECT_EQ(r.state, VioState::kTracked) << k;
    EXPECT_LT(r.body.T_world_body.p.norm(), 1e-3) << k;
    EXPECT_GE(r.covariance.diagonal().minCoeff(), 0) << k << ": not more is known than can be";
  }
}

TEST(StereoInertialOdometry, BeginsWithImagesAloneWhereTheSensorSaysNothing) {
  Ridden flight;
  for (int k = 0; k < 30; ++k) flight.Look(k);
  ExpectTracked(flight, 0.04);
  EXPECT_FALSE(flight.results.back().inertial);
  EXPECT_NE(flight.results.back().problem, InitialisationProblem::kNone);
}

TEST(StereoInertialOdometry, UsesTheSensorFromWhenItComes) {
  Ridden flight;
  flight.next_sample = 5 * kImuPerFrame + 3;
  for (int k = 0; k < 58; ++k) flight.Fly(k);
  ExpectTracked(flight, 0.06);
  const VioFrameResult& last = flight.results.back();
  EXPECT_TRUE(last.inertial);
  EXPECT_GT(last.covariance(kVelocity, kVelocity), 0);
  const BodyState& truth = TestFlight().truth[57 * kImuPerFrame];
  EXPECT_LT((UpOf(last) - truth.T_world_body.R.conjugate() * Vector3d::UnitZ()).norm(), 0.03);
}

TEST(StereoInertialOdometry, GoesOnWithImagesAloneWhereTheGyroscopeIsInDegrees) {
  Ridden flight;
  int lost = 0;
  for (int k = 0; k < 50; ++k) {
    flight.Feed(k, [](ImuSample& sample) {
      sample.gyro *= 57.3;
      return true;
    });
    lost += flight.Look(k).state == VioState::kLost;
  }
  EXPECT_LE(lost, 1);
  EXPECT_LT(MotionError(flight, 25, 49), 0.03);
  EXPECT_FALSE(flight.results.back().inertial);
  EXPECT_THAT(Explain(flight.results.back().problem), HasSubstr("the gyroscope"));
}

TEST(StereoInertialOdometry, GoesOnAfterAGapOfTheSensor) {
  Ridden flight;
  for (int k = 0; k < 58; ++k) {
    flight.Feed(k, [&](const ImuSample& sample) {
      return sample.time_ns < flight.TimeOf(35) || sample.time_ns > flight.TimeOf(43);
    });
    flight.Look(k);
  }
  ExpectTracked(flight, 0.06);
  EXPECT_EQ(flight.odometry.imu_health().gaps, 1);
  EXPECT_TRUE(flight.results[34].inertial);
  EXPECT_FALSE(flight.results[40].inertial);
  EXPECT_EQ(flight.results[40].problem, InitialisationProblem::kGapInData);
  EXPECT_GT(flight.results[34].covariance(kVelocity, kVelocity), 0);
  EXPECT_EQ(flight.results[40].covariance(kVelocity, kVelocity), 0);
  const VioFrameResult& last = flight.results.back();
  EXPECT_GT(last.covariance(kVelocity, kVelocity), 0) << "the sensor is used again";
  const BodyState& truth = TestFlight().truth[57 * kImuPerFrame];
  EXPECT_LT((last.body.T_world_body.R.conjugate() * last.body.velocity -
             truth.T_world_body.R.conjugate() * truth.velocity)
                .norm(),
            0.1);
}

/// What an inertial sensor may do that it should not.
struct WrongSensor {
  const char* name;
  void (*spoil)(ImuSample&);
};

void PrintTo(const WrongSensor& sensor, std::ostream* out) { *out << sensor.name; }

class FlightWithWrong : public testing::TestWithParam<WrongSensor> {
 protected:
  /// @param from first frame of which the samples are wrong.
  static Ridden Fly(int from) {
    Ridden flight;
    for (int k = 0; k < 70; ++k) {
      flight.Feed(k, [&](ImuSample& sample) {
        if (k >= from) GetParam().spoil(sample);
        return true;
      });
      flight.Look(k);
    }
    return flight;
  }

  static bool SaysThatSomethingIsWrong(const Ridden& flight) {
    return std::any_of(flight.results.begin(), flight.results.end(), [](const VioFrameResult& r) {
      return r.problem != InitialisationProblem::kNone &&
             r.problem != InitialisationProblem::kTooLittleData;
    });
  }
};

TEST_P(FlightWithWrong, SensorFromTheBeginningGoesOnWithImagesAlone) {
  const Ridden flight = Fly(0);
  EXPECT_TRUE(SaysThatSomethingIsWrong(flight));
  EXPECT_FALSE(flight.results.back().inertial);
  EXPECT_LE(flight.results.back().segment, 1) << "lost while the gyroscope led the flow, no more";
  for (size_t k = kSettled; k < flight.results.size(); ++k) {
    EXPECT_EQ(flight.results[k].state, VioState::kTracked) << k;
    EXPECT_LT(MotionError(flight, kSettled, k), 0.3) << k;  // until it is noticed
  }
  EXPECT_LT(MotionError(flight, kSettled, flight.results.size() - 1), 0.04);
}

TEST_P(FlightWithWrong, SensorFromSomeTimeOnGoesOnWithImagesAlone) {
  const Ridden flight = Fly(35);
  EXPECT_TRUE(flight.results[34].inertial);
  EXPECT_FALSE(flight.results.back().inertial);
  EXPECT_TRUE(SaysThatSomethingIsWrong(flight));
  for (size_t k = kSettled; k < flight.results.size(); ++k) {
    EXPECT_EQ(flight.results[k].state, VioState::kTracked) << k;
    EXPECT_LT(MotionError(flight, kSettled, k), 0.15) << k;
  }
  EXPECT_LT(MotionError(flight, kSettled, flight.results.size() - 1), 0.06);
}

INSTANTIATE_TEST_SUITE_P(
    Sensors, FlightWithWrong,
    testing::Values(WrongSensor{"AccelerationInG", [](ImuSample& s) { s.accel /= 9.81; }},
                    WrongSensor{"Upside", [](ImuSample& s) { s.accel = -s.accel; }},
                    WrongSensor{"LeftHanded",
                                [](ImuSample& s) { s.gyro.y() *= -1, s.accel.y() *= -1; }},
                    WrongSensor{"SwappedAxes",
                                [](ImuSample& s) {
                                  std::swap(s.gyro.x(), s.gyro.z()),
                                      std::swap(s.accel.x(), s.accel.z());
                                }},
                    WrongSensor{"AccelerometerTurned",
                                [](ImuSample& s) { s.accel.x() *= -1, s.accel.y() *= -1; }},
                    WrongSensor{"Zero", [](ImuSample& s) { s.gyro.setZero(), s.accel.setZero(); }}),
    [](const auto& sensor) { return sensor.param.name; });

TEST(StereoInertialOdometry, DoesNotBeginWithAGyroscopeInDegrees) {
  Ridden flight;
  for (int k = 0; k < 50; ++k) {
    flight.Feed(k, [](ImuSample& sample) { return sample.gyro *= 57.3, true; });
    flight.Look(k);
  }
  // It may lead the flow astray once.
  EXPECT_LE(flight.results.back().segment, 1);
  int lost = 0;
  for (const VioFrameResult& r : flight.results) lost += r.state == VioState::kLost;
  EXPECT_LE(lost, 1);
  EXPECT_FALSE(flight.results.back().inertial);
  EXPECT_NE(flight.results.back().problem, InitialisationProblem::kNone);
  EXPECT_LT(MotionError(flight, kSettled, 49), 0.04);
}

TEST(StereoInertialOdometry, LeavesOutASensorWithAnotherClock) {
  for (const std::int64_t late_ns : {-200'000'000, 200'000'000}) {
    Ridden flight;
    for (int k = 0; k < 70; ++k) {
      flight.Feed(k, [&](ImuSample& sample) { return sample.time_ns += late_ns, true; });
      flight.Look(k);
    }
    EXPECT_FALSE(flight.results.back().inertial) << late_ns;
    EXPECT_LT(MotionError(flight, kSettled, 69), 0.06) << late_ns;
  }
}

TEST(StereoInertialOdometry, FindsWhatTheCamerasClockIsOffBy) {
  constexpr double kLate_s = 0.008;
  const auto fly = [](double sd_s) {
    VioOptions options = Options();
    options.calibration.time_offset_sd_s = sd_s;
    Ridden flight(options);
    for (int k = 0; k < 100; ++k) {
      flight.Feed(k, [&](ImuSample& sample) {
        sample.time_ns += static_cast<std::int64_t>(1e9 * kLate_s);
        return true;
      });
      flight.Look(k);
    }
    return flight;
  };
  const Ridden held = fly(0), free = fly(0.01);
  EXPECT_TRUE(held.results.back().calibration.IsIdentity());
  EXPECT_EQ(held.results.back().calibration_covariance.norm(), 0);
  const VioFrameResult& last = free.results.back();
  EXPECT_TRUE(last.inertial);
  EXPECT_NEAR(last.calibration.time_offset_s, kLate_s, 1e-3);
  EXPECT_LT(Minus(last.calibration, {}).head<6>().norm(), 1e-6);
  EXPECT_GT(last.calibration_covariance(6, 6), 0);
  EXPECT_LT(std::sqrt(last.calibration_covariance(6, 6)), 4e-3);
  EXPECT_LT(MotionError(free, kSettled, 99), 0.04);
  double with = 0, without = 0;  // the sensor's errors since it has taken part for a while
  for (size_t k = 60; k < 100; ++k) {
    with += free.results[k].window.inertial_error;
    without += held.results[k].window.inertial_error;
  }
  EXPECT_LT(with, 0.8 * without);
}

TEST(StereoInertialOdometry, LeavesOutSamplesThatAreNone) {
  Ridden flight;
  int spoilt = 0;
  for (int k = 0; k < 30; ++k) {
    flight.Feed(k, [&](ImuSample& sample) {
      if (sample.time_ns / 5'000'000 % 7 == 0) {
        sample.gyro.y() = NAN;
        ++spoilt;
      } else if (sample.time_ns / 5'000'000 % 11 == 0) {
        sample.accel.x() = INFINITY;
        ++spoilt;
      }
      return true;
    });
    flight.Look(k);
  }
  ExpectTracked(flight, 0.04);
  EXPECT_GT(spoilt, 30);
  EXPECT_EQ(flight.odometry.imu_health().not_finite, spoilt);
}

TEST(StereoInertialOdometry, BearsEmptyRightImages) {
  Ridden flight;
  for (int k = 0; k < 45; ++k) {
    flight.Feed(k);
    flight.Show(k, ImagesAt(k).first, k >= 15 && k < 25 ? cv::Mat() : cv::Mat(ImagesAt(k).second));
    EXPECT_EQ(flight.results.back().stereo_tracks == 0, k >= 15 && k < 25);
  }
  ExpectTracked(flight, 0.04);
  // From the beginning on there is no scale: it says so, and makes none up.
  Ridden mono;
  for (int k = 0; k < 40; ++k) {
    mono.Feed(k);
    mono.Show(k, ImagesAt(k).first, {});
    EXPECT_EQ(mono.results.back().state, VioState::kInitialising);
  }
}

TEST(StereoInertialOdometry, PredictsWhereNothingIsSeenAndTracksAgain) {
  Ridden flight;
  for (int k = 0; k < 56; ++k) {
    const bool black = k >= 25 && k < 35;
    const VioFrameResult& r = black ? flight.FlyBlind(k) : flight.Fly(k);
    if (k < 35 || k >= 38) {
      EXPECT_EQ(r.state, black ? VioState::kPredicted : VioState::kTracked) << k;
    }
    if (k >= static_cast<int>(kSettled)) {
      EXPECT_LT(MotionError(flight, kSettled, k), 0.06) << k;
    }
    EXPECT_EQ(r.segment, 0);
  }
  const auto sigma = [&](int k) {
    return std::sqrt(flight.results[k].covariance.block<3, 3>(kPosition, kPosition).trace());
  };
  EXPECT_GT(sigma(34), 2 * sigma(24)) << "less is known";
}

TEST(StereoInertialOdometry, IsLostAfterBeingBlindForLongAndBeginsAnew) {
  VioOptions options = Options();
  options.blind_s = 0.4;
  Ridden flight(options);
  for (int k = 0; k < 25; ++k) flight.Fly(k);
  ASSERT_TRUE(flight.results.back().inertial);
  for (int k = 25; k < 40; ++k) {
    const VioFrameResult& r = flight.FlyBlind(k);
    const VioState expected = k < 33    ? VioState::kPredicted
                              : k == 33 ? VioState::kLost
                                        : VioState::kInitialising;
    EXPECT_EQ(r.state, expected) << k << ": a map without landmarks predicts nothing";
  }
  for (int k = 40; k < 70; ++k) flight.Fly(k);
  const VioFrameResult& last = flight.results.back();
  EXPECT_EQ(last.state, VioState::kTracked);
  EXPECT_EQ(last.segment, 1) << "one blindness, one new map";
  EXPECT_LT(MotionError(flight, 55, 69), 0.04);
  const BodyState& truth = TestFlight().truth[69 * kImuPerFrame];
  EXPECT_LT((last.body.T_world_body.R.conjugate() * last.body.velocity -
             truth.T_world_body.R.conjugate() * truth.velocity)
                .norm(),
            0.03);
  for (const VioPoint& point : flight.odometry.ActivePoints())
    EXPECT_EQ(point.segment, last.segment);
  for (const VioPoint& point : flight.odometry.TakeFinishedPoints())
    EXPECT_TRUE(point.position.allFinite());
  EXPECT_TRUE(flight.odometry.TakeFinishedPoints().empty());
}

TEST(StereoInertialOdometry, RestsWithoutVelocityAfterItWasLost) {
  // A body that is blind while it moves and at rest when it sees again.
  VioOptions options = Options();
  options.blind_s = 0.2;
  StereoInertialOdometry odometry(Rig(), BodyLeft(), ImuNoise(), options);
  const cv::Mat1b black(kCamera.height, kCamera.width, uint8_t{0});
  const auto& [left, right] = ImagesAt(20);
  const BodyState& at = TestFlight().truth[20 * kImuPerFrame];
  ASSERT_GT(at.velocity.norm(), 0.1);
  size_t next = 0;
  for (int k = 0; k < 50; ++k) {
    const std::int64_t time_ns = Flight::kStart_ns + k * kPeriod;
    for (; next <= static_cast<size_t>(k * kImuPerFrame); ++next) {
      ImuSample sample = TestFlight().samples[next];
      if (k > 20) {
        sample.gyro.setZero();
        sample.accel = at.T_world_body.R.conjugate() * Vector3d(0, 0, 9.81);
      }
      odometry.AddImu(sample);
    }
    VioFrameResult r;
    if (k <= 20)
      r = odometry.Process(time_ns, ImagesAt(k).first, ImagesAt(k).second);
    else
      r = k < 30 ? odometry.Process(time_ns, black, black) : odometry.Process(time_ns, left, right);
    if (k >= 32) {
      EXPECT_EQ(r.state, VioState::kTracked) << k;
      EXPECT_LT(r.body.velocity.norm(), 0.03) << k;
    }
  }
}

TEST(StereoInertialOdometry, RefusesBadInputAndGoesOn) {
  Ridden flight;
  for (int k = 0; k < 10; ++k) flight.Fly(k);
  const auto refusal = [&](std::int64_t time_ns, const cv::Mat& left, const cv::Mat& right) {
    return ErrorMessage([&] { flight.odometry.Process(time_ns, left, right); });
  };
  const auto& [left, right] = ImagesAt(10);
  for (const int k : {9, 5})
    EXPECT_THAT(refusal(flight.TimeOf(k), left, right), HasSubstr("after"));
  const std::int64_t next = flight.TimeOf(10);
  EXPECT_THAT(refusal(next, {}, right), HasSubstr("left"));
  EXPECT_THAT(refusal(next, cv::Mat1b(240, 321), right), HasSubstr("321x240"));
  EXPECT_THAT(refusal(next, left, cv::Mat1b(10, 10)), HasSubstr("right"));
  EXPECT_THAT(refusal(next, cv::Mat1f(240, 320), right), HasSubstr("8-bit"));
  for (int k = 10; k < 25; ++k) flight.Fly(k);
  ExpectTracked(flight, 0.03);
  // As if nothing had been refused.
  Ridden calm;
  for (int k = 0; k < 25; ++k) calm.Fly(k);
  EXPECT_EQ(Minus(calm.results.back().body, {}), Minus(flight.results.back().body, {}));
}

TEST(StereoInertialOdometry, IsTheSameForAnyNumberOfThreads) {
  std::vector<std::vector<StateVector>> runs;
  std::vector<StateMatrix> covariances;
  for (const int threads : {1, 2}) {
    VioOptions options = Options();
    options.threads = threads;
    Ridden flight(options);
    auto& states = runs.emplace_back();
    for (int k = 0; k < 30; ++k) states.push_back(Minus(flight.Fly(k).body, {}));
    covariances.push_back(flight.results.back().covariance);
  }
  EXPECT_EQ(runs[0], runs[1]);
  EXPECT_EQ(covariances[0], covariances[1]);
}

TEST(StereoInertialOdometry, KeepsAWindowOfBoundedSize) {
  VioOptions options = Options();
  options.keyframes = 2;
  Ridden flight(options);
  int finished = 0;
  for (int k = 0; k < 60; ++k) {
    flight.Fly(k);
    finished += static_cast<int>(flight.odometry.TakeFinishedPoints().size());
    EXPECT_LT(flight.odometry.ActivePoints().size(), 1000u);
  }
  EXPECT_GT(finished, 0);
}

TEST(StereoInertialOdometry, RefusesOptionsOutOfRange) {
  const auto refusal = [](const auto& change) {
    VioOptions options = Options();
    change(options);
    return ErrorMessage([&] { StereoInertialOdometry(Rig(), BodyLeft(), ImuNoise(), options); });
  };
  EXPECT_EQ(refusal([](auto&) {}), "no error");
  EXPECT_THAT(refusal([](auto& o) { o.states = 1; }), HasSubstr("states"));
  EXPECT_THAT(refusal([](auto& o) { o.states = 11; }), HasSubstr("states"));
  EXPECT_THAT(refusal([](auto& o) { o.keyframes = 1; }), HasSubstr("keyframes"));
  EXPECT_THAT(refusal([](auto& o) { o.keyframe_share = 0; }), HasSubstr("keyframe_share"));
  EXPECT_THAT(refusal([](auto& o) { o.keyframe_gap = 0; }), HasSubstr("keyframe_gap"));
  EXPECT_THAT(refusal([](auto& o) { o.least_parallax = NAN; }), HasSubstr("least_parallax"));
  EXPECT_THAT(refusal([](auto& o) { o.least_sights = 2; }), HasSubstr("least_sights"));
  EXPECT_THAT(refusal([](auto& o) { o.blind_s = -1; }), HasSubstr("blind_s"));
  EXPECT_THAT(refusal([](auto& o) { o.start_s = 0; }), HasSubstr("start_s"));
  EXPECT_THAT(refusal([](auto& o) { o.start.min_rest_s = 0; }),
              HasSubstr("start.min_rest_s: is 0"));
  EXPECT_THAT(refusal([](auto& o) { o.start.max_motion_error = INFINITY; }),
              HasSubstr("start.max_motion_error"));
  EXPECT_THAT(refusal([](auto& o) { o.start.min_poses = 3; }), HasSubstr("start.min_poses"));
  EXPECT_THAT(refusal([](auto& o) { o.max_inertial_error = 0; }), HasSubstr("max_inertial_error"));
  EXPECT_THAT(refusal([](auto& o) { o.calibration.time_offset_sd_s = 0.06; }),
              HasSubstr("calibration.time_offset_sd_s"));
  EXPECT_THAT(refusal([](auto& o) { o.calibration.rotation_sd_rad = -0.01; }),
              HasSubstr("calibration.rotation_sd_rad"));
  EXPECT_THAT(refusal([](auto& o) { o.calibration.position_sd_m = NAN; }),
              HasSubstr("calibration.position_sd_m"));
  EXPECT_THAT(refusal([](auto& o) { o.threads = -1; }), HasSubstr("threads"));
  EXPECT_THAT(refusal([](auto& o) { o.window.sigma_px = 0; }), HasSubstr("window.sigma_px"));
  EXPECT_THAT(refusal([](auto& o) { o.flow.levels = 0; }), HasSubstr("flow.levels"));
  EXPECT_THAT(refusal([](auto& o) { o.flow.residual = "nothing"; }), HasSubstr("nothing"));
  EXPECT_THAT(refusal([](auto& o) { o.imu.max_gap_s = 0; }), HasSubstr("max_gap_s"));
}

TEST(VioOptions, AreCheckedByName) {
  VioOptions options;
  options.blind_s = -2;
  EXPECT_THAT(ErrorMessage([&] { CheckOptions(options); }),
              testing::AllOf(HasSubstr("blind_s"), HasSubstr("-2")));
}

}  // namespace
}  // namespace sgf::vio
