#include <cmath>

#include <fmt/core.h>

#include <sgf/apps/sequence_change.h>
#include <sgf/core/error.h>
#include <sgf/core/random.h>

namespace sgf::apps {

void CheckChange(const SequenceChange& change) {
  if (!(change.exposure_low > 0 && change.exposure_high >= change.exposure_low))
    throw Error("exposure_low", fmt::format("is {} with exposure_high {}; 0 < low <= high",
                                            change.exposure_low, change.exposure_high));
  if (!(change.period_s > 0))
    throw Error("period_s", fmt::format("is {}; it has to be positive", change.period_s));
  CheckChange(ChangeAt(change, 0));
}

bool ChangesNothing(const SequenceChange& change) {
  return change.exposure_low == 1 && change.exposure_high == 1 && change.vignette == 0 &&
         (change.gamma == 1 || change.encode);
}

ImageChange ChangeAt(const SequenceChange& change, std::int64_t elapsed_ns) {
  const auto period =
      static_cast<uint64_t>(static_cast<double>(elapsed_ns) / (1e9 * change.period_s));
  const double share = Uniform01(static_cast<uint64_t>(change.seed), period);
  ImageChange image;
  image.gamma = change.gamma;
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
