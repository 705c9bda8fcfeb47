// Winner-take-all over window sums, per instruction set (Highway's -inl.h convention).
//
// Winners are found for eight pixels at a time: the reductions across lanes and the look-ups around
// each winner would otherwise take as long as the sums themselves.

#if defined(SGF_STEREO_WINNERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SGF_STEREO_WINNERS_INL_H_
#undef SGF_STEREO_WINNERS_INL_H_
#else
#define SGF_STEREO_WINNERS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <vector>

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include <sgf/stereo/band.h>
#include <sgf/stereo/vector_tag-inl.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kPixels = 8;
constexpr int kAround = 5;  // sums looked at around a winner

// How sums are held in lanes. 16-bit sums use all 16 bits: they are stored less 2^15, so that
// signed lanes compare them. kMax stands for "no candidate" and is above every sum.
template <class Sum>
struct SumTraits {
  static constexpr Sum kOffset = sizeof(Sum) == 2 ? std::numeric_limits<Sum>::min() : 0;
  static constexpr Sum kMax = std::numeric_limits<Sum>::max();
};

template <class T>
HWY_INLINE int LanesOf() {
  return static_cast<int>(hn::Lanes(VectorTag<T>()));
}

// out[p] = op over the lanes of the vector at vectors + p * lanes, for eight pixels p.
template <class T, class Op>
HWY_INLINE void ReduceEach(const T* vectors, T* out, Op op) {
  const int lanes = LanesOf<T>();
#if HWY_TARGET != HWY_SCALAR
  if constexpr (sizeof(T) == 2) {
    const VectorTag<T> d;
    // Each fold halves the lanes per pixel in every 128-bit block and doubles the pixels; after
    // three, a block holds one lane of each pixel, in order.
    const auto load = [&](int p) HWY_ATTR { return hn::Load(d, vectors + p * lanes); };
    const auto fold = [&](auto a, auto b) HWY_ATTR {
      return op(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
    };
    const auto even = fold(fold(load(0), load(4)), fold(load(2), load(6)));
    const auto odd = fold(fold(load(1), load(5)), fold(load(3), load(7)));
    HWY_ALIGN T blocks[HWY_MAX_BYTES / sizeof(T)];
    hn::Store(fold(even, odd), d, blocks);
    const hn::CappedTag<T, kPixels> d_block;
    auto result = hn::Load(d_block, blocks);
    for (int k = kPixels; k < lanes; k += kPixels)
      result = op(result, hn::Load(d_block, blocks + k));
    hn::Store(result, d_block, out);
    return;
  }
#endif
  const hn::CappedTag<T, 1> d1;
  for (int p = 0; p < kPixels; ++p) {
    auto result = hn::Load(d1, vectors + p * lanes);
    for (int k = 1; k < lanes; ++k) result = op(result, hn::Load(d1, vectors + p * lanes + k));
    hn::Store(result, d1, out + p);
  }
}

// The winners of eight pixels.
template <class Sum>
struct Winners {
  HWY_ALIGN Sum least[kPixels];  // the winner's sum
  HWY_ALIGN Sum limit[kPixels];  // a sum below it is too close to the winner's
  HWY_ALIGN Sum rank[kPixels];   // 2^15 - 1 - index of the first candidate below the limit
  HWY_ALIGN Sum close[kPixels];  // number of candidates below the limit
  HWY_ALIGN Sum around[kAround][kPixels];  // sums at that index - 1, 0, +1, +2, +3
  HWY_ALIGN int32_t index[kPixels];        // disparity index of the winner
  HWY_ALIGN int32_t sixteenths[kPixels];   // its sub-pixel index in 1/16 px
  HWY_ALIGN int32_t accepted[kPixels];     // -1 where it exists and is unique, otherwise 0
};

// Finds winners among `stride` sums per pixel, kMax where there is no candidate.
template <class Sum>
class WinnerFinder {
 public:
  WinnerFinder(const BandTask& task, int stride)
      : task_(task),
        stride_(stride),
        rank_(hwy::AllocateAligned<Sum>(stride)),
        lanes_(hwy::AllocateAligned<Sum>(3 * kBlock)) {
    for (int k = 0; k < stride; ++k) rank_[k] = static_cast<Sum>(kFirstRank - k);
    std::fill_n(lanes_.get(), 3 * kBlock, Sum{0});
  }

  // Where the caller leaves the lane-wise minimum of pixel p's sums.
  Sum* Least(int p) { return lanes_.get() + p * LanesOf<Sum>(); }

  // sums[p] stand between at least eight values of kMax; those from index `end` on are kMax too.
  HWY_INLINE void Find(const std::array<const Sum*, kPixels>& sums, int count, int end,
                       Winners<Sum>& winners) {
    ReduceEach(Least(0), winners.least, [](auto a, auto b) HWY_ATTR { return hn::Min(a, b); });
    SetLimits(winners);
    for (int p = 0; p < count; ++p) CountBelow(sums[p], end, winners.limit[p], p);
    ReduceEach(First(0), winners.rank, [](auto a, auto b) HWY_ATTR { return hn::Max(a, b); });
    ReduceEach(Close(0), winners.close, [](auto a, auto b) HWY_ATTR { return hn::Add(a, b); });
    LookAround(sums, winners);
    Interpolate(winners);
  }

 private:
  static constexpr int kFirstRank = std::numeric_limits<int16_t>::max();
  static constexpr int kBlock = kPixels * HWY_MAX_BYTES / static_cast<int>(sizeof(Sum));
  using D = VectorTag<Sum>;

  Sum* First(int p) { return lanes_.get() + kBlock + p * LanesOf<Sum>(); }
  Sum* Close(int p) { return lanes_.get() + 2 * kBlock + p * LanesOf<Sum>(); }

  // The least sums that are far enough from the winners': s + floor(s q / 2^16) + 1.
  HWY_INLINE void SetLimits(Winners<Sum>& w) const {
#if HWY_TARGET != HWY_SCALAR
    if constexpr (sizeof(Sum) == 2) {
      const hn::Full128<int16_t> d;
      const hn::Full128<uint16_t> du;
      const auto offset = hn::Set(du, uint16_t{0x8000});
      const auto least = hn::Xor(hn::BitCast(du, hn::Load(d, w.least)), offset);
      const auto margin =
          hn::MulHigh(least, hn::Set(du, static_cast<uint16_t>(task_.uniqueness_q16)));
      const auto limit =
          hn::SaturatedAdd(hn::SaturatedAdd(least, margin), hn::Set(du, uint16_t{1}));
      hn::Store(hn::BitCast(d, hn::Xor(limit, offset)), d, w.limit);
      return;
    }
#endif
    for (int p = 0; p < kPixels; ++p) {
      const int64_t sum = int64_t{w.least[p]} - SumTraits<Sum>::kOffset;
      const int64_t limit =
          sum + ((sum * task_.uniqueness_q16) >> 16) + 1 + SumTraits<Sum>::kOffset;
      w.limit[p] = static_cast<Sum>(std::min<int64_t>(limit, SumTraits<Sum>::kMax));
    }
  }

  // Loads the sums around each pixel's first candidate below the limit.
  HWY_INLINE void LookAround(const std::array<const Sum*, kPixels>& sums, Winners<Sum>& w) const {
    std::array<const Sum*, kPixels> at;
    for (int p = 0; p < kPixels; ++p)
      at[p] = sums[p] + std::min(kFirstRank - w.rank[p], stride_ - 1) - 1;
#if HWY_TARGET != HWY_SCALAR
    if constexpr (sizeof(Sum) == 2) {
      Transpose(at, w.around);
      return;
    }
#endif
    for (int p = 0; p < kPixels; ++p)
      for (int k = 0; k < kAround; ++k) w.around[k][p] = at[p][k];
  }

#if HWY_TARGET != HWY_SCALAR
  // out[k][p] = at[p][k]: an 8 x 8 transposition whose last rows are not wanted.
  static HWY_INLINE void Transpose(const std::array<const int16_t*, kPixels>& at,
                                   int16_t out[kAround][kPixels]) {
    const hn::Full128<int16_t> d;
    const hn::Full128<int32_t> d2;
    const hn::Full128<int64_t> d4;
    const auto load = [&](int p) HWY_ATTR { return hn::LoadU(d, at[p]); };
    const auto pair = [&](int p) HWY_ATTR {
      return hn::BitCast(d2, hn::InterleaveLower(d, load(p), load(p + 1)));
    };
    const auto pair_upper = [&](int p) HWY_ATTR {
      return hn::BitCast(d2, hn::InterleaveUpper(d, load(p), load(p + 1)));
    };
    const auto low = [&](auto a, auto b)
                         HWY_ATTR { return hn::BitCast(d4, hn::InterleaveLower(d2, a, b)); };
    const auto high = [&](auto a, auto b)
                          HWY_ATTR { return hn::BitCast(d4, hn::InterleaveUpper(d2, a, b)); };
    const auto store = [&](auto v, int k) HWY_ATTR { hn::Store(hn::BitCast(d, v), d, out[k]); };
    const auto first01 = low(pair(0), pair(2)), second01 = low(pair(4), pair(6));
    const auto first23 = high(pair(0), pair(2)), second23 = high(pair(4), pair(6));
    const auto first45 = low(pair_upper(0), pair_upper(2)),
               second45 = low(pair_upper(4), pair_upper(6));
    store(hn::InterleaveLower(d4, first01, second01), 0);
    store(hn::InterleaveUpper(d4, first01, second01), 1);
    store(hn::InterleaveLower(d4, first23, second23), 2);
    store(hn::InterleaveUpper(d4, first23, second23), 3);
    store(hn::InterleaveLower(d4, first45, second45), 4);
  }
#endif

  // Per lane: how many sums lie below the limit, and the highest rank (lowest index) of those.
  HWY_INLINE void CountBelow(const Sum* sums, int end, Sum limit, int p) {
    const D d;
    const auto bound = hn::Set(d, limit);
    auto first = hn::Zero(d);
    auto close = hn::Zero(d);
#pragma GCC unroll 4
    for (int k = 0; k < end; k += LanesOf<Sum>()) {
      const auto below = hn::Gt(bound, hn::Load(d, sums + k));
      first = hn::Max(first, hn::IfThenElseZero(below, hn::Load(d, rank_.get() + k)));
      close = hn::Sub(close, hn::VecFromMask(d, below));
    }
    hn::Store(first, d, First(p));
    hn::Store(close, d, Close(p));
  }

  // The winner is the first candidate below the limit or one of the next two (or it is not unique);
  // it is unique if no more candidates lie below the limit than it and its two neighbours.
  HWY_INLINE void Interpolate(Winners<Sum>& w) const {
    const hn::CappedTag<int32_t, kPixels> di;
    const hn::Rebind<float, decltype(di)> df;
    const auto one = hn::Set(di, 1);
    for (int p = 0; p < kPixels; p += static_cast<int>(hn::Lanes(di))) {
      const auto load = [&](const Sum* from) HWY_ATTR {
        if constexpr (sizeof(Sum) == 2)
          return hn::PromoteTo(di, hn::Load(hn::Rebind<Sum, decltype(di)>(), from + p));
        else
          return hn::Load(di, from + p);
      };
      const auto least = load(w.least), limit = load(w.limit), close = load(w.close);
      const auto s0 = load(w.around[1]), s1 = load(w.around[2]), s2 = load(w.around[3]);
      const auto is0 = hn::Eq(s0, least), is1 = hn::Eq(s1, least), is2 = hn::Eq(s2, least);
      const auto pick = [&](auto a, auto b, auto c)
                            HWY_ATTR { return hn::IfThenElse(is0, a, hn::IfThenElse(is1, b, c)); };
      const auto index = hn::Add(hn::Sub(hn::Set(di, kFirstRank), load(w.rank)),
                                 pick(hn::Zero(di), one, hn::Add(one, one)));
      const auto before = pick(load(w.around[0]), s0, s1);
      const auto after = pick(s1, s2, load(w.around[4]));
      const auto neighbours = hn::Add(hn::VecFromMask(di, hn::Gt(limit, before)),
                                      hn::VecFromMask(di, hn::Gt(limit, after)));
      const auto unique = task_.uniqueness_q16 == 0 ? hn::Gt(close, hn::Zero(di))
                                                    : hn::Eq(close, hn::Sub(one, neighbours));
      const auto found = hn::Or(is0, hn::Or(is1, is2));
      hn::Store(index, di, w.index + p);
      hn::Store(hn::VecFromMask(di, hn::And(found, unique)), di, w.accepted + p);
      const auto shift = SubpixelShift(df, before, least, after);
      hn::Store(hn::Add(hn::ShiftLeft<4>(index), shift), di, w.sixteenths + p);
    }
  }

  // Offset of the minimum from the middle one of three sums, in 1/16 px, rounded; none at the ends
  // of the range, where a neighbour is missing.
  template <class DF, class VI>
  HWY_INLINE VI SubpixelShift(DF df, VI before, VI least, VI after) const {
    const hn::RebindToSigned<DF> di;
    if (task_.subpixel == Subpixel::kNone) return hn::Zero(di);
    const auto rise_before = hn::Sub(before, least), rise_after = hn::Sub(after, least);
    const auto slope = task_.subpixel == Subpixel::kEquiangular ? hn::Max(rise_before, rise_after)
                                                                : hn::Add(rise_before, rise_after);
    const auto shift = hn::Div(hn::ConvertTo(df, hn::ShiftLeft<3>(hn::Sub(before, after))),
                               hn::ConvertTo(df, hn::Max(slope, hn::Set(di, 1))));
    const auto rounded = hn::ConvertTo(di, hn::Floor(hn::Add(shift, hn::Set(df, 0.5F))));
    const auto missing = hn::Set(di, SumTraits<Sum>::kMax);
    return hn::IfThenZeroElse(hn::Or(hn::Eq(before, missing), hn::Eq(after, missing)), rounded);
  }

  const BandTask& task_;
  int stride_;
  hwy::AlignedFreeUniquePtr<Sum[]> rank_, lanes_;
};

// Winners of the right image's pixels over the same sums, for the left-right check.
template <class Sum>
class RightView {
 public:
  RightView(const BandTask& task, int stride)
      : task_(task), stride_(stride), before_(std::max(0, -task.min_disparity)) {
    if (!Enabled()) return;
    const size_t size =
        before_ + task.width + std::max(0, task.min_disparity) + stride + LanesOf<Sum>();
    least_.resize(size);
    index_.resize(size);
    left_.resize(task.width);
    numbers_.resize(stride + 2 * kPixels + LanesOf<Sum>());
    std::iota(numbers_.begin(), numbers_.end(), static_cast<Sum>(-kPixels));
  }

  bool Enabled() const { return task_.left_right_max >= 0; }

  void StartRow() {
    std::fill(least_.begin(), least_.end(), SumTraits<Sum>::kMax);
    std::fill(left_.begin(), left_.end(), -1);
  }

  // Takes the sums and winners of `count` left pixels from x on. A vector of right pixels takes all
  // of them at once: one pixel after the other would load what the one before has just stored,
  // shifted by a lane. Sums need kPixels + lanes values of kMax around them.
  HWY_INLINE void Add(int x, int count, const std::array<const Sum*, kPixels>& sums,
                      const Winners<Sum>& winners) {
    const VectorTag<Sum> d;
    for (int p = 0; p < count; ++p) left_[x + p] = winners.accepted[p] ? winners.index[p] : -1;
    Sum* least = least_.data() + Right(x);
    Sum* index = index_.data() + Right(x);
    const Sum* numbers = numbers_.data() + kPixels;
    for (int k = 1 - count; k < stride_; k += LanesOf<Sum>()) {
      auto least_k = hn::LoadU(d, least + k);
      auto index_k = hn::LoadU(d, index + k);
      for (int p = 0; p < count; ++p) {
        const auto sum = hn::LoadU(d, sums[p] + k + p);
        const auto better = hn::Gt(least_k, sum);
        index_k = hn::IfThenElse(better, hn::LoadU(d, numbers + k + p), index_k);
        least_k = hn::Min(least_k, sum);
      }
      hn::StoreU(least_k, d, least + k);
      hn::StoreU(index_k, d, index + k);
    }
  }

  // Drops winners whose right pixel prefers another disparity.
  void Check(int16_t* disparity, int16_t invalid) const {
    for (int x = 0; x < task_.width; ++x) {
      if (left_[x] < 0) continue;
      const int right = index_[Right(x) + left_[x]];
      if (std::abs(right - left_[x]) > task_.left_right_max) disparity[x] = invalid;
    }
  }

 private:
  // Position of the right pixel of left pixel x at disparity index 0; the row is reversed.
  int Right(int x) const { return before_ + task_.width - 1 - x + task_.min_disparity; }

  const BandTask& task_;
  int stride_, before_;
  std::vector<Sum> least_, index_;
  std::vector<Sum> numbers_;  // numbers_[kPixels + k] = k
  std::vector<int> left_;
};

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
