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
            "num_disparities: is 0; it has to be in [1, 2048]");
  EXPECT_EQ(MessageFor([](auto& o) { o.num_disparities = 5000; }),
            "num_disparities: is 5000; it has to be in [1, 2048]");
  EXPECT_EQ(MessageFor([](auto& o) { o.window = 0; }), "window: is 0; it has to be in [1, 51]");
  EXPECT_EQ(MessageFor([](auto& o) { o.window = 8; }), "window: is 8; it has to be odd");
  EXPECT_EQ(MessageFor([](auto& o) { o.uniqueness_pct = 100; }),
            "uniqueness_pct: is 100; it has to be in [0, 99]");
  EXPECT_EQ(MessageFor([](auto& o) { o.left_right_max = -2; }),
            "left_right_max: is -2; it has to be in [-1, 2047]");
  EXPECT_EQ(MessageFor([](auto& o) { o.tau = 0; }), "tau: is 0; it has to be in [1e-30, 1]");
  EXPECT_EQ(MessageFor([](auto& o) { o.threads = -1; }),
            "threads: is -1; it has to be in [0, 4096]");
  EXPECT_EQ(MessageFor([](auto& o) { o.prefilter_window = 4; }),
            "prefilter_window: is 4; it has to be odd");
  EXPECT_EQ(MessageFor([](auto& o) { o.pm.alpha = 2; }), "pm.alpha: is 2; it has to be in [0, 1]");
  EXPECT_EQ(MessageFor([](auto& o) { o.epsilon.tile_px = 0; }),
            "epsilon.tile_px: is 0; it has to be in [1, 1000000]");
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
