// The path of a stereo camera through a sequence, without an inertial sensor.
//   keyframe_odometry FOLDER TRAJECTORY, a sequence in the layout of EuRoC or KITTI odometry and a
//   file for the left camera's poses (TUM's format)
#include <iostream>
#include <vector>

#include <sgf/core/error.h>
#include <sgf/core/timed_pose.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/io/trajectory.h>
#include <sgf/odometry/odometry.h>
#include <sgf/odometry/rectification.h>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: keyframe_odometry FOLDER TRAJECTORY\n";
    return 2;
  }
  const sgf::OdometrySequence sequence = sgf::OpenOdometrySequence(argv[1]);
  if (!sequence.stereo()) throw sgf::Error(argv[1], "is no stereo sequence");
  const auto& left = sequence.cameras[0];
  const auto& right = sequence.cameras[1];
  const sgf::odometry::StereoRectifier rectifier(left.camera, right.camera,
                                                 left.T_body_cam.Inverse() * right.T_body_cam);
  sgf::odometry::Odometry odometry({rectifier.camera(), rectifier.baseline_m()}, {});
  std::vector<sgf::TimedPose> path;
  for (const sgf::OdometryFrame& frame : sequence.frames) {
    const auto [rectified_left, rectified_right] =
        rectifier.Rectify(sgf::ReadGrey(frame.left), sgf::ReadGrey(frame.right));
    const auto result = odometry.ProcessStereo(frame.time_ns, rectified_left, rectified_right);
    if (result.state != sgf::odometry::TrackingState::kLost)
      path.push_back({frame.time_ns, result.T_world_cam});
  }
  sgf::WriteTrajectory(argv[2], path);
  std::cout << path.size() << " of " << sequence.frames.size() << " frames have a pose\n";
} catch (const sgf::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
