// The row kernels against the plainest definition, bit by bit, on every instruction set.

#include <algorithm>
#include <functional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/reference_matcher.h>
#include <support/stereo_images.h>

#include <sgf/core/simd.h>
#include <support/fixed_point.h>
#include <sgf/metrics/registry.h>
#include <sgf/metrics/sample_image.h>
#include <sgf/stereo/band.h>
#include <sgf/stereo/block_matcher.h>

namespace sgf::stereo {
namespace {

struct Case {
  const char* name;
  std::function<void(BlockMatcherOptions&)> set;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

// Different from one another in everything that the kernels branch on: whole and partial vectors,
// windows, borders on either side, checks, interpolation, operators, epsilon as number and map.
const Case kCases[] = {
    {"defaults", [](auto&) {}},
    {"one_disparity", [](auto& o) { o.num_disparities = 1; }},
    {"seven_disparities", [](auto& o) { o.num_disparities = 7; }},
    {"partial_vector", [](auto& o) { o.num_disparities = 45; }},
    {"all_columns", [](auto& o) { o.num_disparities = 83; }},
    {"window_1", [](auto& o) { o.window = 1; }},
    {"window_15", [](auto& o) { o.window = 15; }},
    {"window_of_the_height", [](auto& o) { o.window = 31; }},
    {"min_disparity_5", [](auto& o) { o.min_disparity = 5; }},
    {"min_disparity_minus_9", [](auto& o) { o.min_disparity = -9; }},
    {"out_of_the_image", [](auto& o) { o.min_disparity = 70; }},
    {"not_unique", [](auto& o) { o.uniqueness_pct = 0; }},
    {"very_unique", [](auto& o) { o.uniqueness_pct = 40; }},
    {"no_left_right", [](auto& o) { o.left_right_max = -1; }},
    {"strict_left_right", [](auto& o) { o.left_right_max = 0; }},
    {"no_subpixel", [](auto& o) { o.subpixel = Subpixel::kNone; }},
    {"parabola", [](auto& o) { o.subpixel = Subpixel::kParabola; }},
    {"central_differences", [](auto& o) { o.gradient = GradientOperator::kCentral; }},
    {"large_tau", [](auto& o) { o.tau = 0.05; }},
    {"tiles",
     [](auto& o) {
       o.epsilon = {metrics::EpsilonScope::kTile, 16};
     }},
    {"noise_floor", [](auto& o) { o.epsilon.noise_floor = 50; }},
};

BlockMatcherOptions OptionsOf(const Case& c) {
  BlockMatcherOptions options;
  options.num_disparities = 32;
  options.window = 5;
  c.set(options);
  return options;
}

std::vector<metrics::FixedSample> FixedSamples(const cv::Mat& image, const BlockMatcherOptions& o,
                                               int scale) {
  const auto samples = metrics::MakeSampleImage(image, o.gradient, o.epsilon, o.tau);
  std::vector<metrics::FixedSample> fixed;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      fixed.push_back(metrics::QuantizeSample(samples.At(y, x), scale));
  return fixed;
}

// Sum over the part of the window inside the left image; the right image's border is repeated.
template <class Cost>
int64_t WindowSum(cv::Size size, int window, int x, int y, int disparity, Cost cost) {
  const int r = window / 2;
  int64_t sum = 0;
  for (int v = std::max(0, y - r); v <= std::min(size.height - 1, y + r); ++v)
    for (int u = std::max(0, x - r); u <= std::min(size.width - 1, x + r); ++u)
      sum += cost(v, u, std::clamp(u - disparity, 0, size.width - 1));
  return sum;
}

cv::Mat1s ReferenceSgf(const cv::Mat& left, const cv::Mat& right,
                       const BlockMatcherOptions& options) {
  const int scale = internal::SgfCostScale(options.window);
  const auto l = FixedSamples(left, options, scale), r = FixedSamples(right, options, scale);
  const auto cost = [&](int y, int x, int x_right) {
    return metrics::FixedSgfCost(l[y * left.cols + x], r[y * left.cols + x_right], scale);
  };
  const ReferenceMatcher matcher(left.size(), options, [&](int x, int y, int disparity) {
    return WindowSum(left.size(), options.window, x, y, disparity, cost);
  });
  return matcher.Disparity();
}

// A pair with matches, non-matches, saturated and flat parts.
std::pair<cv::Mat1b, cv::Mat1b> MixedPair() {
  auto [left, right] = ShiftedPair({83, 31}, 6.4, 3);
  left(cv::Rect(20, 8, 14, 12)) = 128;
  right(cv::Rect(16, 8, 12, 12)) = 128;
  right(cv::Rect(60, 0, 23, 31)) = TexturedImage({23, 31}, 9);
  return {left, right};
}

int64_t Differences(const cv::Mat1s& a, const cv::Mat1s& b) { return cv::countNonZero(a != b); }

class RestrictTo {
 public:
  explicit RestrictTo(const std::string& target) { RestrictSimd(target); }
  ~RestrictTo() { RestrictSimd(""); }
};

class SgfKernelTest : public ::testing::TestWithParam<Case> {};

TEST_P(SgfKernelTest, EqualsTheScalarDefinitionOnEveryInstructionSet) {
  const BlockMatcherOptions options = OptionsOf(GetParam());
  const auto [left, right] = MixedPair();
  const cv::Mat1s expected = ReferenceSgf(left, right, options);
  for (const std::string& target : SimdTargets()) {
    const RestrictTo restriction(target);
    cv::Mat1s disparity;
    BlockMatcher(options).Compute(left, right, disparity);
    EXPECT_EQ(Differences(disparity, expected), 0) << target;
  }
}

TEST_P(SgfKernelTest, EqualsItselfOnTheSameImageAsFloat) {
  const BlockMatcherOptions options = OptionsOf(GetParam());
  const auto [left, right] = MixedPair();
  cv::Mat1f left_float, right_float;
  left.convertTo(left_float, CV_32F);
  right.convertTo(right_float, CV_32F);
  cv::Mat1s from_pixels, from_floats;
  BlockMatcher(options).Compute(left, right, from_pixels);
  BlockMatcher(options).Compute(left_float, right_float, from_floats);
  EXPECT_EQ(Differences(from_pixels, from_floats), 0);
}

INSTANTIATE_TEST_SUITE_P(All, SgfKernelTest, ::testing::ValuesIn(kCases),
                         [](const auto& test) { return test.param.name; });

TEST(SgfKernel, SumsOfTheLargestCostsFitTheirLanes) {
  // Opposite gradients everywhere: every cost is the largest there is.
  cv::Mat1b left(40, 60), right(40, 60);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 60; ++x) {
      left(y, x) = static_cast<uint8_t>(4 * x);
      right(y, x) = static_cast<uint8_t>(255 - 4 * x);
    }
  BlockMatcherOptions options;
  options.num_disparities = 20;
  options.uniqueness_pct = 0;
  for (const int window : {9, 15, 21, 23, 31, 39}) {
    options.window = window;
    cv::Mat1s disparity;
    BlockMatcher(options).Compute(left, right, disparity);
    EXPECT_EQ(Differences(disparity, ReferenceSgf(left, right, options)), 0) << window;
    EXPECT_LE(2 * (internal::SgfCostScale(window) + 1) * window * window, 65534) << window;
  }
}

// The general kernel, on the dissimilarities that take other paths to their costs.
template <class Cost>
void ExpectGeneralKernelEquals(const BlockMatcherOptions& options, const cv::Mat& left,
                               const cv::Mat& right, Cost cost) {
  const ReferenceMatcher matcher(left.size(), options, [&](int x, int y, int disparity) {
    return WindowSum(left.size(), options.window, x, y, disparity, cost);
  });
  const cv::Mat1s expected = matcher.Disparity();
  for (const std::string& target : SimdTargets()) {
    const RestrictTo restriction(target);
    cv::Mat1s disparity;
    BlockMatcher(options).Compute(left, right, disparity);
    EXPECT_EQ(Differences(disparity, expected), 0) << options.metric << " on " << target;
  }
}

class GeneralKernelTest : public ::testing::TestWithParam<Case> {};

TEST_P(GeneralKernelTest, SumsAbsoluteDifferencesAsDefined) {
  BlockMatcherOptions options = OptionsOf(GetParam());
  options.metric = "sad";
  const auto [left, right] = MixedPair();
  ExpectGeneralKernelEquals(options, left, right, [l = left, r = right](int y, int x, int x_right) {
    return 256 * std::abs(l(y, x) - r(y, x_right));
  });
}

TEST_P(GeneralKernelTest, SumsHammingDistancesAsDefined) {
  BlockMatcherOptions options = OptionsOf(GetParam());
  options.metric = "census";
  const auto [left, right] = MixedPair();
  const auto l = metrics::ComputeCensus(left), r = metrics::ComputeCensus(right);
  ExpectGeneralKernelEquals(options, left, right, [&](int y, int x, int x_right) {
    return metrics::Census{}(l.Row(y)[x], r.Row(y)[x_right]);
  });
}

INSTANTIATE_TEST_SUITE_P(All, GeneralKernelTest, ::testing::ValuesIn(kCases),
                         [](const auto& test) { return test.param.name; });

TEST(WindowKernel, TakesTheDissimilarityOfTheWholeWindow) {
  BlockMatcherOptions options = OptionsOf(kCases[0]);
  options.metric = "zncc";
  const auto [left, right] = MixedPair();
  const auto l = metrics::MakeSampleImage(left, options.gradient, options.epsilon);
  const auto r = metrics::MakeSampleImage(right, options.gradient, options.epsilon);
  const ReferenceMatcher matcher(
      left.size(), options, [&, size = left.size()](int x, int y, int disparity) {
        metrics::Zncc::Sums<double> sums;
        WindowSum(size, options.window, x, y, disparity, [&](int v, int u, int u_right) {
          const auto i = l.At(v, u), j = r.At(v, u_right);
          sums.Add(metrics::MakeSample<double>(i.intensity, i.gx, i.gy, 1),
                   metrics::MakeSample<double>(j.intensity, j.gx, j.gy, 1));
          return 0;
        });
        return static_cast<int64_t>(16383 * static_cast<float>(metrics::Zncc{}.Value(sums)) + 0.5F);
      });
  cv::Mat1s disparity;
  BlockMatcher(options).Compute(left, right, disparity);
  EXPECT_EQ(Differences(disparity, matcher.Disparity()), 0);
}

}  // namespace
}  // namespace sgf::stereo
