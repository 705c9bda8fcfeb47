#include <utility>

#include <Eigen/Cholesky>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/vio/preintegration.h>

namespace sgf::vio {

using Eigen::Matrix3d, Eigen::Quaterniond, Eigen::Vector3d;

namespace {

void CheckNoise(const ImuNoise& noise) {
  for (const auto& [name, value] :
       {std::pair("gyroscope_noise_density", noise.gyroscope_noise_density),
        std::pair("gyroscope_random_walk", noise.gyroscope_random_walk),
        std::pair("accelerometer_noise_density", noise.accelerometer_noise_density),
        std::pair("accelerometer_random_walk", noise.accelerometer_random_walk)})
    if (!(value > 0 && std::isfinite(value)))
      throw Error("preintegration", fmt::format("{} is {}; it has to be positive", name, value));
}

void CheckStretch(const ImuSample& begin, const ImuSample& end, std::int64_t to_ns) {
  if (begin.time_ns != to_ns)
    throw Error("preintegration",
                fmt::format("a stretch from {} ns cannot follow {} ns", begin.time_ns, to_ns));
  if (end.time_ns <= begin.time_ns)
    throw Error("preintegration",
                fmt::format("a stretch from {} ns ends at {} ns", begin.time_ns, end.time_ns));
  if (!(begin.gyro + begin.accel + end.gyro + end.accel).allFinite())
    throw Error("preintegration", fmt::format("a sample at {} ns or {} ns is not finite",
                                              begin.time_ns, end.time_ns));
}

/// Samples at the beginning and the end of a stretch and what lies between them in its middle.
struct Stretch {
  double h;  // s
  ImuSample begin, middle, end;
};

// A parabola is no good where it would be drawn out from a much shorter stretch: that multiplies
// the noise.
Stretch MakeStretch(const std::optional<ImuSample>& before, const ImuSample& begin,
                    const ImuSample& end) {
  const double h = Seconds(begin.time_ns, end.time_ns);
  Stretch s{h, begin, begin, end};
  const double h_before = before ? Seconds(before->time_ns, begin.time_ns) : 0;
  for (const auto sensor : {&ImuSample::gyro, &ImuSample::accel}) {
    s.middle.*sensor = 0.5 * (begin.*sensor + end.*sensor);
    if (h_before < 0.5 * h) continue;
    const Vector3d bend =
        ((end.*sensor - begin.*sensor) / h - (begin.*sensor - (*before).*sensor) / h_before) /
        (h + h_before);  // half the second derivative
    s.middle.*sensor -= 0.25 * h * h * bend;
  }
  return s;
}

/// Motion over a part of a stretch: rotation vector, and its derivative by the angular rate.
struct Turn {
  Turn(const Vector3d& vector, const Matrix3d& vector_by_rate)
      : R(ExpSO3(vector)),
        back(R.conjugate().toRotationMatrix()),
        by_rate(RightJacobianSO3(vector) * vector_by_rate) {}

  Quaterniond R;
  Matrix3d back;     // what a turn before becomes after this one, in right tangents
  Matrix3d by_rate;  // right tangent by a constant added to the rate
};

// Magnus' series for the parabola through three rates, by half and by the whole of the stretch.
Turn HalfTurn(double h, const Vector3d& w0, const Vector3d& w1, const Vector3d& w2) {
  return {h / 24 * (5 * w0 + 8 * w1 - w2) + h * h / 48 * w0.cross(w1),
          0.5 * h * Matrix3d::Identity() - h * h / 48 * HatSO3(w1 - w0)};
}

Turn WholeTurn(double h, const Vector3d& w0, const Vector3d& w1, const Vector3d& w2) {
  return {h / 6 * (w0 + 4 * w1 + w2) + h * h / 12 * w0.cross(w2),
          h * Matrix3d::Identity() - h * h / 12 * HatSO3(w2 - w0)};
}

/// Covariance of the six inputs' noise when each is taken to be constant over h seconds.
Eigen::Matrix<double, 6, 1> InputVariance(const ImuNoise& noise, const NoiseFactors& factors,
                                          double h) {
  const double gyro = factors.gyro * noise.gyroscope_noise_density;
  const double accel = factors.accel * noise.accelerometer_noise_density;
  Eigen::Matrix<double, 6, 1> variance;
  variance << Vector3d::Constant(gyro * gyro / h), Vector3d::Constant(accel * accel / h);
  return variance;
}

}  // namespace

BodyState Plus(const BodyState& state, const StateVector& delta) {
  BodyState moved = state;
  SE3& T = moved.T_world_body;
  T.R = (T.R * ExpSO3(delta.segment<3>(kRotation))).normalized();
  T.p += delta.segment<3>(kPosition);
  moved.velocity += delta.segment<3>(kVelocity);
  moved.gyro_bias += delta.segment<3>(kGyroBias);
  moved.accel_bias += delta.segment<3>(kAccelBias);
  return moved;
}

StateVector Minus(const BodyState& to, const BodyState& from) {
  StateVector delta;
  delta << LogSO3(from.T_world_body.R.conjugate() * to.T_world_body.R),
      to.T_world_body.p - from.T_world_body.p, to.velocity - from.velocity,
      to.gyro_bias - from.gyro_bias, to.accel_bias - from.accel_bias;
  return delta;
}

Preintegration::Preintegration(std::int64_t from_ns, const ImuBias& linearization,
                               const ImuNoise& noise)
    : from_ns_(from_ns), to_ns_(from_ns), linearization_(linearization), noise_(noise) {
  CheckNoise(noise);
  if (!(linearization.gyro + linearization.accel).allFinite())
    throw Error("preintegration", "a bias is not finite");
}

void Preintegration::Integrate(const ImuSample& begin, const ImuSample& end,
                               const NoiseFactors& factors) {
  CheckStretch(begin, end, to_ns_);
  const Stretch s = MakeStretch(before_, begin, end);
  const double h = s.h;
  const auto rate = [&](const ImuSample& x) { return Vector3d(x.gyro - linearization_.gyro); };
  const auto force = [&](const ImuSample& x) { return Vector3d(x.accel - linearization_.accel); };
  const Vector3d w0 = rate(s.begin), w1 = rate(s.middle), w2 = rate(s.end);
  const Turn half = HalfTurn(h, w0, w1, w2), whole = WholeTurn(h, w0, w1, w2);
  const Vector3d f0 = force(s.begin), f1 = force(s.middle), f2 = force(s.end);
  const Quaterniond next_R = (delta_R_ * whole.R).normalized();
  const Matrix3d R0 = delta_R_.toRotationMatrix(), R1 = R0 * half.R.toRotationMatrix(),
                 R2 = next_R.toRotationMatrix();

  // The residual r is truth minus measurement: r <- A r - B (noise + bias error), per step.
  const Matrix3d a0 = -R0 * HatSO3(f0), a1 = -R1 * HatSO3(f1), a2 = -R2 * HatSO3(f2);
  StateMatrix F = StateMatrix::Identity();
  F.block<3, 3>(kRotation, kRotation) = whole.back;
  F.block<3, 3>(kPosition, kRotation) = h * h / 6 * (a0 + 2 * a1 * half.back);
  F.block<3, 3>(kPosition, kVelocity) = h * Matrix3d::Identity();
  F.block<3, 3>(kVelocity, kRotation) = h / 6 * (a0 + 4 * a1 * half.back + a2 * whole.back);
  F.block<3, 3>(kRotation, kGyroBias) = -whole.by_rate;
  F.block<3, 3>(kPosition, kGyroBias) = -h * h / 3 * a1 * half.by_rate;
  F.block<3, 3>(kVelocity, kGyroBias) = -h / 6 * (4 * a1 * half.by_rate + a2 * whole.by_rate);
  F.block<3, 3>(kPosition, kAccelBias) = -h * h / 6 * (R0 + 2 * R1);
  F.block<3, 3>(kVelocity, kAccelBias) = -h / 6 * (R0 + 4 * R1 + R2);
  Propagate(F, InputVariance(noise_, factors, h), h);

  delta_p_ += h * delta_v_ + h * h / 6 * (R0 * f0 + 2 * R1 * f1);
  delta_v_ += h / 6 * (R0 * f0 + 4 * R1 * f1 + R2 * f2);
  delta_R_ = next_R;
  angle_ += h / 6 * (s.begin.gyro + 4 * s.middle.gyro + s.end.gyro);
  before_ = begin;
  to_ns_ = end.time_ns;
}

void Preintegration::Propagate(const StateMatrix& F, const Eigen::Matrix<double, 6, 1>& variance,
                               double h) {
  const Eigen::Matrix<double, 9, 6> B = F.topRightCorner<9, 6>();
  transition_ = (F * transition_).eval();
  covariance_ = (F * covariance_ * F.transpose()).eval();
  covariance_.topLeftCorner<9, 9>() += B * variance.asDiagonal() * B.transpose();
  // White noise is not constant over the step: its double integral has variance h^3/3, not h^3/4.
  // Without this the covariance of a single step were singular.
  covariance_.diagonal().segment<3>(kPosition) += h * h * h * h / 12 * variance.tail<3>();
  const auto walk = [h](double density) { return Vector3d::Constant(density * density * h); };
  covariance_.diagonal().segment<3>(kGyroBias) += walk(noise_.gyroscope_random_walk);
  covariance_.diagonal().segment<3>(kAccelBias) += walk(noise_.accelerometer_random_walk);
  covariance9_ = covariance_.topLeftCorner<9, 9>();
}

Vector3d Preintegration::mean_gyro() const {
  return to_ns_ == from_ns_ ? Vector3d::Zero() : Vector3d(angle_ / dt_s());
}

Preintegration::Deltas Preintegration::Corrected(const BodyState& state) const {
  Eigen::Matrix<double, 6, 1> bias;
  bias << state.gyro_bias - linearization_.gyro, state.accel_bias - linearization_.accel;
  const Eigen::Matrix<double, 9, 1> change = BiasJacobian() * bias;
  const Vector3d turn = change.segment<3>(kRotation);
  return {delta_R_ * ExpSO3(turn), delta_p_ + change.segment<3>(kPosition),
          delta_v_ + change.segment<3>(kVelocity), turn};
}

BodyState Preintegration::Predict(const BodyState& from, double gravity) const {
  const Deltas delta = Corrected(from);
  const Vector3d g(0, 0, -gravity);
  const double dt = dt_s();
  const Quaterniond& R = from.T_world_body.R;
  BodyState to = from;
  to.time_ns = to_ns_;
  to.T_world_body.R = (R * delta.R).normalized();
  to.T_world_body.p += dt * from.velocity + 0.5 * dt * dt * g + R * delta.p;
  to.velocity += dt * g + R * delta.v;
  return to;
}

StateVector Preintegration::Residual(const BodyState& from, const BodyState& to, double gravity,
                                     StateMatrix* J_from, StateMatrix* J_to) const {
  const Deltas delta = Corrected(from);
  const Vector3d g(0, 0, -gravity);
  const double dt = dt_s();
  const Quaterniond R_from_world = from.T_world_body.R.conjugate();
  const Quaterniond R_from_to = R_from_world * to.T_world_body.R;
  const Vector3d moved = R_from_world * (to.T_world_body.p - from.T_world_body.p -
                                         dt * from.velocity - 0.5 * dt * dt * g);
  const Vector3d sped_up = R_from_world * (to.velocity - from.velocity - dt * g);
  const Vector3d turned = LogSO3(delta.R.conjugate() * R_from_to);
  StateVector r;
  r << turned, moved - delta.p, sped_up - delta.v, to.gyro_bias - from.gyro_bias,
      to.accel_bias - from.accel_bias;

  const Matrix3d inverse_Jr = InverseRightJacobianSO3(turned);
  const Matrix3d Rt = R_from_world.toRotationMatrix();
  if (J_from) {
    J_from->setZero();
    J_from->topRightCorner<9, 6>() = -BiasJacobian();
    J_from->block<3, 3>(kRotation, kGyroBias) =
        -inverse_Jr * ExpSO3(turned).conjugate().toRotationMatrix() * RightJacobianSO3(delta.turn) *
        BiasJacobian().topLeftCorner<3, 3>();
    J_from->block<3, 3>(kRotation, kRotation) =
        -inverse_Jr * R_from_to.conjugate().toRotationMatrix();
    J_from->block<3, 3>(kPosition, kRotation) = HatSO3(moved);
    J_from->block<3, 3>(kPosition, kPosition) = -Rt;
    J_from->block<3, 3>(kPosition, kVelocity) = -dt * Rt;
    J_from->block<3, 3>(kVelocity, kRotation) = HatSO3(sped_up);
    J_from->block<3, 3>(kVelocity, kVelocity) = -Rt;
    J_from->bottomRightCorner<6, 6>().diagonal().setConstant(-1);
  }
  if (J_to) {
    J_to->setIdentity();
    J_to->block<3, 3>(kRotation, kRotation) = inverse_Jr;
    J_to->block<3, 3>(kPosition, kPosition) = Rt;
    J_to->block<3, 3>(kVelocity, kVelocity) = Rt;
  }
  return r;
}

StateMatrix Preintegration::SquareRootInformation() const {
  if (to_ns_ == from_ns_) throw Error("preintegration", "is of no measurements");
  const Eigen::LLT<StateMatrix> factor(covariance_);
  return factor.matrixL().solve(StateMatrix::Identity());
}

}  // namespace sgf::vio
