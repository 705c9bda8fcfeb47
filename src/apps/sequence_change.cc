#include <cmath>

#include <fmt/core.h>

#include <sgf/apps/sequence_change.h>
#include <sgf/core/error.h>
#include <sgf/core/random.h>

namespace sgf::apps {
namespace {

/// Where the wandering spot is: in shares of the image's width or height, by the axis.
double SpotAt(const SequenceChange& change, double elapsed_s, uint64_t axis) {
  const double periods = elapsed_s / change.light_period_s;
  const auto last = static_cast<uint64_t>(periods);
  const uint64_t stream = Hash64(static_cast<uint64_t>(change.seed), axis);
  return std::lerp(Uniform01(stream, last), Uniform01(stream, last + 1),
                   periods - static_cast<double>(last));
}

}  // namespace

void CheckChange(const SequenceChange& change) {
  if (!(change.exposure_low > 0 && change.exposure_high >= change.exposure_low))
    throw Error("exposure_low", fmt::format("is {} with exposure_high {}; 0 < low <= high",
                                            change.exposure_low, change.exposure_high));
  if (!(change.period_s > 0))
    throw Error("period_s", fmt::format("is {}; it has to be positive", change.period_s));
  if (!(change.light_period_s > 0))
    throw Error("light_period_s",
                fmt::format("is {}; it has to be positive", change.light_period_s));
  CheckChange(ChangeAt(change, 0));
}

bool ChangesNothing(const SequenceChange& change) {
  return change.exposure_low == 1 && change.exposure_high == 1 && change.vignette == 0 &&
         change.light == 0 && (change.gamma == 1 || change.encode);
}

ImageChange ChangeAt(const SequenceChange& change, std::int64_t elapsed_ns) {
  const double elapsed_s = 1e-9 * static_cast<double>(elapsed_ns);
  const auto period = static_cast<uint64_t>(elapsed_s / change.period_s);
  const double share = Uniform01(static_cast<uint64_t>(change.seed), period);
  ImageChange image;
  image.gamma = change.gamma;
  image.light = change.light;
  image.light_x = SpotAt(change, elapsed_s, 0);
  image.light_y = SpotAt(change, elapsed_s, 1);
  image.light_radius = change.light_radius;
  image.exposure = period == 0 ? 1
                               : change.exposure_low *
                                     std::pow(change.exposure_high / change.exposure_low, share);
  image.vignette = change.vignette;
  image.encode = change.encode;
  return image;
}

double ClippedShare(const cv::Mat1b& image) {
  return static_cast<double>(cv::countNonZero(image == 255)) / static_cast<double>(image.total());
}

}  // namespace sgf::apps
