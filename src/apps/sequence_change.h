#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

#include <sgf/apps/image_change.h>

namespace sgf::apps {

/// A change of light over a sequence and of its cameras' vignette: each period has an exposure of
/// its own, drawn log-uniformly, and a spot of light or shade wanders over the image, straight from
/// one place that was drawn to the next. The defaults change nothing.
struct SequenceChange {
  double gamma = 1;
  double light = 0;
  double light_radius = 0.2;
  double light_period_s = 1;
  double exposure_low = 1;
  double exposure_high = 1;
  double period_s = 1;
  double vignette = 0;
  bool encode = true;
  int seed = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("gamma", gamma, "", "exponent from stored levels to light: 255 (level / 255)^gamma");
    visit("light", light, "", "a wandering spot: light times 1 + this in its centre; above -1");
    visit("light_radius", light_radius, "image diagonals",
          "standard deviation of the spot's Gaussian profile");
    visit("light_period_s", light_period_s, "s", "in which the spot goes from a place to the next");
    visit("exposure_low", exposure_low, "", "smallest factor on light");
    visit("exposure_high", exposure_high, "", "largest factor on light");
    visit("period_s", period_s, "s", "time between jumps of the exposure; the first has factor 1");
    visit("vignette", vignette, "", "v of the factor 1 - v r^2, r = 1 at the corners");
    visit("encode", encode, "",
          "store what light changed as the camera did; else as it is, linear");
    visit("seed", seed, "", "chooses the exposures and the places of the spot");
  }
};

/// @throws Error naming the option that is out of range.
void CheckChange(const SequenceChange& change);

/// Whether images stay as they are.
bool ChangesNothing(const SequenceChange& change);

/// The change of the images taken `elapsed_ns` after the first ones; both eyes have the same.
ImageChange ChangeAt(const SequenceChange& change, std::int64_t elapsed_ns);

/// Share of the pixels that have no room above: 255.
double ClippedShare(const cv::Mat1b& image);

}  // namespace sgf::apps
