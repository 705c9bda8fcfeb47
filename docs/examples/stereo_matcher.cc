// Disparities of a rectified stereo pair, as a program gets them that has used cv::StereoBM.
//   stereo_matcher LEFT RIGHT DISPARITY.pfm
#include <cmath>
#include <iostream>

#include <opencv2/core.hpp>

#include <sgf/core/error.h>
#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/stereo/stereo_sgf.h>

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::cerr << "usage: stereo_matcher LEFT RIGHT DISPARITY.pfm\n";
    return 2;
  }
  const cv::Mat1b left = sgf::ReadGrey(argv[1]), right = sgf::ReadGrey(argv[2]);
  const auto matcher = sgf::StereoSgf::create(64, 9);  // was: cv::StereoBM::create(64, 9)
  cv::Mat1s fixed;                                     // 16 * disparity
  matcher->compute(left, right, fixed);
  cv::Mat1f disparity;  // px, NaN where there is no match
  fixed.convertTo(disparity, CV_32F, 1.0 / cv::StereoMatcher::DISP_SCALE);
  disparity.setTo(NAN, disparity == matcher->getMinDisparity() - 1);
  sgf::WriteDisparityPfm(argv[3], disparity);
  std::cout << cv::countNonZero(disparity == disparity) << " of " << disparity.total()
            << " pixels are matched\n";
} catch (const sgf::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
