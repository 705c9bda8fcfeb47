#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sgf/io/euroc.h>
#include <sgf/synth/exposure.h>
#include <sgf/synth/imu.h>
#include <sgf/synth/photometry.h>
#include <sgf/synth/renderer.h>
#include <sgf/synth/trajectory.h>

namespace sgf::synth {

/// The pair of cameras on the rig.
enum class RigModel {
  kEuroc,    ///< EuRoC's own calibration: radial-tangential distortion, 0.110 m apart
  kPinhole,  ///< two ideal cameras, rows aligned, exactly 0.11 m apart
};
std::span<const std::pair<const char*, RigModel>> EnumNames(RigModel);

/// Camera 0 (left) and 1 (right) of a rig, 752x480 px, 20 Hz.
std::vector<EurocCamera> RigCameras(RigModel rig);

/// The part of a trajectory that a sequence's short version has. It is a sequence of its own: its
/// auto-exposure and its noise start with its first frame.
struct ShortOptions {
  double from_s = 0;
  int frames = 150;

  template <class V>
  void VisitFields(V&& visit) {
    visit("from_s", from_s, "s", "time of the first stereo frame");
    visit("frames", frames, "", "stereo frames, at most 200");
  }
};

/// Everything that decides what a stereo-inertial sequence holds.
struct SequenceRecipe {
  std::string scene = "mocap_room_1";
  RigModel rig = RigModel::kEuroc;
  double duration_s = 20;
  ShortOptions short_version;
  TrajectoryOptions trajectory;
  ExposureOptions exposure;
  PhotometryOptions photometry;
  int blur_samples = 1;
  ImuOptions imu;
  uint64_t seed = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("scene", scene, "", "name of the scene");
    visit("rig", rig, "", "the cameras: euroc or pinhole");
    visit("duration_s", duration_s, "s", "length of the full version");
    visit("short", short_version, "", "part of it that the short version has");
    visit("trajectory", trajectory, "", "where the left camera goes and looks");
    visit("exposure", exposure, "", "exposure times and lights over time");
    visit("photometry", photometry, "", "what the cameras make of radiance");
    visit("blur_samples", blur_samples, "",
          "instants within the exposure that motion blur averages over, odd");
    visit("imu", imu, "", "inertial sensor");
    visit("seed", seed, "", "seed of the cameras' noise");
  }
};

/// @throws Error naming the key that is out of range, for those that no part of the recipe checks
/// when it is used.
void CheckRecipe(const SequenceRecipe& recipe);

enum class SequenceVersion {
  kShort,    ///< the part that the recipe names
  kFull,     ///< all of it
  kPreview,  ///< all of it at one stereo frame a second
};

/// What rendering a sequence takes.
struct SequenceEstimate {
  int frames = 0;          ///< stereo frames
  int64_t bytes = 0;       ///< on disk, an upper bound
  int64_t renderings = 0;  ///< views to trace: blur renders a frame several times
};
SequenceEstimate Estimate(const SequenceRecipe& recipe, SequenceVersion version, bool keep_exr);

/// What identifies the content of a rendered sequence: a hash of the resolved recipe, the version
/// and the state of the rendering code.
std::string RecipeHash(const SequenceRecipe& recipe, SequenceVersion version, bool keep_exr,
                       const RenderOptions& options);

struct SequenceRequest {
  SequenceRecipe recipe;
  SequenceVersion version = SequenceVersion::kShort;
  bool keep_exr = false;              ///< also write all layers of every frame
  std::filesystem::path folder = {};  ///< of the sequence; replaced as a whole
  /// Told of every finished stereo frame; may be empty.
  std::function<void(int frame, int frames)> progress = {};
};

/// Renders a sequence into a folder in EuRoC's layout, in which mav0/ also holds depth0/
/// (ground-truth depth of every tenth left frame, EXR, m along the optical axis) and, in each
/// camera's folder, DSO's pcalib.txt, vignette.png and times.txt. recipe.yaml beside mav0/ has the
/// resolved recipe. The folder appears whole or not at all and carries a manifest. Time stamps and
/// ground truth are those of mid-exposure.
/// @param renderer of the recipe's scene.
/// @throws Error for a recipe out of range, a camera that sees a surface closer than 0.1 m, and
///   files that cannot be written.
void RenderSequence(const Renderer& renderer, const SequenceRequest& request);

}  // namespace sgf::synth
