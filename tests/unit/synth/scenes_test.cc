// What every scene and every recipe of a stereo pair must hold.

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <yaml-cpp/yaml.h>

#include <sgf/core/options.h>
#include <sgf/synth/sequence.h>
#include <sgf/synth/stereo_pair.h>

namespace sgf::synth {
namespace {

// Light as coarse as it gets: geometry and texture do not depend on it.
const RenderOptions kCoarse{.light_texels = 20000, .light_samples = 4, .bounce_samples = 4};

class Scenes : public testing::TestWithParam<std::string> {};

template <class Use>
void ForEachMaterial(const Scene& scene, Use&& use) {
  for (const Object& object : scene.objects)
    for (const Part& part : object.parts) use(part.material);
}

TEST_P(Scenes, AreRichEnough) {
  const Scene scene = BuildScene(GetParam());
  std::set<int> textures;
  bool plain = false, shiny = false;
  ForEachMaterial(scene, [&](const Material& m) {
    if (m.texture >= 0) textures.insert(m.texture);
    plain |= m.texture < 0;
    shiny |= m.specular > 0 || m.mirror > 0;
  });
  EXPECT_GE(scene.objects.size(), 40);
  EXPECT_GE(textures.size(), 8);
  EXPECT_GE(scene.LightGroups().size(), 2);
  EXPECT_GE(scene.views.size(), 4);
  EXPECT_TRUE(plain);
  EXPECT_TRUE(shiny);
}

TEST_P(Scenes, EveryLightGroupShowsInSomeViewAndNoViewIsBlocked) {
  const Renderer renderer(BuildScene(GetParam()), kCoarse);
  const PixelRays rays({188, 120, 115, 115, 93.5, 59.5}, 1);
  std::vector<double> brightest(renderer.scene().LightGroups().size());
  for (const View& view : renderer.scene().views) {
    const Frame frame =
        renderer.Render(rays, LookAt(view.eye.cast<double>(), view.target.cast<double>()));
    double nearest = 0;
    cv::minMaxLoc(frame.depth, &nearest);
    EXPECT_GT(nearest, 0.3) << view.name;
    for (size_t g = 0; g < brightest.size(); ++g)
      brightest[g] = std::max(brightest[g], cv::mean(frame.light[g])[1]);
  }
  for (double light : brightest) EXPECT_GT(light, 0.005);
}

/// A frame with the camera that took it.
struct Shot {
  Camera camera;
  SE3 T_world_cam;
  Frame frame;

  Eigen::Vector3d Point(int x, int y) const {
    return T_world_cam * (frame.depth(y, x) * camera.Unproject({x, y}));
  }
};

/// Inverse depth at a sub-pixel place, which is bilinear on a plane; NaN where the four pixels
/// about it are not on one, to a tenth of a millimetre.
double InverseDepthAt(const Shot& shot, int id, const Eigen::Vector2d& at) {
  const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
  const cv::Vec3f n = shot.frame.normal(y, x);
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const int i = x + k % 2, j = y + k / 2;
    const Eigen::Vector3d step = shot.Point(i, j) - shot.Point(x, y);
    if (shot.frame.id(j, i) != id) return NAN;
    if (!(std::abs(step.dot(Eigen::Vector3d(n[0], n[1], n[2]))) < 1e-4)) return NAN;
    sum += (1 - std::abs(at.x() - i)) * (1 - std::abs(at.y() - j)) / shot.frame.depth(j, i);
  }
  return sum;
}

// Points of a frame, projected into another one taken 5 cm and 2 degrees away, then back by that
// one's depth: only points that both frames see.
std::vector<double> ReprojectionErrors(const Renderer& renderer, const View& view) {
  const Camera camera = RigCameras(RigModel::kEuroc)[0].camera;
  const PixelRays rays(camera, 1);
  const SE3 T_world_a = LookAt(view.eye.cast<double>(), view.target.cast<double>());
  const SE3 T_world_b = T_world_a * SE3{ExpSO3({0.02, -0.03, 0.01}), {0.04, -0.02, 0.03}};
  const Shot a{camera, T_world_a, renderer.Render(rays, T_world_a)};
  const Shot b{camera, T_world_b, renderer.Render(rays, T_world_b)};
  const cv::Mat1b seen = renderer.SeenFrom(a.frame.depth, camera, T_world_a, T_world_b.p);
  std::vector<double> errors;
  for (int y = 4; y < camera.height; y += 8)
    for (int x = 4; x < camera.width; x += 8) {
      const Eigen::Vector3d in_b = T_world_b.Inverse() * a.Point(x, y);
      if (!seen(y, x) || in_b.z() < 0.1) continue;
      const Eigen::Vector2d at = camera.Project(in_b);
      if (at.minCoeff() < 0 || at.x() >= camera.width - 1 || at.y() >= camera.height - 1) continue;
      const double inverse_depth = InverseDepthAt(b, a.frame.id(y, x), at);
      if (std::isnan(inverse_depth)) continue;
      const Eigen::Vector3d back = T_world_b * (camera.Unproject(at) / inverse_depth);
      errors.push_back((camera.Project(T_world_a.Inverse() * back) - Eigen::Vector2d(x, y)).norm());
    }
  return errors;
}

TEST_P(Scenes, PosesAndDepthReprojectFrameToFrame) {
  const Renderer renderer(BuildScene(GetParam()), kCoarse);
  for (const View& view : renderer.scene().views) {
    std::vector<double> errors = ReprojectionErrors(renderer, view);
    std::sort(errors.begin(), errors.end());
    ASSERT_GT(errors.size(), 1000) << view.name;
    EXPECT_LT(errors.back(), 0.05) << view.name;
  }
}

std::vector<PairOptions> PairsOf(const std::string& scene) {
  std::vector<PairOptions> pairs;
  for (const YAML::Node& node :
       YAML::LoadFile(SGF_SOURCE_DIR "/datasets/synthetic/pairs.yaml")["pairs"]) {
    PairOptions pair;
    ReadOptions(node, pair, "pairs.yaml");
    if (pair.scene == scene) pairs.push_back(pair);
  }
  return pairs;
}

/// Correlation of the left image with the right one warped by the ground truth.
double WarpedCorrelation(const RenderedPair& pair) {
  const cv::Mat1f left = Luminance(pair.left.diffuse), right = Luminance(pair.right.diffuse);
  cv::Mat1f columns(left.size()), rows(left.size()), warped;
  cv::Mat1b valid = cv::Mat1b::zeros(left.size());
  for (int y = 0; y < left.rows; ++y)
    for (int x = 0; x < left.cols; ++x) {
      const float d = pair.disparity_noc(y, x);
      columns(y, x) = static_cast<float>(x) - (std::isnan(d) ? 0 : d);
      rows(y, x) = static_cast<float>(y);
      valid(y, x) = std::isnan(d) ? 0 : 255;
    }
  cv::remap(right, warped, columns, rows, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  cv::Scalar mean_l, sd_l, mean_w, sd_w;
  cv::meanStdDev(left, mean_l, sd_l, valid);
  cv::meanStdDev(warped, mean_w, sd_w, valid);
  const cv::Scalar cross = cv::mean((left - mean_l[0]).mul(warped - mean_w[0]), valid);
  return cross[0] / (sd_l[0] * sd_w[0]);
}

TEST_P(Scenes, GroundTruthOfEveryPairWarpsOneImageToTheOther) {
  const Renderer renderer(BuildScene(GetParam()), kCoarse);
  const std::vector<PairOptions> pairs = PairsOf(GetParam());
  EXPECT_GE(pairs.size(), 2);
  for (const PairOptions& options : pairs) {
    const RenderedPair pair = RenderPair(renderer, options);
    const double correlation = WarpedCorrelation(pair);
    EXPECT_GT(correlation, 0.99) << options.view;
  }
}

std::vector<std::string> SceneNames() {
  std::vector<std::string> names;
  for (const SceneInfo& scene : AllScenes()) names.emplace_back(scene.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(All, Scenes, testing::ValuesIn(SceneNames()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace sgf::synth
