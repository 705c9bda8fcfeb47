#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <support/error_message.h>
#include <support/reference_matcher.h>
#include <support/stereo_images.h>

#include <sgf/core/options.h>
#include <sgf/core/simd.h>
#include <sgf/metrics/registry.h>
#include <sgf/stereo/byte_scale.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/semi_global.h>
#include <sgf/stereo/semi_global_rows.h>
#include <sgf/stereo/stereo_sgf.h>

namespace sgf::stereo {
namespace {

cv::Mat1s Compute(const SemiGlobalOptions& options, const cv::Mat& left, const cv::Mat& right) {
  cv::Mat1s disparity;
  SemiGlobal(options).Compute(left, right, disparity);
  return disparity;
}

SemiGlobalOptions With(const std::string& metric) {
  SemiGlobalOptions options;
  options.metric = metric;
  options.num_disparities = 24;
  return options;
}

int64_t Differences(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); }

class RestrictTo {
 public:
  explicit RestrictTo(const std::string& target) { RestrictSimd(target); }
  ~RestrictTo() { RestrictSimd(""); }
};

// Numbers for every pixel and disparity index of an image.
struct Volume {
  Volume(cv::Size image_size, int disparities)
      : size(image_size), count(disparities), values(image_size.area() * disparities) {}

  int& operator()(int x, int y, int k) { return values[(y * size.width + x) * count + k]; }
  int operator()(int x, int y, int k) const { return values[(y * size.width + x) * count + k]; }
  bool Holds(int x, int y) const { return x >= 0 && x < size.width && y >= 0 && y < size.height; }

  cv::Size size;
  int count;
  std::vector<int> values;
};

// Semi-global matching as its documentation defines it, in the plainest loops.
class ReferenceSemiGlobal {
 public:
  ReferenceSemiGlobal(const cv::Mat& left, const cv::Mat& right, const SemiGlobalOptions& options)
      : options_(options),
        costs_(left.size(), options.num_disparities),
        sums_(left.size(), options.num_disparities) {
    const auto factory = internal::PrepareCostRows(left, right, options, options.window);
    Average(ByteCosts(factory, left.size()), factory.window);
    for (const auto& [dx, dy] :
         {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}})
      AddPaths(dx, dy);
  }

  cv::Mat1s Disparity() const {
    BlockMatcherOptions winners;
    static_cast<CostOptions&>(winners) = options_;
    winners.subpixel = options_.subpixel;
    winners.uniqueness_pct = options_.uniqueness_pct;
    winners.left_right_max = options_.left_right_max;
    return ReferenceMatcher(sums_.size, winners,
                            [&](int x, int y, int disparity) {
                              return sums_(x, y, disparity - options_.min_disparity);
                            })
        .Disparity();
  }

 private:
  // The mean of every eighth row becomes 64; the scale has 16 significant bits.
  Volume ByteCosts(const internal::CostRowsFactory& factory, cv::Size size) const {
    Volume costs(size, options_.num_disparities);
    const auto rows = factory.make();
    std::vector<uint16_t> row(static_cast<size_t>(size.width) * costs.count);
    uint64_t total = 0, number = 0;
    for (int y = 0; y < size.height; ++y) {
      rows->Row(y, costs.count, row.data());
      std::copy(row.begin(), row.end(), &costs(0, y, 0));
      for (const uint16_t cost : row) total += y % 8 == 0 ? cost : 0;
      number += y % 8 == 0 ? row.size() : 0;
    }
    uint64_t scale =
        std::min<uint64_t>((number * 64 << 16) / std::max<uint64_t>(total, 1), 1 << 24);
    const int cut = std::max(0, static_cast<int>(std::bit_width(scale)) - 16);
    scale = scale >> cut << cut;
    for (int& cost : costs.values)
      cost = static_cast<int>(std::min<uint64_t>((cost * scale + 32768) >> 16, 255));
    return costs;
  }

  void Average(const Volume& bytes, int window) {
    const int r = window / 2;
    for (int y = 0; y < bytes.size.height; ++y)
      for (int x = 0; x < bytes.size.width; ++x)
        for (int k = 0; k < bytes.count; ++k) {
          int sum = 0, number = 0;
          for (int v = y - r; v <= y + r; ++v)
            for (int u = x - r; u <= x + r; ++u)
              if (bytes.Holds(u, v)) sum += bytes(u, v, k), ++number;
          const int average = static_cast<int>(sum * internal::AverageFactor(number) >> 15);
          costs_(x, y, k) = std::min(average, 127);
        }
  }

  // Path costs of one direction, eq. 13 of Hirschmueller's paper.
  void AddPaths(int dx, int dy) {
    Volume paths = costs_;
    const cv::Size size = costs_.size;
    for (int j = 0; j < size.height; ++j)
      for (int i = 0; i < size.width; ++i) {
        const int x = dx < 0 ? size.width - 1 - i : i, y = dy < 0 ? size.height - 1 - j : j;
        if (!costs_.Holds(x - dx, y - dy)) continue;
        const int* from = &paths(x - dx, y - dy, 0);
        for (int k = 0; k < costs_.count; ++k) paths(x, y, k) += Step(from, k);
      }
    for (size_t i = 0; i < paths.values.size(); ++i) sums_.values[i] += paths.values[i];
  }

  int Step(const int* from, int k) const {
    const int least = *std::min_element(from, from + costs_.count);
    int step = std::min(from[k], least + options_.p2);
    if (k > 0) step = std::min(step, from[k - 1] + options_.p1);
    if (k + 1 < costs_.count) step = std::min(step, from[k + 1] + options_.p1);
    return step - least;
  }

  SemiGlobalOptions options_;
  Volume costs_, sums_;
};

struct Case {
  const char* name;
  std::function<void(SemiGlobalOptions&)> set;
  cv::Size size{83, 31};
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

// Different from one another in everything that the kernels branch on.
const Case kCases[] = {
    {"defaults", [](auto&) {}},
    {"one_disparity", [](auto& o) { o.num_disparities = 1; }},
    {"seven_disparities", [](auto& o) { o.num_disparities = 7; }},
    {"partial_vector", [](auto& o) { o.num_disparities = 45; }},
    {"whole_vectors", [](auto& o) { o.num_disparities = 64; }},
    {"all_columns", [](auto& o) { o.num_disparities = 83; }},
    {"window_1", [](auto& o) { o.window = 1; }},
    {"largest_window", [](auto& o) { o.window = 11; }},
    {"min_disparity_5", [](auto& o) { o.min_disparity = 5; }},
    {"min_disparity_minus_9", [](auto& o) { o.min_disparity = -9; }},
    {"out_of_the_image", [](auto& o) { o.min_disparity = 70; }},
    {"no_penalties", [](auto& o) { o.p1 = o.p2 = 0; }},
    {"largest_penalties", [](auto& o) { o.p1 = o.p2 = 127; }},
    {"not_unique", [](auto& o) { o.uniqueness_pct = 0; }},
    {"very_unique", [](auto& o) { o.uniqueness_pct = 40; }},
    {"no_left_right", [](auto& o) { o.left_right_max = -1; }},
    {"strict_left_right", [](auto& o) { o.left_right_max = 0; }},
    {"no_subpixel", [](auto& o) { o.subpixel = Subpixel::kNone; }},
    {"equiangular", [](auto& o) { o.subpixel = Subpixel::kEquiangular; }},
    {"one_row", [](auto& o) { o.window = 1; }, {83, 1}},
    {"two_rows", [](auto& o) { o.window = 1; }, {83, 2}},
    {"one_column", [](auto& o) { o.window = o.num_disparities = 1; }, {1, 31}},
    {"many_rows", [](auto& o) { o.num_disparities = 9; }, {21, 150}},
};

SemiGlobalOptions OptionsOf(const Case& c, const std::string& metric) {
  SemiGlobalOptions options = With(metric);
  options.num_disparities = 32;
  c.set(options);
  return options;
}

// A pair with matches, non-matches, flat parts and opposite gradients.
std::pair<cv::Mat1b, cv::Mat1b> MixedPair(cv::Size size) {
  auto [left, right] = ShiftedPair({83, 150}, 6.4, 3);
  left(cv::Rect(20, 8, 14, 12)) = 128;
  right(cv::Rect(16, 8, 12, 12)) = 128;
  right(cv::Rect(60, 0, 23, 31)) = TexturedImage({23, 31}, 9);
  right(cv::Rect(0, 20, 83, 5)) = 255 - right(cv::Rect(0, 20, 83, 5));
  const cv::Rect part({0, 0}, size);
  return {left(part).clone(), right(part).clone()};
}

class SemiGlobalKernelTest : public ::testing::TestWithParam<Case> {};

TEST_P(SemiGlobalKernelTest, EqualsThePlainDefinitionOnEveryInstructionSet) {
  const auto [left, right] = MixedPair(GetParam().size);
  for (const char* metric : {"sgf", "sad", "zncc"}) {
    const SemiGlobalOptions options = OptionsOf(GetParam(), metric);
    const cv::Mat1s expected = ReferenceSemiGlobal(left, right, options).Disparity();
    for (const std::string& target : SimdTargets()) {
      const RestrictTo restriction(target);
      EXPECT_EQ(Differences(Compute(options, left, right), expected), 0)
          << metric << " on " << target;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, SemiGlobalKernelTest, ::testing::ValuesIn(kCases),
                         [](const auto& test) { return test.param.name; });

TEST(SemiGlobalKernel, ScalesCostsToBytesOnEveryInstructionSet) {
  std::vector<uint16_t> costs(5 * 37);
  for (size_t i = 0; i < costs.size(); ++i) costs[i] = static_cast<uint16_t>(i * i * i);
  for (const uint32_t scale : {64U, 65535U, 65536U, 0x28000U, 1U << 24})
    for (const int count : {1, 15, 16, 37})
      for (const std::string& target : SimdTargets()) {
        const RestrictTo restriction(target);
        std::vector<uint8_t> bytes(5 * 40, 77);
        internal::ScaleToBytes(costs.data(), 5, count, scale, 40, bytes.data());
        for (int x = 0; x < 5; ++x)
          for (int k = 0; k < 40; ++k) {
            const uint64_t cost = k < count ? costs[x * count + k] : 0;
            const uint64_t expected = std::min<uint64_t>((cost * scale + 32768) >> 16, 255);
            ASSERT_EQ(bytes[x * 40 + k], k < count ? expected : 77) << scale << " " << target;
          }
      }
}

std::vector<std::string> StereoMetrics() {
  std::vector<std::string> names{std::string(kCensusSobel)};
  for (const auto& metric : metrics::AllMetrics())
    if (metric.traits.kind != metrics::MetricKind::kPatch) names.emplace_back(metric.name);
  return names;
}

// Share of the pixels away from the border whose disparity is within half a px of the truth.
double ShareRight(const SemiGlobalOptions& options, const cv::Mat1s& disparity, double truth) {
  const cv::Mat1f values = SemiGlobal(options).ToFloat(disparity);
  const cv::Mat1f inner = values(cv::Rect(24, 6, values.cols - 30, values.rows - 12));
  int good = 0;
  for (const float value : inner) good += std::abs(value - truth) <= 0.5;
  return good / static_cast<double>(inner.total());
}

class SemiGlobalMetricTest : public ::testing::TestWithParam<std::string> {};

TEST_P(SemiGlobalMetricTest, FindsTheDisparityOfAShiftedTexture) {
  SemiGlobalOptions options = With(GetParam());
  options.uniqueness_pct = 0;
  const auto [left, right] = ShiftedPair({120, 40}, 7, 1);
  EXPECT_GT(ShareRight(options, Compute(options, left, right), 7), 0.999);
}

TEST_P(SemiGlobalMetricTest, GivesTheSameBitsForAnyNumberOfThreads) {
  SemiGlobalOptions options = With(GetParam());
  const auto [left, right] = ShiftedPair({70, 50}, 5.3, 2);
  const cv::Mat1s one = Compute(options, left, right);
  for (const int threads : {2, 3, 8}) {
    options.threads = threads;
    EXPECT_EQ(Differences(Compute(options, left, right), one), 0) << threads;
  }
}

TEST_P(SemiGlobalMetricTest, SweepsUniquenessAsIfMatchedAnew) {
  SemiGlobalOptions options = With(GetParam());
  options.speckle_window = 10;
  const auto [left, right] = MixedPair({83, 40});
  const Matches matches = SemiGlobal(options).Match(left, right);
  for (const double uniqueness : {0., 5., 60.}) {
    options.uniqueness_pct = uniqueness;
    const cv::Mat1s filtered = SemiGlobal(options).Filter(matches, uniqueness);
    EXPECT_EQ(Differences(filtered, Compute(options, left, right)), 0) << uniqueness;
  }
}

INSTANTIATE_TEST_SUITE_P(Table, SemiGlobalMetricTest, ::testing::ValuesIn(StereoMetrics()),
                         [](const auto& test) { return test.param; });

TEST(SemiGlobal, PenaltiesCarryMatchesThroughNoise) {
  auto [left, right] = ShiftedPair({120, 40}, 7, 1);
  cv::Mat1b noise(left.size());
  cv::RNG(5).fill(noise, cv::RNG::NORMAL, 60, 30);
  left += noise;
  SemiGlobalOptions options = With("sgf");
  options.window = 3;
  options.uniqueness_pct = 0;
  const double with = ShareRight(options, Compute(options, left, right), 7);
  options.p1 = options.p2 = 0;
  const double without = ShareRight(options, Compute(options, left, right), 7);
  EXPECT_LT(without, 0.7);
  EXPECT_GT(with, 0.9);
}

TEST(SemiGlobal, FillsAFlatPartFromItsSurroundings) {
  auto [left, right] = ShiftedPair({120, 60}, 7, 1);
  left(cv::Rect(50, 20, 30, 20)) = 100;
  right(cv::Rect(43, 20, 30, 20)) = 100;
  SemiGlobalOptions options = With("sgf");
  options.uniqueness_pct = 0;
  const cv::Mat1s disparity = Compute(options, left, right);
  EXPECT_EQ(cv::countNonZero(cv::abs(disparity(cv::Rect(50, 20, 30, 20)) - 16 * 7) <= 16), 600);
}

TEST(SemiGlobal, FindsNothingUniqueWithoutTexture) {
  const cv::Mat1b flat(20, 40, uint8_t{90});
  for (const char* metric : {"sgf", "sad", "census", "zncc"}) {
    SemiGlobalOptions options = With(metric);
    const cv::Mat1s disparity = Compute(options, flat, flat);
    // But for columns with no more than two candidates, which are neighbours.
    EXPECT_EQ(cv::countNonZero(disparity.colRange(2, 40) != -16), 0) << metric;
    options.uniqueness_pct = 0;
    EXPECT_EQ(Differences(Compute(options, flat, flat), cv::Mat1s::zeros(20, 40)), 0) << metric;
  }
}

TEST(SemiGlobal, TakesImagesOfOtherDepths) {
  const auto [left, right] = MixedPair({83, 40});
  const SemiGlobalOptions options = With("sgf");
  const cv::Mat1s expected = Compute(options, left, right);
  for (const int depth : {CV_16U, CV_32F}) {
    cv::Mat left_deep, right_deep;
    left.convertTo(left_deep, depth);
    right.convertTo(right_deep, depth);
    EXPECT_EQ(Differences(Compute(options, left_deep, right_deep), expected), 0) << depth;
  }
}

TEST(SemiGlobal, RejectsImagesThatDoNotFit) {
  cv::Mat1s out;
  const auto message = [&](const cv::Mat& left, const cv::Mat& right, const std::string& metric) {
    return ErrorMessage([&] { SemiGlobal(With(metric)).Compute(left, right, out); });
  };
  const cv::Mat good(30, 40, CV_8U, cv::Scalar(0)), narrow(30, 20, CV_8U), low(4, 40, CV_8U);
  EXPECT_EQ(message(cv::Mat(), good, "sgf"), "left image: image is empty");
  EXPECT_EQ(message(good, cv::Mat(30, 41, CV_8U), "sgf"),
            "right image: is 41x30 CV_8UC1, the left image 40x30 CV_8UC1");
  EXPECT_EQ(message(narrow, narrow, "sgf"), "num_disparities: 24 exceeds the image's width of 20");
  EXPECT_EQ(message(low, low, "sgf"), "window: 5 exceeds the image of 40x4");
  EXPECT_TRUE(out.empty());
  EXPECT_EQ(message(cv::Mat(30, 40, CV_16U), cv::Mat(30, 40, CV_16U), "census_sobel"),
            "metric: census_sobel needs 8-bit images, got CV_16UC1");
  EXPECT_THROW(SemiGlobal(With("sgf")).Match(low, low), Error);
  EXPECT_THROW(SemiGlobal(With("sgf")).Filter(Matches{}, 100), Error);
}

std::string MessageFor(const std::function<void(SemiGlobalOptions&)>& spoil) {
  SemiGlobalOptions options;
  spoil(options);
  return ErrorMessage([&] { SemiGlobal{options}; });
}

TEST(SemiGlobalOptions, RejectsWhatIsOutOfRangeWithNameAndValue) {
  EXPECT_EQ(MessageFor([](auto&) {}), "no error");
  EXPECT_EQ(MessageFor([](auto& o) { o.num_disparities = 0; }),
            "num_disparities: is 0; it has to be in [1, 2048]");
  EXPECT_EQ(MessageFor([](auto& o) { o.window = 13; }), "window: is 13; it has to be in [1, 11]");
  EXPECT_EQ(MessageFor([](auto& o) { o.window = 4; }), "window: is 4; it has to be odd");
  EXPECT_EQ(MessageFor([](auto& o) { o.p2 = 128; }), "p2: is 128; it has to be in [0, 127]");
  EXPECT_EQ(MessageFor([](auto& o) { o.p1 = 100, o.p2 = 99; }),
            "p1: is 100; it has to be in [0, 99]");
  EXPECT_EQ(MessageFor([](auto& o) { o.p1 = -1; }), "p1: is -1; it has to be in [0, 120]");
  EXPECT_EQ(MessageFor([](auto& o) { o.uniqueness_pct = 100; }),
            "uniqueness_pct: is 100; it has to be in [0, 99]");
  EXPECT_EQ(MessageFor([](auto& o) { o.left_right_max = -2; }),
            "left_right_max: is -2; it has to be in [-1, 2047]");
  EXPECT_EQ(MessageFor([](auto& o) { o.speckle_window = -1; }),
            "speckle_window: is -1; it has to be in [0, 1000000000]");
  EXPECT_EQ(MessageFor([](auto& o) { o.metric = "lssd"; }),
            "metric: 'lssd' compares patches and cannot be a stereo cost");
}

TEST(StereoSgfSemiGlobal, SwapsInForStereoSgbmThroughTheSameInterface) {
  const auto [left, right] = ShiftedPair({160, 60}, 11, 1);
  for (const cv::Ptr<cv::StereoMatcher>& matcher :
       {cv::Ptr<cv::StereoMatcher>(cv::StereoSGBM::create(0, 32, 5)),
        cv::Ptr<cv::StereoMatcher>(StereoSgfSemiGlobal::create(0, 32, 5))}) {
    cv::Mat disparity;
    matcher->compute(left, right, disparity);
    ASSERT_EQ(disparity.type(), CV_16SC1);
    ASSERT_EQ(disparity.size(), left.size());
    EXPECT_NEAR(disparity.at<short>(30, 80), 16 * 11, 2);
  }
}

TEST(StereoSgfSemiGlobal, KeepsItsParameters) {
  const auto matcher = StereoSgfSemiGlobal::create(0, 48, 7);
  EXPECT_EQ(matcher->getNumDisparities(), 48);
  EXPECT_EQ(matcher->getBlockSize(), 7);
  matcher->setMinDisparity(-3);
  matcher->setNumDisparities(20);
  matcher->setBlockSize(3);
  matcher->setSpeckleWindowSize(50);
  matcher->setSpeckleRange(2);
  matcher->setDisp12MaxDiff(3);
  matcher->setUniquenessRatio(12);
  matcher->setP1(9);
  matcher->setP2(80);
  matcher->setThreads(2);
  EXPECT_EQ(matcher->getMinDisparity(), -3);
  EXPECT_EQ(matcher->getNumDisparities(), 20);
  EXPECT_EQ(matcher->getBlockSize(), 3);
  EXPECT_EQ(matcher->getSpeckleWindowSize(), 50);
  EXPECT_EQ(matcher->getSpeckleRange(), 2);
  EXPECT_EQ(matcher->getDisp12MaxDiff(), 3);
  EXPECT_EQ(matcher->getUniquenessRatio(), 12);
  EXPECT_EQ(matcher->getP1(), 9);
  EXPECT_EQ(matcher->getP2(), 80);
  EXPECT_EQ(matcher->getThreads(), 2);
}

TEST(StereoSgfSemiGlobal, TakesParametersInTheOrderOfStereoSgbm) {
  constexpr std::array kAll = {-3, 48, 7, 9, 80, 2, 63, 12, 50, 4};
  const auto create = [&](auto make) { return std::apply(make, kAll); };
  const auto sgbm = create([](auto... all) { return cv::StereoSGBM::create(all...); });
  const auto ours = create([](auto... all) { return StereoSgfSemiGlobal::create(all...); });
  EXPECT_EQ(ours->getMinDisparity(), sgbm->getMinDisparity());
  EXPECT_EQ(ours->getNumDisparities(), sgbm->getNumDisparities());
  EXPECT_EQ(ours->getBlockSize(), sgbm->getBlockSize());
  EXPECT_EQ(ours->getP1(), sgbm->getP1());
  EXPECT_EQ(ours->getP2(), sgbm->getP2());
  EXPECT_EQ(ours->getDisp12MaxDiff(), sgbm->getDisp12MaxDiff());
  EXPECT_EQ(ours->getUniquenessRatio(), sgbm->getUniquenessRatio());
  EXPECT_EQ(ours->getSpeckleWindowSize(), sgbm->getSpeckleWindowSize());
  EXPECT_EQ(ours->getSpeckleRange(), sgbm->getSpeckleRange());
}

TEST(StereoSgfSemiGlobal, ZerosStandForDefaults) {
  const SemiGlobalOptions defaults;
  for (const auto& matcher :
       {StereoSgfSemiGlobal::create(), StereoSgfSemiGlobal::create(0, 0, 5, 0, 0, 0)}) {
    EXPECT_EQ(matcher->getMinDisparity(), defaults.min_disparity);
    EXPECT_EQ(matcher->getNumDisparities(), defaults.num_disparities);
    EXPECT_EQ(matcher->getBlockSize(), defaults.window);
    EXPECT_EQ(matcher->getP1(), defaults.p1);
    EXPECT_EQ(matcher->getP2(), defaults.p2);
    EXPECT_EQ(matcher->getDisp12MaxDiff(), defaults.left_right_max);
    EXPECT_EQ(matcher->getUniquenessRatio(), defaults.uniqueness_pct);
    EXPECT_EQ(matcher->getSpeckleWindowSize(), defaults.speckle_window);
    EXPECT_EQ(matcher->getSpeckleRange(), defaults.speckle_range);
  }
  EXPECT_EQ(StereoSgfSemiGlobal::create(0, 16, 5, 0, 0, -5)->getDisp12MaxDiff(), -1);
}

TEST(StereoSgfSemiGlobal, ThrowsForPenaltiesInTheUnitsOfStereoSgbm) {
  EXPECT_EQ(ErrorMessage([] { StereoSgfSemiGlobal::create(0, 16, 5, 8 * 25, 32 * 25); }),
            "p2: is 800; it has to be in [0, 127]");
}

TEST(StereoSgfSemiGlobal, ThrowsForBadParametersAndImages) {
  EXPECT_THROW(StereoSgfSemiGlobal::create(0, -16, 5), Error);
  EXPECT_THROW(StereoSgfSemiGlobal::create(0, 16, 4), Error);
  cv::Mat disparity;
  EXPECT_THROW(StereoSgfSemiGlobal::create(0, 16, 5)->compute(cv::Mat(), cv::Mat(), disparity),
               Error);
}

}  // namespace
}  // namespace sgf::stereo
