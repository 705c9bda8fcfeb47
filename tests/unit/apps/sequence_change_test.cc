#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include <sgf/apps/sequence_change.h>

#include "support/error_message.h"

namespace sgf::apps {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

TEST(SequenceChange, DefaultsChangeNothing) {
  EXPECT_TRUE(ChangesNothing({}));
  EXPECT_FALSE(ChangesNothing(SequenceChange{.light = -0.5}));
  EXPECT_FALSE(ChangesNothing(SequenceChange{.exposure_high = 2}));
}

TEST(SequenceChange, ExposureIsConstantWithinAPeriod) {
  const SequenceChange change{.exposure_low = 0.5, .exposure_high = 2, .period_s = 2};
  EXPECT_EQ(ChangeAt(change, 0).exposure, 1);
  EXPECT_EQ(ChangeAt(change, 2 * kSecond).exposure, ChangeAt(change, 3 * kSecond).exposure);
  EXPECT_NE(ChangeAt(change, 2 * kSecond).exposure, ChangeAt(change, 4 * kSecond).exposure);
}

TEST(SequenceChange, SpotGoesStraightFromAPlaceToTheNext) {
  const SequenceChange change{.light = -0.9, .light_radius = 0.3, .light_period_s = 2};
  const ImageChange begin = ChangeAt(change, 2 * kSecond), middle = ChangeAt(change, 3 * kSecond),
                    end = ChangeAt(change, 4 * kSecond - 1);
  EXPECT_EQ(middle.light, -0.9);
  EXPECT_EQ(middle.light_radius, 0.3);
  EXPECT_NEAR(middle.light_x, (begin.light_x + end.light_x) / 2, 1e-8);
  EXPECT_NEAR(middle.light_y, (begin.light_y + end.light_y) / 2, 1e-8);
  EXPECT_GT(std::hypot(begin.light_x - end.light_x, begin.light_y - end.light_y), 0.01);
  EXPECT_NEAR(end.light_x, ChangeAt(change, 4 * kSecond).light_x, 1e-8);
}

TEST(SequenceChange, SeedsDiffer) {
  const SequenceChange one{.light = 1, .seed = 1}, two{.light = 1, .seed = 2};
  EXPECT_NE(ChangeAt(one, kSecond).light_x, ChangeAt(two, kSecond).light_x);
}

TEST(SequenceChange, RefusesWhatIsOutOfRange) {
  EXPECT_NE(
      ErrorMessage([] { CheckChange(SequenceChange{.light_period_s = 0}); }).find("light_period_s"),
      std::string::npos);
  EXPECT_NE(ErrorMessage([] { CheckChange(SequenceChange{.light = -1}); }).find("light"),
            std::string::npos);
  EXPECT_NE(
      ErrorMessage([] { CheckChange(SequenceChange{.exposure_low = 2}); }).find("exposure_low"),
      std::string::npos);
}

}  // namespace
}  // namespace sgf::apps
