#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

namespace sgf::apps {

/// A change of light or camera, in this order: blur, gamma, local light, exposure, vignette, gamma
/// again, offset, noise, rounding to 8 bits. Without a gamma, light changes grey levels as stored.
/// The defaults change nothing.
struct ImageChange {
  double blur = 0;
  double gamma = 1;
  double light = 0;
  double light_x = 0.3;
  double light_y = 0.4;
  double light_radius = 0.15;
  double exposure = 1;
  double vignette = 0;
  bool encode = true;
  double offset = 0;
  double noise = 0;
  bool quantise = true;

  template <class V>
  void VisitFields(V&& visit) {
    visit("blur", blur, "px", "standard deviation of a Gaussian blur");
    visit("gamma", gamma, "", "exponent from stored levels to light: 255 (level / 255)^gamma");
    visit("light", light, "", "a local light: grey levels times 1 + this in its centre");
    visit("light_x", light_x, "image widths", "centre of the local light");
    visit("light_y", light_y, "image heights", "centre of the local light");
    visit("light_radius", light_radius, "image diagonals",
          "standard deviation of the local light's Gaussian profile");
    visit("exposure", exposure, "", "factor on all grey levels");
    visit("vignette", vignette, "", "v of the factor 1 - v r^2, r = 1 at the corners");
    visit("encode", encode, "",
          "store what light changed as the camera did; else as it is, linear");
    visit("offset", offset, "grey levels", "added to all grey levels");
    visit("noise", noise, "grey levels", "standard deviation of Gaussian noise");
    visit("quantise", quantise, "", "round to 8 bits, clipped to [0, 255]; else keep fractions");
  }
};

/// @throws Error naming the option for an exposure or gamma that is not positive, a vignette
/// outside
///   [0, 1), a light that is not above -1 or has no radius, negative blur or noise, or a value that
///   is not finite.
void CheckChange(const ImageChange& change);

/// The changed image, each channel like a grey image, with noise of its own: 8 bits deep where it
/// is quantised, else CV_32F.
/// @param image grey levels, 8 bits deep, of any number of channels.
/// @param seed chooses the noise.
/// @throws Error as CheckChange().
cv::Mat ApplyChange(const cv::Mat& image, const ImageChange& change, uint64_t seed);

}  // namespace sgf::apps
