// Winners of a row of pixels from their sums over the disparities, per instruction set (Highway's
// -inl.h convention): what block matching and semi-global matching end in.

#if defined(SGF_STEREO_ROW_WINNERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SGF_STEREO_ROW_WINNERS_INL_H_
#undef SGF_STEREO_ROW_WINNERS_INL_H_
#else
#define SGF_STEREO_ROW_WINNERS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <numeric>

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include <sgf/stereo/winners-inl.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Not inlined, or g++ 12 warns of sizes that no caller has.
template <class T>
HWY_NOINLINE hwy::AlignedFreeUniquePtr<T[]> Filled(size_t size, T value) {
  auto values = hwy::AllocateAligned<T>(size);
  std::fill_n(values.get(), size, value);
  return values;
}

// Takes sums in slots of eight pixels and writes disparities (and costs) of a row.
template <class Sum>
class RowWinners {
 public:
  // @param stride a multiple of the lanes of Sum, at least the number of disparities.
  RowWinners(const BandTask& task, int stride)
      : task_(task),
        stride_(stride),
        finder_(task, stride),
        right_view_(task, stride),
        slots_(Filled<Sum>(2 * kPixels * static_cast<size_t>(SlotStride()), kMax)),
        index_(Filled<Sum>(stride, 0)) {
    std::iota(index_.get(), index_.get() + stride, Sum{0});
  }

  // The sums of pixel slot p, between guards; slots from kPixels on hold masked copies. Indices
  // from the number of disparities on are kMax.
  Sum* Slot(int p) { return slots_.get() + kGuard + static_cast<size_t>(p) * SlotStride(); }
  int SlotStride() const { return stride_ + 2 * kGuard; }

  // Where the caller leaves the lane-wise minimum of slot p.
  Sum* Least(int p) { return finder_.Least(p); }

  // A number of disparity indices rounded up to whole vectors: at least one, at most all.
  int WholeVectors(int count) const {
    if (count >= stride_) return stride_;
    return static_cast<int>(hwy::RoundUpTo(std::max(1, count), LanesOf<Sum>()));
  }

  void StartRow() {
    for (int p = 0; p < kPixels; ++p) std::fill_n(Slot(kPixels + p), stride_, kMax);
    if (right_view_.Enabled()) right_view_.StartRow();
  }

  // Takes the winners of the `count` pixels in the slots, which are those of row y from x on.
  void Take(int x, int y, int count) {
    int end;
    const std::array<const Sum*, kPixels> sums = Candidates(x, count, end);
    Winners<Sum> winners;
    finder_.Find(sums, count, end, winners);
    int16_t* disparity = (*task_.disparity)[y] + x;
    for (int p = 0; p < count; ++p)
      disparity[p] = winners.accepted[p]
                         ? static_cast<int16_t>(16 * task_.min_disparity + winners.sixteenths[p])
                         : InvalidDisparity(task_.min_disparity);
    if (right_view_.Enabled()) right_view_.Add(x, count, sums, winners);
    if (task_.best)
      for (int p = 0; p < count; ++p)
        if (winners.accepted[p]) KeepCosts(x + p, y, sums[p], winners.index[p]);
  }

  // Ends a row with the left-right check.
  void EndRow(int y) {
    if (right_view_.Enabled())
      right_view_.Check((*task_.disparity)[y], InvalidDisparity(task_.min_disparity));
  }

 private:
  using D = VectorTag<Sum>;
  static constexpr Sum kMax = SumTraits<Sum>::kMax;
  // kMax around every slot: enough for a vector and the pixels of a block, and a multiple of any
  // vector so that slots stay aligned.
  static constexpr int kGuard = std::max<int>(64, 2 * HWY_MAX_BYTES / sizeof(Sum));

  // The sums of `count` pixels from x on over their candidates. All slots are set.
  // @param[out] end all candidates lie below this index, in whole vectors.
  HWY_INLINE std::array<const Sum*, kPixels> Candidates(int x, int count, int& end) {
    std::array<const Sum*, kPixels> sums;
    for (int p = 0; p < kPixels; ++p) sums[p] = Slot(p);
    end = stride_;
    if (x < task_.num_disparities - 1 + task_.min_disparity ||
        x + count > task_.width + task_.min_disparity) {
      end = WholeVectors(x + count - task_.min_disparity);
      for (int p = 0; p < count; ++p) sums[p] = MaskedCopy(x + p, p, end);
    }
    return sums;
  }

  // The sums of pixel x with those kMax whose disparity leaves the right image, and their least. A
  // copy up to index `copied`, since block matching slides its sums on from the slots.
  const Sum* MaskedCopy(int x, int p, int copied) {
    const int first = std::max(0, x - task_.min_disparity - (task_.width - 1));
    const int end = std::min(task_.num_disparities, x - task_.min_disparity + 1);
    const D d;
    const auto none = hn::Set(d, kMax);
    const auto low = hn::Set(d, static_cast<Sum>(first));
    const auto high = hn::Set(d, static_cast<Sum>(std::max(end, 0) - 1));
    Sum* copy = Slot(kPixels + p);
    auto least = none;
    for (int k = 0; k < copied; k += LanesOf<Sum>()) {
      const auto index = hn::Load(d, index_.get() + k);
      const auto out = hn::Or(hn::Gt(low, index), hn::Gt(index, high));
      const auto sums = hn::IfThenElse(out, none, hn::Load(d, Slot(p) + k));
      hn::Store(sums, d, copy + k);
      least = hn::Min(least, sums);
    }
    hn::Store(least, d, finder_.Least(p));
    return copy;
  }

  // The winner's sum and the least one that is neither its own nor a neighbour's.
  void KeepCosts(int x, int y, const Sum* sums, int index) {
    Sum second = kMax;
    for (int k = 0; k < index - 1; ++k) second = std::min(second, sums[k]);
    for (int k = index + 2; k < task_.num_disparities; ++k) second = std::min(second, sums[k]);
    (*task_.best)(y, x) = sums[index] - SumTraits<Sum>::kOffset;
    (*task_.second)(y, x) = second == kMax ? kNoSecond : second - SumTraits<Sum>::kOffset;
  }

  const BandTask& task_;
  int stride_;
  WinnerFinder<Sum> finder_;
  RightView<Sum> right_view_;
  hwy::AlignedFreeUniquePtr<Sum[]> slots_, index_;
};

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
