#pragma once

#include <opencv2/core.hpp>

namespace sgf::stereo {

/// Fills the pixels without a disparity: each takes the smaller of the nearest values to its left
/// and right on its row, the background, for most of what has no match is hidden in the other image
/// behind something nearer (Hirschmueller, PAMI 2008, Sec. 2.5.3). A row without any value takes
/// over the nearest row that has one, the upper one of two. A map without any value stays as it is.
/// @param[in,out] disparity px, not finite where there is none.
void FillHoles(cv::Mat1f& disparity);

}  // namespace sgf::stereo
