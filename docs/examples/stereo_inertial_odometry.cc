// The path of a body with a stereo camera and an inertial sensor.
//   stereo_inertial_odometry FOLDER TRAJECTORY, a sequence in EuRoC's layout and a file for the
//   body's poses (TUM's format)
#include <iostream>
#include <vector>

#include <sgf/core/error.h>
#include <sgf/core/timed_pose.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/io/trajectory.h>
#include <sgf/vio/stereo_inertial_odometry.h>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: stereo_inertial_odometry FOLDER TRAJECTORY\n";
    return 2;
  }
  const sgf::OdometrySequence sequence = sgf::OpenOdometrySequence(argv[1]);
  if (!sequence.stereo()) throw sgf::Error(argv[1], "is no stereo sequence");
  const auto& left = sequence.cameras[0];
  const auto& right = sequence.cameras[1];
  sgf::vio::VioOptions options;
  options.flow.residual = "ngv";  // follows patches under changing light
  options.flow.image.epsilon.scope = sgf::metrics::EpsilonScope::kWindow;
  sgf::vio::StereoInertialOdometry odometry(
      {left.camera, right.camera, left.T_body_cam.Inverse() * right.T_body_cam}, left.T_body_cam,
      sequence.imu_noise, options);
  std::vector<sgf::TimedPose> path;
  auto sample = sequence.imu.begin();
  for (const sgf::OdometryFrame& frame : sequence.frames) {
    // Measurements come before their frame, and one more to interpolate at its time.
    for (bool after = false; sample != sequence.imu.end() && !after; ++sample) {
      odometry.AddImu(*sample);
      after = sample->time_ns >= frame.time_ns;
    }
    const auto result =
        odometry.Process(frame.time_ns, sgf::ReadGrey(frame.left), sgf::ReadGrey(frame.right));
    if (result.state == sgf::vio::VioState::kTracked)
      path.push_back({frame.time_ns, result.body.T_world_body});
  }
  sgf::WriteTrajectory(argv[2], path);
  std::cout << path.size() << " of " << sequence.frames.size() << " frames have a pose\n";
} catch (const sgf::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
