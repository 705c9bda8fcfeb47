#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/core/options.h>
#include <sgf/stereo/block_matcher.h>

namespace sgf::stereo {
namespace {

std::string MessageFor(const std::function<void(BlockMatcherOptions&)>& spoil) {
  BlockMatcherOptions options;
  spoil(options);
  return ErrorMessage([&] { BlockMatcher{options}; });
}

TEST(BlockMatcherOptions, RejectsWhatIsOutOfRangeWithNameAndValue) {
  EXPECT_EQ(MessageFor([](auto&) {}), "no error");
  EXPECT_EQ(MessageFor([](auto& o) { o.num_disparities = 0; }),
            "num_disparities: must be in [1, 2048], got 0");
  EXPECT_EQ(MessageFor([](auto& o) { o.num_disparities = 5000; }),
            "num_disparities: must be in [1, 2048], got 5000");
  EXPECT_EQ(MessageFor([](auto& o) { o.window = 0; }), "window: must be in [1, 51], got 0");
  EXPECT_EQ(MessageFor([](auto& o) { o.window = 8; }), "window: must be odd, got 8");
  EXPECT_EQ(MessageFor([](auto& o) { o.uniqueness_pct = 100; }),
            "uniqueness_pct: must be in [0, 99], got 100");
  EXPECT_EQ(MessageFor([](auto& o) { o.left_right_max = -2; }),
            "left_right_max: must be in [-1, 2047], got -2");
  EXPECT_EQ(MessageFor([](auto& o) { o.tau = 0; }), "tau: must be in [1e-30, 1], got 0");
  EXPECT_EQ(MessageFor([](auto& o) { o.threads = -1; }), "threads: must be in [0, 4096], got -1");
  EXPECT_EQ(MessageFor([](auto& o) { o.prefilter_window = 4; }),
            "prefilter_window: must be odd, got 4");
  EXPECT_EQ(MessageFor([](auto& o) { o.pm.alpha = 2; }), "pm.alpha: must be in [0, 1], got 2");
  EXPECT_EQ(MessageFor([](auto& o) { o.epsilon.tile_px = 0; }),
            "epsilon.tile_px: must be in [1, 1000000], got 0");
}

TEST(BlockMatcherOptions, AnUnknownMetricIsAnErrorThatListsTheKnownOnes) {
  const std::string message = MessageFor([](auto& o) { o.metric = "sfg"; });
  EXPECT_THAT(message, ::testing::HasSubstr("sfg"));
  EXPECT_THAT(message, ::testing::HasSubstr("sgf3_vec"));
}

TEST(BlockMatcherOptions, AreReadFromYaml) {
  BlockMatcherOptions options;
  ReadOptions(YAML::Load("{metric: pm, prefilter: xsobel, subpixel: parabola, pm: {tau_c: .inf}, "
                         "epsilon: {scope: tile}}"),
              options, "run.yaml");
  EXPECT_EQ(options.metric, "pm");
  EXPECT_EQ(options.prefilter, Prefilter::kXSobel);
  EXPECT_EQ(options.subpixel, Subpixel::kParabola);
  EXPECT_TRUE(std::isinf(options.pm.tau_c));
  EXPECT_EQ(options.epsilon.scope, metrics::EpsilonScope::kTile);
}

}  // namespace
}  // namespace sgf::stereo
