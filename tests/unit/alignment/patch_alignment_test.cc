#include <map>
#include <set>

#include <gtest/gtest.h>
#include <unit/alignment/analytic_image.h>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>

namespace sgf::alignment {
namespace {

constexpr int kSize = 240;
const Vector2<double> kCentre(120, 120);

/// The analytic image seen through x = centre + (1 / scale) R(-angle) (u - centre - shift).
cv::Mat1f Transformed(double angle, double scale, const Vector2<double>& shift) {
  const AnalyticImage image;
  cv::Mat1f out(kSize, kSize);
  const Eigen::Matrix2d back = Eigen::Rotation2Dd(-angle).toRotationMatrix() / scale;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) {
      const Vector2<double> p = kCentre + back * (Vector2<double>(x, y) - kCentre - shift);
      out(y, x) = static_cast<float>(image.Intensity(p.x(), p.y()));
    }
  return out;
}

TEST(Pattern, HasItsPixels) {
  std::map<Pattern, std::set<std::pair<float, float>>> pixels;
  for (const auto& [name, pattern] : EnumNames(Pattern{}))
    for (const Eigen::Vector2f& offset : Offsets(pattern))
      EXPECT_TRUE(pixels[pattern].emplace(offset.x(), offset.y()).second) << name << " repeats";
  EXPECT_EQ(pixels[Pattern::kPoint].size(), 1u);
  EXPECT_EQ(pixels[Pattern::kDso8].size(), 8u);
  EXPECT_EQ(pixels[Pattern::kCross17].size(), 17u);
  EXPECT_EQ(pixels[Pattern::kSquare25].size(), 25u);
  EXPECT_EQ(pixels[Pattern::kBasalt52].size(), 52u);
}

/// Mean distance between found and true places of patches, as a vector: the bias.
template <class Warp, class Residual>
Vector2<double> Bias(const Residual& residual, double angle, double scale) {
  const Vector2<double> shift(1.3, -0.7);
  const SampleChannels before = MakeSampleChannels(Transformed(0, 1, {0, 0}), {});
  const SampleChannels after = MakeSampleChannels(Transformed(angle, scale, shift), {});
  const Eigen::Matrix2d forth = Eigen::Rotation2Dd(angle).toRotationMatrix() * scale;
  Vector2<double> sum(0, 0);
  int converged = 0;
  for (int y = 70; y <= 170; y += 10)
    for (int x = 70; x <= 170; x += 10) {
      const Vector2<double> centre(x, y);
      Patch<Residual, Warp> patch;
      const auto offset = [](const Vector2<double>& o) { return o; };
      if (!MakePatch(before, centre, Offsets(Pattern::kBasalt52), offset, patch)) continue;
      const Vector2<double> truth = kCentre + shift + forth * (centre - kCentre);
      Warp warp;
      warp.centre = truth + Vector2<double>(0.4, -0.3);
      if constexpr (Warp::kParameters >= 3) warp.angle = angle - 0.03;
      if constexpr (Warp::kParameters == 4) warp.log_scale = std::log(scale) + 0.03;
      AlignPatch(residual, after, patch, RobustKind::kHuber,
                 {.max_iterations = 60, .tolerance = 1e-9}, warp);
      if ((warp.centre - truth).norm() > 0.5) continue;
      sum += warp.centre - truth;
      ++converged;
    }
  EXPECT_GT(converged, 100);
  return sum / std::max(converged, 1);
}

/// Residuals that vanish where images agree; others have their minimum elsewhere.
template <class Body>
void ForEachExactResidual(const Body& body) {
  for (const ResidualInfo& info : AllResiduals())
    VisitResidual(info.name, [&](const auto& residual) {
      using Residual = std::remove_cvref_t<decltype(residual)>;
      if constexpr (kOfSamplesAlone<Residual>) {
        SCOPED_TRACE(std::string(info.name));
        if (info.name != "ngf" && info.name != "ugf") body(residual);
      }
    });
}

TEST(PatchAlignment, HasNoBiasUnderTwentyDegreesOfRoll) {
  ForEachExactResidual([](const auto& residual) {
    EXPECT_LT(Bias<Se2Warp<double>>(residual, 20 * M_PI / 180, 1).norm(), 0.01);
  });
}

TEST(PatchAlignment, HasNoBiasUnderAScaleOfOnePointThree) {
  ForEachExactResidual([](const auto& residual) {
    EXPECT_LT(Bias<SimilarityWarp<double>>(residual, 0.1, 1.3).norm(), 0.01);
  });
}

TEST(PatchAlignment, SaysWhenThePatchLeavesTheImage) {
  const SampleChannels image = MakeSampleChannels(Transformed(0, 1, {0, 0}), {});
  Patch<PointResidual<metrics::Ngv>, TranslationWarp<double>> patch;
  const auto offset = [](const Vector2<double>& o) { return o; };
  ASSERT_TRUE(MakePatch(image, kCentre, Offsets(Pattern::kDso8), offset, patch));
  TranslationWarp<double> warp{{-20, 100}};
  EXPECT_FALSE(AlignPatch(PointResidual<metrics::Ngv>{}, image, patch, RobustKind::kHuber, {}, warp)
                   .converged);
  EXPECT_FALSE(MakePatch(image, Vector2<double>(1, 1), Offsets(Pattern::kDso8), offset, patch));
}

}  // namespace
}  // namespace sgf::alignment
