#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/direct/initializer.h>

namespace sgf::direct {
namespace {

using test::kCamera;

cv::Mat1f ViewFrom(const SE3& T_world_cam, double gain = 1) {
  return test::CornerWorld(kCamera).Render(T_world_cam, gain).grey;
}

SE3 PoseAt(int k) { return {ExpSO3({0, 0.004 * k, 0}), {0.04 * k, 0.01 * k, 0.01 * k}}; }

TEST(Initializer, FindsTheFirstMotion) {
  Initializer initializer(kCamera, {});
  std::optional<InitialMotion> motion;
  int last = -1;
  while (!motion && last < 40) motion = initializer.Add(ViewFrom(PoseAt(++last)));
  ASSERT_TRUE(motion);
  ASSERT_EQ(motion->T_cam_first.size(), static_cast<size_t>(last) + 1);
  for (int k = 1; k <= last; ++k) {
    const SE3 truth = PoseAt(k).Inverse();
    EXPECT_LT(LogSO3(motion->T_cam_first[k].R * truth.R.conjugate()).norm(), 0.01);
  }
  const Eigen::Vector3d found = motion->T_cam_first[last].p, truth = PoseAt(last).Inverse().p;
  EXPECT_LT((found.normalized() - truth.normalized()).norm(), 0.1);
  EXPECT_NEAR(found.norm(), truth.norm() / 3.7, 0.2 * truth.norm() / 3.7);  // of the median depth
}

TEST(Initializer, FollowsThroughAChangeOfTheExposure) {
  Initializer initializer(kCamera, {});
  std::optional<InitialMotion> motion;
  for (int k = 0; !motion && k < 40; ++k)
    motion = initializer.Add(ViewFrom(PoseAt(k), k % 4 < 2 ? 1 : 0.6));
  EXPECT_TRUE(motion);
}

TEST(Initializer, SaysNothingWithoutParallax) {
  Initializer standing(kCamera, {}), turning(kCamera, {}), dark(kCamera, {});
  for (int k = 0; k < 15; ++k) {
    EXPECT_FALSE(standing.Add(ViewFrom({})));
    EXPECT_FALSE(turning.Add(ViewFrom({ExpSO3({0, 0.01 * k, 0}), {0, 0, 0}})));
    EXPECT_FALSE(dark.Add(cv::Mat1f(240, 320, 0.f)));
  }
}

TEST(Initializer, BeginsAnewAfterAJumpCut) {
  Initializer initializer(kCamera, {});
  for (int k = 0; k < 3; ++k) initializer.Add(ViewFrom(PoseAt(k)));
  EXPECT_EQ(initializer.frames(), 3);
  EXPECT_FALSE(initializer.Add(ViewFrom({ExpSO3({0.3, 0.2, 1}), {1, -1, -1}})));
  EXPECT_EQ(initializer.frames(), 1);
}

TEST(Initializer, RefusesOptionsOutOfRange) {
  EXPECT_THAT(ErrorMessage([] { Initializer(kCamera, {.corners = 10}); }),
              testing::HasSubstr("corners"));
  EXPECT_THAT(ErrorMessage([] { Initializer(kCamera, {.min_inliers = 2}); }),
              testing::HasSubstr("min_inliers"));
}

}  // namespace
}  // namespace sgf::direct
