// Finds how a stereo camera has moved between the first two frames of a sequence: depth by block
// matching in the first, then alignment of its left image with the second's.
//   direct_alignment FOLDER, a sequence in the layout of EuRoC or KITTI odometry
#include <iostream>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/alignment/point_selection.h>
#include <sgf/core/error.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/odometry/rectification.h>
#include <sgf/stereo/block_matcher.h>

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: direct_alignment FOLDER\n";
    return 2;
  }
  const sgf::OdometrySequence sequence = sgf::OpenOdometrySequence(argv[1]);
  if (!sequence.stereo() || sequence.frames.size() < 2)
    throw sgf::Error(argv[1], "has no two stereo pairs");
  const auto& left = sequence.cameras[0];
  const auto& right = sequence.cameras[1];
  const sgf::odometry::StereoRectifier rectifier(left.camera, right.camera,
                                                 left.T_body_cam.Inverse() * right.T_body_cam);
  const auto pair = [&](const sgf::OdometryFrame& frame) {
    return rectifier.Rectify(sgf::ReadGrey(frame.left), sgf::ReadGrey(frame.right));
  };
  const auto [first, first_right] = pair(sequence.frames[0]);
  const cv::Mat second = pair(sequence.frames[1]).first;

  const sgf::stereo::BlockMatcher matcher({});
  cv::Mat1s fixed;
  matcher.Compute(first, first_right, fixed);
  const cv::Mat1f disparity = matcher.ToFloat(fixed);  // px, NaN where there is no match

  const sgf::alignment::DirectAligner aligner(rectifier.camera(), {});  // by sgf
  const auto pyramid = aligner.MakePyramid(first);
  const double depth_px_m = rectifier.camera().fx * rectifier.baseline_m();
  std::vector<sgf::alignment::ReferencePoint> points;
  for (const cv::Point p :
       sgf::alignment::SelectPoints(pyramid.samples[0], cv::Mat1b(disparity > 0), {}))
    points.push_back({Eigen::Vector2f(p.x, p.y), static_cast<float>(disparity(p) / depth_px_m)});
  const auto reference = aligner.MakeReference(pyramid, points);
  const auto result = aligner.Align(*reference, aligner.MakePyramid(second), sgf::SE3());
  if (!result.ok()) throw sgf::Error(argv[1], "its frames cannot be aligned");
  std::cout << points.size() << " points; the camera has moved by "
            << result.T_cur_ref.Inverse().p.transpose() << " m\n";
} catch (const sgf::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
