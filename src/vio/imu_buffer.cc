#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>
#include <sgf/vio/imu_buffer.h>

namespace sgf::vio {

namespace {

void Check(const ImuBufferOptions& o) {
  for (const auto& [name, value] : {std::pair("imu.max_gap_s", o.max_gap_s),
                                    std::pair("imu.gyro_full_scale", o.gyro_full_scale),
                                    std::pair("imu.accel_full_scale", o.accel_full_scale),
                                    std::pair("imu.max_span_s", o.max_span_s)})
    Require(value > 0, name, value, "positive");
  Require(o.max_bridge_s >= o.max_gap_s, "imu.max_bridge_s", o.max_bridge_s,
          fmt::format("at least imu.max_gap_s, {}", o.max_gap_s));
  for (const auto& [name, value] :
       {std::pair("imu.gap_noise_factor", o.gap_noise_factor),
        std::pair("imu.saturation_noise_factor", o.saturation_noise_factor)})
    Require(value >= 1 && std::isfinite(value), name, value, "finite and at least 1");
}

ImuSample Interpolate(const ImuSample& a, const ImuSample& b, std::int64_t time_ns) {
  if (time_ns == a.time_ns) return a;
  const double t = Seconds(a.time_ns, time_ns) / Seconds(a.time_ns, b.time_ns);
  return {time_ns, (1 - t) * a.gyro + t * b.gyro, (1 - t) * a.accel + t * b.accel};
}

bool Reaches(const Eigen::Vector3d& value, double full_scale) {
  return value.lpNorm<Eigen::Infinity>() >= full_scale;
}

}  // namespace

ImuBuffer::ImuBuffer(const ImuNoise& noise, const ImuBufferOptions& options)
    : noise_(noise), options_(options) {
  Check(options);
  Preintegration(0, {}, noise);  // checks the noise
}

bool ImuBuffer::Add(const ImuSample& sample) {
  const auto refuse = [](std::int64_t& count) { return ++count, false; };
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) return refuse(health_.not_finite);
  if (!samples_.empty()) {
    const std::int64_t last_ns = samples_.back().time_ns;
    if (sample.time_ns == last_ns) return refuse(health_.duplicates);
    if (sample.time_ns < last_ns) return refuse(health_.backwards);
    const double gap_s = Seconds(last_ns, sample.time_ns);
    health_.longest_gap_s = std::max(health_.longest_gap_s, gap_s);
    health_.gaps += gap_s > options_.max_gap_s;
  }
  ++health_.taken;
  health_.saturated += Reaches(sample.gyro, options_.gyro_full_scale) ||
                       Reaches(sample.accel, options_.accel_full_scale);
  samples_.push_back(sample);
  for (; Seconds(samples_.front().time_ns, sample.time_ns) > options_.max_span_s;
       samples_.pop_front())
    ++health_.overflowed;
  return true;
}

bool ImuBuffer::Covers(std::int64_t from_ns, std::int64_t to_ns) const {
  return !samples_.empty() && samples_.front().time_ns <= from_ns &&
         samples_.back().time_ns >= to_ns;
}

size_t ImuBuffer::IndexAt(std::int64_t time_ns) const {
  const auto after = std::upper_bound(
      samples_.begin(), samples_.end(), time_ns,
      [](std::int64_t time, const ImuSample& sample) { return time < sample.time_ns; });
  return after - samples_.begin() - 1;
}

double ImuBuffer::LongestGap_s(std::int64_t from_ns, std::int64_t to_ns) const {
  if (!Covers(from_ns, to_ns)) return std::numeric_limits<double>::infinity();
  double longest = 0;
  for (size_t i = IndexAt(from_ns); samples_[i].time_ns < to_ns; ++i)
    longest = std::max(longest, Seconds(samples_[i].time_ns, samples_[i + 1].time_ns));
  return longest;
}

NoiseFactors ImuBuffer::FactorsBetween(size_t index) const {
  const ImuSample &a = samples_[index], &b = samples_[index + 1];
  const bool gap = Seconds(a.time_ns, b.time_ns) > options_.max_gap_s;
  const auto factor = [&](Eigen::Vector3d ImuSample::*sensor, double full_scale) {
    const bool saturated = Reaches(a.*sensor, full_scale) || Reaches(b.*sensor, full_scale);
    return std::max(saturated ? options_.saturation_noise_factor : 1,
                    gap ? options_.gap_noise_factor : 1);
  };
  return {factor(&ImuSample::gyro, options_.gyro_full_scale),
          factor(&ImuSample::accel, options_.accel_full_scale)};
}

std::optional<Preintegration> ImuBuffer::Between(std::int64_t from_ns, std::int64_t to_ns,
                                                 const ImuBias& bias) const {
  if (to_ns <= from_ns) throw Error("imu", fmt::format("{} ns is not after {} ns", to_ns, from_ns));
  if (LongestGap_s(from_ns, to_ns) > options_.max_bridge_s) return std::nullopt;
  Preintegration sum(from_ns, bias, noise_);
  for (size_t i = IndexAt(from_ns); sum.to_ns() < to_ns; ++i) {
    const ImuSample &a = samples_[i], &b = samples_[i + 1];
    sum.Integrate(Interpolate(a, b, std::max(a.time_ns, from_ns)),
                  b.time_ns <= to_ns ? b : Interpolate(a, b, to_ns), FactorsBetween(i));
  }
  return sum;
}

std::optional<Eigen::Vector3d> ImuBuffer::GyroAt(std::int64_t time_ns) const {
  if (!Covers(time_ns, time_ns)) return std::nullopt;
  const size_t i = IndexAt(time_ns);
  if (samples_[i].time_ns == time_ns) return samples_[i].gyro;
  return Interpolate(samples_[i], samples_[i + 1], time_ns).gyro;
}

void ImuBuffer::DropBefore(std::int64_t time_ns) {
  while (samples_.size() > 1 && samples_[1].time_ns <= time_ns) samples_.pop_front();
}

}  // namespace sgf::vio
