#include <vector>

#include <gtest/gtest.h>

#include <sgf/core/keyframe_choice.h>

namespace sgf {
namespace {

using Places = std::vector<Eigen::Vector3d>;

TEST(LeastUsefulKeyframe, IsNearToOthersAndFarFromTheNewest) {
  const Places places = {{0, 0, 0}, {5, 0, 0}, {5.1, 0, 0}, {8, 0, 0}};
  EXPECT_EQ(LeastUsefulKeyframe(places, {9, 0, 0}), 1U);
  EXPECT_EQ(LeastUsefulKeyframe(places, {1, 0, 0}), 2U);
}

TEST(LeastUsefulKeyframe, TakesTheFirstOfThoseAlike) {
  EXPECT_EQ(LeastUsefulKeyframe(Places{{1, 0, 0}}, {0, 0, 0}), 0U);
  EXPECT_EQ(LeastUsefulKeyframe(Places(3, Eigen::Vector3d::Zero()), {1, 0, 0}), 0U);
}

}  // namespace
}  // namespace sgf
