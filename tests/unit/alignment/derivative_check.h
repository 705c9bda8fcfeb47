#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <sgf/alignment/patch_alignment.h>
#include <sgf/alignment/residual_table.h>
#include <sgf/core/random.h>

/// Patches at random places under random warps, and the derivatives of their residuals.
namespace sgf::alignment {

/// A camera for images of a size, px.
inline Camera CameraFor(int width, int height) {
  return {.width = width,
          .height = height,
          .fx = 0.75 * width,
          .fy = 0.78 * width,
          .cx = 0.5 * width,
          .cy = 0.5 * height};
}

/// A place in the middle of an image, px.
inline Vector2<double> PlaceIn(const Camera& camera, uint64_t seed) {
  return {camera.width * (0.2 + 0.6 * Uniform01(seed, 0)),
          camera.height * (0.2 + 0.6 * Uniform01(seed, 1))};
}

inline SE3 RandomMotion(uint64_t seed) {
  const auto u = [&](uint64_t k) { return Uniform01(seed, 10 + k) - 0.5; };
  return {ExpSO3({0.4 * u(0), 0.4 * u(1), 0.8 * u(2)}), {u(3), u(4), u(5)}};
}

/// A warp at random, and what it takes for the pixel `offset` (px) from the patch's centre.
template <class Warp>
struct WarpCase;

template <>
struct WarpCase<TranslationWarp<double>> {
  static TranslationWarp<double> Make(const Camera& camera, uint64_t seed) {
    return {PlaceIn(camera, seed)};
  }
  static Vector2<double> Input(const Camera& /*camera*/, uint64_t /*seed*/,
                               const Vector2<double>& offset) {
    return offset;
  }
};

template <bool kScaled>
struct WarpCase<PlanarWarp<double, kScaled>> : WarpCase<TranslationWarp<double>> {
  static PlanarWarp<double, kScaled> Make(const Camera& camera, uint64_t seed) {
    return {PlaceIn(camera, seed), Uniform01(seed, 4) - 0.5,
            kScaled ? 0.6 * (Uniform01(seed, 5) - 0.5) : 0.0};
  }
};

/// A pixel of a slanted patch.
inline PixelAtDepth<double> SlantedPixel(const Camera& camera, uint64_t seed, double inverse_depth,
                                         const Vector2<double>& offset) {
  const auto u = [&](uint64_t k) { return Uniform01(seed, k) - 0.5; };
  const Vector2<double> slope(0.01 * u(7), 0.01 * u(8));
  return {{0.6 * u(2) + offset.x() / camera.fx, 0.6 * u(3) + offset.y() / camera.fy},
          inverse_depth + slope.dot(offset),
          slope};
}

template <>
struct WarpCase<Se3Warp<double>> {
  static Se3Warp<double> Make(const Camera& camera, uint64_t seed) {
    return {camera, RandomMotion(seed)};
  }
  static PixelAtDepth<double> Input(const Camera& camera, uint64_t seed,
                                    const Vector2<double>& offset) {
    return SlantedPixel(camera, seed, 0.1 + 0.8 * Uniform01(seed, 9), offset);
  }
};

template <>
struct WarpCase<EpipolarWarp<double>> {
  static EpipolarWarp<double> Make(const Camera& camera, uint64_t seed) {
    return {camera, RandomMotion(seed), 0.1 + 0.8 * Uniform01(seed, 9)};
  }
  static PixelAtDepth<double> Input(const Camera& camera, uint64_t seed,
                                    const Vector2<double>& offset) {
    return SlantedPixel(camera, seed, 0, offset);
  }
};

/// A warp with all parameters of a point between two key-frames, whose camera has changed since the
/// rays were made.
struct WindowWarp : Se3DepthCameraWarp<double> {
  Camera of_rays, camera;

  WindowWarp(const Camera& camera_in, const SE3& T_cur_ref, double inverse_depth,
             const Camera& of_rays_in)
      : Se3DepthCameraWarp(camera_in, T_cur_ref, inverse_depth, of_rays_in),
        of_rays(of_rays_in),
        camera(camera_in) {}

  void Update(const Eigen::Matrix<double, 11, 1>& delta) {
    Se3DepthWarp<double> next = moved;
    next.Update(delta.head<7>());
    Camera changed = camera;
    changed.fx += delta(7);
    changed.fy += delta(8);
    changed.cx += delta(9);
    changed.cy += delta(10);
    *this = {changed, next.motion.T_cur_ref, next.inverse_depth, of_rays};
  }
};

template <>
struct WarpCase<WindowWarp> : WarpCase<EpipolarWarp<double>> {
  static WindowWarp Make(const Camera& camera, uint64_t seed) {
    Camera changed = camera;
    changed.fx *= 1.03;
    changed.fy *= 0.98;
    changed.cx += 2;
    changed.cy -= 3;
    return {changed, RandomMotion(seed), 0.1 + 0.8 * Uniform01(seed, 9), camera};
  }
};

/// A patch of a few pixels that do not look like where the warp finds them: nothing vanishes.
/// @return whether it lies inside the image, there and here.
template <class Residual, class Warp, class Image>
bool RandomPatch(const Image& image, const Camera& camera, const Warp& warp, uint64_t seed,
                 Patch<Residual, Warp>& patch) {
  std::vector<Eigen::Vector2f> offsets;
  for (uint64_t k = 0; k < 4; ++k)
    offsets.emplace_back(6 * Uniform01(seed, 20 + k) - 3, 6 * Uniform01(seed, 30 + k) - 3);
  const auto input_of = [&](const Vector2<double>& offset) {
    return WarpCase<Warp>::Input(camera, seed, offset);
  };
  const Vector2<double> elsewhere = PlaceIn(camera, seed + 1000);
  WarpedPatch<Warp> points;
  return MakePatch(image, elsewhere, offsets, input_of, patch) &&
         WarpPatch(image, warp, patch.Inputs(), points);
}

/// Parameters of a warp and of a residual, in this order.
template <class Residual, class Warp>
inline constexpr int kAllParameters = Warp::kParameters + Residual::kExtraParameters;

template <class Residual>
constexpr bool kOfSamples = std::is_same_v<typename Residual::Channels, SampleChannels>;

/// The closed-form derivative of a patch's residuals, one above the other.
template <class Residual, class Warp, class Image>
Eigen::MatrixXd Jacobian(const Residual& residual, const Image& image, const Warp& warp,
                         const Patch<Residual, Warp>& patch) {
  constexpr int kDim = Residual::kDim;
  Eigen::MatrixXd jacobian(kDim * patch.size, kAllParameters<Residual, Warp>);
  LinearizePatch<double>(
      residual, image, warp, patch.Inputs(), patch.References(),
      [&](size_t k, const auto& /*r*/, const auto& J) { jacobian.middleRows<kDim>(kDim * k) = J; });
  return jacobian;
}

/// Residuals of a patch after a change of the parameters, with epsilon as it was before: the
/// derivatives hold it constant.
template <class Residual, class Warp, class Image>
Eigen::VectorXd ResidualsAfter(
    const Eigen::Matrix<double, kAllParameters<Residual, Warp>, 1>& delta, Residual residual,
    const Image& image, const Warp& before, const Patch<Residual, Warp>& patch) {
  Warp after = before;
  after.Update(delta.template head<Warp::kParameters>());
  if constexpr (Residual::kExtraParameters > 0) residual.Update(delta.template tail<2>());
  Eigen::VectorXd residuals(Residual::kDim * patch.size);
  const auto put = [&](size_t k, const auto& r) {
    residuals.segment<Residual::kDim>(Residual::kDim * k) = r;
  };
  if constexpr (!kPointwise<Residual>) {
    EvaluatePatch<double>(residual, image, after, patch.Inputs(), patch.References(), put);
    return residuals;
  } else {
    for (size_t k = 0; k < patch.size; ++k) {
      typename Warp::Point from, to;
      before.At(patch.inputs[k], from);
      after.At(patch.inputs[k], to);
      auto channels = image.Sample(to.pixel).value;
      if constexpr (kOfSamples<Residual>)
        channels[kEpsilon] *= from.A().squaredNorm() / to.A().squaredNorm();
      put(k, residual.template Value<double>(channels, to.A(), patch.references[k]));
    }
    return residuals;
  }
}

/// Whether the pixels of a patch stay between the same four pixels of the image: at the border the
/// derivative of a bilinear interpolation jumps.
template <class Warp, class Inputs>
bool StaysBetweenPixels(const Warp& before, const Warp& after, const Inputs& inputs) {
  const auto cell = [](const Warp& warp, const auto& input) {
    typename Warp::Point point;
    warp.At(input, point);
    return Eigen::Vector2d(point.pixel.array().floor());
  };
  return std::all_of(inputs.begin(), inputs.end(),
                     [&](const auto& input) { return cell(before, input) == cell(after, input); });
}

/// Central differences for all parameters; empty where a step crosses a pixel's border.
template <class Residual, class Warp, class Image>
Eigen::MatrixXd NumericJacobian(const Residual& residual, const Image& image, const Warp& warp,
                                const Patch<Residual, Warp>& patch, double step) {
  constexpr int P = kAllParameters<Residual, Warp>;
  Eigen::MatrixXd jacobian(Residual::kDim * patch.size, P);
  for (int k = 0; k < P; ++k) {
    const Eigen::Matrix<double, P, 1> delta = step * Eigen::Matrix<double, P, 1>::Unit(k);
    for (const double side : {-1, 1}) {
      Warp moved = warp;
      moved.Update(side * delta.template head<Warp::kParameters>());
      if (!StaysBetweenPixels(warp, moved, patch.Inputs())) return {};
    }
    jacobian.col(k) = (ResidualsAfter(delta, residual, image, warp, patch) -
                       ResidualsAfter(-delta, residual, image, warp, patch)) /
                      (2 * step);
  }
  return jacobian;
}

/// body(residual) for every residual in the table, with parameters at which none is trivial.
template <class Body>
void ForEachResidual(const Body& body) {
  for (const ResidualInfo& info : AllResiduals())
    VisitResidual(info.name, [&](auto residual) {
      SCOPED_TRACE(std::string(info.name));
      if constexpr (std::is_same_v<decltype(residual), AffinePhotoResidual>)
        residual = {.alpha = 0.3, .beta = -7};
      if constexpr (std::is_same_v<decltype(residual), PointResidual<metrics::Pm>>)
        residual.metric = {.alpha = 0.9, .tau_c = 60, .tau_g = 20};  // some of both parts truncated
      body(residual);
    });
}

/// body(warp, patch) for some patches of an image that are in view.
template <class Warp, class Residual, class Image, class Body>
void ForSomePatches(const Residual& /*residual*/, const Image& image, const Camera& camera,
                    const Body& body) {
  int patches = 0;
  for (uint64_t seed = 0; seed < 500 && patches < 40; ++seed) {
    const Warp warp = WarpCase<Warp>::Make(camera, seed);
    Patch<Residual, Warp> patch;
    if (!RandomPatch(image, camera, warp, seed, patch)) continue;
    body(warp, patch);
    ++patches;
  }
  EXPECT_EQ(patches, 40);
}

/// Expects closed forms and central differences to agree, but for the few patches in which a step
/// crosses a kink of the residual.
template <class Warp, class Residual, class Image>
void ExpectAgreementWithDifferences(const Residual& residual, const Image& image,
                                    const Camera& camera) {
  constexpr double kStep = 1e-6;
  std::vector<double> errors;
  ForSomePatches<Warp>(residual, image, camera, [&](const Warp& warp, const auto& patch) {
    const Eigen::MatrixXd numeric = NumericJacobian(residual, image, warp, patch, kStep);
    if (numeric.size() == 0) return;
    errors.push_back((Jacobian(residual, image, warp, patch) - numeric).norm() /
                     (numeric.norm() + 1e-9));
  });
  ASSERT_GE(errors.size(), 30u);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() * 9 / 10], 1e-5);
}

/// The same for every residual on a picture as alignment has it: in interpolated pixels.
template <class Warp>
void ExpectAgreementOnPicture(const cv::Mat& picture) {
  const SampleChannels samples = MakeSampleChannels(picture, {});
  BitPlanes planes;
  MakeBitPlanes(picture, planes);
  const Camera camera = CameraFor(picture.cols, picture.rows);
  ForEachResidual([&](const auto& residual) {
    if constexpr (kOfSamples<std::remove_cvref_t<decltype(residual)>>)
      ExpectAgreementWithDifferences<Warp>(residual, samples, camera);
    else
      ExpectAgreementWithDifferences<Warp>(residual, planes, camera);
  });
}

template <class T>
class WarpTest : public testing::Test {};
using Warps = testing::Types<TranslationWarp<double>, Se2Warp<double>, SimilarityWarp<double>,
                             Se3Warp<double>, EpipolarWarp<double>, WindowWarp>;
TYPED_TEST_SUITE(WarpTest, Warps);

}  // namespace sgf::alignment
