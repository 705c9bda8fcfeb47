#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/core/options.h>
#include <sgf/synth/exposure.h>
#include <sgf/synth/photometry.h>

#include "support/error_message.h"

namespace sgf::synth {
namespace {

using ::testing::ElementsAre;
using ::testing::StartsWith;

std::vector<double> InverseResponse(int levels, double gamma = 1) {
  return CameraResponse({ResponseModel::kGamma, gamma, {}}).InverseTable(levels);
}

// A wall in front of a 16-bit camera that saturates at 1 / radiance ms.
cv::Mat Image(double radiance, double exposure_ms) {
  const double level = 65535 * std::min(1., radiance * exposure_ms);
  return cv::Mat_<uint16_t>(4, 4, static_cast<uint16_t>(std::lround(level)));
}

ExposureOptions Automatic() {
  ExposureOptions options;
  options.automatic.enabled = true;
  return options;
}

// Exposure times of frames at 1 Hz in front of the wall.
std::vector<double> TimesMs(const ExposureOptions& options, double radiance, int frames) {
  ExposureControl control(options, InverseResponse(65536));
  std::vector<double> times_ms;
  for (int frame = 0; frame < frames; ++frame) {
    times_ms.push_back(control.ExposureMs(frame));
    control.Observe(Image(radiance, times_ms.back()));
  }
  return times_ms;
}

TEST(ExposureControl, KeepsTheBaseWhenNothingElseIsAskedFor) {
  EXPECT_THAT(TimesMs({}, 0.001, 4), ElementsAre(5, 5, 5, 5));
}

TEST(ExposureControl, JumpsWithinWindowsAndFromATimeOn) {
  ExposureOptions options;
  options.jumps = {{1, 3, 2.}, {.from_s = 2, .factor = 0.5}};
  EXPECT_THAT(TimesMs(options, 0.1, 5), ElementsAre(5, 10, 5, 2.5, 2.5));
}

TEST(ExposureControl, StaysWithinTheLimits) {
  ExposureOptions options;
  options.min_ms = 2;
  options.max_ms = 12;
  options.jumps = {{1, 2, 10.}, {2, 3, 0.01}};
  EXPECT_THAT(TimesMs(options, 0.1, 4), ElementsAre(5, 12, 2, 5));
}

TEST(ExposureControl, ReachesTheTarget) {
  for (const double radiance : {0.02, 0.05, 0.3}) {
    const double last_ms = TimesMs(Automatic(), radiance, 60).back();
    EXPECT_NEAR(last_ms * radiance, 0.2, 1e-4) << radiance;
  }
}

TEST(ExposureControl, LagsByTheTimeConstant) {
  ExposureOptions options = Automatic();
  options.automatic.time_constant_frames = 6;
  const double wanted_ms = 0.2 / 0.1;
  const auto times_ms = TimesMs(options, 0.1, 7);
  EXPECT_EQ(times_ms[0], 5);
  EXPECT_NEAR(std::log(times_ms[6] / wanted_ms), std::log(5 / wanted_ms) * std::exp(-1), 1e-3);
  for (size_t i = 1; i < times_ms.size(); ++i) EXPECT_LT(times_ms[i], times_ms[i - 1]);
}

TEST(ExposureControl, WithoutLagTheNextFrameIsRight) {
  ExposureOptions options = Automatic();
  options.automatic.time_constant_frames = 0;
  const auto times_ms = TimesMs(options, 0.1, 3);
  EXPECT_NEAR(times_ms[1], 2, 1e-4);
  EXPECT_NEAR(times_ms[2], 2, 1e-4);
}

TEST(ExposureControl, WorksAgainstAJump) {
  ExposureOptions options = Automatic();
  options.jumps = {{.from_s = 50, .factor = 3}};
  const auto times_ms = TimesMs(options, 0.1, 100);
  EXPECT_NEAR(times_ms[49], 2, 0.01);
  EXPECT_NEAR(times_ms[50], 6, 0.01);
  EXPECT_NEAR(times_ms[99], 2, 0.01);
}

TEST(ExposureControl, AnswersABlackAndASaturatedImageWithinBounds) {
  const auto dark = TimesMs(Automatic(), 0, 20), bright = TimesMs(Automatic(), 100, 60);
  EXPECT_LT(dark[1], 5 * 3);
  EXPECT_EQ(dark.back(), 20);
  EXPECT_LT(bright[1], 5);
  EXPECT_EQ(bright.back(), 0.02);
}

TEST(SignalLevel, IsThatOfIrradianceNotOfGreyLevels) {
  cv::Mat1b image(1, 10);
  for (int x = 0; x < 10; ++x) image(x) = static_cast<uint8_t>(20 * x);
  double mean = 0;
  for (int x = 0; x < 10; ++x) mean += std::pow(20 * x / 255., 2.2) / 10;
  const auto inverse = InverseResponse(256, 2.2);
  AutoExposureOptions options;
  EXPECT_NEAR(SignalLevel(image, inverse, options), mean, 1e-12);
  options.statistic = ExposureStatistic::kPercentile;
  for (const auto& [percentile, level] :
       {std::pair(0, 0), std::pair(10, 0), std::pair(11, 20), std::pair(50, 80), std::pair(90, 160),
        std::pair(100, 180)}) {
    options.percentile = percentile;
    EXPECT_NEAR(SignalLevel(image, inverse, options), std::pow(level / 255., 2.2), 1e-12)
        << percentile;
  }
}

TEST(SignalLevel, NeedsAnImageThatGoesWithTheResponse) {
  const auto message = [](const cv::Mat& image, int levels) {
    return ErrorMessage([&] { SignalLevel(image, InverseResponse(levels), {}); });
  };
  EXPECT_EQ(message(Image(0, 1), 256),
            "auto-exposure: image is 4x4 CV_16UC1, the response has 256 levels");
  EXPECT_THAT(message(cv::Mat1b(), 256), StartsWith("auto-exposure: image is 0x0"));
  EXPECT_THAT(message(cv::Mat3b(2, 2), 256), StartsWith("auto-exposure: image is 2x2 CV_8UC3"));
  EXPECT_EQ(message(cv::Mat1b(2, 2, uint8_t{3}), 256), "no error");
}

TEST(ExposureOptions, AreReadFromYaml) {
  ExposureOptions options;
  ReadOptions(YAML::Load("base_ms: 3\n"
                         "automatic: {enabled: true, statistic: percentile, percentile: 80}\n"
                         "jumps:\n"
                         "  - {from_s: 2, factor: 0.5}\n"
                         "  - {from_s: 4, to_s: 5, factor: 4}\n"
                         "lights:\n"
                         "  - {group: lamp, from_s: 1, strength: 0, ramp_s: 0.1}\n"),
              options, "recipe.yaml");
  EXPECT_EQ(options.base_ms, 3);
  EXPECT_EQ(options.automatic.statistic, ExposureStatistic::kPercentile);
  ASSERT_EQ(options.jumps.size(), 2U);
  EXPECT_EQ(options.jumps[0].to_s, std::numeric_limits<double>::infinity());
  EXPECT_EQ(options.jumps[1].factor, 4);
  ASSERT_EQ(options.lights.size(), 1U);
  EXPECT_EQ(options.lights[0].group, "lamp");
  EXPECT_EQ(ErrorMessage(
                [&] { ReadOptions(YAML::Load("jumps:\n  - {from: 2}"), options, "recipe.yaml"); }),
            "recipe.yaml:2: unknown key 'from'");
}

template <class Change>
std::string MessageOf(Change change) {
  ExposureOptions options;
  change(options);
  return ErrorMessage([&] { ExposureControl(options, InverseResponse(256)); });
}

TEST(ExposureOptions, OutOfRangeAreErrorsThatNameKeyAndValue) {
  using O = ExposureOptions;
  EXPECT_EQ(MessageOf([](O&) {}), "no error");
  EXPECT_EQ(MessageOf([](O& o) { o.base_ms = -5; }), "base_ms: is -5; it has to be positive");
  EXPECT_EQ(MessageOf([](O& o) { o.base_ms = NAN; }), "base_ms: is nan; it has to be positive");
  EXPECT_EQ(MessageOf([](O& o) { o.base_ms = 50; }),
            "base_ms: is 50; it has to be from min_ms to max_ms");
  EXPECT_EQ(MessageOf([](O& o) { o.min_ms = 0; }), "min_ms: is 0; it has to be positive");
  EXPECT_EQ(MessageOf([](O& o) { o.min_ms = 30; }), "max_ms: is 20; it must not be below min_ms");
  EXPECT_EQ(MessageOf([](O& o) { o.automatic.target = 1; }),
            "automatic.target: is 1; it has to be between 0 and 1");
  EXPECT_EQ(MessageOf([](O& o) { o.automatic.percentile = 101; }),
            "automatic.percentile: is 101; it has to be from 0 to 100");
  EXPECT_EQ(MessageOf([](O& o) { o.automatic.time_constant_frames = -1; }),
            "automatic.time_constant_frames: is -1; it must not be negative");
  EXPECT_EQ(MessageOf([](O& o) {
              o.jumps = {{}, {2, 1, 1.}};
            }),
            "jumps[1]: begins at 2 s and ends at 1 s");
  EXPECT_EQ(MessageOf([](O& o) {
              o.jumps = {{0, 1, 0.}};
            }),
            "jumps[0].factor: is 0; it has to be positive");
}

TEST(LightSchedule, LightsAreAsTheSceneHasThemWithoutAChange) {
  EXPECT_THAT(LightSchedule({}, {"sun", "lamp"}).Strengths(3), ElementsAre(1, 1));
}

TEST(LightSchedule, SwitchesGroupsOffAndOnAgain) {
  const LightSchedule schedule({{"lamp", 2, 4, 0., 0.}}, {"sun", "lamp"});
  EXPECT_THAT(schedule.Strengths(1.99), ElementsAre(1, 1));
  EXPECT_THAT(schedule.Strengths(2), ElementsAre(1, 0));
  EXPECT_THAT(schedule.Strengths(3.99), ElementsAre(1, 0));
  EXPECT_THAT(schedule.Strengths(4), ElementsAre(1, 1));
}

TEST(LightSchedule, ChangesAlongRamps) {
  const LightSchedule schedule({{"lamp", 2, 4, 3., 0.5}}, {"lamp"});
  EXPECT_THAT(schedule.Strengths(2), ElementsAre(1));
  EXPECT_THAT(schedule.Strengths(2.25), ElementsAre(2));
  EXPECT_THAT(schedule.Strengths(2.5), ElementsAre(3));
  EXPECT_THAT(schedule.Strengths(4), ElementsAre(3));
  EXPECT_THAT(schedule.Strengths(4.125), ElementsAre(2.5));
  EXPECT_THAT(schedule.Strengths(5), ElementsAre(1));
}

TEST(LightSchedule, AChangeWithoutTimesHoldsThroughoutAndChangesMultiply) {
  const LightSchedule schedule({{.group = "sun", .strength = 0.5, .ramp_s = 1},
                                {.group = "sun", .from_s = 10, .strength = 0.5}},
                               {"lamp", "sun"});
  EXPECT_THAT(schedule.Strengths(0), ElementsAre(1, 0.5));
  EXPECT_THAT(schedule.Strengths(10), ElementsAre(1, 0.25));
}

TEST(LightSchedule, OutOfRangeIsAnErrorThatNamesTheChange) {
  const auto message = [](const LightChange& change) {
    return ErrorMessage([&] { LightSchedule({change}, {"sun", "lamp"}); });
  };
  EXPECT_EQ(message({.group = "moon"}), "lights[0].group: is 'moon'; the scene has sun, lamp");
  EXPECT_EQ(message({.group = "sun", .strength = -1}),
            "lights[0].strength: is -1; it must not be negative");
  EXPECT_EQ(message({.group = "sun", .ramp_s = -1}),
            "lights[0].ramp_s: is -1; it must not be negative");
  EXPECT_EQ(message({.group = "sun", .from_s = 3, .to_s = 2}),
            "lights[0]: begins at 3 s and ends at 2 s");
}

}  // namespace
}  // namespace sgf::synth
