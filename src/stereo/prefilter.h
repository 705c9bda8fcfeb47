#pragma once

#include <opencv2/core.hpp>

#include <sgf/stereo/cost_options.h>

namespace sgf::stereo {

/// Applies one of cv::StereoBM's prefilters to a one-channel 8-bit image; the result is 8-bit in
/// [0, 2 * prefilter_cap], with the cap for "no response". kNone returns the image itself.
/// @throws Error if a filter is asked for and the image is not 8-bit.
cv::Mat ApplyPrefilter(const cv::Mat& image, const CostOptions& options);

}  // namespace sgf::stereo
