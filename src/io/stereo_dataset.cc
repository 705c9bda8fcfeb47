#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/calib.h>
#include <sgf/io/disparity.h>
#include <sgf/io/image.h>
#include <sgf/io/stereo_dataset.h>

namespace sgf {
namespace {

namespace fs = std::filesystem;

// Names under which a file or folder of a layout may stand; the first that exists counts.
using Names = std::vector<const char*>;

std::optional<fs::path> FirstExisting(const fs::path& folder, const Names& names) {
  std::error_code ignored;
  for (const char* name : names)
    if (fs::exists(folder / name, ignored)) return folder / name;
  return std::nullopt;
}

// The path for a file that must exist; reading it reports when it does not.
fs::path FirstExistingOrFirst(const fs::path& folder, const Names& names) {
  return FirstExisting(folder, names).value_or(folder / names.front());
}

// --- Middlebury: a folder a scene ---

struct SceneFiles {
  Names left, right, truth;
};

SceneFiles MiddleburyFiles(StereoLayout layout) {
  switch (layout) {
    case StereoLayout::kMiddlebury2001:
      return {{"im2.ppm", "scene1.row3.col3.ppm"},
              {"im6.ppm", "scene1.row3.col4.ppm"},
              {"disp2.pgm", "truedisp.row3.col3.pgm"}};
    case StereoLayout::kMiddlebury2003:
      return {{"im2.png", "im2.ppm"}, {"im6.png", "im6.ppm"}, {"disp2.png", "disp2.pgm"}};
    case StereoLayout::kMiddlebury2006:
      return {{"view1.png"}, {"view5.png"}, {"disp1.png"}};
    default:
      return {{"im0.png"}, {"im1.png"}, {"disp0GT.pfm", "disp0.pfm"}};
  }
}

StereoScene MiddleburyScene(const fs::path& folder, StereoLayout layout) {
  const SceneFiles files = MiddleburyFiles(layout);
  StereoScene scene;
  scene.name = folder.filename().string();
  scene.layout = layout;
  scene.left = FirstExistingOrFirst(folder, files.left);
  scene.right = FirstExistingOrFirst(folder, files.right);
  scene.truth_all = FirstExisting(folder, files.truth);
  if (layout != StereoLayout::kMiddleburyEval3) return scene;
  scene.mask_noc = FirstExisting(folder, {"mask0nocc.png"});
  if (const auto calib = FirstExisting(folder, {"calib.txt"}))
    scene.num_disparities = ReadCalibNdisp(*calib);
  return scene;
}

std::vector<StereoScene> ListMiddlebury(const fs::path& folder, StereoLayout layout) {
  const Names left = MiddleburyFiles(layout).left;
  std::vector<StereoScene> scenes;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_directory() && FirstExisting(entry.path(), left))
      scenes.push_back(MiddleburyScene(entry.path(), layout));
  return scenes;
}

// --- KITTI: a folder a kind of image, the same file name in each ---

bool IsKitti(StereoLayout layout) {
  return layout == StereoLayout::kKitti2015 || layout == StereoLayout::kKitti2012;
}

struct KittiFolders {
  Names left, right;
  const char* truth_all;
  const char* truth_noc;
};

KittiFolders FoldersOf(StereoLayout layout) {
  if (layout == StereoLayout::kKitti2012)
    return {{"colored_0", "image_0"}, {"colored_1", "image_1"}, "disp_occ", "disp_noc"};
  return {{"image_2"}, {"image_3"}, "disp_occ_0", "disp_noc_0"};
}

// Of each scene KITTI has the frames NNNNNN_10, which ground truth belongs to, and NNNNNN_11.
constexpr std::string_view kKittiSuffix = "_10.png";

std::vector<StereoScene> ListKitti(const fs::path& folder, StereoLayout layout) {
  const KittiFolders folders = FoldersOf(layout);
  const auto left = FirstExisting(folder, folders.left);
  std::vector<StereoScene> scenes;
  if (!left) return scenes;
  for (const auto& entry : fs::directory_iterator(*left)) {
    const std::string file = entry.path().filename().string();
    if (!file.ends_with(kKittiSuffix)) continue;
    StereoScene scene;
    scene.name = file.substr(0, file.size() - kKittiSuffix.size());
    scene.layout = layout;
    scene.left = entry.path();
    scene.right = FirstExistingOrFirst(folder, folders.right) / file;
    scene.truth_all = FirstExisting(folder / folders.truth_all, {file.c_str()});
    scene.truth_noc = FirstExisting(folder / folders.truth_noc, {file.c_str()});
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

// --- Loading ---

std::string SizeText(cv::Size size) { return fmt::format("{}x{}", size.width, size.height); }

void RequireSize(const fs::path& path, const cv::Mat& image, const StereoScene& scene,
                 cv::Size left) {
  if (image.size() != left)
    throw Error(path.string(), fmt::format("is {}, but {} is {}", SizeText(image.size()),
                                           scene.left.string(), SizeText(left)));
}

// Scale of a layout whose datasets come in several sizes, told from one side of the image.
double ScaleBySide(const fs::path& truth, const char* side, int value,
                   std::span<const std::pair<int, double>> scales) {
  for (const auto& [known, scale] : scales)
    if (known == value) return scale;
  throw Error(truth.string(),
              fmt::format("image {} is {}, which tells no disparity scale", side, value));
}

// Grey levels per px of an 8-bit ground truth.
double TruthScale(const StereoScene& scene, cv::Size size) {
  static constexpr std::array<std::pair<int, double>, 3> kWidths2003{
      {{450, 4}, {900, 2}, {1800, 1}}};
  static constexpr std::array<std::pair<int, double>, 3> kHeights2006{
      {{1110, 1}, {555, 2}, {370, 3}}};
  switch (scene.layout) {
    case StereoLayout::kMiddlebury2001:
      return scene.name == "tsukuba" ? 16 : 8;
    case StereoLayout::kMiddlebury2003:
      return ScaleBySide(*scene.truth_all, "width", size.width, kWidths2003);
    case StereoLayout::kMiddlebury2006:
      return ScaleBySide(*scene.truth_all, "height", size.height, kHeights2006);
    default:
      return 1;  // PFM and 16-bit maps need none
  }
}

cv::Mat1f ReadTruth(const StereoScene& scene, const std::optional<fs::path>& path, cv::Size left) {
  if (!path) return {};
  cv::Mat1f truth = ReadDisparity(*path, TruthScale(scene, left));
  RequireSize(*path, truth, scene, left);
  return truth;
}

cv::Mat1f VisibleTruth(const StereoScene& scene, const cv::Mat1f& truth_all) {
  const cv::Mat1b mask = ReadGrey(*scene.mask_noc);
  RequireSize(*scene.mask_noc, mask, scene, truth_all.size());
  cv::Mat1f truth(truth_all.size(), std::numeric_limits<float>::quiet_NaN());
  truth_all.copyTo(truth, mask == 255);
  return truth;
}

// --- Writing a Middlebury scene ---

constexpr uchar kVisible = 255, kOccluded = 128;

void RequireCalibSize(const fs::path& folder, const char* what, const cv::Mat& image,
                      const MiddleburyCalib& calib) {
  const cv::Size size(calib.width, calib.height);
  if (image.size() != size)
    throw Error(folder.string(), fmt::format("{} is {}, the calibration's size {}", what,
                                             SizeText(image.size()), SizeText(size)));
}

cv::Mat1b VisibilityMask(const StereoPair& pair) {
  cv::Mat1b mask = cv::Mat1b::zeros(pair.truth_all.size());
  mask.setTo(kOccluded, pair.truth_all == pair.truth_all);  // NaN equals nothing
  mask.setTo(kVisible, pair.truth_noc == pair.truth_noc);
  return mask;
}

// Text of calib.txt; its vmin and vmax are the least and largest true disparity, rounded outwards.
std::string CalibText(const fs::path& folder, const cv::Mat1f& truth, const MiddleburyCalib& c) {
  double smallest = 0, largest = 0;
  const cv::Mat known = truth == truth;
  if (cv::countNonZero(known) == 0)
    throw Error(folder.string(), "the ground truth knows no disparity");
  cv::minMaxLoc(truth, &smallest, &largest, nullptr, nullptr, known);
  const auto camera = [&](double cx) {
    return fmt::format("[{} 0 {}; 0 {} {}; 0 0 1]", c.f, cx, c.f, c.cy);
  };
  return fmt::format(
      "cam0={}\ncam1={}\ndoffs={}\nbaseline={}\nwidth={}\nheight={}\nndisp={}\nisint=0\n"
      "vmin={}\nvmax={}\ndyavg=0\ndymax=0\n",
      camera(c.cx), camera(c.cx + c.doffs), c.doffs, 1000 * c.baseline_m, c.width, c.height,
      c.ndisp, std::floor(smallest), std::ceil(largest));
}

}  // namespace

std::span<const std::pair<const char*, StereoLayout>> EnumNames(StereoLayout) {
  static constexpr std::array<std::pair<const char*, StereoLayout>, 6> kNames{
      {{"middlebury_eval3", StereoLayout::kMiddleburyEval3},
       {"middlebury2001", StereoLayout::kMiddlebury2001},
       {"middlebury2003", StereoLayout::kMiddlebury2003},
       {"middlebury2006", StereoLayout::kMiddlebury2006},
       {"kitti2015", StereoLayout::kKitti2015},
       {"kitti2012", StereoLayout::kKitti2012}}};
  return kNames;
}

std::vector<StereoScene> ListStereoScenes(const fs::path& folder, StereoLayout layout) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw Error(folder.string(), "folder does not exist");
  std::vector<StereoScene> scenes;
  try {
    scenes = IsKitti(layout) ? ListKitti(folder, layout) : ListMiddlebury(folder, layout);
  } catch (const fs::filesystem_error& error) {
    throw Error(folder.string(), error.code().message());
  }
  if (scenes.empty()) throw Error(folder.string(), "holds no stereo pair of the expected layout");
  std::sort(scenes.begin(), scenes.end(),
            [](const StereoScene& a, const StereoScene& b) { return a.name < b.name; });
  return scenes;
}

StereoScene FindMiddleburyScene(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw Error(folder.string(), "folder does not exist");
  const fs::path named = folder.has_filename() ? folder : folder.parent_path();
  return MiddleburyScene(named, StereoLayout::kMiddleburyEval3);
}

StereoPair LoadStereoScene(const StereoScene& scene) {
  StereoPair pair;
  pair.name = scene.name;
  pair.num_disparities = scene.num_disparities;
  pair.left = ReadImage(scene.left, cv::IMREAD_ANYCOLOR);
  pair.right = ReadImage(scene.right, cv::IMREAD_ANYCOLOR);
  RequireSize(scene.right, pair.right, scene, pair.left.size());
  pair.truth_all = ReadTruth(scene, scene.truth_all, pair.left.size());
  pair.truth_noc = scene.mask_noc && scene.truth_all
                       ? VisibleTruth(scene, pair.truth_all)
                       : ReadTruth(scene, scene.truth_noc, pair.left.size());
  return pair;
}

void WriteMiddleburyScene(const fs::path& folder, const StereoPair& pair,
                          const MiddleburyCalib& calib) {
  for (const auto& [what, image] :
       {std::pair<const char*, const cv::Mat*>{"left image", &pair.left},
        {"right image", &pair.right},
        {"truth_all", &pair.truth_all},
        {"truth_noc", &pair.truth_noc}})
    RequireCalibSize(folder, what, *image, calib);
  const std::string calib_text = CalibText(folder, pair.truth_all, calib);
  MakeFolder(folder);
  WritePng(folder / "im0.png", pair.left);
  WritePng(folder / "im1.png", pair.right);
  WriteDisparityPfm(folder / "disp0GT.pfm", pair.truth_all);
  WritePng(folder / "mask0nocc.png", VisibilityMask(pair));
  AtomicFile file(folder / "calib.txt");
  file.Write(calib_text);
  file.Commit();
}

}  // namespace sgf
