#pragma once

#include <cstdint>
#include <string>

#include <sgf/io/calib.h>
#include <sgf/io/stereo_dataset.h>
#include <sgf/synth/photometry.h>
#include <sgf/synth/renderer.h>

namespace sgf::synth {

/// A rectified stereo pair of a scene.
struct PairOptions {
  std::string scene = "living_room";
  std::string view;
  int width = 640;
  int height = 480;
  double focal_px = 525;
  double baseline_m = 0.11;
  double left_exposure_ms = 10;
  double right_exposure_ms = 10;
  PhotometryOptions photometry;
  uint64_t seed = 0;

  template <class V>
  void VisitFields(V&& visit) {
    visit("scene", scene, "", "name of the scene");
    visit("view", view, "", "name of one of the scene's views: the left camera's");
    visit("width", width, "px", "image size");
    visit("height", height, "px", "image size");
    visit("focal_px", focal_px, "px", "focal length");
    visit("baseline_m", baseline_m, "m", "distance of the right camera");
    visit("left_exposure_ms", left_exposure_ms, "ms", "exposure time of the left image");
    visit("right_exposure_ms", right_exposure_ms, "ms", "exposure time of the right image");
    visit("photometry", photometry, "", "what the cameras make of radiance");
    visit("seed", seed, "", "seed of the cameras' noise");
  }
};

/// Both views with all layers, and the exact disparities of the left one.
struct RenderedPair {
  Camera camera;  ///< of both
  SE3 T_world_left, T_world_right;
  Frame left, right;
  cv::Mat1f disparity;      ///< px, NaN for the sky
  cv::Mat1f disparity_noc;  ///< NaN also where the right camera does not see the point
  MiddleburyCalib calib;
};

/// Renders a pair. Occlusion is decided per pixel centre by a ray to the right camera.
/// @param renderer of the scene that the options name.
/// @throws Error for a view that the scene does not have, sizes, focal length or baseline that are
///   not positive.
RenderedPair RenderPair(const Renderer& renderer, const PairOptions& options);

/// The images that the cameras take of it, in grey levels, with the ground truth.
/// @throws Error for photometry options or exposure times out of range.
StereoPair Expose(const RenderedPair& pair, const PairOptions& options, int threads);

/// What identifies the content of a rendered pair: a hash of the resolved options and of the state
/// of the rendering code.
std::string RecipeHash(const PairOptions& pair, const RenderOptions& options, bool keep_exr);

}  // namespace sgf::synth
