// A program outside the project that swaps cv::StereoBM for sgf::StereoSgf.
#include <iostream>

#include <opencv2/core.hpp>

#include <sgf/stereo/stereo_sgf.h>

int main() {
  cv::Mat1b left(60, 120), right(60, 120);
  cv::randu(left, 0, 255);
  constexpr int kShift = 7;
  right = 0;
  left.colRange(kShift, 120).copyTo(right.colRange(0, 120 - kShift));
  cv::Mat disparity;
  auto matcher = sgf::StereoSgf::create(16, 9);  // was: cv::StereoBM::create(16, 9)
  matcher->compute(left, right, disparity);
  std::cout << "disparity " << disparity.at<short>(30, 60) / 16.0 << '\n';
}
