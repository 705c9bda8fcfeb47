#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/alignment/level.h>
#include <sgf/alignment/pattern.h>
#include <sgf/alignment/warp.h>

/// Patches followed from image to image by any residual, in code that is chosen for the instruction
/// set at run time. The same bits for every instruction set.
namespace sgf::flow::internal {

/// How patches are followed.
struct TrackerOptions {
  std::string residual = "lssd";
  alignment::Pattern pattern = alignment::Pattern::kBasalt52;
  int levels = 4;
  int max_iterations = 5;
  double tolerance_px = 0.01;
  alignment::LevelOptions image = {};
};

/// Gradients of an image, and what they are normalised by.
struct GradientLevel {
  alignment::GradientChannels gradients;
  cv::Mat1f epsilon;  ///< of MakeGradientChannels()
};

/// An image as a tracker samples it, finest level first: grey levels or their gradients.
struct Pyramid {
  std::vector<cv::Mat1f> grey;
  std::vector<GradientLevel> gradient;  ///< empty for residuals of intensities
};

/// Where a patch is in another image: in pixels of the finest level.
using PatchWarp = alignment::Se2Warp<float>;

/// What a tracker keeps of a patch at all levels: its pixels and, for residuals that are linearised
/// there, the step that follows from a residual.
class PatchTemplate {
 public:
  virtual ~PatchTemplate() = default;
};

/// Follows patches. Const calls may run in parallel.
class PatchTracker {
 public:
  virtual ~PatchTracker() = default;

  /// Fills a pyramid; its memory is used again.
  /// @param grey one channel.
  virtual void MakePyramid(const cv::Mat& grey, Pyramid& pyramid) const = 0;

  virtual std::unique_ptr<PatchTemplate> NewTemplate() const = 0;

  /// Takes a patch from an image. At coarse levels it may reach over the border, where pixels count
  /// as flat.
  /// @param centre px.
  /// @param levels that will be used, the finest ones.
  /// @return whether it lies whole in the finest level and can be followed there: not where it is
  ///   flat or has but one edge.
  virtual bool MakeTemplate(const Pyramid& image, const Eigen::Vector2f& centre, int levels,
                            PatchTemplate& patch) const = 0;

  /// Where a patch, as it is, fits best at the coarsest level.
  /// @param places px of the finest level, at least one.
  virtual Eigen::Vector2f Likeliest(const PatchTemplate& patch, const Pyramid& image,
                                    std::span<const Eigen::Vector2f> places) const = 0;

  /// Finds a patch in an image, from the coarsest level used to the finest.
  /// @param levels that are used, the finest ones.
  /// @param[in,out] warp first guess and result; undefined where it is not found.
  /// @return whether it was found whole in view.
  virtual bool Track(const PatchTemplate& patch, const Pyramid& image, int levels,
                     PatchWarp& warp) const = 0;
};

/// Whether patches can be followed by the residual of this name: one of samples alone.
/// @throws Error for a name that is unknown.
bool CanTrack(std::string_view residual);

/// @param options with a residual that CanTrack().
std::unique_ptr<const PatchTracker> MakePatchTracker(const TrackerOptions& options);

}  // namespace sgf::flow::internal
