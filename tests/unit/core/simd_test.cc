#include <gtest/gtest.h>

#include <sgf/core/error.h>
#include <sgf/core/simd.h>

namespace sgf {
namespace {

TEST(Simd, RestrictsToEachTargetAndLiftsTheRestriction) {
  const auto targets = SimdTargets();
  ASSERT_FALSE(targets.empty());
  for (const auto& target : targets) {
    RestrictSimd(target);
    EXPECT_EQ(ActiveSimdTarget(), target);
  }
  RestrictSimd("");
  EXPECT_EQ(SimdTargets(), targets);
  EXPECT_EQ(ActiveSimdTarget(), targets.front());
}

TEST(Simd, RejectsAnUnknownTargetAndStaysUnrestricted) {
  const auto targets = SimdTargets();
  EXPECT_THROW(RestrictSimd("mmx"), Error);
  EXPECT_EQ(SimdTargets(), targets);
}

}  // namespace
}  // namespace sgf
