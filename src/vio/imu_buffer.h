#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include <sgf/core/inertial.h>
#include <sgf/vio/preintegration.h>

namespace sgf::vio {

struct ImuBufferOptions {
  double max_gap_s = 0.05;
  double max_bridge_s = 0.25;
  double gap_noise_factor = 100;
  double gyro_full_scale = 17.4;
  double accel_full_scale = 176;
  double saturation_noise_factor = 1e4;
  double max_span_s = 60;

  template <class V>
  void VisitFields(V&& visit) {
    visit("max_gap_s", max_gap_s, "s", "time between two samples beyond which some are missing");
    visit("max_bridge_s", max_bridge_s, "s",
          "time between two samples over which measurements are interpolated; nothing is known "
          "across longer ones");
    visit("gap_noise_factor", gap_noise_factor, "",
          "by how much noise is raised where samples are missing");
    visit("gyro_full_scale", gyro_full_scale, "rad/s",
          "angular rate about an axis from which on the sensor is saturated; the default is just "
          "below that of EuRoC's ADIS16448");
    visit("accel_full_scale", accel_full_scale, "m/s^2", "the same for the acceleration");
    visit("saturation_noise_factor", saturation_noise_factor, "",
          "by how much the noise of a saturated sensor is raised");
    visit("max_span_s", max_span_s, "s", "older samples are forgotten even if nobody asks for it");
  }
};

/// What has become of the samples so far. A sample that is not taken is counted once.
struct ImuHealth {
  std::int64_t taken = 0;
  std::int64_t duplicates = 0;  ///< not taken: of the time of the last one
  std::int64_t backwards = 0;   ///< not taken: before the last one
  std::int64_t not_finite = 0;  ///< not taken: not a number, or infinite
  std::int64_t saturated = 0;   ///< taken
  std::int64_t gaps = 0;        ///< longer than max_gap_s
  double longest_gap_s = 0;     ///< longest time from one sample to the next, s
  std::int64_t overflowed = 0;  ///< taken, but forgotten for max_span_s
};

/// The latest measurements of an inertial sensor, to be integrated between any two times. Bad
/// samples are counted, not thrown: a flight does not end for them.
class ImuBuffer {
 public:
  /// @throws Error for options out of range and for noise that is not positive.
  explicit ImuBuffer(const ImuNoise& noise, const ImuBufferOptions& options = {});

  /// @return whether the sample was taken; otherwise health() says why not.
  bool Add(const ImuSample& sample);

  /// Whether samples reach from one time to the other, both included; gaps are not looked at.
  bool Covers(std::int64_t from_ns, std::int64_t to_ns) const;

  /// Longest time (s) from one sample to the next among those that Between() would use; infinite
  /// where they do not cover the stretch.
  double LongestGap_s(std::int64_t from_ns, std::int64_t to_ns) const;

  /// Measurements from one time to the other, interpolated at both ends. Noise is raised where the
  /// sensor is saturated and over gaps longer than max_gap_s.
  /// @return nothing where samples do not cover the stretch, or miss for longer than max_bridge_s.
  /// @throws Error if to_ns is not after from_ns or a bias is not finite.
  std::optional<Preintegration> Between(std::int64_t from_ns, std::int64_t to_ns,
                                        const ImuBias& bias) const;

  /// Angular rate as measured at a time, interpolated, rad/s; nothing where samples do not cover
  /// it.
  std::optional<Eigen::Vector3d> GyroAt(std::int64_t time_ns) const;

  /// Forgets what Between() does not need for times from `time_ns` on.
  void DropBefore(std::int64_t time_ns);

  /// Forgets all samples, to begin anew after the sensor's clock has jumped back. The counts stay.
  void Clear() { samples_.clear(); }

  const std::deque<ImuSample>& samples() const { return samples_; }
  const ImuHealth& health() const { return health_; }
  const ImuNoise& noise() const { return noise_; }

 private:
  /// Index of the last sample not after `time_ns`; there has to be one.
  size_t IndexAt(std::int64_t time_ns) const;

  NoiseFactors FactorsBetween(size_t index) const;

  ImuNoise noise_;
  ImuBufferOptions options_;
  std::deque<ImuSample> samples_;
  ImuHealth health_;
};

}  // namespace sgf::vio
