#include <array>
#include <type_traits>
#include <vector>

#include <fmt/core.h>

#include <sgf/alignment/residual_table.h>
#include <sgf/alignment/robust.h>
#include <sgf/alignment/solver.h>
#include <sgf/core/error.h>
#include <sgf/direct/window_patches.h>

namespace sgf::direct {
namespace {

using alignment::Pattern, alignment::SampleChannels;

constexpr alignment::RobustLoss<float> kLoss{alignment::RobustKind::kHuber, 1};

template <class Residual, bool kRefinesCamera>
class WindowPatchesOf : public WindowPatches {
  using CameraWarp = alignment::Se3DepthCameraWarp<float>;
  using Warp = std::conditional_t<kRefinesCamera, CameraWarp, alignment::Se3DepthWarp<float>>;
  using Point = typename Warp::Point;
  using PatchArray = Eigen::Array<float, kPatchPixels, 1>;
  using Reference = typename Residual::template Reference<float>;
  static constexpr int kDim = Residual::kDim;
  static constexpr bool kBrightness = Residual::kExtraParameters == 2;
  static constexpr int kParameters = Warp::kParameters + Residual::kExtraParameters;

  struct Patch {
    PatchArray ray_x, ray_y;
    std::array<Reference, kPatchPixels> references;
  };

 public:
  explicit WindowPatchesOf(const Camera& camera) : camera_(camera) {}

  void Clear() override { patches_.clear(); }

  void Add(const SampleChannels& host, const Eigen::Vector2f& pixel) override {
    Patch& patch = patches_.emplace_back();
    const auto offsets = alignment::Offsets(Pattern::kDso8);
    for (int k = 0; k < kPatchPixels; ++k) {
      const auto ray = alignment::RayOf<float>(camera_, pixel + offsets[k]);
      patch.ray_x(k) = ray.x();
      patch.ray_y(k) = ray.y();
      patch.references[k] =
          Residual::template MakeReference<float>(host.Sample<float>(pixel + offsets[k]));
    }
  }

  int SquaredNorms(int index, double inverse_depth, const KeyframePair& pair,
                   const SampleChannels& image,
                   std::span<float, kPatchPixels> norms) const override {
    const Patch& patch = patches_[index];
    const Residual residual = ResidualOf(pair);
    int count = 0;
    for (int k = 0; k < kPatchPixels; ++k) {
      Point point;
      if (!WarpOf(pair.now).At(InputOf(patch, k, inverse_depth), point) ||
          !image.Inside(point.pixel))
        continue;
      norms[count++] =
          residual.template Value<float>(image.Value(point.pixel), point.A(), patch.references[k])
              .squaredNorm();
    }
    return count;
  }

  std::optional<double> Cost(int index, double inverse_depth, const KeyframePair& pair,
                             const SampleChannels& image, double scale) const override {
    const Patch& patch = patches_[index];
    Places places;
    if (!FindPlaces(patch, inverse_depth, pair, image, places)) return std::nullopt;
    const Residual residual = ResidualOf(pair);
    const auto inverse_scale = static_cast<float>(1 / scale);
    float cost = 0;
    for (int k = 0; k < kPatchPixels; ++k)
      cost += kLoss.Rho(
          (inverse_scale * residual.template Value<float>(
                               image.Value(places[k]), DerivativeAt(patch, k, inverse_depth, pair),
                               patch.references[k]))
              .squaredNorm());
    return cost;
  }

  std::optional<double> Linearize(int index, double inverse_depth, const KeyframePair& pair,
                                  const SampleChannels& image, double scale,
                                  RelativeEquations& equations) const override {
    const Patch& patch = patches_[index];
    Places places;
    if (!FindPlaces(patch, inverse_depth, pair, image, places)) return std::nullopt;
    const Residual residual = ResidualOf(pair);
    const auto inverse_scale = static_cast<float>(1 / scale);
    alignment::NormalEquations<float, kParameters> sum;
    float cost = 0;
    for (int k = 0; k < kPatchPixels; ++k) {
      Point linear;
      if (!WarpOf(pair.linear).At(InputOf(patch, k, inverse_depth), linear)) return std::nullopt;
      const auto at = image.Sample(places[k]);
      const Eigen::Matrix<float, kDim, 1> r =
          inverse_scale *
          residual.template Value<float>(at.value, DerivativeAt(patch, k, inverse_depth, pair),
                                         patch.references[k]);
      Eigen::Matrix<float, kDim, kParameters> J;
      residual.Linearize(at, linear, patch.references[k], J);
      const float s = r.squaredNorm();
      cost += kLoss.Rho(s);
      sum.Add(r, inverse_scale * J, kLoss.Weight(s));
    }
    Expand(sum, equations);
    return cost;
  }

  int dim() const override { return kDim; }
  double least_scale() const override {
    constexpr double kRounding = 0.3;        // grey levels: 1 / sqrt(12)
    constexpr double kDimensionless = 1e-3;  // of residuals that are about 1 where nothing fits
    return kBrightness ? kRounding : kDimensionless;
  }
  bool has_brightness() const override { return kBrightness; }

 private:
  static const Warp& WarpOf(const CameraWarp& warp) {
    if constexpr (kRefinesCamera)
      return warp;
    else
      return warp.moved;
  }

  static Residual ResidualOf(const KeyframePair& pair) {
    Residual residual;
    if constexpr (kBrightness) {
      residual.alpha = pair.brightness.alpha;
      residual.beta = pair.brightness.beta;
    }
    return residual;
  }

  static typename Warp::Input InputOf(const Patch& patch, int k, double inverse_depth) {
    return {{patch.ray_x(k), patch.ray_y(k)},
            static_cast<float>(inverse_depth),
            alignment::Vector2<float>::Zero()};
  }

  using Places = std::array<alignment::Vector2<float>, kPatchPixels>;

  /// Where a patch's pixels are now: Warp::At() for all at once, without derivatives.
  /// @return whether all of them are in view.
  static bool FindPlaces(const Patch& patch, double inverse_depth, const KeyframePair& pair,
                         const SampleChannels& image, Places& places) {
    const CameraWarp& warp = pair.now;
    const auto& to = warp.moved.motion.projector;
    const alignment::Vector3<float> shift = static_cast<float>(inverse_depth) * to.p + to.R.col(2);
    const PatchArray ray_x = patch.ray_x * warp.ray_scale.x() + warp.ray_shift.x();
    const PatchArray ray_y = patch.ray_y * warp.ray_scale.y() + warp.ray_shift.y();
    const PatchArray z = to.R(2, 0) * ray_x + to.R(2, 1) * ray_y + shift.z();
    if (!(z.minCoeff() > 1e-3f)) return false;
    const PatchArray x = to.fx * (to.R(0, 0) * ray_x + to.R(0, 1) * ray_y + shift.x()) / z + to.cx;
    const PatchArray y = to.fy * (to.R(1, 0) * ray_x + to.R(1, 1) * ray_y + shift.y()) / z + to.cy;
    for (int k = 0; k < kPatchPixels; ++k) {
      places[k] = {x(k), y(k)};
      if (!image.Inside(places[k])) return false;
      image.Prefetch(places[k]);
    }
    return true;
  }

  /// Derivative of the place by the pixel of the host, where the residual asks for it.
  static Eigen::Matrix2f DerivativeAt(const Patch& patch, int k, double inverse_depth,
                                      const KeyframePair& pair) {
    if constexpr (kBrightness) return Eigen::Matrix2f::Identity();  // intensities have none
    Point point;
    if (!WarpOf(pair.now).At(InputOf(patch, k, inverse_depth), point))
      return Eigen::Matrix2f::Identity();
    return point.A();
  }

  /// From the parameters that play a part, brightness last, to all.
  static void Expand(const alignment::NormalEquations<float, kParameters>& sum,
                     RelativeEquations& equations) {
    equations.H.setZero();
    equations.b.setZero();
    const auto H = sum.H();
    const auto b = sum.b();
    constexpr int m = kRelativeBrightness;  // pose and depth, at the same place in both
    equations.H.template topLeftCorner<m, m>() = H.template topLeftCorner<m, m>();
    equations.b.template head<m>() = b.template head<m>();
    const auto put = [&]<int kFrom, int kTo, int kSize>() {
      equations.b.template segment<kSize>(kTo) = b.template segment<kSize>(kFrom);
      equations.H.template block<kSize, kSize>(kTo, kTo) =
          H.template block<kSize, kSize>(kFrom, kFrom);
      equations.H.template block<m, kSize>(0, kTo) = H.template block<m, kSize>(0, kFrom);
      equations.H.template block<kSize, m>(kTo, 0) = H.template block<kSize, m>(kFrom, 0);
    };
    constexpr int kLast = Warp::kParameters;
    if constexpr (kBrightness) put.template operator()<kLast, kRelativeBrightness, 2>();
    if constexpr (kRefinesCamera) {
      put.template operator()<m, kRelativeCamera, 4>();
      equations.H.template block<2, 4>(kRelativeBrightness, kRelativeCamera) =
          H.template block<2, 4>(kLast, m);
      equations.H.template block<4, 2>(kRelativeCamera, kRelativeBrightness) =
          H.template block<4, 2>(m, kLast);
    }
  }

  Camera camera_;
  std::vector<Patch> patches_;
};

template <class Residual>
constexpr bool kOfWindows =
    std::is_same_v<typename Residual::Channels, SampleChannels>&& alignment::kPointwise<Residual>;

/// The camera is refined where intensities are compared: code for all residuals would double the
/// library.
template <class Residual>
constexpr bool kRefinesCameras = std::is_same_v<Residual, alignment::AffinePhotoResidual>;

}  // namespace

bool HasWindowPatches(const std::string& name, bool refines_camera) {
  bool has = false;
  alignment::VisitResidual(name, [&](const auto& residual) {
    using Residual = std::remove_cvref_t<decltype(residual)>;
    has = kOfWindows<Residual> && (!refines_camera || kRefinesCameras<Residual>);
  });
  return has;
}

std::unique_ptr<WindowPatches> MakeWindowPatches(const std::string& name, const Camera& camera,
                                                 bool refines_camera) {
  if (!HasWindowPatches(name, refines_camera))
    throw Error("window.residual", fmt::format("'{}' cannot refine a window", name));
  std::unique_ptr<WindowPatches> patches;
  alignment::VisitResidual(name, [&](const auto& residual) {
    using Residual = std::remove_cvref_t<decltype(residual)>;
    if constexpr (kRefinesCameras<Residual>)
      if (refines_camera) patches = std::make_unique<WindowPatchesOf<Residual, true>>(camera);
    if constexpr (kOfWindows<Residual>)
      if (!patches) patches = std::make_unique<WindowPatchesOf<Residual, false>>(camera);
  });
  return patches;
}

}  // namespace sgf::direct
