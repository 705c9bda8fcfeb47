// The row kernels of block matching, compiled once per instruction set by Highway.
//
// A band is processed row by row. When an image row enters, every left column x updates its column
// sums V[x][d] over the window's rows, and the window sum slides along x:
// H[x][d] = H[x-1][d] + V[x+r][d] - V[x-r-1][d]. Lanes run along d. The costs of the last `window`
// rows stay in a ring so that they can be taken off when they leave. All sums are exact integers,
// so nothing depends on how rows are split into bands.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/stereo/band.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <array>
#include <numeric>

#include <hwy/highway.h>

#include <sgf/stereo/band.h>
#include <sgf/stereo/row_winners-inl.h>
#include <sgf/stereo/sgf_rows-inl.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {

// The costs that SgfSource makes, as rows.
class SgfCostRows final : public CostRows {
 public:
  SgfCostRows(int width, const CostOptions& options, std::shared_ptr<const SgfImage> left,
              std::shared_ptr<const SgfImage> right)
      : left_(std::move(left)),
        right_(std::move(right)),
        width_(width),
        count_(options.num_disparities),
        source_(TaskOf(width, options), *left_, *right_,
                static_cast<int>(hwy::RoundUpTo(count_, hn::Lanes(D16())))) {}

  void Row(int y, int stride, uint16_t* costs) override {
    const D16 d;
    const hn::RebindToUnsigned<D16> du;
    const int lanes = static_cast<int>(hn::Lanes(d)), whole = count_ / lanes * lanes;
    HWY_ALIGN uint16_t last[HWY_MAX_BYTES / sizeof(uint16_t)];
    source_.StartRow(y);
    for (int x = 0; x < width_; ++x, costs += stride) {
      const auto column = source_.At(x);
      for (int k = 0; k < whole; k += lanes)
        hn::StoreU(hn::BitCast(du, column(d, k)), du, costs + k);
      if (whole == count_) continue;
      hn::Store(hn::BitCast(du, column(d, whole)), du, last);
      std::copy_n(last, count_ - whole, costs + whole);
    }
  }

 private:
  static BandTask TaskOf(int width, const CostOptions& options) {
    BandTask task{};
    task.width = width;
    task.min_disparity = options.min_disparity;
    task.num_disparities = options.num_disparities;
    task.window = 1;
    return task;
  }

  std::shared_ptr<const SgfImage> left_, right_;
  int width_, count_;
  SgfSource source_;
};

// Source of costs for BandMatcher: rows that are made elsewhere.
class RowSource {
 public:
  using Sum = int32_t;
  using Cost = uint16_t;
  using D = VectorTag<Sum>;

  RowSource(const BandTask& task, CostRows& rows, int stride)
      : rows_(rows),
        stride_(stride),
        size_(static_cast<size_t>(task.width) * stride),
        costs_(hwy::AllocateAligned<Cost>(size_)) {
    std::fill_n(costs_.get(), size_, Cost{0});
  }

  void StartRow(int y) { rows_.Row(y, stride_, costs_.get()); }

  struct Column {
    const Cost* costs;
    HWY_INLINE hn::Vec<D> operator()(D d, int k) const {
      return hn::PromoteTo(d, hn::Load(hn::Rebind<Cost, D>(), costs + k));
    }
  };
  HWY_INLINE Column At(int x) const { return {costs_.get() + static_cast<size_t>(x) * stride_}; }

 private:
  CostRows& rows_;
  int stride_;
  size_t size_;
  hwy::AlignedFreeUniquePtr<Cost[]> costs_;
};

template <class Source>
class BandMatcher {
 public:
  BandMatcher(const BandTask& task, int stride, Source& source)
      : task_(task),
        source_(source),
        radius_(task.window / 2),
        stride_(stride),
        whole_(task.num_disparities / LanesOf<Sum>() * LanesOf<Sum>()),
        winners_(task, stride) {
    const size_t row = static_cast<size_t>(task.width) * stride;
    ring_ = Filled<Cost>(task.window * row, 0);
    column_sums_ = Filled<Sum>((task.width + 2 * radius_ + 1) * static_cast<size_t>(stride), 0);
    // Columns run from -radius - 1 to width + radius - 1; those outside the image stay zero.
    column_zero_ = column_sums_.get() + static_cast<size_t>(radius_ + 1) * stride;
    full_reach_ = stride + task.min_disparity - radius_;
    wanted_ = Filled<Sum>(stride, 0);
    std::fill_n(wanted_.get(), task.num_disparities, Sum{-1});
  }

  void Run() {
    for (int y = task_.y_begin - radius_; y < task_.y_end + radius_; ++y) {
      const int slot = (y + task_.window) % task_.window;
      ring_row_ = ring_.get() + static_cast<size_t>(slot) * task_.width * stride_;
      if (y >= 0 && y < task_.height) {
        source_.StartRow(y);
        EnterRow<true>(y - radius_);
      } else {
        EnterRow<false>(y - radius_);
      }
    }
  }

 private:
  using Sum = typename Source::Sum;
  using Cost = typename Source::Cost;
  using D = VectorTag<Sum>;
  using V = hn::Vec<D>;
  static constexpr Sum kMax = SumTraits<Sum>::kMax;

  // Adds the entering row's costs to a vector of column sums and takes the leaving row's off.
  template <bool kInside, bool kPadded, class Column>
  HWY_INLINE V UpdateColumn(const Column& column, int k, Cost* ring, Sum* sums) const {
    const D d;
    const hn::Rebind<Cost, D> d_cost;
    const auto leaving = hn::PromoteTo(d, hn::Load(d_cost, ring + k));
    auto cost = hn::Zero(d);
    if constexpr (kInside) cost = column(d, k);
    // Lanes past the last disparity cost nothing, so that their window sums stay at kMax.
    if constexpr (kInside && kPadded) cost = hn::And(cost, hn::Load(d, wanted_.get() + k));
    hn::Store(hn::DemoteTo(d_cost, cost), d_cost, ring + k);
    const auto sum = hn::Sub(hn::Add(hn::Load(d, sums + k), cost), leaving);
    hn::Store(sum, d, sums + k);
    return sum;
  }

  // Updates the sums of column x and passes each vector on: use(k, sums).
  template <bool kInside, class Use>
  HWY_INLINE void EnterColumn(int x, Use use) {
    if (x < 0 || x >= task_.width) {
      for (int k = 0; k < stride_; k += LanesOf<Sum>()) use(k, hn::Zero(D()));
      return;
    }
    const ptrdiff_t at = static_cast<ptrdiff_t>(x) * stride_;
    Cost* ring = ring_row_ + at;
    Sum* sums = column_zero_ + at;
    const auto column = source_.At(x);
    const int end = x < full_reach_ ? Reach(x) : stride_;
    const int whole = std::min(whole_, end);
#pragma GCC unroll 2
    for (int k = 0; k < whole; k += LanesOf<Sum>())
      use(k, UpdateColumn<kInside, false>(column, k, ring, sums));
    if (whole_ < end) use(whole_, UpdateColumn<kInside, true>(column, whole_, ring, sums));
  }

  // Disparity indices below this, in whole vectors, are candidates of some window that holds column
  // x; the column sums of the others are never looked at and stay zero.
  int Reach(int x) const { return winners_.WholeVectors(x + radius_ - task_.min_disparity + 1); }

  template <bool kInside>
  void EnterRow(int y) {
    if (y < task_.y_begin) {
      for (int x = 0; x < task_.width; ++x) EnterColumn<kInside>(x, [](int, V) {});
      return;
    }
    StartWindows<kInside>();
    winners_.StartRow();
    for (int x = 0; x < task_.width; x += kPixels) {
      const int count = std::min(kPixels, task_.width - x);
      SlideWindows<kInside>(x, count);
      winners_.Take(x, y, count);
    }
    winners_.EndRow(y);
  }

  // Window sums at x = -1, in the slot from which the first pixel slides on. The other slots start
  // empty too, since sliding leaves out what no column reaches yet.
  template <bool kInside>
  void StartWindows() {
    const D d;
    for (int p = 0; p < kPixels; ++p) {
      Sum* sums = winners_.Slot(p);
      std::fill_n(sums, task_.num_disparities, SumTraits<Sum>::kOffset);
      std::fill(sums + task_.num_disparities, sums + stride_, kMax);
    }
    Sum* window = winners_.Slot(kPixels - 1);
    for (int x = 0; x < radius_; ++x)
      EnterColumn<kInside>(x, [&](int k, V sums) HWY_ATTR {
        hn::Store(hn::Add(hn::Load(d, window + k), sums), d, window + k);
      });
  }

  // Window sums of `count` pixels from x on, and the lane-wise minimum of each.
  template <bool kInside>
  HWY_INLINE void SlideWindows(int x, int count) {
    const D d;
    const Sum* previous = winners_.Slot(kPixels - 1);
    Sum* window = winners_.Slot(0);
    const Sum* leaving = column_zero_ + static_cast<ptrdiff_t>(x - radius_ - 1) * stride_;
    for (int p = 0; p < count; ++p) {
      auto least = hn::Set(d, kMax);
      EnterColumn<kInside>(x + p + radius_, [&](int k, V entering) HWY_ATTR {
        const auto change = hn::Sub(entering, hn::Load(d, leaving + k));
        const auto sum = hn::Add(hn::Load(d, previous + k), change);
        hn::Store(sum, d, window + k);
        least = hn::Min(least, sum);
      });
      hn::Store(least, d, winners_.Least(p));
      previous = window;
      window += winners_.SlotStride();
      leaving += stride_;
    }
  }

  const BandTask& task_;
  Source& source_;
  int radius_, stride_;
  int whole_;       // disparity indices in vectors that hold no padding
  int full_reach_;  // first column all of whose sums are needed
  RowWinners<Sum> winners_;
  hwy::AlignedFreeUniquePtr<Cost[]> ring_;
  hwy::AlignedFreeUniquePtr<Sum[]> column_sums_, wanted_;
  Cost* ring_row_ = nullptr;
  Sum* column_zero_;
};

template <class Sum>
int Stride(const BandTask& task) {
  return static_cast<int>(hwy::RoundUpTo(task.num_disparities, LanesOf<Sum>()));
}

void SgfBand(const BandTask& task, const SgfImage& left, const SgfImage& right) {
  const int stride = Stride<SgfSource::Sum>(task);
  SgfSource source(task, left, right, stride);
  BandMatcher<SgfSource>(task, stride, source).Run();
}

std::unique_ptr<CostRows> SgfRows(int width, const CostOptions& options,
                                  std::shared_ptr<const SgfImage> left,
                                  std::shared_ptr<const SgfImage> right) {
  return std::make_unique<SgfCostRows>(width, options, std::move(left), std::move(right));
}

void CostBand(const BandTask& task, CostRows& costs) {
  const int stride = Stride<RowSource::Sum>(task);
  RowSource source(task, costs, stride);
  BandMatcher<RowSource>(task, stride, source).Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sgf::stereo::internal {

HWY_EXPORT(SumSquaredGradient);
HWY_EXPORT(SgfBand);
HWY_EXPORT(SgfRows);
HWY_EXPORT(CostBand);

int64_t SumSquaredGradient(const cv::Mat1b& image, GradientOperator op, int begin, int end) {
  return HWY_DYNAMIC_DISPATCH(SumSquaredGradient)(image, op, begin, end);
}

void MatchSgfBand(const BandTask& task, const SgfImage& left, const SgfImage& right) {
  HWY_DYNAMIC_DISPATCH(SgfBand)(task, left, right);
}

std::unique_ptr<CostRows> MakeSgfCostRows(int width, const CostOptions& options,
                                          std::shared_ptr<const SgfImage> left,
                                          std::shared_ptr<const SgfImage> right) {
  return HWY_DYNAMIC_DISPATCH(SgfRows)(width, options, std::move(left), std::move(right));
}

void MatchCostBand(const BandTask& task, CostRows& costs) {
  HWY_DYNAMIC_DISPATCH(CostBand)(task, costs);
}

int SgfCostScale(int window) {
  // 8 bits would hold twice this. But r = scale / max(||a||^2, tau) saturates at 2^15 - 1, so that
  // tau is at least scale / 32767: half the resolution of a cost buys half the tau, and weak
  // gradients tell more than the last bit of a strong one's cost.
  constexpr int kLargest = 63;
  // Rounding can take a cost two past its range [0, 2 scale].
  return std::min(kLargest, 65534 / (2 * window * window) - 1);
}

}  // namespace sgf::stereo::internal
#endif  // HWY_ONCE
