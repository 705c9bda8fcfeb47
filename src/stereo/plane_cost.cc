// Costs of slanted planes, compiled once per instruction set by Highway. All sums are exact
// integers, so that every instruction set gives the same result.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/stereo/plane_cost.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <array>
#include <cmath>

#include <hwy/highway.h>

#include <sgf/core/parallel.h>
#include <sgf/stereo/plane_cost.h>
#include <sgf/stereo/vector_tag-inl.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {

constexpr int kSteps = kStepsPerPx;
constexpr int kRowsPerCheck = 5;  // between looks at the limit

using D16 = VectorTag<int16_t>;
using D32 = hn::RepartitionToWide<D16>;
using V16 = hn::Vec<D16>;
using V32 = hn::Vec<D32>;

// Rows of a window in vectors, at a number of columns that the compiler knows.
template <int kColumns>
struct WindowRows {
  static constexpr int kLanes = static_cast<int>(hn::MaxLanes(D16()));
  static constexpr int kVectors = kColumns / kLanes;

  const VolumeView& view;
  int highest;  // steps at the last disparity
  // The plane along a row in steps, relative to the window's centre column.
  HWY_ALIGN std::array<int16_t, kColumns> offsets;

  WindowRows(const VolumeView& volume, const Plane& plane, int radius)
      : view(volume), highest(kSteps * (volume.num_disparities - 1)) {
    for (int k = 0; k < kColumns; ++k)
      offsets[k] = static_cast<int16_t>(
          std::lrint(static_cast<float>(kSteps) * plane.slope_x * static_cast<float>(k - radius)));
  }

  // Adds weight * cost * kSteps over one row. @param base steps at the centre column.
  HWY_INLINE void Add(const uint8_t* costs, const uint8_t* weights, int base, V32& sum0,
                      V32& sum1) const {
    constexpr int kFew = 4 * kSteps;
    if (std::abs(offsets[kColumns - 1] - offsets[0]) <= kFew) {
      AddVectors<kVectors>(costs, weights, base, 0, sum0, sum1);
    } else {
      for (int k = 0; k < kVectors; ++k) AddVectors<1>(costs, weights, base, k, sum0, sum1);
    }
  }

 private:
  // Vectors [begin, begin + kCount) of a row. Each disparity index that the plane meets there
  // counts by how near the plane it is, down to 0 at a distance of 1 px.
  template <int kCount>
  HWY_INLINE void AddVectors(const uint8_t* costs, const uint8_t* weights, int base, int begin,
                             V32& sum0, V32& sum1) const {
    const D16 d;
    const D32 d32;
    const hn::Rebind<uint8_t, D16> d8;
    const int at = begin * kLanes;
    const auto [near, far] =
        std::minmax({base + offsets[at], base + offsets[at + kCount * kLanes - 1]});
    const int first = std::clamp(near, 0, highest) / kSteps;
    const int last = (std::clamp(far, 0, highest) + kSteps - 1) / kSteps;
    // Relative to `first`, cut to the range of disparities.
    const auto low = hn::Set(d, static_cast<int16_t>(std::max(-kSteps * first, -32768)));
    const auto high = hn::Set(d, static_cast<int16_t>(std::min(highest - kSteps * first, 32767)));
    const auto shift =
        hn::Set(d, static_cast<int16_t>(std::clamp(base - kSteps * first, -16384, 16383)));
    V16 distance[kCount], sum[kCount];
    for (int k = 0; k < kCount; ++k) {
      const auto moved = hn::SaturatedAdd(hn::Load(d, &offsets[at + k * kLanes]), shift);
      distance[k] = hn::Min(hn::Max(moved, low), high);
      sum[k] = hn::Zero(d);
    }
    const auto full = hn::Set(d, int16_t{kSteps});
    const uint8_t* row = costs + at + first * view.index_stride;
    for (int index = first; index <= last; ++index, row += view.index_stride)
      for (int k = 0; k < kCount; ++k) {
        const auto weight = hn::Max(hn::Sub(full, hn::Abs(distance[k])), hn::Zero(d));
        const auto cost = hn::PromoteTo(d, hn::LoadU(d8, row + k * kLanes));
        sum[k] = hn::Add(sum[k], hn::Mul(cost, weight));
        distance[k] = hn::Sub(distance[k], full);
      }
    for (int k = 0; k < kCount; ++k) {
      const auto weight = hn::PromoteTo(d, hn::LoadU(d8, weights + at + k * kLanes));
      sum0 = hn::ReorderWidenMulAccumulate(d32, sum[k], weight, sum0, sum1);
    }
  }
};

template <int kColumns>
uint64_t SumRows(const VolumeView& view, const SupportWindows& windows, int i, const Plane& plane,
                 uint64_t limit) {
  const D32 d32;
  const int radius = windows.window() / 2;
  const cv::Point centre = windows.Centre(i);
  const WindowRows<kColumns> rows(view, plane, radius);
  const int y_begin = std::max(0, centre.y - radius);
  const int y_end = std::min(view.height, centre.y + radius + 1);
  const uint8_t* weights = windows.Weights(i) + (y_begin - centre.y + radius) * kColumns;
  const uint8_t* costs = view.origin + y_begin * view.row_stride + (centre.x - radius);
  const float start =
      plane.At(static_cast<float>(centre.x), 0) - static_cast<float>(view.min_disparity);
  uint64_t total = 0;
  for (int y = y_begin; y < y_end;) {
    auto sum0 = hn::Zero(d32), sum1 = hn::Zero(d32);
    for (const int stop = std::min(y_end, y + kRowsPerCheck); y < stop; ++y) {
      const float d = std::clamp(start + plane.slope_y * static_cast<float>(y), -8000.F, 8000.F);
      rows.Add(costs, weights, static_cast<int>(std::lrint(static_cast<float>(kSteps) * d)), sum0,
               sum1);
      weights += kColumns;
      costs += view.row_stride;
    }
    const hn::RebindToUnsigned<D32> du;
    total += hn::GetLane(hn::SumOfLanes(du, hn::BitCast(du, hn::Add(sum0, sum1))));
    if (total >= limit) return total;
  }
  return total;
}

// Sum of weight * cost * kSteps over a window, or at least `limit`.
uint64_t WindowSum(const VolumeView& view, const SupportWindows& windows, int i, const Plane& plane,
                   uint64_t limit) {
  switch (windows.stride()) {
    case 16:
      return SumRows<16>(view, windows, i, plane, limit);
    case 32:
      return SumRows<32>(view, windows, i, plane, limit);
    default:
      return SumRows<48>(view, windows, i, plane, limit);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sgf::stereo::internal {

HWY_EXPORT(WindowSum);

namespace {

constexpr int kSide = 64;  // columns that windows may read outside the image on either side

// out[k * stride + x] = in[x * count + k], in blocks that stay in the cache.
void Transpose(const uint8_t* in, int width, int count, uint8_t* out, ptrdiff_t stride) {
  constexpr int kBlock = 16;
  for (int k0 = 0; k0 < count; k0 += kBlock)
    for (int x0 = 0; x0 < width; x0 += kBlock)
      for (int k = k0; k < std::min(count, k0 + kBlock); ++k)
        for (int x = x0; x < std::min(width, x0 + kBlock); ++x)
          out[k * stride + x] = in[x * count + k];
}

}  // namespace

CostVolume::CostVolume(const CostRowsFactory& factory, cv::Size size, const CostOptions& options,
                       double outside_share)
    : size_(size),
      min_disparity_(options.min_disparity),
      num_disparities_(options.num_disparities),
      outside_share_(outside_share) {
  const int largest = min_disparity_ + num_disparities_;
  index_stride_ = size.width + 2 * kSide + std::max(0, largest) + std::max(0, -min_disparity_);
  const size_t total = static_cast<size_t>(size.height) * num_disparities_ * index_stride_;
  costs_ = hwy::AllocateAligned<uint8_t>(total + 2 * kSide);
  const uint32_t scale = ByteScaleQ16(factory, size, num_disparities_);
  constexpr int kBands = 16;  // a fixed number: makers of windowed costs start anew in each
  const int bands = std::min(kBands, size.height);
  ParallelFor(bands, options.threads, [&](int i) {
    FillRows(factory, scale, size_.height * i / bands, size_.height * (i + 1) / bands);
  });
}

// Each pixel's mean cost over the disparities that lead into the other image, and kMeanByteCost
// where none does.
struct CostVolume::MeanCosts {
  std::vector<int> left, right;

  MeanCosts(const uint8_t* row, int width, int min_disparity, int count)
      : left(width), right(width) {
    std::vector<int> left_count(width), right_count(width);
    for (int x = 0; x < width; ++x, row += count) {
      const int first = std::max(0, x - min_disparity - (width - 1));
      const int end = std::min(count, x - min_disparity + 1);
      for (int k = first; k < end; ++k) {
        const int partner = x - min_disparity - k;
        left[x] += row[k];
        right[partner] += row[k];
        ++right_count[partner];
      }
      left_count[x] = std::max(0, end - first);
    }
    const auto mean = [](int sum, int n) { return n > 0 ? sum / n : kMeanByteCost; };
    std::transform(left.begin(), left.end(), left_count.begin(), left.begin(), mean);
    std::transform(right.begin(), right.end(), right_count.begin(), right.begin(), mean);
  }
};

void CostVolume::FillRows(const CostRowsFactory& factory, uint32_t scale_q16, int y_begin,
                          int y_end) {
  ByteCostRows rows(factory, scale_q16, size_.width, num_disparities_);
  std::vector<uint8_t> row(static_cast<size_t>(size_.width) * num_disparities_);
  const int left_side = kSide + std::max(0, -min_disparity_);
  for (int y = y_begin; y < y_end; ++y) {
    rows.Row(y, num_disparities_, row.data());
    const MeanCosts mean(row.data(), size_.width, min_disparity_, num_disparities_);
    uint8_t* out =
        costs_.get() + static_cast<ptrdiff_t>(y) * num_disparities_ * index_stride_ + left_side;
    Transpose(row.data(), size_.width, num_disparities_, out, index_stride_);
    for (int k = 0; k < num_disparities_; ++k, out += index_stride_)
      FillOutside(mean, min_disparity_ + k, out);
  }
}

// Sets the costs at disparity d of pixels whose partner lies outside the other image.
void CostVolume::FillOutside(const MeanCosts& mean, int d, uint8_t* costs) const {
  const auto outside = [&](int cost) {
    return static_cast<uint8_t>(std::min(255L, std::lrint(outside_share_ * cost)));
  };
  const int width = size_.width;
  for (int x = 0; x < width; ++x) {
    if (x < d || x >= width + d) costs[x] = outside(mean.left[x]);
    const int seen = x + d;  // where the left image would show the right pixel x
    if (seen < 0 || seen >= width) costs[seen] = outside(mean.right[x]);
  }
}

VolumeView CostVolume::Left() const {
  return {costs_.get() + kSide + std::max(0, -min_disparity_),
          num_disparities_ * index_stride_,
          index_stride_,
          size_.width,
          size_.height,
          min_disparity_,
          num_disparities_};
}

// The right pixel x meets the left one at x + d.
VolumeView CostVolume::Right() const {
  VolumeView view = Left();
  view.origin += min_disparity_;
  view.index_stride += 1;
  return view;
}

namespace {

// Weight by difference of colours, summed over three channels.
std::vector<uint8_t> WeightTable(double gamma) {
  std::vector<uint8_t> table(3 * 255 + 1);
  for (size_t i = 0; i < table.size(); ++i)
    table[i] = static_cast<uint8_t>(std::lrint(255 * std::exp(-static_cast<double>(i) / gamma)));
  return table;
}

template <int kChannels>
int ColourDifference(const uint8_t* a, const uint8_t* b) {
  if constexpr (kChannels == 1) return 3 * std::abs(*a - *b);
  return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]);
}

// Writes the weights of the window around `centre` and returns their sum.
template <int kChannels>
int Weigh(const cv::Mat& image, cv::Point centre, int radius, const std::vector<uint8_t>& table,
          int stride, uint8_t* weights) {
  const uint8_t* middle = image.ptr(centre.y) + kChannels * centre.x;
  const cv::Rect inside = WindowInside(centre, radius, image.size());
  int total = 0;
  for (int y = inside.y; y < inside.br().y; ++y) {
    const uint8_t* row = image.ptr(y);
    uint8_t* out = weights + (y - centre.y + radius) * stride - (centre.x - radius);
    for (int x = inside.x; x < inside.br().x; ++x) {
      out[x] = table[ColourDifference<kChannels>(middle, row + kChannels * x)];
      total += out[x];
    }
  }
  return total;
}

}  // namespace

SupportWindows::SupportWindows(const cv::Mat& image, const std::vector<cv::Point>& centres,
                               int window, double gamma, int threads)
    : window_(window),
      stride_(static_cast<int>(hwy::RoundUpTo(window, 16))),
      centres_(centres),
      weights_(centres.size() * window * stride_),
      totals_(centres.size()) {
  const std::vector<uint8_t> table = WeightTable(gamma);
  const auto weigh = image.channels() == 1 ? Weigh<1> : Weigh<3>;
  ParallelForBatches(static_cast<int>(centres.size()), threads, [&](int i) {
    totals_[i] = weigh(image, centres[i], window / 2, table, stride_,
                       weights_.data() + static_cast<size_t>(i) * window * stride_);
  });
}

float PlaneCost(const VolumeView& view, const SupportWindows& windows, int i, const Plane& plane,
                float limit) {
  const double unit = static_cast<double>(kStepsPerPx) * windows.TotalWeight(i);
  const double most = std::ceil(static_cast<double>(limit) * unit);
  constexpr double kNoLimit = 1e18;
  const auto limit_sum = static_cast<uint64_t>(std::clamp(most, 0.0, kNoLimit));
  const uint64_t sum = HWY_DYNAMIC_DISPATCH(WindowSum)(view, windows, i, plane, limit_sum);
  return static_cast<float>(static_cast<double>(sum) / unit);
}

}  // namespace sgf::stereo::internal
#endif  // HWY_ONCE
