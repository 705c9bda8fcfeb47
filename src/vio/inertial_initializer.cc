#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/vio/inertial_initializer.h>

namespace sgf::vio {

using Eigen::Matrix3d, Eigen::MatrixXd, Eigen::Quaterniond, Eigen::Vector3d, Eigen::VectorXd;
using Problem = InitialisationProblem;

namespace {

void Check(std::span<const TimedPose> poses, std::span<const Preintegration> motions) {
  if (motions.size() + 1 != poses.size())
    throw Error("initializer",
                fmt::format("{} poses have {} motions between them", poses.size(), motions.size()));
  for (size_t k = 0; k < motions.size(); ++k)
    if (motions[k].from_ns() != poses[k].time_ns || motions[k].to_ns() != poses[k + 1].time_ns ||
        motions[k].dt_s() <= 0)
      throw Error("initializer", fmt::format("motion {} is not from pose {} to the next", k, k));
}

/// @param force RMS of the accelerometer's measurements, in the unit that they have.
Problem JudgeGravity(double magnitude, double force, const InertialInitializerOptions& options) {
  constexpr double kTolerance = 0.1;  // of gravity
  if (std::abs(magnitude - options.gravity) <= kTolerance * options.gravity) return Problem::kNone;
  // 1 at rest; what the body accelerates by adds to it.
  return force > 0.5 && force < 2.5 ? Problem::kAccelerationInG : Problem::kGravityMagnitude;
}

/// Smallest rotation from a frame to one whose z axis is up.
Quaterniond TurnUp(const Vector3d& up) { return RotationBetween(up, Vector3d::UnitZ()); }

/// Mean and standard deviation, axis by axis.
struct Statistics {
  Vector3d mean = Vector3d::Zero(), sd = Vector3d::Zero();
};

Statistics StatisticsOf(std::span<const ImuSample> samples, Vector3d ImuSample::*sensor) {
  Statistics s;
  const double n = static_cast<double>(samples.size());
  for (const ImuSample& x : samples) s.mean += x.*sensor / n;
  for (const ImuSample& x : samples) s.sd += (x.*sensor - s.mean).cwiseAbs2() / n;
  s.sd = s.sd.cwiseSqrt();
  return s;
}

/// How much the body turns, as vision and gyroscope have it.
struct Turning {
  double visual_rate = 0;   // RMS, rad/s
  double gyro_rate = 0;     // as measured
  double visual_angle = 0;  // RMS of what a constant rate does not explain of the rotations, rad
  double mean_dt_s = 0;
};

Vector3d VisualTurn(const TimedPose& from, const TimedPose& to) {
  return LogSO3(from.pose.R.conjugate() * to.pose.R);
}

Turning TurningOf(std::span<const TimedPose> poses, std::span<const Preintegration> motions) {
  const double n = static_cast<double>(motions.size());
  Vector3d mean_rate = Vector3d::Zero();
  for (size_t k = 0; k < motions.size(); ++k)
    mean_rate += VisualTurn(poses[k], poses[k + 1]) / motions[k].dt_s() / n;
  Turning turning;
  for (size_t k = 0; k < motions.size(); ++k) {
    const double dt = motions[k].dt_s();
    const Vector3d turn = VisualTurn(poses[k], poses[k + 1]);
    turning.visual_angle += (turn - dt * mean_rate).squaredNorm() / n;
    turning.visual_rate += (turn / dt).squaredNorm() / n;
    turning.gyro_rate += motions[k].mean_gyro().squaredNorm() / n;
    turning.mean_dt_s += dt / n;
  }
  turning.visual_angle = std::sqrt(turning.visual_angle);
  turning.visual_rate = std::sqrt(turning.visual_rate);
  turning.gyro_rate = std::sqrt(turning.gyro_rate);
  return turning;
}

struct GyroFit {
  Vector3d bias = Vector3d::Zero();
  Vector3d sd = Vector3d::Zero();
  double error_rad = 0;  // RMS of the rotation that is left of a motion
};

BodyState AtPose(const TimedPose& pose, const Vector3d& gyro_bias) {
  BodyState state;
  state.T_world_body = pose.pose;
  state.gyro_bias = gyro_bias;
  return state;
}

// Covariance of the motions' rotation residuals. The error of a visual rotation is in the residual
// before it and, turned and with the other sign, in the one after it; that the two take each other
// back makes the bias about twice as well known as independent residuals would.
MatrixXd RotationCovariance(std::span<const TimedPose> poses,
                            std::span<const Preintegration> motions, double visual_sd_rad) {
  const double visual = visual_sd_rad * visual_sd_rad;
  const Eigen::Index n = static_cast<Eigen::Index>(motions.size());
  MatrixXd C = MatrixXd::Zero(3 * n, 3 * n);
  for (Eigen::Index k = 0; k < n; ++k) {
    C.block<3, 3>(3 * k, 3 * k) =
        motions[k].covariance().topLeftCorner<3, 3>() + 2 * visual * Matrix3d::Identity();
    if (k == 0) continue;
    const Matrix3d R = (poses[k].pose.R.conjugate() * poses[k + 1].pose.R).toRotationMatrix();
    C.block<3, 3>(3 * k - 3, 3 * k) = -visual * R;
    C.block<3, 3>(3 * k, 3 * k - 3) = -visual * R.transpose();
  }
  return C;
}

// Gauss-Newton on the rotations alone.
GyroFit FitGyroscope(std::span<const TimedPose> poses, std::span<const Preintegration> motions,
                     const InertialInitializerOptions& options) {
  const Eigen::LLT<MatrixXd> noise(
      RotationCovariance(poses, motions, options.visual_rotation_sd_rad));
  const Eigen::Index n = static_cast<Eigen::Index>(motions.size());
  GyroFit fit;
  fit.bias = motions[0].linearization().gyro;
  constexpr int kIterations = 5;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    MatrixXd J(3 * n, 3);
    VectorXd r(3 * n);
    for (Eigen::Index k = 0; k < n; ++k) {
      StateMatrix J_from;
      const StateVector residual = motions[k].Residual(
          AtPose(poses[k], fit.bias), AtPose(poses[k + 1], fit.bias), options.gravity, &J_from);
      r.segment<3>(3 * k) = residual.segment<3>(kRotation);
      J.middleRows<3>(3 * k) = J_from.block<3, 3>(kRotation, kGyroBias);
    }
    const Matrix3d covariance = (J.transpose() * noise.solve(J)).inverse();
    fit.error_rad = std::sqrt(r.squaredNorm() / static_cast<double>(n));
    fit.sd = covariance.diagonal().cwiseSqrt();
    if (iteration < kIterations) fit.bias -= covariance * (J.transpose() * noise.solve(r));
  }
  return fit;
}

Problem JudgeGyroscope(const Turning& turning, const GyroFit& fit,
                       const InertialInitializerOptions& options) {
  // Only where the body turns more than vision errs is there anything to compare.
  const double noise = std::numbers::sqrt2 * options.visual_rotation_sd_rad;
  if (turning.visual_rate > 5 * noise / turning.mean_dt_s) {
    constexpr double kDegPerRad = 180 / std::numbers::pi;
    const double ratio = turning.gyro_rate / turning.visual_rate / kDegPerRad;
    if (ratio > 0.5 && ratio < 3) return Problem::kGyroscopeInDegrees;
  }
  constexpr double kUnexplained = 0.3;  // of the turning
  if (fit.error_rad > std::max(4 * noise, kUnexplained * turning.visual_angle))
    return Problem::kSensorAxes;
  return fit.bias.norm() > options.max_gyro_bias ? Problem::kGyroscopeBias : Problem::kNone;
}

/// Gravity as a known part and one along the columns of a basis.
struct GravityModel {
  Vector3d known = Vector3d::Zero();
  MatrixXd basis = Matrix3d::Identity();
};

GravityModel WithMagnitude(const Vector3d& gravity, double magnitude) {
  const Vector3d down = gravity.normalized(), across = down.unitOrthogonal();
  MatrixXd basis(3, 2);
  basis << across, down.cross(across);
  return {magnitude * down, basis};
}

/// Velocities (visual frame), gravity (visual frame) and the accelerometer's bias.
struct MotionFit {
  std::vector<Vector3d> velocities;
  Vector3d gravity, accel_bias, accel_bias_sd;
  MatrixXd gravity_covariance;  // along the basis of the model
  double error = 0;             // RMS of the residuals in their sigmas
};

/// Normal equations of velocities, gravity and accelerometer's bias, in this order.
class MotionEquations {
 public:
  MotionEquations(size_t poses, const GravityModel& model)
      : model_(model),
        gravity_at_(3 * static_cast<Eigen::Index>(poses)),
        bias_at_(gravity_at_ + model.basis.cols()),
        H_(MatrixXd::Zero(bias_at_ + 3, bias_at_ + 3)),
        b_(VectorXd::Zero(bias_at_ + 3)) {}

  /// Adds the motion from pose k to the next: what it does to position and to velocity.
  void Add(size_t k, const TimedPose& from, const TimedPose& to, const Preintegration& motion,
           const Vector3d& gyro_bias, const InertialInitializerOptions& options) {
    const double dt = motion.dt_s();
    BodyState origin;  // without gravity, what Predict() adds to it are the corrected deltas
    origin.gyro_bias = gyro_bias;
    origin.accel_bias = motion.linearization().accel;
    const BodyState moved = motion.Predict(origin, 0);
    const Matrix3d Rt = from.pose.R.conjugate().toRotationMatrix();
    const auto bias_jacobian = motion.BiasJacobian();
    const Eigen::Index at = 3 * static_cast<Eigen::Index>(k);
    // A visual rotation that is off turns what is measured.
    const auto sigma = [&](int row, double delta, double visual_sd) {
      const double turned = options.visual_rotation_sd_rad * delta;
      const double inertial = motion.covariance().diagonal().segment<3>(row).mean();
      return std::sqrt(inertial + turned * turned + 2 * visual_sd * visual_sd);
    };

    MatrixXd A = MatrixXd::Zero(3, b_.size());
    A.middleCols<3>(at) = dt * Rt;
    A.middleCols(gravity_at_, model_.basis.cols()) = 0.5 * dt * dt * Rt * model_.basis;
    A.rightCols<3>() = bias_jacobian.block<3, 3>(kPosition, 3);
    const Vector3d& delta_p = moved.T_world_body.p;
    AddRows(A,
            Rt * (to.pose.p - from.pose.p - 0.5 * dt * dt * model_.known) - delta_p +
                A.rightCols<3>() * origin.accel_bias,
            sigma(kPosition, delta_p.norm(), options.visual_position_sd_m));

    A.middleCols<3>(at) = -Rt;
    A.middleCols<3>(at + 3) = Rt;
    A.middleCols(gravity_at_, model_.basis.cols()) = -dt * Rt * model_.basis;
    A.rightCols<3>() = -bias_jacobian.block<3, 3>(kVelocity, 3);
    AddRows(A, dt * Rt * model_.known + moved.velocity + A.rightCols<3>() * origin.accel_bias,
            sigma(kVelocity, moved.velocity.norm(), 0));
  }

  MotionFit Solve(double accel_bias_sd) {
    H_.bottomRightCorner<3, 3>().diagonal().array() += 1 / (accel_bias_sd * accel_bias_sd);
    const Eigen::LDLT<MatrixXd> solver(H_);
    const VectorXd x = solver.solve(b_);
    MatrixXd last = MatrixXd::Zero(b_.size(), b_.size() - gravity_at_);
    last.bottomRows(last.cols()).setIdentity();
    const MatrixXd covariance = solver.solve(last).bottomRows(last.cols());
    MotionFit fit;
    for (Eigen::Index i = 0; i < gravity_at_; i += 3) fit.velocities.push_back(x.segment<3>(i));
    const Eigen::Index m = model_.basis.cols();
    fit.gravity = model_.known + model_.basis * x.segment(gravity_at_, m);
    fit.accel_bias = x.tail<3>();
    fit.accel_bias_sd = covariance.diagonal().tail<3>().cwiseSqrt();
    fit.gravity_covariance = covariance.topLeftCorner(m, m);
    // At the minimum the weighted squares are c - b^T x. Velocities take up half of the rows.
    fit.error =
        std::sqrt(std::max(0.0, squares_ - b_.dot(x)) / (rows_ - static_cast<double>(gravity_at_)));
    return fit;
  }

 private:
  void AddRows(const MatrixXd& A, const Vector3d& right, double sigma) {
    const double weight = 1 / (sigma * sigma);
    H_ += weight * A.transpose() * A;
    b_ += weight * A.transpose() * right;
    squares_ += weight * right.squaredNorm();
    rows_ += 3;
  }

  GravityModel model_;
  Eigen::Index gravity_at_, bias_at_;
  MatrixXd H_;
  VectorXd b_;
  double squares_ = 0;
  int rows_ = 0;
};

MotionFit FitMotion(std::span<const TimedPose> poses, std::span<const Preintegration> motions,
                    const Vector3d& gyro_bias, const GravityModel& model,
                    const InertialInitializerOptions& options) {
  MotionEquations equations(poses.size(), model);
  for (size_t k = 0; k < motions.size(); ++k)
    equations.Add(k, poses[k], poses[k + 1], motions[k], gyro_bias, options);
  return equations.Solve(options.accel_bias_sd);
}

// RMS over the motions of the mean specific force.
double ForceOf(std::span<const Preintegration> motions) {
  double squares = 0;
  for (const Preintegration& motion : motions)
    squares += (motion.delta_v() / motion.dt_s()).squaredNorm();
  return std::sqrt(squares / static_cast<double>(motions.size()));
}

double LargestSd(const MatrixXd& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<MatrixXd>(covariance).eigenvalues().maxCoeff());
}

// Velocities, gravity and the accelerometer's bias, once the gyroscope's is known.
void SolveMotion(std::span<const TimedPose> poses, std::span<const Preintegration> motions,
                 const GyroFit& gyro, const InertialInitializerOptions& options,
                 InertialInitialisation& result) {
  MotionFit fit = FitMotion(poses, motions, gyro.bias, {}, options);
  result.gravity = fit.gravity.norm();
  constexpr double kMaxGravitySd = 0.05;  // of gravity; half of what JudgeGravity() tolerates
  if (LargestSd(fit.gravity_covariance) > kMaxGravitySd * options.gravity) {
    result.problem = Problem::kTooLittleData;
    return;
  }
  result.problem = JudgeGravity(result.gravity, ForceOf(motions), options);
  if (!result.ok()) return;
  constexpr int kIterations = 4;
  for (int i = 0; i < kIterations; ++i)
    fit =
        FitMotion(poses, motions, gyro.bias, WithMagnitude(fit.gravity, options.gravity), options);
  result.tilt_sd_rad = LargestSd(fit.gravity_covariance) / options.gravity;
  result.motion_error = fit.error;
  result.accel_bias_sd = fit.accel_bias_sd;
  if (fit.error > options.max_motion_error)
    result.problem = Problem::kMotionDisagrees;
  else if (result.tilt_sd_rad > options.max_tilt_sd_rad)
    result.problem = Problem::kTooLittleData;
  if (!result.ok()) return;

  result.T_world_visual.R = TurnUp(-fit.gravity);
  for (size_t k = 0; k < poses.size(); ++k)
    result.states.push_back({poses[k].time_ns, result.T_world_visual * poses[k].pose,
                             result.T_world_visual.R * fit.velocities[k], gyro.bias,
                             fit.accel_bias});
}

}  // namespace

void CheckOptions(const InertialInitializerOptions& options) {
  for (const auto& [name, value] :
       {std::pair("start.gravity", options.gravity),
        std::pair("start.min_rest_s", options.min_rest_s),
        std::pair("start.rest_gyro_sd", options.rest_gyro_sd),
        std::pair("start.rest_accel_sd", options.rest_accel_sd),
        std::pair("start.max_gyro_bias", options.max_gyro_bias),
        std::pair("start.visual_rotation_sd_rad", options.visual_rotation_sd_rad),
        std::pair("start.visual_position_sd_m", options.visual_position_sd_m),
        std::pair("start.accel_bias_sd", options.accel_bias_sd),
        std::pair("start.max_tilt_sd_rad", options.max_tilt_sd_rad),
        std::pair("start.max_motion_error", options.max_motion_error)})
    Require(value > 0 && std::isfinite(value), name, value, "finite and positive");
  Require(options.min_poses >= 4, "start.min_poses", options.min_poses, "at least 4");
}

std::span<const std::pair<const char*, Problem>> EnumNames(Problem) {
  static constexpr std::pair<const char*, Problem> kNames[] = {
      {"none", Problem::kNone},
      {"too_little_data", Problem::kTooLittleData},
      {"gap_in_data", Problem::kGapInData},
      {"moving", Problem::kMoving},
      {"gyroscope_in_degrees", Problem::kGyroscopeInDegrees},
      {"sensor_axes", Problem::kSensorAxes},
      {"gyroscope_bias", Problem::kGyroscopeBias},
      {"acceleration_in_g", Problem::kAccelerationInG},
      {"gravity_magnitude", Problem::kGravityMagnitude},
      {"motion_disagrees", Problem::kMotionDisagrees}};
  return kNames;
}

const char* Explain(Problem problem) {
  switch (problem) {
    case Problem::kNone:
      return "no problem";
    case Problem::kTooLittleData:
      return "too little data or motion yet";
    case Problem::kGapInData:
      return "inertial measurements are missing: a gap, or another clock?";
    case Problem::kMoving:
      return "the body is not at rest";
    case Problem::kGyroscopeInDegrees:
      return "rotations are about 57.3 times the visual ones: gyroscope in degrees?";
    case Problem::kSensorAxes:
      return "the gyroscope's rotations are not the visual ones: axes of the inertial sensor?";
    case Problem::kGyroscopeBias:
      return "the gyroscope's bias is too large to be believed: its unit or axes?";
    case Problem::kAccelerationInG:
      return "gravity is about 1: acceleration in g?";
    case Problem::kGravityMagnitude:
      return "gravity has the wrong magnitude: unit of the acceleration, or scale of the poses?";
    case Problem::kMotionDisagrees:
      return "measured motion is not the visual one: axes or clock of the inertial sensor, scale "
             "of the "
             "poses, or images of other times?";
  }
  return "?";
}

InertialInitialisation InitializeAtRest(std::span<const ImuSample> samples,
                                        const InertialInitializerOptions& options) {
  CheckOptions(options);
  InertialInitialisation result;
  if (samples.size() < 2 ||
      1e-9 * static_cast<double>(samples.back().time_ns - samples.front().time_ns) <
          options.min_rest_s)
    return result;
  const Statistics gyro = StatisticsOf(samples, &ImuSample::gyro);
  const Statistics accel = StatisticsOf(samples, &ImuSample::accel);
  result.gravity = accel.mean.norm();
  const double n = static_cast<double>(samples.size());
  result.gyro_bias_sd = gyro.sd / std::sqrt(n);
  result.accel_bias_sd.setConstant(options.accel_bias_sd);
  result.tilt_sd_rad = options.accel_bias_sd / options.gravity;
  // Not "sd > limit": what is not a number is not at rest either.
  if (!(gyro.sd.maxCoeff() <= options.rest_gyro_sd && accel.sd.maxCoeff() <= options.rest_accel_sd))
    result.problem = Problem::kMoving;
  else if (gyro.mean.norm() > options.max_gyro_bias)
    result.problem = Problem::kGyroscopeBias;
  else
    result.problem = JudgeGravity(result.gravity, result.gravity, options);
  if (!result.ok()) return result;

  BodyState state;
  state.time_ns = samples.back().time_ns;
  state.T_world_body.R = TurnUp(accel.mean);
  state.gyro_bias = gyro.mean;
  state.accel_bias = (1 - options.gravity / result.gravity) * accel.mean;
  result.states = {state};
  return result;
}

InertialInitialisation InitializeAtRest(const ImuBuffer& buffer, std::int64_t from_ns,
                                        std::int64_t to_ns,
                                        const InertialInitializerOptions& options) {
  std::vector<ImuSample> samples;
  for (const ImuSample& sample : buffer.samples())
    if (sample.time_ns >= from_ns && sample.time_ns <= to_ns) samples.push_back(sample);
  return InitializeAtRest(samples, options);
}

InertialInitialisation InitializeMoving(std::span<const TimedPose> poses,
                                        std::span<const Preintegration> motions,
                                        const InertialInitializerOptions& options) {
  CheckOptions(options);
  InertialInitialisation result;
  if (poses.size() < static_cast<size_t>(options.min_poses)) return result;
  Check(poses, motions);
  const GyroFit gyro = FitGyroscope(poses, motions, options);
  result.rotation_error_rad = gyro.error_rad;
  result.gyro_bias_sd = gyro.sd;
  result.problem = JudgeGyroscope(TurningOf(poses, motions), gyro, options);
  if (result.ok()) SolveMotion(poses, motions, gyro, options, result);
  return result;
}

InertialInitialisation InitializeMoving(std::span<const TimedPose> poses, const ImuBuffer& buffer,
                                        const InertialInitializerOptions& options) {
  InertialInitialisation result;
  ImuBias bias;
  constexpr int kIterations = 3;  // what is left after the third is of higher order by far
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    std::vector<Preintegration> motions;
    for (size_t k = 0; k + 1 < poses.size(); ++k) {
      const auto motion = buffer.Between(poses[k].time_ns, poses[k + 1].time_ns, bias);
      if (!motion) {
        result.problem = Problem::kGapInData;
        return result;
      }
      motions.push_back(*motion);
    }
    result = InitializeMoving(poses, motions, options);
    if (!result.ok()) return result;
    bias = {result.states[0].gyro_bias, result.states[0].accel_bias};
  }
  return result;
}

}  // namespace sgf::vio
