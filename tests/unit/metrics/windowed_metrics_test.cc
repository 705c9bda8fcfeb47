#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/core/error.h>

#include "unit/metrics/fields.h"

namespace sgf::metrics {
namespace {

using testing::Field;
using testing::RandomTexture;
using Window = std::vector<Sample<double>>;
using Span = std::span<const Sample<double>>;

Window Mapped(const Window& window, double gain, double offset) {
  Window mapped;
  for (const auto& s : window)
    mapped.push_back(MakeSample<double>(gain * s.intensity + offset, gain * s.gx, gain * s.gy, 30));
  return mapped;
}

Window TextureWindow(unsigned seed) { return Field(RandomTexture(9, 9, seed)).Window(2, 2, 5); }

template <class M>
class WindowedMetricTest : public ::testing::Test {};
using WindowMetricTypes = ::testing::Types<Gom, Ncc, Zncc>;
TYPED_TEST_SUITE(WindowedMetricTest, WindowMetricTypes, testing::MetricTestName);

TYPED_TEST(WindowedMetricTest, SlidesToTheValueOfTheWindow) {
  const Field i(RandomTexture(1, 40, 1)), j(RandomTexture(1, 40, 2));
  using Sums = typename TypeParam::template Sums<double>;
  const auto one = [&](int x) {
    Sums sums;
    sums.Add(i.samples[x], j.samples[x]);
    return sums;
  };
  Sums sliding;
  for (int x = 0; x < 40; ++x) {
    sliding += one(x);
    if (x >= 7) sliding -= one(x - 7);
    if (x < 6) continue;
    const Span window_i(i.samples.data() + x - 6, 7), window_j(j.samples.data() + x - 6, 7);
    EXPECT_NEAR(TypeParam{}.Value(sliding), TypeParam{}(window_i, window_j), 1e-12);
  }
}

TYPED_TEST(WindowedMetricTest, WithoutInformationHasTheValueOneAndNoSlope) {
  const Window black(25, MakeSample<double>(0, 0, 0, 30)), texture = TextureWindow(1);
  for (const auto& [i, j] :
       {std::pair(black, black), std::pair(black, texture), std::pair(texture, black)}) {
    EXPECT_EQ(TypeParam{}(Span(i), Span(j)), 1);
    typename TypeParam::template Sums<double> sums;
    for (size_t k = 0; k < i.size(); ++k) sums.Add(i[k], j[k]);
    const auto derivative = TypeParam{}.Derivative(sums, i[3], j[3]);
    EXPECT_EQ(derivative.intensity.norm() + derivative.gradient.norm(), 0);
  }
  EXPECT_EQ(TypeParam{}.Value(typename TypeParam::template Sums<double>{}), 1);
}

TYPED_TEST(WindowedMetricTest, RejectsWindowsThatDoNotPair) {
  const Window texture = TextureWindow(1);
  const Span whole(texture);
  try {
    TypeParam{}(whole, whole.first(24));
    FAIL() << "accepted windows of different sizes";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              std::string(TypeParam::kInfo.name) + ": windows of 25 and 24 pixels");
  }
  EXPECT_THROW(TypeParam{}(whole.first(0), whole.first(0)), Error);
}

// Flat windows of intensities whose sums are rounded.
template <class T>
void ExpectFlatWindowsToBeFlat() {
  std::vector<Sample<T>> texture;
  for (const Sample<double>& s : TextureWindow(1))
    texture.push_back(MakeSample<T>(static_cast<T>(s.intensity), 0, 0, 30));
  for (int level = 1; level < 256; ++level) {
    const T intensity = static_cast<T>(level) / T(7);
    const std::vector<Sample<T>> grey(25, MakeSample<T>(intensity, 0, 0, 30));
    const std::span<const Sample<T>> i(grey), j(texture);
    EXPECT_EQ(Zncc{}(i, i), 1) << intensity;
    EXPECT_EQ(Zncc{}(i, j), 1) << intensity;
    EXPECT_EQ(Zncc{}(j, i), 1) << intensity;
  }
}

TEST(Zncc, TakesFlatWindowsForFlatDespiteRounding) {
  ExpectFlatWindowsToBeFlat<double>();
  ExpectFlatWindowsToBeFlat<float>();
}

TEST(Zncc, SeesTheFaintestTextureOfAnEightBitImage) {
  Window faint(81, MakeSample<double>(255, 0, 0, 30));
  faint[40].intensity = 254;
  EXPECT_NEAR(Zncc{}(Span(faint), Span(faint)), 0, 1e-9);
}

TEST(WindowedMetrics, SpanTheirRanges) {
  const Window texture = TextureWindow(1);
  const Window negative = Mapped(texture, -1, 255);
  EXPECT_NEAR(Zncc{}(Span(texture), Span(negative)), 2, 1e-12);
  EXPECT_NEAR(Gom{}(Span(texture), Span(negative)), 0, 1e-12);
  Window turned = texture;
  for (auto& s : turned) s = MakeSample<double>(s.intensity, -s.gy, s.gx, 30);
  EXPECT_EQ(Gom{}(Span(texture), Span(turned)), 1);
}

TEST(Ncc, OfAHandComputedWindow) {
  const auto grey = [](double v) { return MakeSample<double>(v, 0, 0, 30); };
  const Window i = {grey(3), grey(4)}, j = {grey(4), grey(3)};
  EXPECT_DOUBLE_EQ(Ncc{}(Span(i), Span(j)), 1 - 24.0 / 25);
  EXPECT_DOUBLE_EQ(Zncc{}(Span(i), Span(j)), 2);
}

TEST(Lssd, DividesByTheMean) {
  const auto grey = [](double v) { return MakeSample<double>(v, 0, 0, 30); };
  const Window i = {grey(1), grey(3)}, j = {grey(5), grey(5)}, black = {grey(0), grey(0)};
  EXPECT_EQ(Lssd{}(Span(i), Span(j)), Eigen::Vector2d(-0.5, 0.5));
  EXPECT_EQ(Lssd{}(Span(black), Span(j)), Eigen::Vector2d(-1, -1));
  EXPECT_EQ(Lssd{}.Jacobian(Span(black)), Eigen::Matrix2d::Identity());
  EXPECT_THROW(Lssd{}(Span(i), Span(j).first(1)), Error);
  EXPECT_THROW(Lssd{}(Span{}, Span{}), Error);
}

}  // namespace
}  // namespace sgf::metrics
