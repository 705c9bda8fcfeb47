#include <sgf/core/gradient.h>
#include <sgf/metrics/census.h>

namespace sgf::metrics {
namespace {

constexpr int kHalfWidth = Census::kWidth / 2;
constexpr int kHalfHeight = Census::kHeight / 2;

// Signatures of row y of the image inside `padded`.
template <class Pixel>
void CensusRow(const cv::Mat& padded, int y, int cols, uint64_t* signatures) {
  const Pixel* centre = padded.ptr<Pixel>(y + kHalfHeight) + kHalfWidth;
  int bit = 0;
  for (int dy = 0; dy < Census::kHeight; ++dy)
    for (int dx = 0; dx < Census::kWidth; ++dx) {
      if (dy == kHalfHeight && dx == kHalfWidth) continue;
      const Pixel* neighbour = padded.ptr<Pixel>(y + dy) + dx;
      for (int x = 0; x < cols; ++x)
        signatures[x] |= static_cast<uint64_t>(neighbour[x] < centre[x]) << bit;
      ++bit;
    }
}

template <class Pixel>
CensusImage CensusOf(const cv::Mat& grey) {
  cv::Mat padded;
  cv::copyMakeBorder(grey, padded, kHalfHeight, kHalfHeight, kHalfWidth, kHalfWidth,
                     cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
  CensusImage census(grey.rows, grey.cols);
  for (int y = 0; y < grey.rows; ++y) CensusRow<Pixel>(padded, y, grey.cols, census.Row(y));
  return census;
}

}  // namespace

CensusImage ComputeCensus(const cv::Mat& grey) {
  RequireGreyImage(grey, "census input");
  switch (grey.depth()) {
    case CV_8U:
      return CensusOf<uint8_t>(grey);
    case CV_16U:
      return CensusOf<uint16_t>(grey);
    default:
      return CensusOf<float>(grey);
  }
}

}  // namespace sgf::metrics
