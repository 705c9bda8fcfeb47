// Follows points through the stereo images of a sequence and says what becomes of them.
//   optical_flow FOLDER, a sequence in the layout of EuRoC or KITTI odometry
#include <iostream>

#include <sgf/core/error.h>
#include <sgf/flow/stereo_flow.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::cerr << "usage: optical_flow FOLDER\n";
    return 2;
  }
  const sgf::OdometrySequence sequence = sgf::OpenOdometrySequence(argv[1]);
  if (!sequence.stereo()) throw sgf::Error(argv[1], "is no stereo sequence");
  const auto& left = sequence.cameras[0];
  const auto& right = sequence.cameras[1];
  sgf::flow::FlowOptions options;
  options.residual = "ngv";  // follows patches under changing light
  options.image.epsilon.scope = sgf::metrics::EpsilonScope::kWindow;
  sgf::flow::StereoFlow flow(
      {left.camera, right.camera, left.T_body_cam.Inverse() * right.T_body_cam}, options);
  for (const sgf::OdometryFrame& frame : sequence.frames) {
    const auto seen =
        flow.Process(frame.time_ns, sgf::ReadGrey(frame.left), sgf::ReadGrey(frame.right));
    std::cout << frame.time_ns << ": " << seen.tracked << " followed, " << seen.lost << " lost, "
              << seen.detected << " new, " << seen.stereo << " seen by both cameras\n";
  }
} catch (const sgf::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
