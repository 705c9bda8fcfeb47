#include <cstdlib>
#include <filesystem>
#include <vector>

#include <gtest/gtest.h>

#include <sgf/eval/trajectory.h>
#include <sgf/io/odometry_dataset.h>

namespace sgf {
namespace {

// What a camera odometry without any error gives for the MH_01 slice.
class PerfectCamera : public ::testing::Test {
 protected:
  PerfectCamera() {
    for (const OdometryFrame& frame : sequence_.frames) {
      times_.push_back(frame.time_ns);
      if (const auto pose = InterpolatePose(sequence_.truth, frame.time_ns, 0.02))
        camera_.push_back({frame.time_ns, *pose * T_body_cam_});
    }
  }

  TrajectoryScores Score(const SE3& T_body_est, TrajectoryAlignment align) const {
    return ScoreTrajectory(camera_, sequence_.truth, T_body_est, times_, {align});
  }

  const OdometrySequence sequence_ =
      OpenOdometrySequence(std::filesystem::path(std::getenv("SGF_DATA")) / "euroc/MH_01_easy");
  const SE3 T_body_cam_ = sequence_.cameras[0].T_body_cam;
  std::vector<std::int64_t> times_;
  std::vector<TimedPose> camera_;
};

TEST_F(PerfectCamera, IsPerfectThroughTheExtrinsics) {
  for (const auto align : {TrajectoryAlignment::kSe3, TrajectoryAlignment::kSim3}) {
    const TrajectoryScores scores = Score(T_body_cam_, align);
    EXPECT_EQ(scores.poses, 240);
    EXPECT_EQ(scores.coverage_pct, 100);
    EXPECT_NEAR(scores.path_m, 4.4, 0.1);
    EXPECT_LT(scores.ate_max_m, 1e-9);
    EXPECT_LT(scores.orientation_rmse_deg, 1e-6);
    EXPECT_NEAR(scores.scale, 1, 1e-9);
  }
}

// The camera lies 69 mm off the body, which is where the truth is.
TEST_F(PerfectCamera, IsOffByTheLeverArmWithoutThem) {
  EXPECT_NEAR(Score({}, TrajectoryAlignment::kSe3).ate_rmse_m, 0.0066, 0.00005);
}

}  // namespace
}  // namespace sgf
