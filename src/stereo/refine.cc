#include <algorithm>
#include <cmath>
#include <vector>

#include <sgf/stereo/refine.h>

namespace sgf::stereo {
namespace {

// Fills the holes of a row; false if it has no value.
bool FillRow(float* row, int width) {
  int last = -1;  // nearest column with a value to the left
  for (int x = 0; x < width; ++x) {
    if (!std::isfinite(row[x])) continue;
    const float fill = last < 0 ? row[x] : std::min(row[last], row[x]);
    std::fill(row + last + 1, row + x, fill);
    last = x;
  }
  if (last < 0) return false;
  std::fill(row + last + 1, row + width, row[last]);
  return true;
}

}  // namespace

void FillHoles(cv::Mat1f& disparity) {
  std::vector<int> filled;
  for (int y = 0; y < disparity.rows; ++y)
    if (FillRow(disparity[y], disparity.cols)) filled.push_back(y);
  if (filled.empty()) return;
  size_t next = 0;  // of `filled`, the first at or below y
  for (int y = 0; y < disparity.rows; ++y) {
    if (next < filled.size() && filled[next] < y) ++next;
    if (next < filled.size() && filled[next] == y) continue;
    const bool above =
        next == filled.size() || (next > 0 && y - filled[next - 1] <= filled[next] - y);
    disparity.row(filled[above ? next - 1 : next]).copyTo(disparity.row(y));
  }
}

}  // namespace sgf::stereo
