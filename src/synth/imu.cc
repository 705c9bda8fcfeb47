#include <cmath>
#include <utility>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/random.h>
#include <sgf/synth/imu.h>

namespace sgf::synth {

namespace {

void CheckInterval(double from_s, double to_s) {
  constexpr double kMaxTime_s = 1e6;
  if (!(from_s >= -kMaxTime_s && to_s >= from_s && to_s <= kMaxTime_s))
    throw Error("imu", fmt::format("the interval from {} s to {} s is empty or beyond {} s", from_s,
                                   to_s, kMaxTime_s));
}

/// What one of the two sensors adds to the truth, sample by sample.
class SensorErrors {
 public:
  SensorErrors(const std::array<double, 3>& initial_bias, double density, double random_walk,
               const ImuOptions& options, std::uint64_t stream)
      : bias_(initial_bias.data()),
        white_sigma_(options.noisy ? density * std::sqrt(options.rate_hz) : 0),
        step_sigma_(options.noisy ? random_walk / std::sqrt(options.rate_hz) : 0),
        white_seed_(Hash64(options.seed, 2 * stream)),
        step_seed_(Hash64(options.seed, 2 * stream + 1)) {}

  const Eigen::Vector3d& bias() const { return bias_; }

  Eigen::Vector3d White(std::uint64_t sample) const {
    return white_sigma_ * Normal(white_seed_, sample);
  }

  void StepBias(std::uint64_t sample) { bias_ += step_sigma_ * Normal(step_seed_, sample); }

 private:
  static Eigen::Vector3d Normal(std::uint64_t seed, std::uint64_t sample) {
    return {Gaussian(seed, 3 * sample), Gaussian(seed, 3 * sample + 1),
            Gaussian(seed, 3 * sample + 2)};
  }

  Eigen::Vector3d bias_;
  double white_sigma_, step_sigma_;
  std::uint64_t white_seed_, step_seed_;
};

}  // namespace

void Check(const ImuOptions& o) {
  constexpr double kMaxRate = 1e5;  // Hz
  if (!(o.rate_hz > 0 && o.rate_hz <= kMaxRate))
    throw Error("imu", fmt::format("rate_hz is {}; it has to lie in (0, {}]", o.rate_hz, kMaxRate));
  for (const auto& [name, value] :
       {std::pair("gravity", o.gravity),
        std::pair("gyroscope_noise_density", o.noise.gyroscope_noise_density),
        std::pair("gyroscope_random_walk", o.noise.gyroscope_random_walk),
        std::pair("accelerometer_noise_density", o.noise.accelerometer_noise_density),
        std::pair("accelerometer_random_walk", o.noise.accelerometer_random_walk)})
    if (!(value >= 0 && std::isfinite(value)))
      throw Error("imu", fmt::format("{} is {}; it has to be 0 or more", name, value));
  for (const auto& bias : {o.initial_gyroscope_bias, o.initial_accelerometer_bias})
    for (const double value : bias)
      if (!std::isfinite(value)) throw Error("imu", fmt::format("an initial bias is {}", value));
}

std::vector<ImuSample> SimulateImu(const Trajectory& trajectory, double from_s, double to_s,
                                   const ImuOptions& options, std::int64_t start_ns,
                                   std::vector<BodyState>* truth) {
  Check(options);
  CheckInterval(from_s, to_s);
  const ImuNoise& noise = options.noise;
  SensorErrors gyro(options.initial_gyroscope_bias, noise.gyroscope_noise_density,
                    noise.gyroscope_random_walk, options, 0);
  SensorErrors accel(options.initial_accelerometer_bias, noise.accelerometer_noise_density,
                     noise.accelerometer_random_walk, options, 1);
  const Eigen::Vector3d g(0, 0, -options.gravity);
  // Rounding in to_s does not cost the last sample.
  const long last = static_cast<long>((to_s - from_s + 1e-10) * options.rate_hz);
  const std::int64_t from_ns = std::llround(from_s * 1e9);

  std::vector<ImuSample> samples;
  samples.reserve(last + 1);
  if (truth) truth->clear();
  for (long k = 0; k <= last; ++k) {
    const std::int64_t time_ns = from_ns + std::llround(k * 1e9 / options.rate_hz);
    const MotionState state = trajectory.At(time_ns * 1e-9);
    const SE3& T_world_body = state.T_world_body;
    const Eigen::Vector3d force = T_world_body.R.conjugate() * (state.acceleration - g);
    samples.push_back({start_ns + time_ns, state.angular_velocity + gyro.bias() + gyro.White(k),
                       force + accel.bias() + accel.White(k)});
    if (truth)
      truth->push_back(
          {start_ns + time_ns, T_world_body, state.velocity, gyro.bias(), accel.bias()});
    gyro.StepBias(k);
    accel.StepBias(k);
  }
  return samples;
}

}  // namespace sgf::synth
