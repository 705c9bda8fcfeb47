#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/core/se3.h>

/// What direct odometry keeps of a key-frame.
namespace sgf::direct {

inline constexpr int kMostKeyframes = 30;  ///< of a window, but for one that is about to leave
inline constexpr int kPatchPixels = 8;     ///< of alignment::Pattern::kDso8

/// Brightness of an image of radiance L: I = exp(a) L + b, in grey levels. With known exposure
/// times a begins at their logarithm.
struct Brightness {
  double a = 0;
  double b = 0;
};

/// I_ref = exp(alpha) I_cur + beta, as alignment::AffinePhotoResidual has it.
struct RelativeBrightness {
  double alpha = 0;
  double beta = 0;
};

inline RelativeBrightness Between(const Brightness& ref, const Brightness& cur) {
  const double alpha = ref.a - cur.a;
  return {alpha, ref.b - std::exp(alpha) * cur.b};
}

/// The brightness of the current image, of the reference's and what is between them.
inline Brightness Apply(const Brightness& ref, const RelativeBrightness& relative) {
  return {ref.a - relative.alpha, (ref.b - relative.beta) * std::exp(-relative.alpha)};
}

/// How the last search for a point has ended.
enum class TraceStatus {
  kNew,        ///< not searched for yet
  kGood,       ///< found, the interval is smaller than before
  kSkipped,    ///< the interval is smaller than what a search could tell
  kUncertain,  ///< the epipolar line runs along the edge
  kOutOfView,  ///< not in view
  kOutlier,    ///< nothing on the line looks like it
};

/// A pixel of a key-frame whose depth is searched for. Inverse depths are per unit of the map,
/// along the optical axis.
struct ImmaturePoint {
  Eigen::Vector2f pixel;
  Eigen::Matrix2f structure = Eigen::Matrix2f::Zero();  ///< structure tensor of its patch
  float inverse_depth_min = 0;
  float inverse_depth_max = INFINITY;
  float quality = 0;             ///< second best over best dissimilarity on the last line
  float interval_px = INFINITY;  ///< length of the interval on the last line
  TraceStatus status = TraceStatus::kNew;
  int found = 0;     ///< how often its interval became smaller
  int outliers = 0;  ///< in a row

  float InverseDepth() const { return 0.5f * (inverse_depth_min + inverse_depth_max); }

  /// Twice not found where it has to be: moving, or hidden (DSO's rule).
  bool GivenUp() const { return outliers >= 2; }
};

/// How a point of the window is seen by another key-frame.
struct Observation {
  int target = 0;        ///< id of the key-frame
  bool counted = false;  ///< in the point's support
};

/// A pixel of a key-frame whose depth is known and refined in the window.
struct ActivePoint {
  Eigen::Vector2f pixel;
  double inverse_depth = 0;
  double variance = INFINITY;  ///< of the inverse depth
  int support = 0;             ///< key-frames that saw it so far, those that left as well
  std::vector<Observation> observations = {};

  bool SeenBy(int keyframe) const {
    return std::any_of(observations.begin(), observations.end(),
                       [&](const Observation& seen) { return seen.target == keyframe; });
  }
};

/// A key-frame of the window.
struct Keyframe {
  int id = 0;
  SE3 T_cam_world = {};
  Brightness brightness = {};
  double log_exposure = 0;  ///< what `a` is expected to be
  SE3 linearization = {};   ///< T_cam_world at which derivatives are taken
  Brightness brightness_linearization = {};
  bool in_prior = false;  ///< its linearisation is fixed by what was marginalised
  alignment::Pyramid pyramid = {};
  std::vector<ImmaturePoint> immature = {};
  std::vector<ActivePoint> points = {};
  int points_made = 0;  ///< that have ever been active

  const alignment::SampleChannels& image() const { return pyramid.samples.front(); }
};

using Window = std::vector<std::unique_ptr<Keyframe>>;  ///< oldest first

/// Active points of all key-frames.
inline int CountActive(const Window& window) {
  int count = 0;
  for (const auto& frame : window) count += static_cast<int>(frame->points.size());
  return count;
}

}  // namespace sgf::direct
