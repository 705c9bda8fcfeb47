#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/io/calib.h>

namespace sgf {

/// How a stereo dataset lies on disk. Ground truth is always that of the left image. Middlebury
/// datasets have a folder a scene, KITTI's a folder a kind of image.
enum class StereoLayout {
  /// Middlebury 2014 and evaluation v3: im0.png, im1.png, disp0GT.pfm or disp0.pfm, mask0nocc.png
  /// (255: visible in both images), calib.txt.
  kMiddleburyEval3,
  /// Middlebury 2001: im2.ppm, im6.ppm, disp2.pgm with 8 grey levels per px; tsukuba:
  /// scene1.row3.col3.ppm, scene1.row3.col4.ppm, truedisp.row3.col3.pgm with 16.
  kMiddlebury2001,
  /// Middlebury 2003: im2, im6 and disp2 as .png or .ppm/.pgm; grey levels per px by image width:
  /// 4 for 450 (quarter size), 2 for 900 (half), 1 for 1800 (full).
  kMiddlebury2003,
  /// Middlebury 2005 and 2006: view1.png, view5.png, disp1.png, which holds full-size disparities:
  /// grey levels per px by image height: 1 for 1110 (full size), 2 for 555 (half), 3 for 370
  /// (third).
  kMiddlebury2006,
  /// KITTI 2015: image_2, image_3, disp_occ_0 (all pixels), disp_noc_0 (non-occluded ones).
  kKitti2015,
  /// KITTI 2012: colored_0 and colored_1, or else image_0 and image_1; disp_occ, disp_noc.
  kKitti2012,
};

/// Names of the layouts in files as datasets/stereo_layouts.yaml.
std::span<const std::pair<const char*, StereoLayout>> EnumNames(StereoLayout);

/// Files of one stereo pair.
struct StereoScene {
  std::string name;  ///< of the scene's folder, or KITTI's six-digit frame number
  StereoLayout layout = StereoLayout::kMiddleburyEval3;
  std::filesystem::path left;
  std::filesystem::path right;
  std::optional<std::filesystem::path> truth_all;  ///< disparities of all pixels
  std::optional<std::filesystem::path> truth_noc;  ///< disparities of non-occluded pixels (KITTI)
  std::optional<std::filesystem::path> mask_noc;   ///< 255 where not occluded (Middlebury)
  int num_disparities = 0;                         ///< ndisp of calib.txt; 0: unknown
};

/// A rectified stereo pair with its ground truth. All images have the size of the left one.
struct StereoPair {
  std::string name;
  cv::Mat left;             ///< 8-bit, BGR or grey as stored
  cv::Mat right;            ///< as `left`
  cv::Mat1f truth_all;      ///< px, NaN = unknown; empty where the dataset has none
  cv::Mat1f truth_noc;      ///< of the pixels visible in both images; empty where there is none
  int num_disparities = 0;  ///< to search, as the dataset states it; 0: unknown
};

/// Finds the scenes of a dataset: those with a left image. Images are not read, calib.txt is.
/// @return scenes in the order of their names.
/// @throws Error naming the folder when it is missing or holds no scene; for a bad calib.txt.
std::vector<StereoScene> ListStereoScenes(const std::filesystem::path& folder, StereoLayout layout);

/// The files of one scene in Middlebury's layout (kMiddleburyEval3); the scene has the folder's
/// name. Images are not read, calib.txt is.
/// @throws Error naming the folder when it is missing; for a bad calib.txt.
StereoScene FindMiddleburyScene(const std::filesystem::path& folder);

/// Reads the images of a scene. For Middlebury, truth_noc is truth_all where the mask is 255.
/// @throws Error naming the file that is missing or cannot be read, whose size differs from the
/// left
///   image's (with both sizes), or whose scale cannot be told from the image's size.
StereoPair LoadStereoScene(const StereoScene& scene);

/// Writes a scene in Middlebury's layout (kMiddleburyEval3), from which LoadStereoScene() gives the
/// same pair back: im0.png, im1.png, disp0GT.pfm (infinity: unknown), mask0nocc.png (255 visible in
/// both images, 128 occluded, 0 unknown) and, last, calib.txt. The folder is made if missing.
/// @param pair images of 8 bits, grey or BGR; both ground truths, of which truth_noc has a value at
///   the pixels visible in both images only. Its name and num_disparities are not used: the
///   folder's name and `calib.ndisp` stand for them.
/// @throws Error naming the folder when it cannot be made, an image or ground truth is missing or
///   not of calib's size, or no disparity is known; and as WritePng(), WritePfm().
void WriteMiddleburyScene(const std::filesystem::path& folder, const StereoPair& pair,
                          const MiddleburyCalib& calib);

}  // namespace sgf
