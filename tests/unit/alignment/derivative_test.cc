#include <ceres/jet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unit/alignment/analytic_image.h>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/core/random.h>

namespace sgf::alignment {
namespace {

const Camera kCamera{.width = 400, .height = 300, .fx = 300, .fy = 310, .cx = 200, .cy = 150};

/// A warp with inputs around which its derivative is checked.
template <class Warp>
struct WarpCase;

template <>
struct WarpCase<TranslationWarp<double>> {
  static TranslationWarp<double> Make(uint64_t seed) {
    return {{60 + 80 * Uniform01(seed, 0), 60 + 80 * Uniform01(seed, 1)}};
  }
  static Vector2<double> Input(uint64_t seed) {
    return {6 * Uniform01(seed, 2) - 3, 6 * Uniform01(seed, 3) - 3};
  }
};

template <bool kScaled>
struct WarpCase<PlanarWarp<double, kScaled>> {
  static PlanarWarp<double, kScaled> Make(uint64_t seed) {
    return {{60 + 80 * Uniform01(seed, 0), 60 + 80 * Uniform01(seed, 1)},
            Uniform01(seed, 4) - 0.5,
            kScaled ? 0.6 * (Uniform01(seed, 5) - 0.5) : 0.0};
  }
  static Vector2<double> Input(uint64_t seed) {
    return WarpCase<TranslationWarp<double>>::Input(seed);
  }
};

SE3 Motion(uint64_t seed) {
  const auto u = [&](uint64_t k) { return Uniform01(seed, 10 + k) - 0.5; };
  return {ExpSO3({0.4 * u(0), 0.4 * u(1), 0.8 * u(2)}), {u(3), u(4), u(5)}};
}

Vector2<double> Ray(uint64_t seed) {
  return {0.6 * (Uniform01(seed, 2) - 0.5), 0.6 * (Uniform01(seed, 3) - 0.5)};
}

Vector2<double> Slope(uint64_t seed) {
  return {0.01 * (Uniform01(seed, 7) - 0.5), 0.01 * (Uniform01(seed, 8) - 0.5)};
}

template <>
struct WarpCase<Se3Warp<double>> {
  static Se3Warp<double> Make(uint64_t seed) { return {kCamera, Motion(seed)}; }
  static PixelAtDepth<double> Input(uint64_t seed) {
    return {Ray(seed), Uniform01(seed, 9), Slope(seed)};
  }
};

template <>
struct WarpCase<EpipolarWarp<double>> {
  static EpipolarWarp<double> Make(uint64_t seed) {
    return {kCamera, Motion(seed), 0.1 + 0.8 * Uniform01(seed, 9)};
  }
  static PixelAtDepth<double> Input(uint64_t seed) { return {Ray(seed), 0.02, Slope(seed)}; }
};

/// Residual at the warp moved by delta, epsilon held at its value at the unmoved warp, as the
/// derivatives hold it.
template <class Residual, class Warp, class Image>
auto ValueAt(const Image& image, Warp warp, const typename Warp::Input& input,
             const typename Residual::template Reference<double>& reference,
             const typename Warp::Parameters& delta) {
  typename Warp::Point before, after;
  warp.At(input, before);
  warp.Update(delta);
  warp.At(input, after);
  auto channels = image.Sample(after.pixel).value;
  channels[kEpsilon] *= before.A().squaredNorm() / after.A().squaredNorm();
  return Residual{}.template Value<double>(channels, after.A(), reference);
}

template <class T>
class WarpTest : public testing::Test {};
using Warps = testing::Types<TranslationWarp<double>, Se2Warp<double>, SimilarityWarp<double>,
                             Se3Warp<double>, EpipolarWarp<double>>;
TYPED_TEST_SUITE(WarpTest, Warps);

/// Median relative error of the analytic derivative over many places.
template <class Residual, class Warp, class Image>
double MedianError(const Image& image, double step) {
  constexpr int P = Warp::kParameters;
  std::vector<double> errors;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const Warp warp = WarpCase<Warp>::Make(seed);
    const auto input = WarpCase<Warp>::Input(seed);
    typename Warp::Point point;
    if (!warp.At(input, point) || !image.Inside(point.pixel)) continue;
    // A reference from elsewhere: residuals do not vanish.
    const Vector2<double> elsewhere(40 + 60 * Uniform01(seed, 30), 40 + 60 * Uniform01(seed, 31));
    const auto reference = Residual::template MakeReference<double>(image.Sample(elsewhere));
    Eigen::Matrix<double, Residual::kDim, P> J, numeric;
    Residual{}.Linearize(image.Sample(point.pixel), point, reference, J);
    for (int k = 0; k < P; ++k) {
      const typename Warp::Parameters delta = step * Warp::Parameters::Unit(k);
      numeric.col(k) = (ValueAt<Residual>(image, warp, input, reference, delta) -
                        ValueAt<Residual>(image, warp, input, reference, -delta)) /
                       (2 * step);
    }
    errors.push_back((J - numeric).norm() / (numeric.norm() + 1e-9));
  }
  EXPECT_GT(errors.size(), 40u);
  std::nth_element(errors.begin(), errors.begin() + errors.size() * 9 / 10, errors.end());
  return errors[errors.size() * 9 / 10];
}

/// body(residual) for every residual that compares pixels one by one through their samples.
template <class Body>
void ForEachPointResidual(const Body& body) {
  for (const ResidualInfo& info : AllResiduals())
    VisitResidual(info.name, [&](const auto& residual) {
      using Residual = std::remove_cvref_t<decltype(residual)>;
      if constexpr (std::is_same_v<typename Residual::Channels, SampleChannels> &&
                    kPointwise<Residual> && Residual::kExtraParameters == 0) {
        SCOPED_TRACE(std::string(info.name));
        body(residual);
      }
    });
}

TYPED_TEST(WarpTest, DerivativesAgreeWithDifferencesOnAnAnalyticImage) {
  ForEachPointResidual([](const auto& residual) {
    using Residual = std::remove_cvref_t<decltype(residual)>;
    EXPECT_LT((MedianError<Residual, TypeParam>(AnalyticImage{}, 1e-6)), 1e-5);
  });
}

}  // namespace
}  // namespace sgf::alignment
