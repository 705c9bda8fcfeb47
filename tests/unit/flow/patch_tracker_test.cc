#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/core/simd.h>
#include <sgf/flow/patch_tracker.h>

namespace sgf::flow::internal {
namespace {

using Eigen::Vector2f;

constexpr const char* kResiduals[] = {"lssd", "photo", "gm",  "gn",  "ugf",     "sgf",
                                      "sgf2", "sgf3",  "ngv", "sgv", "sgf3_vec"};
// The derivatives of as_extracted.h.
constexpr const char* kAsExtracted[] = {"sgf_as_extracted", "sgf2_as_extracted",
                                        "sgf3_as_extracted"};

// A texture with structure at all levels.
double Texture(double x, double y) {
  return 120 + 30 * std::sin(0.31 * x + 0.12 * y) + 25 * std::sin(-0.17 * x + 0.35 * y + 1) +
         22 * std::sin(0.07 * x - 0.05 * y + 2) + 20 * std::sin(0.03 * x + 0.08 * y + 3);
}

// The texture moved by (shift, angle) about a centre, with another brightness.
struct Motion {
  Vector2f shift = {0, 0};
  float angle = 0;
  double gain = 1, offset = 0;
  double shade_px = INFINITY;  // the gain's radius
};
const Vector2f kCentre(160, 120);

cv::Mat1b Render(const Motion& motion) {
  cv::Mat1b image(240, 320);
  const double c = std::cos(motion.angle), s = std::sin(motion.angle);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      const double dx = x - kCentre.x() - motion.shift.x(), dy = y - kCentre.y() - motion.shift.y();
      const double grey = Texture(kCentre.x() + c * dx + s * dy, kCentre.y() - s * dx + c * dy);
      const double gain = std::hypot(dx, dy) < motion.shade_px ? motion.gain : 1;
      image(y, x) = cv::saturate_cast<uint8_t>(gain * grey + motion.offset);
    }
  return image;
}

struct Found {
  bool found = false;
  PatchWarp warp;
};

Found TrackCentre(const TrackerOptions& options, const Motion& motion) {
  const auto tracker = MakePatchTracker(options);
  Pyramid first, second;
  tracker->MakePyramid(Render({}), first);
  tracker->MakePyramid(Render(motion), second);
  const auto patch = tracker->NewTemplate();
  Found result;
  result.warp.centre = kCentre;
  result.found = tracker->MakeTemplate(first, kCentre, options.levels, *patch) &&
                 tracker->Track(*patch, second, options.levels, result.warp);
  return result;
}

class OfEveryResidual : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Residuals, OfEveryResidual, testing::ValuesIn(kResiduals),
                         [](const auto& test) { return std::string(test.param); });

TEST_P(OfEveryResidual, FindsAMotionInThePlane) {
  const Motion motion{{6.3f, -4.6f}, 0.1f};
  const Found result = TrackCentre({.residual = GetParam(), .max_iterations = 15}, motion);
  ASSERT_TRUE(result.found);
  // ugf is less where gradients are stronger, so its minimum is not where patches are equal.
  const float most = std::string(GetParam()) == "ugf" ? 0.25f : 0.05f;
  EXPECT_LT((result.warp.centre - kCentre - motion.shift).norm(), most);
  EXPECT_NEAR(result.warp.angle, motion.angle, 0.01);
}

TEST_P(OfEveryResidual, HasTheSameBitsForEveryInstructionSet) {
  const Motion motion{{3.2f, 1.7f}, -0.05f};
  const Found expected = TrackCentre({.residual = GetParam()}, motion);
  ASSERT_TRUE(expected.found);
  for (const std::string& isa : SimdTargets()) {
    SCOPED_TRACE(isa);
    RestrictSimd(isa);
    const Found result = TrackCentre({.residual = GetParam()}, motion);
    EXPECT_EQ(result.warp.centre, expected.warp.centre);
    EXPECT_EQ(result.warp.angle, expected.warp.angle);
  }
  RestrictSimd("");
}

TEST(PatchTracker, FollowsADarkerImageWhereTheResidualIgnoresGain) {
  const Motion darker{{2.4f, 1.3f}, 0, 0.6};
  const auto error = [&](const char* residual) {
    const Found result = TrackCentre({.residual = residual, .max_iterations = 15}, darker);
    return result.found ? (result.warp.centre - kCentre - darker.shift).norm() : 1e3f;
  };
  for (const char* residual : {"lssd", "ngv", "sgv", "sgf", "sgf3", "sgf3_vec"})
    EXPECT_LT(error(residual), 0.1f) << residual;
  EXPECT_GT(error("photo"), 0.3f);
}

TEST(PatchTracker, BearsAShadeWhereGradientsAreNormalisedAroundThePatch) {
  const Motion shaded{{2.4f, 1.3f}, 0, 0.25, 0, 70};
  const auto error = [&](metrics::EpsilonScope scope) {
    TrackerOptions options{.residual = "ngv", .levels = 2, .max_iterations = 15};
    options.image.epsilon.scope = scope;
    const Found result = TrackCentre(options, shaded);
    return result.found ? (result.warp.centre - kCentre - shaded.shift).norm() : 1e3f;
  };
  const float image = error(metrics::EpsilonScope::kImage);
  EXPECT_LT(error(metrics::EpsilonScope::kTile), 0.5f * image);
  EXPECT_LT(error(metrics::EpsilonScope::kWindow), 0.5f * image);
}

TEST(PatchTracker, TracksWithEveryPattern) {
  const Motion motion{{1.2f, -0.7f}, 0};
  for (const auto& [name, pattern] : EnumNames(alignment::Pattern{})) {
    if (pattern == alignment::Pattern::kPoint) continue;  // has no angle
    const Found result =
        TrackCentre({.residual = "ngv", .pattern = pattern, .max_iterations = 15}, motion);
    ASSERT_TRUE(result.found) << name;
    // Grey levels are rounded: eight pixels leave more of that than 52.
    EXPECT_LT((result.warp.centre - kCentre - motion.shift).norm(), 0.15f) << name;
  }
}

TEST(PatchTracker, RefusesPatchesWithoutStructure) {
  const cv::Mat1b flat(240, 320, uint8_t(90));
  cv::Mat1b edge(240, 320, uint8_t(40));
  edge.colRange(160, 320) = 200;
  for (const char* residual : kResiduals)
    for (const cv::Mat1b& image : {flat, edge}) {
      const auto tracker = MakePatchTracker({.residual = residual});
      Pyramid pyramid;
      tracker->MakePyramid(image, pyramid);
      const auto patch = tracker->NewTemplate();
      EXPECT_FALSE(tracker->MakeTemplate(pyramid, kCentre, 4, *patch)) << residual;
    }
}

TEST(PatchTracker, KeepsPatchesWholeInView) {
  const auto tracker = MakePatchTracker({});
  Pyramid pyramid;
  tracker->MakePyramid(Render({}), pyramid);
  const auto patch = tracker->NewTemplate();
  EXPECT_FALSE(tracker->MakeTemplate(pyramid, {5, 120}, 4, *patch));
  EXPECT_FALSE(tracker->MakeTemplate(pyramid, {160, 236}, 4, *patch));
  EXPECT_FALSE(tracker->MakeTemplate(pyramid, {NAN, 120}, 4, *patch));
  ASSERT_TRUE(tracker->MakeTemplate(pyramid, {12, 120}, 4, *patch));
  PatchWarp warp;
  warp.centre = {-40, 120};
  EXPECT_FALSE(tracker->Track(*patch, pyramid, 4, warp));
}

TEST(PatchTracker, FindsTheLikeliestOfSeveralPlaces) {
  const auto tracker = MakePatchTracker({.residual = "ngv"});
  Pyramid pyramid;
  tracker->MakePyramid(Render({}), pyramid);
  const auto patch = tracker->NewTemplate();
  ASSERT_TRUE(tracker->MakeTemplate(pyramid, kCentre, 4, *patch));
  const std::vector<Vector2f> places = {{-50, 120}, {100, 120}, {162, 121}, {220, 100}};
  EXPECT_EQ(tracker->Likeliest(*patch, pyramid, places), places[2]);
}

TEST(PatchTracker, TakesResidualsOfSamplesAlone) {
  for (const char* residual : kResiduals) EXPECT_TRUE(CanTrack(residual)) << residual;
  for (const char* residual : kAsExtracted) EXPECT_TRUE(CanTrack(residual)) << residual;
  for (const char* residual : {"photo_affine", "bit_planes", "ngf", "sad"})
    EXPECT_FALSE(CanTrack(residual)) << residual;
  EXPECT_THAT(ErrorMessage([] { CanTrack("nonsense"); }), testing::HasSubstr("nonsense"));
}

}  // namespace
}  // namespace sgf::flow::internal
