#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/odometry/rectification.h>

namespace sgf::odometry {
namespace {

// Rows between corners of the left image and where the right image matches their surroundings best,
// px; only for matches that leave no doubt.
std::vector<double> RowOffsets(const cv::Mat1b& left, const cv::Mat1b& right) {
  constexpr int kHalf = 8, kRows = 12, kDisparities = 100;
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(left, corners, 300, 0.01, 15);
  std::vector<double> offsets;
  for (const cv::Point corner : corners) {
    const cv::Rect patch(corner.x - kHalf, corner.y - kHalf, 2 * kHalf + 1, 2 * kHalf + 1);
    const cv::Rect range(patch.x - kDisparities, patch.y - kRows, patch.width + kDisparities,
                         patch.height + 2 * kRows);
    if ((range & cv::Rect({0, 0}, left.size())) != range) continue;
    cv::Mat1f likeness;
    cv::matchTemplate(right(range), left(patch), likeness, cv::TM_CCOEFF_NORMED);
    double best = 0;
    cv::Point at;
    cv::minMaxLoc(likeness, nullptr, &best, nullptr, &at);
    if (best > 0.95) offsets.push_back(std::abs(at.y - kRows));
  }
  return offsets;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.at(values.size() / 2);
}

TEST(RectificationData, MatchesOfMachineHall01LieInOneRow) {
  const OdometrySequence sequence =
      OpenOdometrySequence(std::filesystem::path(std::getenv("SGF_DATA")) / "euroc/MH_01_easy");
  const EurocCamera &left = sequence.cameras[0], &right = sequence.cameras[1];
  const StereoRectifier rectifier(left.camera, right.camera,
                                  left.T_body_cam.Inverse() * right.T_body_cam);
  std::vector<double> raw, rectified;
  for (const size_t i : {0, 120, 239}) {
    const cv::Mat1b l = ReadGrey(sequence.frames[i].left), r = ReadGrey(sequence.frames[i].right);
    for (const double offset : RowOffsets(l, r)) raw.push_back(offset);
    const auto [a, b] = rectifier.Rectify(l, r);
    for (const double offset : RowOffsets(a, b)) rectified.push_back(offset);
  }
  RecordProperty("matches", static_cast<int>(rectified.size()));
  EXPECT_GT(rectified.size(), 200U);
  EXPECT_LT(Median(rectified), 0.5);
  EXPECT_GT(Median(raw), 2) << "the raw images do need it";
}

}  // namespace
}  // namespace sgf::odometry
