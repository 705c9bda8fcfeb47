// The committed renderings of tests/fixtures: what other programs read of them, and whether today's
// renderer still makes them.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <sgf/synth/frame_exr.h>

namespace sgf::synth {
namespace {

class Fixtures : public testing::TestWithParam<std::string> {
 protected:
  std::string Path() const { return SGF_SOURCE_DIR "/tests/fixtures/" + GetParam() + ".exr"; }
};

double ShareAbove(const cv::Mat& difference, double limit) {
  return cv::countNonZero(difference > limit) / static_cast<double>(difference.total());
}

TEST_P(Fixtures, HaveAllLayersWhichAddUp) {
  const ExrImage image = ReadExr(Path());
  const Frame frame = FromExr(image, Path());
  EXPECT_GE(frame.groups.size(), 2);
  ASSERT_TRUE(image.camera && image.T_world_cam);
  const cv::Mat3f sum = GetLayer(image, "", Path());
  EXPECT_LT(cv::norm(frame.Radiance(), sum, cv::NORM_INF), 2e-3 * cv::norm(sum, cv::NORM_INF));
  double nearest = 0;
  cv::minMaxLoc(frame.depth, &nearest);
  EXPECT_GT(nearest, 0.3);
}

TEST_P(Fixtures, OpenInOpenCV) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);  // read at the first image
  const cv::Mat bgr = cv::imread(Path(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(bgr.type(), CV_32FC3);
  cv::Mat3f rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  EXPECT_EQ(cv::norm(rgb, GetLayer(ReadExr(Path()), "", Path()), cv::NORM_INF), 0);
}

TEST_P(Fixtures, OpenInExrheader) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(
      popen(("exrheader '" + Path() + "' 2>&1").c_str(), "r"), pclose);
  std::string output(100000, '\0');
  output.resize(fread(output.data(), 1, output.size(), pipe.get()));
  for (const char* line : {"R, 16-bit floating-point", "Z, 32-bit floating-point",
                           "id, 32-bit unsigned integer", "diffuse.G", "N.Z", "light."})
    EXPECT_THAT(output, testing::HasSubstr(line)) << "package openexr has to be installed";
}

// If this fails after a change that is meant to change renderings: raise kRenderingVersion and make
// the fixtures anew, as tests/fixtures/README.md says.
TEST_P(Fixtures, AreWhatIsRenderedNow) {
  const ExrImage image = ReadExr(Path());
  const Frame then = FromExr(image, Path());
  const Renderer renderer(BuildScene(image.attributes.at("scene")), {});
  const Frame now = FromExr(ToExr(renderer.Render(PixelRays(*image.camera, 4), *image.T_world_cam),
                                  *image.camera, *image.T_world_cam),
                            "now");
  // Other versions of the mathematical library may move a ray across an edge.
  EXPECT_LT(ShareAbove(cv::abs(now.id - then.id), 0), 0.002);
  cv::Mat1f depth_difference;
  cv::patchNaNs(depth_difference = cv::abs(now.depth - then.depth) / then.depth);
  EXPECT_LT(ShareAbove(depth_difference, 1e-5), 0.002);
  ASSERT_EQ(now.groups, then.groups);
  for (size_t g = 0; g < now.groups.size(); ++g) {
    const cv::Mat difference = cv::abs(now.light[g] - then.light[g]);
    EXPECT_LT(cv::mean(difference)[1], 1e-3 * cv::mean(then.light[g])[1] + 1e-6) << now.groups[g];
  }
}

INSTANTIATE_TEST_SUITE_P(All, Fixtures, testing::Values("living_room_sofa", "street_shops"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace sgf::synth
