#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include <sgf/alignment/level.h>
#include <sgf/alignment/warp.h>
#include <sgf/core/camera.h>
#include <sgf/direct/frame.h>

/// The patches of a window's points and how they look in other key-frames: all of the window that
/// depends on the dissimilarity.
namespace sgf::direct {

/// Parameters of a point between two key-frames: relative pose (6), inverse depth, relative
/// brightness alpha and beta, and fx, fy, cx, cy of the camera.
inline constexpr int kRelativeParameters = 13, kRelativeDepth = 6, kRelativeBrightness = 7,
                     kRelativeCamera = 9;
using RelativeParameters = Eigen::Matrix<double, kRelativeParameters, 1>;

/// Normal equations H delta = -b in them; zero where a parameter plays no part.
struct RelativeEquations {
  Eigen::Matrix<double, kRelativeParameters, kRelativeParameters> H;
  RelativeParameters b;
};

/// How one key-frame sees the points of another.
struct KeyframePair {
  alignment::Se3DepthCameraWarp<float> now, linear;  ///< as it is, and where derivatives are taken
  RelativeBrightness brightness;
};

class WindowPatches {
 public:
  virtual ~WindowPatches() = default;
  virtual void Clear() = 0;

  /// Adds the patch around a pixel of its host's image.
  virtual void Add(const alignment::SampleChannels& host, const Eigen::Vector2f& pixel) = 0;

  /// Squared norms of a patch's residuals, those in view.
  /// @return how many.
  virtual int SquaredNorms(int patch, double inverse_depth, const KeyframePair& pair,
                           const alignment::SampleChannels& image,
                           std::span<float, kPatchPixels> norms) const = 0;

  /// Sum of Huber's loss over a patch's residuals.
  /// @param scale of the residuals.
  /// @return nothing where not all of it is in view.
  virtual std::optional<double> Cost(int patch, double inverse_depth, const KeyframePair& pair,
                                     const alignment::SampleChannels& image,
                                     double scale) const = 0;

  /// The same, and its normal equations.
  virtual std::optional<double> Linearize(int patch, double inverse_depth, const KeyframePair& pair,
                                          const alignment::SampleChannels& image, double scale,
                                          RelativeEquations& equations) const = 0;

  /// Components of a pixel's residual.
  virtual int dim() const = 0;

  /// The least scale of residuals: what rounding to grey levels leaves in images without any noise.
  virtual double least_scale() const = 0;

  /// Whether it depends on the brightness.
  virtual bool has_brightness() const = 0;
};

/// Whether a window can be refined with a residual, and its camera as well.
bool HasWindowPatches(const std::string& residual, bool refines_camera);

/// @param camera that patches are taken with.
/// @param refines_camera whether there are derivatives by the camera.
/// @throws Error where HasWindowPatches() says no.
std::unique_ptr<WindowPatches> MakeWindowPatches(const std::string& residual, const Camera& camera,
                                                 bool refines_camera);

}  // namespace sgf::direct
