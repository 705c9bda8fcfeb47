// Costs of slanted planes against the plainest definition, bit by bit, on every instruction set.

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <support/stereo_images.h>

#include <sgf/core/simd.h>
#include <sgf/stereo/plane_cost.h>

namespace sgf::stereo::internal {
namespace {

constexpr float kNoLimit = std::numeric_limits<float>::max();

class RestrictTo {
 public:
  explicit RestrictTo(const std::string& target) { RestrictSimd(target); }
  ~RestrictTo() { RestrictSimd(""); }
};

// Any numbers as the costs of a pair.
class GivenRows : public CostRows {
 public:
  GivenRows(cv::Size size, int count, uint64_t seed) : width_(size.width), count_(count) {
    std::mt19937_64 random(seed);
    costs_.resize(static_cast<size_t>(size.area()) * count);
    for (uint16_t& cost : costs_) cost = static_cast<uint16_t>(random() % 300);
  }

  void Row(int y, int stride, uint16_t* costs) override {
    for (int x = 0; x < width_; ++x)
      for (int k = 0; k < count_; ++k)
        costs[x * stride + k] = costs_[(static_cast<size_t>(y) * width_ + x) * count_ + k];
  }

 private:
  int width_, count_;
  std::vector<uint16_t> costs_;
};

CostRowsFactory GivenCosts(cv::Size size, int count) {
  return {[=] { return std::make_unique<GivenRows>(size, count, 5); }, 1};
}

CostOptions Range(int min_disparity, int num_disparities) {
  CostOptions options;
  options.min_disparity = min_disparity;
  options.num_disparities = num_disparities;
  return options;
}

int Cost(const VolumeView& view, int x, int y, int k) {
  return view.origin[y * view.row_stride + k * view.index_stride + x];
}

// Byte costs [pixel][disparity] of a pair.
class ByteCosts {
 public:
  ByteCosts(const CostRowsFactory& factory, cv::Size size, const CostOptions& options)
      : size_(size), min_(options.min_disparity), count_(options.num_disparities) {
    ByteCostRows rows(factory, ByteScaleQ16(factory, size, count_), size.width, count_);
    bytes_.resize(static_cast<size_t>(size.area()) * count_);
    for (int y = 0; y < size.height; ++y) rows.Row(y, count_, &bytes_[Index(0, y, 0)]);
  }

  bool Holds(int x) const { return x >= 0 && x < size_.width; }
  // Column of the left image and of the right one that a pixel of either meets.
  int LeftColumn(bool left, int x, int k) const { return left ? x : x + min_ + k; }
  int Partner(bool left, int x, int k) const { return left ? x - min_ - k : x + min_ + k; }

  double Expected(bool left, int x, int y, int k, double outside_share) const {
    if (Holds(Partner(left, x, k))) return bytes_[Index(LeftColumn(left, x, k), y, k)];
    double sum = 0, number = 0;
    for (int m = 0; m < count_; ++m)
      if (Holds(Partner(left, x, m))) {
        sum += bytes_[Index(LeftColumn(left, x, m), y, m)];
        ++number;
      }
    return std::min(255.0, outside_share * (number > 0 ? sum / number : kMeanByteCost));
  }

 private:
  size_t Index(int x, int y, int k) const {
    return (static_cast<size_t>(y) * size_.width + x) * count_ + k;
  }

  cv::Size size_;
  int min_, count_;
  std::vector<uint8_t> bytes_;
};

TEST(CostVolume, BothViewsShowThePairsCostsAndAShareOfTheMeanOutside) {
  const cv::Size size(37, 19);
  for (const auto& [min, count] : {std::pair{0, 20}, {-9, 20}, {5, 21}, {-40, 80}, {30, 37}})
    for (const double share : {0.0, 0.5, 1.0, 9.0}) {
      const CostOptions options = Range(min, count);
      const CostRowsFactory factory = GivenCosts(size, count);
      const CostVolume volume(factory, size, options, share);
      const ByteCosts bytes(factory, size, options);
      for (const bool left : {true, false}) {
        const VolumeView view = left ? volume.Left() : volume.Right();
        double worst_inside = 0, worst_outside = 0;
        for (int y = 0; y < size.height; ++y)
          for (int x = 0; x < size.width; ++x)
            for (int k = 0; k < count; ++k) {
              double& worst = bytes.Holds(bytes.Partner(left, x, k)) ? worst_inside : worst_outside;
              worst = std::max(
                  worst, std::abs(Cost(view, x, y, k) - bytes.Expected(left, x, y, k, share)));
            }
        EXPECT_EQ(worst_inside, 0) << left << ' ' << min << ' ' << share;
        EXPECT_LE(worst_outside, 0.5 + share) << left << ' ' << min << ' ' << share;
      }
    }
}

TEST(CostVolume, DoesNotDependOnThreads) {
  const cv::Size size(37, 40);
  CostOptions options = Range(-3, 20);
  const CostVolume one(GivenCosts(size, 20), size, options, 0.5);
  options.threads = 3;
  const CostVolume three(GivenCosts(size, 20), size, options, 0.5);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      for (int k = 0; k < 20; ++k)
        ASSERT_EQ(Cost(one.Left(), x, y, k), Cost(three.Left(), x, y, k));
}

int ColourDifference(const cv::Mat& image, cv::Point a, cv::Point b) {
  if (image.channels() == 1) return 3 * std::abs(image.at<uint8_t>(a) - image.at<uint8_t>(b));
  const cv::Vec3i u = image.at<cv::Vec3b>(a), v = image.at<cv::Vec3b>(b);
  return static_cast<int>(cv::norm(u - v, cv::NORM_L1));
}

int WeightOf(const cv::Mat& image, cv::Point centre, cv::Point p, double gamma) {
  if (!cv::Rect({}, image.size()).contains(p)) return 0;
  return static_cast<int>(std::lrint(255 * std::exp(-ColourDifference(image, centre, p) / gamma)));
}

cv::Mat Colourful(cv::Size size) {
  cv::Mat image;
  cv::merge(
      std::vector<cv::Mat>{TexturedImage(size, 1), TexturedImage(size, 2), TexturedImage(size, 3)},
      image);
  return image;
}

// Corners, borders and the inside of an image.
std::vector<cv::Point> Spots(cv::Size size) {
  const int right = size.width - 1, bottom = size.height - 1;
  return {{0, 0},           {right, 0},          {0, bottom},
          {right, bottom},  {size.width / 2, 0}, {0, size.height / 3},
          {right, 5},       {13, bottom},        {size.width / 2, size.height / 2},
          {right - 20, 18}, {9, bottom - 10}};
}

TEST(SupportWindows, WeighByLikenessOfColour) {
  const cv::Size size(53, 41);
  for (const cv::Mat& image : {cv::Mat(TexturedImage(size, 6)), Colourful(size)})
    for (const int window : {3, 15, 17, 45})
      for (const double gamma : {0.01, 20.0, 1e5}) {
        const std::vector<cv::Point> centres = Spots(size);
        const SupportWindows windows(image, centres, window, gamma, 2);
        for (int i = 0; i < static_cast<int>(centres.size()); ++i) {
          int total = 0;
          for (int y = 0; y < window; ++y)
            for (int x = 0; x < windows.stride(); ++x) {
              const cv::Point p = centres[i] + cv::Point(x - window / 2, y - window / 2);
              const int expected = x < window ? WeightOf(image, centres[i], p, gamma) : 0;
              ASSERT_EQ(windows.Weights(i)[y * windows.stride() + x], expected) << centres[i] << p;
              total += expected;
            }
          EXPECT_EQ(windows.TotalWeight(i), total);
          EXPECT_EQ(windows.Weight(i, centres[i].x, centres[i].y), 255);
        }
      }
}

// Sum of cost * 32 over a window. The plane is rounded to 1/32 px along the centre column, and so
// is its fall from there along a row.
int64_t ReferenceSum(const VolumeView& view, const SupportWindows& windows, int i,
                     const Plane& plane) {
  const cv::Point centre = windows.Centre(i);
  const int radius = windows.window() / 2, highest = 32 * (view.num_disparities - 1);
  const float start =
      plane.At(static_cast<float>(centre.x), 0) - static_cast<float>(view.min_disparity);
  int64_t sum = 0;
  for (int y = centre.y - radius; y <= centre.y + radius; ++y)
    for (int x = centre.x - radius; x <= centre.x + radius; ++x) {
      if (x < 0 || x >= view.width || y < 0 || y >= view.height) continue;
      const long base = std::lrint(32 * (start + plane.slope_y * static_cast<float>(y)));
      const long fall = std::lrint(32 * plane.slope_x * static_cast<float>(x - centre.x));
      const int at = static_cast<int>(std::clamp(base + fall, 0L, static_cast<long>(highest)));
      const int k = at / 32, part = at % 32;
      const int next = part > 0 ? Cost(view, x, y, k + 1) : 0;
      const int cost = (32 - part) * Cost(view, x, y, k) + part * next;
      sum += int64_t{windows.Weight(i, x, y)} * cost;
    }
  return sum;
}

float ReferenceCost(const VolumeView& view, const SupportWindows& windows, int i,
                    const Plane& plane) {
  return static_cast<float>(static_cast<double>(ReferenceSum(view, windows, i, plane)) /
                            (32.0 * windows.TotalWeight(i)));
}

// Planes through a pixel at disparities in, at the ends of and far out of a range.
std::vector<Plane> PlanesThrough(cv::Point centre, const VolumeView& view) {
  const auto low = static_cast<float>(view.min_disparity);
  const auto count = static_cast<float>(view.num_disparities);
  std::vector<Plane> planes;
  for (const float slope_x : {0.F, 0.03F, -0.4F, 1.F, -1.7F, 3.F, -3.F})
    for (const float slope_y : {0.F, -0.05F, 0.9F, 3.F, -3.F})
      for (const float d : {low, low + 0.37F * count, low + count - 1, low - 30, low + count + 200})
        planes.push_back(Plane::Through(static_cast<float>(centre.x), static_cast<float>(centre.y),
                                        d, slope_x, slope_y));
  return planes;
}

// Number of planes whose cost is not exactly that of the reference.
int Deviations(const VolumeView& view, const SupportWindows& windows, int centres) {
  int count = 0;
  for (int i = 0; i < centres; ++i)
    for (const Plane& plane : PlanesThrough(windows.Centre(i), view))
      if (PlaneCost(view, windows, i, plane, kNoLimit) != ReferenceCost(view, windows, i, plane))
        ++count;
  return count;
}

void ExpectReference(cv::Size size, const CostOptions& options, int window) {
  const CostVolume volume(GivenCosts(size, options.num_disparities), size, options, 0.5);
  const std::vector<cv::Point> centres = Spots(size);
  const SupportWindows windows(Colourful(size), centres, window, 40, 1);
  for (const std::string& target : SimdTargets()) {
    const RestrictTo restriction(target);
    for (const VolumeView& view : {volume.Left(), volume.Right()})
      EXPECT_EQ(Deviations(view, windows, static_cast<int>(centres.size())), 0)
          << target << ", window " << window << ", from " << options.min_disparity;
  }
}

TEST(PlaneCost, EqualsTheDefinitionOnEveryInstructionSet) {
  for (const int window : {3, 15, 17, 35, 45}) {
    ExpectReference({61, 47}, Range(0, 24), window);
    ExpectReference({61, 47}, Range(-9, 33), window);
  }
}

TEST(PlaneCost, EqualsTheDefinitionForAnyRange) {
  ExpectReference({61, 47}, Range(0, 1), 15);
  ExpectReference({61, 47}, Range(12, 2), 35);
  ExpectReference({29, 22}, Range(-200, 150), 35);
  ExpectReference({29, 22}, Range(-1500, 3000), 45);
}

TEST(PlaneCost, IsTheMeanOfCostsInterpolatedOnThePlane) {
  // Costs that rise evenly with the disparity: interpolation is exact, and so is the mean.
  const cv::Size size(80, 60);
  struct RampRows : CostRows {
    void Row(int, int stride, uint16_t* costs) override {
      for (int x = 0; x < 80; ++x)
        for (int k = 0; k < 20; ++k) costs[x * stride + k] = static_cast<uint16_t>(10 + 4 * k);
    }
  };
  const CostRowsFactory ramp{[] { return std::make_unique<RampRows>(); }, 1};
  const CostVolume volume(ramp, size, Range(0, 20), 0.5);
  const SupportWindows windows(cv::Mat1b(size, 7), {{50, 30}}, 15, 20, 1);
  const VolumeView view = volume.Left();
  const double step = (Cost(view, 50, 30, 15) - Cost(view, 50, 30, 5)) / 10.0;
  for (const auto& [slope_x, slope_y] : {std::pair{0.F, 0.F}, {0.31F, -0.2F}, {-0.5F, 0.4F}})
    for (const float d : {7.F, 9.3F, 10.77F}) {
      const Plane plane = Plane::Through(50, 30, d, slope_x, slope_y);
      EXPECT_NEAR(PlaneCost(view, windows, 0, plane, kNoLimit), Cost(view, 50, 30, 0) + step * d,
                  1.0);
    }
}

TEST(PlaneCost, ReachesTheLimitWhereverTheWholeSumDoes) {
  const cv::Size size(61, 47);
  const CostVolume volume(GivenCosts(size, 24), size, Range(0, 24), 0.5);
  const std::vector<cv::Point> centres = Spots(size);
  const SupportWindows windows(Colourful(size), centres, 35, 40, 1);
  const VolumeView view = volume.Left();
  for (int i = 0; i < static_cast<int>(centres.size()); ++i)
    for (const Plane& plane : PlanesThrough(centres[i], view)) {
      const float cost = PlaneCost(view, windows, i, plane, kNoLimit);
      for (const float limit : {-1.F, 0.F, 0.01F, 0.5F * cost, 0.99F * cost, cost}) {
        const float found = PlaneCost(view, windows, i, plane, limit);
        ASSERT_GE(found, limit);
        ASSERT_LE(found, cost);
      }
      for (const float limit : {std::nextafter(cost, 1e9F), 1.01F * cost, 300.F})
        ASSERT_EQ(PlaneCost(view, windows, i, plane, limit), cost);
    }
}

TEST(PlaneCost, APartOfTheSumJustBelowTheLimitIsNotTakenForTheWhole) {
  // Only the centre and one pixel in the last row weigh anything.
  const cv::Size size(31, 31);
  cv::Mat1b image(size, 0);
  const cv::Point centre(15, 15), last(16, 18);
  image(centre) = image(last) = 255;
  const CostVolume volume(GivenCosts(size, 8), size, Range(0, 8), 0.5);
  const SupportWindows windows(image, {centre}, 7, 20, 1);
  const VolumeView view = volume.Left();
  ASSERT_EQ(windows.TotalWeight(0), 2 * 255);
  for (int k = 0; k < 8; ++k) {
    const int first = Cost(view, centre.x, centre.y, k), second = Cost(view, last.x, last.y, k);
    if (second == 0) continue;
    const float limit =
        static_cast<float>((32 * 255.0 * first + 0.5) / (32.0 * windows.TotalWeight(0)));
    const Plane level{0, 0, static_cast<float>(k)};
    EXPECT_EQ(PlaneCost(view, windows, 0, level, kNoLimit),
              0.5F * static_cast<float>(first + second));
    EXPECT_GE(PlaneCost(view, windows, 0, level, limit), limit) << k;
  }
}

}  // namespace
}  // namespace sgf::stereo::internal
