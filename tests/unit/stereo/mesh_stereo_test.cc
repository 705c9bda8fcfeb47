#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <support/error_message.h>
#include <support/stereo_images.h>

#include <sgf/core/options.h>
#include <sgf/core/simd.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/mesh_refine.h>
#include <sgf/stereo/mesh_stereo.h>
#include <sgf/stereo/plane_field.h>

namespace sgf::stereo {
namespace {

class RestrictTo {
 public:
  explicit RestrictTo(const std::string& target) { RestrictSimd(target); }
  ~RestrictTo() { RestrictSimd(""); }
};

MeshStereoOptions With(const std::string& metric, int num_disparities = 16) {
  MeshStereoOptions options;
  options.metric = metric;
  options.num_disparities = num_disparities;
  return options;
}

using Pair = std::pair<cv::Mat, cv::Mat>;

// Left and right view of a texture with disparity(x, y) at pixel (x, y) of the left one.
Pair PairWith(cv::Size size, const std::function<double(int, int)>& disparity, uint64_t seed) {
  constexpr int kMargin = 40;
  const cv::Mat1b wide = TexturedImage({size.width + 2 * kMargin, size.height}, seed);
  cv::Mat1f map_x(size), map_y(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      map_x(y, x) = static_cast<float>(kMargin + x - disparity(x, y));
      map_y(y, x) = static_cast<float>(y);
    }
  cv::Mat left;
  cv::remap(wide, left, map_x, map_y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return {left, wide(cv::Rect({kMargin, 0}, size)).clone()};
}

// The same grey levels in colours that differ from place to place.
cv::Mat Tinted(const cv::Mat& grey) {
  cv::Mat darker = 0.8 * grey, colour;
  cv::merge(std::vector<cv::Mat>{grey, darker, grey}, colour);
  return colour;
}

double MeanError(const cv::Mat1f& found, const std::function<double(int, int)>& disparity) {
  constexpr int kLeft = 16;  // columns that the right image does not show
  double sum = 0;
  for (int y = 0; y < found.rows; ++y)
    for (int x = kLeft; x < found.cols; ++x) sum += std::abs(found(y, x) - disparity(x, y));
  return sum / (found.rows * (found.cols - kLeft));
}

double ShareValid(const MeshStereoResult& result) {
  return cv::countNonZero(result.valid) / static_cast<double>(result.valid.total());
}

class MeshStereoTest : public ::testing::TestWithParam<const char*> {};

TEST_P(MeshStereoTest, FindsSlantedPlanes) {
  const std::vector<std::function<double(int, int)>> planes{
      [](int x, int y) { return 4 + 0.06 * x + 0.02 * y; },
      [](int x, int y) { return 12 - 0.05 * x - 0.03 * y; },
  };
  for (size_t i = 0; i < planes.size(); ++i) {
    const auto [left, right] = PairWith({120, 90}, planes[i], i + 1);
    const MeshStereoResult result = MeshStereo(With(GetParam())).Match(left, right);
    EXPECT_LT(MeanError(result.disparity, planes[i]), 0.25) << "plane " << i;
    EXPECT_GT(ShareValid(result), 0.8) << "plane " << i;
  }
}

TEST_P(MeshStereoTest, FindsPlanesThatFaceTheCamera) {
  // Costs interpolated linearly are least at integer disparities, to which such planes are drawn.
  for (const auto& [disparity, most] : {std::pair{7.0, 0.05}, {6.2, 0.25}, {6.4, 0.45}}) {
    const auto [left, right] = ShiftedPair({120, 90}, disparity, 1);
    const MeshStereoResult result = MeshStereo(With(GetParam())).Match(left, right);
    EXPECT_LT(MeanError(result.disparity, [d = disparity](int, int) { return d; }), most);
    EXPECT_GT(ShareValid(result), 0.8);
  }
}

TEST_P(MeshStereoTest, FindsPlanesInColour) {
  const auto plane = [](int x, int y) { return 3 + 0.04 * x + 0.05 * y; };
  const auto [left, right] = PairWith({120, 90}, plane, 4);
  const MeshStereoResult result = MeshStereo(With(GetParam())).Match(Tinted(left), Tinted(right));
  EXPECT_LT(MeanError(result.disparity, plane), 0.25);
}

TEST_P(MeshStereoTest, FindsNegativeDisparities) {
  MeshStereoOptions options = With(GetParam());
  options.min_disparity = -12;
  const auto [left, right] = ShiftedPair({120, 90}, -6.1, 5);
  const MeshStereoResult result = MeshStereo(options).Match(left, right);
  EXPECT_LT(MeanError(result.disparity, [](int, int) { return -6.1; }), 0.25);
}

INSTANTIATE_TEST_SUITE_P(All, MeshStereoTest, ::testing::Values("sgf", "sad", "census_sobel"),
                         [](const auto& test) { return std::string(test.param); });

TEST(MeshStereo, BothImagesStartNearTheirDisparities) {
  const auto plane = [](int x, int y) { return 4 + 0.06 * x + 0.02 * y; };
  const auto [left, right] = PairWith({120, 90}, plane, 1);
  MeshStereoOptions options = With("sgf");
  options.rounds = 0;
  const MeshStereoResult result = MeshStereo(options).Match(left, right);
  EXPECT_LT(MeanError(result.disparity, plane), 0.4);
  EXPECT_GT(ShareValid(result), 0.8);
}

TEST(CheckLeftRight, ConfirmsWhatThePartnerAgreesWith) {
  const cv::Mat1f left = (cv::Mat1f(1, 6) << 1, 1, 2.25F, 3, 0, 9);
  const cv::Mat1f right = (cv::Mat1f(1, 6) << 2.5F, 0, 0, 0, 1.25F, 0);
  EXPECT_EQ(cv::norm(internal::CheckLeftRight(left, right, 1.5),
                     cv::Mat1b((cv::Mat1b(1, 6) << 0, 255, 255, 255, 255, 0)), cv::NORM_INF),
            0);
  EXPECT_EQ(cv::countNonZero(internal::CheckLeftRight(left, right, 1)), 2);
}

TEST(MedianOfInvalid, TakesTheMedianOfPixelsOfTheSameColour) {
  const cv::Size size(31, 21);
  cv::Mat1b image(size, 10), valid(size, 255);
  image.colRange(16, 31) = 250;
  cv::Mat1f disparity(size, -3.0F);
  disparity.colRange(16, 31) = 6.25F;
  const cv::Mat1f expected = disparity.clone();
  for (const cv::Point hole : {cv::Point(15, 10), {16, 10}, {0, 0}, {30, 20}}) {
    valid(hole) = 0;
    disparity(hole) = 2;
  }
  disparity(5, 5) = 1;  // valid: stays as it is
  MeshStereoOptions options = With("sgf");
  options.min_disparity = -4;
  options.median_window = 0;
  const cv::Mat1f before = disparity.clone();
  internal::MedianOfInvalid(image, valid, options, disparity);
  EXPECT_EQ(cv::countNonZero(disparity != before), 0);
  options.median_window = 9;
  internal::MedianOfInvalid(image, valid, options, disparity);
  EXPECT_EQ(disparity(5, 5), 1);
  disparity(5, 5) = expected(5, 5);
  EXPECT_EQ(cv::countNonZero(disparity != expected), 0);
}

TEST(PlaneField, UnconfirmedTrianglesTakeTheNearestPlaneOfTheSameColour) {
  // Three stripes: of the two outer ones, which differ, the middle one resembles the left.
  const cv::Size size(120, 60);
  cv::Mat1b image(size, 50), valid(size, 255);
  image.colRange(80, 120) = 220;
  valid.colRange(40, 80) = 0;
  cv::Mat1f guess(size, 5.0F);
  guess.colRange(40, 80) = 9;
  guess.colRange(80, 120) = 12;
  MeshStereoOptions options = With("sad");
  options.window = 3;  // each triangle starts from the stripe that it lies in
  const internal::CostVolume volume(internal::PrepareCostRows(image, image, options, 9), size,
                                    options, 0.5);
  const TriangleMesh mesh = BuildMesh(image, options.mesh);
  std::vector<cv::Point> centres;
  for (int i = 0; i < mesh.size(); ++i) centres.emplace_back(mesh.Barycentre(i));
  const internal::SupportWindows windows(image, centres, options.window, options.gamma, 1);
  internal::PlaneField field(volume.Left(), mesh, windows, image, options, 1);
  field.Initialise(guess);
  field.FillUnconfirmed(valid);
  const cv::Mat1f found = internal::Render(mesh, field.planes(), 0, 16);
  EXPECT_NEAR(cv::norm(found.colRange(48, 72), cv::Mat1f(60, 24, 5.0F), cv::NORM_INF), 0, 0.1);
  EXPECT_NEAR(cv::mean(found.colRange(90, 120))[0], 12, 0.1);
}

void ExpectSame(const MeshStereoResult& a, const MeshStereoResult& b) {
  EXPECT_EQ(cv::countNonZero(a.disparity != b.disparity), 0);
  EXPECT_EQ(cv::countNonZero(a.valid != b.valid), 0);
  EXPECT_EQ(a.mesh.vertices, b.mesh.vertices);
  EXPECT_EQ(a.mesh.triangles, b.mesh.triangles);
}

// A textured square before a textured background.
struct SquareScene {
  static constexpr double kNear = 13, kFar = 4;
  const cv::Rect square{50, 30, 40, 32};
  cv::Mat1b left, right;

  SquareScene() {
    std::tie(left, right) = ShiftedPair({120, 90}, kFar, 6);
    left *= 0.5;
    right *= 0.5;
    const cv::Mat1b texture = 128 + 0.5 * TexturedImage(square.size(), 7);
    texture.copyTo(left(square));
    texture.copyTo(right(square - cv::Point(static_cast<int>(kNear), 0)));
  }
};

TEST(MeshStereo, IsTheSameForAnyThreadsAndInstructionSet) {
  const SquareScene scene;
  for (const char* metric : {"sgf", "sad"}) {
    MeshStereoOptions options = With(metric);
    const MeshStereoResult expected = MeshStereo(options).Match(scene.left, scene.right);
    for (const int threads : {2, 4}) {
      SCOPED_TRACE(threads);
      options.threads = threads;
      ExpectSame(MeshStereo(options).Match(scene.left, scene.right), expected);
    }
    for (const std::string& target : SimdTargets()) {
      SCOPED_TRACE(target);
      const RestrictTo restriction(target);
      ExpectSame(MeshStereo(options).Match(scene.left, scene.right), expected);
    }
  }
}

TEST(MeshStereo, TheSeedMovesTheResultLittle) {
  const SquareScene scene;
  MeshStereoOptions options = With("sgf");
  const MeshStereoResult first = MeshStereo(options).Match(scene.left, scene.right);
  options.seed = 2;
  const MeshStereoResult second = MeshStereo(options).Match(scene.left, scene.right);
  const double mean = cv::norm(first.disparity, second.disparity, cv::NORM_L1) /
                      static_cast<double>(first.disparity.total());
  EXPECT_GT(mean, 0);
  EXPECT_LT(mean, 0.25);
}

TEST(MeshStereo, TellsForegroundFromBackground) {
  const SquareScene scene;
  const MeshStereoResult result = MeshStereo(With("sgf")).Match(scene.left, scene.right);
  const double error = MeanError(result.disparity, [&](int x, int y) {
    return scene.square.contains({x, y}) ? SquareScene::kNear : SquareScene::kFar;
  });
  EXPECT_LT(error, 0.4);
  // What the square hides from the right image is background that nothing confirms.
  const cv::Rect hidden(scene.square.x - 8, scene.square.y + 2, 6, scene.square.height - 4);
  EXPECT_LT(cv::countNonZero(result.valid(hidden)), hidden.area() / 4);
  EXPECT_NEAR(cv::mean(result.disparity(hidden))[0], SquareScene::kFar, 1);
}

// Places of vertices, each counted once.
size_t Places(const DisparityMesh& mesh) {
  std::set<std::pair<float, float>> places;
  for (const cv::Point3f& v : mesh.vertices) places.insert({v.x, v.y});
  return places.size();
}

TEST(MeshStereo, SplitsTheMeshAtStepsOnly) {
  const SquareScene scene;
  const DisparityMesh split = MeshStereo(With("sgf")).Match(scene.left, scene.right).mesh;
  EXPECT_EQ(Places(split), BuildMesh(scene.left, {}).vertices.size());
  EXPECT_GE(split.vertices.size(), Places(split) + 10);

  const auto [left, right] = ShiftedPair({120, 90}, 5, 8);
  const DisparityMesh whole = MeshStereo(With("sgf")).Match(left, right).mesh;
  EXPECT_EQ(whole.vertices.size(), Places(whole));
}

TEST(MeshStereo, TheMeshIsThatOfTheLeftImageAndLiesOnItsDisparities) {
  const auto plane = [](int x, int y) { return 4 + 0.06 * x + 0.02 * y; };
  const auto [left, right] = PairWith({120, 90}, plane, 9);
  const DisparityMesh mesh = MeshStereo(With("sgf")).Match(left, right).mesh;
  EXPECT_EQ(mesh.triangles.size(), BuildMesh(left, {}).triangles.size());
  double sum = 0;
  for (const auto& triangle : mesh.triangles)
    for (const int v : triangle) {
      ASSERT_GE(v, 0);
      ASSERT_LT(v, static_cast<int>(mesh.vertices.size()));
      const cv::Point3f p = mesh.vertices[v];
      sum += std::abs(p.z - (4 + 0.06 * (p.x - 0.5) + 0.02 * (p.y - 0.5)));
    }
  EXPECT_LT(sum / (3.0 * static_cast<double>(mesh.triangles.size())), 0.25);
}

// Dense and within the range searched, whatever the images.
void ExpectDefined(const MeshStereoOptions& options, const cv::Mat& left, const cv::Mat& right) {
  const MeshStereoResult result = MeshStereo(options).Match(left, right);
  ASSERT_EQ(result.disparity.size(), left.size());
  ASSERT_EQ(result.valid.size(), left.size());
  const float low = static_cast<float>(options.min_disparity);
  const float high = low + static_cast<float>(options.num_disparities - 1);
  for (const float d : result.disparity) ASSERT_TRUE(d >= low && d <= high) << d;
  for (const auto& triangle : result.mesh.triangles)
    for (const int v : triangle) ASSERT_LT(v, static_cast<int>(result.mesh.vertices.size()));
  for (const cv::Point3f& v : result.mesh.vertices) ASSERT_TRUE(std::isfinite(v.z));
}

TEST(MeshStereo, IsDefinedForImagesOfAnySize) {
  for (const cv::Size size : {cv::Size(1, 1),
                              {2, 2},
                              {2, 3},
                              {7, 9},
                              {60, 1},
                              {1, 60},
                              {60, 5},
                              {13, 13},
                              {14, 40},
                              {61, 14}})
    for (const int most : {1, 8}) {
      SCOPED_TRACE(testing::Message() << size << ' ' << most);
      const cv::Mat1b left = TexturedImage(size, 1), right = TexturedImage(size, 2);
      for (const char* metric : {"sgf", "sad", "census_sobel", "zncc"}) {
        const MeshStereoOptions options = With(metric, std::min(most, size.width));
        ExpectDefined(options, left, right);
        ExpectDefined(options, Tinted(left), Tinted(right));
      }
    }
}

TEST(MeshStereo, IsDefinedWithoutTextureAndWithoutMatches) {
  const cv::Size size(70, 50);
  const cv::Mat1b black(size, 0), grey(size, 100), textured = TexturedImage(size, 3);
  for (const char* metric : {"sgf", "sad", "census_sobel", "zncc"})
    for (const auto& [left, right] : {std::pair{black, black}, {grey, black}, {textured, grey}}) {
      SCOPED_TRACE(metric);
      ExpectDefined(With(metric), left, right);
    }
}

TEST(MeshStereo, IsDefinedForAnyRange) {
  const auto [left, right] = ShiftedPair({70, 50}, 6.4, 3);
  for (const auto& [min, count] :
       {std::pair{0, 1}, {6, 1}, {0, 70}, {-70, 70}, {60, 20}, {200, 10}, {-2047, 3}, {2040, 8}}) {
    SCOPED_TRACE(min);
    MeshStereoOptions options = With("sgf", count);
    options.min_disparity = min;
    ExpectDefined(options, left, right);
  }
}

TEST(MeshStereo, IsDefinedAtTheEndsOfItsOptions) {
  const auto [left, right] = ShiftedPair({70, 50}, 6.4, 3);
  const std::vector<std::function<void(MeshStereoOptions&)>> cases{
      [](auto& o) { o.window = 3; },
      [](auto& o) { o.window = 45; },
      [](auto& o) { o.gamma = 1e-3; },
      [](auto& o) { o.outside_share = 255; },
      [](auto& o) { o.rounds = 0; },
      [](auto& o) { o.passes = o.global_trials = o.random_trials = 0; },
      [](auto& o) { o.smoothness = 1e6; },
      [](auto& o) { o.smoothness = 0; },
      [](auto& o) { o.split_px = o.split_gamma = 1e-3; },
      [](auto& o) { o.split_least = 1e-6; },
      [](auto& o) { o.alignment_weight = 1e-3; },
      [](auto& o) { o.island_share = 1; },
      [](auto& o) { o.left_right_max = 0; },
      [](auto& o) { o.median_window = 0; },
      [](auto& o) {
        o.mesh = {4, 1e-3, 0, 1};
      },
      [](auto& o) {
        o.mesh = {1000, 1e6, 1000, 1000};
      },
      [](auto& o) { o.mesh.spacing_px = 1000; },
      [](auto& o) { o.random_disparity_px = 2047, o.random_slope = 10; },
      [](auto& o) { o.seed = std::numeric_limits<int>::max(); },
  };
  for (size_t i = 0; i < cases.size(); ++i) {
    SCOPED_TRACE(i);
    MeshStereoOptions options = With("sgf");
    cases[i](options);
    ExpectDefined(options, left, right);
  }
}

TEST(MeshStereo, LeavesTheImagesAlone) {
  const auto [left, right] = ShiftedPair({70, 50}, 6.4, 3);
  const cv::Mat left_before = left.clone(), right_before = right.clone();
  MeshStereo(With("sgf")).Match(left, right);
  EXPECT_EQ(cv::countNonZero(left != left_before), 0);
  EXPECT_EQ(cv::countNonZero(right != right_before), 0);
}

TEST(MeshStereo, ComputeGivesSixteenthsOfAPixel) {
  const auto [left, right] = ShiftedPair({70, 50}, 6.4, 3);
  const MeshStereo matcher(With("sgf"));
  cv::Mat1s sixteenths;
  matcher.Compute(left, right, sixteenths);
  const cv::Mat1f disparity = matcher.Match(left, right).disparity;
  ASSERT_EQ(sixteenths.size(), disparity.size());
  for (int y = 0; y < disparity.rows; ++y)
    for (int x = 0; x < disparity.cols; ++x)
      ASSERT_LE(std::abs(static_cast<float>(sixteenths(y, x)) - 16 * disparity(y, x)), 0.5F);
}

std::string MessageFor(const cv::Mat& left, const cv::Mat& right, int num_disparities = 16) {
  return ErrorMessage([&] { MeshStereo(With("sgf", num_disparities)).Match(left, right); });
}

TEST(MeshStereo, RejectsImagesThatDoNotFit) {
  const cv::Mat grey(20, 30, CV_8UC1, 9.0), colour(20, 30, CV_8UC3, 9.0);
  EXPECT_EQ(MessageFor(grey, grey), "no error");
  EXPECT_EQ(MessageFor(cv::Mat(), grey), "left image: is empty");
  EXPECT_EQ(MessageFor(grey, cv::Mat()), "right image: is empty");
  EXPECT_EQ(MessageFor(cv::Mat(20, 30, CV_16UC1, 9.0), grey),
            "left image: has to be 8-bit with one or three channels, got CV_16UC1");
  EXPECT_EQ(MessageFor(grey, cv::Mat(20, 30, CV_32FC1, 9.0)),
            "right image: has to be 8-bit with one or three channels, got CV_32FC1");
  EXPECT_EQ(MessageFor(cv::Mat(20, 30, CV_8UC4, 9.0), colour),
            "left image: has to be 8-bit with one or three channels, got CV_8UC4");
  EXPECT_THAT(MessageFor(grey, cv::Mat(21, 30, CV_8UC1, 9.0)),
              ::testing::HasSubstr("right image: is 30x21"));
  EXPECT_THAT(MessageFor(grey, colour), ::testing::StartsWith("right image: "));
  EXPECT_THAT(MessageFor(colour, grey), ::testing::StartsWith("right image: "));
  EXPECT_EQ(MessageFor(grey, grey, 31), "num_disparities: 31 exceeds the image's width of 30");
}

struct Spoilt {
  const char* message;  // the start of it
  std::function<void(MeshStereoOptions&)> spoil;
};

TEST(MeshStereoOptions, RejectsWhatIsOutOfRangeWithNameAndValue) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Spoilt> cases{
      {"no error", [](auto&) {}},
      {"num_disparities: is 0; it has to be in [1, 2048]", [](auto& o) { o.num_disparities = 0; }},
      {"min_disparity: ", [](auto& o) { o.min_disparity = -2048; }},
      {"tau: ", [](auto& o) { o.tau = 0; }},
      {"threads: ", [](auto& o) { o.threads = -1; }},
      {"window: is 1; it has to be in [3, 45]", [](auto& o) { o.window = 1; }},
      {"window: is 47; it has to be in [3, 45]", [](auto& o) { o.window = 47; }},
      {"window: is 12; it has to be odd", [](auto& o) { o.window = 12; }},
      {"gamma: ", [](auto& o) { o.gamma = 0; }},
      {"cost_window: is 8; it has to be odd", [](auto& o) { o.cost_window = 8; }},
      {"cost_window: ", [](auto& o) { o.cost_window = -1; }},
      {"cost_window: ", [](auto& o) { o.cost_window = 47; }},
      {"outside_share: ", [](auto& o) { o.outside_share = -0.1; }},
      {"outside_share: ", [](auto& o) { o.outside_share = 256; }},
      {"mesh.region_px: is 3; it has to be in [4, 1000]", [](auto& o) { o.mesh.region_px = 3; }},
      {"mesh.compactness: ", [](auto& o) { o.mesh.compactness = 0; }},
      {"mesh.tolerance_px: ", [](auto& o) { o.mesh.tolerance_px = -1; }},
      {"mesh.spacing_px: ", [](auto& o) { o.mesh.spacing_px = 0; }},
      {"rounds: ", [](auto& o) { o.rounds = -1; }},
      {"passes: ", [](auto& o) { o.passes = -1; }},
      {"global_trials: ", [](auto& o) { o.global_trials = -1; }},
      {"random_trials: ", [](auto& o) { o.random_trials = 1001; }},
      {"random_disparity_px: ", [](auto& o) { o.random_disparity_px = -1; }},
      {"random_slope: ", [](auto& o) { o.random_slope = 11; }},
      {"smoothness: ", [](auto& o) { o.smoothness = -1; }},
      {"split_px: ", [](auto& o) { o.split_px = 0; }},
      {"split_gamma: ", [](auto& o) { o.split_gamma = 0; }},
      {"split_least: ", [](auto& o) { o.split_least = 0; }},
      {"split_least: ", [](auto& o) { o.split_least = 1.1; }},
      {"alignment_weight: ", [](auto& o) { o.alignment_weight = 0; }},
      {"island_share: ", [](auto& o) { o.island_share = 1.1; }},
      {"left_right_max: ", [](auto& o) { o.left_right_max = -1; }},
      {"median_window: is 4; it has to be odd", [](auto& o) { o.median_window = 4; }},
      {"median_window: ", [](auto& o) { o.median_window = 47; }},
      {"seed: is -1; it has to be in [0, 2147483647]", [](auto& o) { o.seed = -1; }},
      {"smoothness: is nan; it has to be in [0, 1000000]", [](auto& o) { o.smoothness = kNan; }},
  };
  for (const Spoilt& c : cases) {
    MeshStereoOptions options;
    c.spoil(options);
    EXPECT_THAT(ErrorMessage([&] { MeshStereo{options}; }), ::testing::StartsWith(c.message));
  }
}

TEST(MeshStereoOptions, AreReadFromYaml) {
  MeshStereoOptions options;
  ReadOptions(YAML::Load("{metric: census_sobel, window: 21, mesh: {region_px: 9}, seed: 7}"),
              options, "run.yaml");
  EXPECT_EQ(options.metric, "census_sobel");
  EXPECT_EQ(options.window, 21);
  EXPECT_EQ(options.mesh.region_px, 9);
  EXPECT_EQ(options.seed, 7);
}

}  // namespace
}  // namespace sgf::stereo
