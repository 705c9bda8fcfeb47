#pragma once

#include <array>
#include <cmath>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/alignment/level.h>

namespace sgf::alignment {

/// A sum of sinusoids, which stands in for a ChannelImage: values and derivatives are exact for
/// every scalar type, ceres::Jet among them.
class AnalyticImage {
 public:
  template <class T>
  bool Inside(const Eigen::Matrix<T, 2, 1>& /*p*/) const {
    return true;
  }

  template <class T>
  T Intensity(const T& x, const T& y) const {
    using std::sin;
    T value = T(120);
    for (const Wave& w : kWaves) value += w.amplitude * sin(w.kx * x + w.ky * y + w.phase);
    return value;
  }

  /// Channels as SampleChannels has them, with epsilon constant.
  template <class T>
  ChannelsAt<T, 4> Sample(const Eigen::Matrix<T, 2, 1>& p) const {
    using std::cos, std::sin;
    ChannelsAt<T, 4> at;
    at.value << Intensity(p.x(), p.y()), T(0), T(0), T(kEpsilonValue);
    at.d_x << T(0), T(0), T(0), T(0);
    at.d_y = at.d_x;
    for (const Wave& w : kWaves) {
      const T phase = w.kx * p.x() + w.ky * p.y() + w.phase;
      const T slope = w.amplitude * cos(phase);
      const T bend = -w.amplitude * sin(phase);
      at.value[kGradientX] += w.kx * slope;
      at.value[kGradientY] += w.ky * slope;
      at.d_x[kGradientX] += w.kx * w.kx * bend;
      at.d_y[kGradientX] += w.kx * w.ky * bend;
      at.d_x[kGradientY] += w.kx * w.ky * bend;
      at.d_y[kGradientY] += w.ky * w.ky * bend;
    }
    at.d_x[kIntensity] = at.value[kGradientX];
    at.d_y[kIntensity] = at.value[kGradientY];
    return at;
  }

 private:
  static constexpr double kEpsilonValue = 25;
  struct Wave {
    double amplitude, kx, ky, phase;
  };
  static constexpr std::array<Wave, 6> kWaves = {{{30, 0.11, 0.07, 0.3},
                                                  {22, -0.19, 0.13, 1.1},
                                                  {14, 0.31, 0.05, 2.2},
                                                  {14, 0.07, -0.33, 0.9},
                                                  {8, 0.23, 0.29, 4.0},
                                                  {8, -0.37, 0.21, 5.1}}};
};

/// Stands in for bit-planes: the analytic image at eight offsets.
class AnalyticPlanes {
 public:
  template <class T>
  bool Inside(const Eigen::Matrix<T, 2, 1>& /*p*/) const {
    return true;
  }

  template <class T>
  ChannelsAt<T, 8> Sample(const Eigen::Matrix<T, 2, 1>& p) const {
    ChannelsAt<T, 8> at;
    for (int k = 0; k < 8; ++k) {
      const ChannelsAt<T, 4> plane =
          AnalyticImage{}.Sample<T>({p.x() + T(5.0 * k), p.y() - T(3.0 * k)});
      at.value[k] = plane.value[kIntensity];
      at.d_x[k] = plane.d_x[kIntensity];
      at.d_y[k] = plane.d_y[kIntensity];
    }
    return at;
  }
};

}  // namespace sgf::alignment
