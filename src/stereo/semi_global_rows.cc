// The row kernels of semi-global matching, compiled once per instruction set by Highway.
//
// Costs of all pixels and disparities, averaged over a window, are bytes. Two sweeps over them
// follow path costs in four directions each: one from the top with the paths from the left, upper
// left, top and upper right, one from the bottom with their opposites. A sweep needs no more than
// the path costs of the row before, in bytes; lanes run along the disparities. All is exact integer
// arithmetic, so nothing depends on how rows are shared out.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/stereo/semi_global_rows.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <sgf/core/parallel.h>
#include <sgf/stereo/row_winners-inl.h>
#include <sgf/stereo/semi_global_rows.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {

using D8 = VectorTag<uint8_t>;
using V8 = hn::Vec<D8>;
using DU16 = VectorTag<uint16_t>;

constexpr uint8_t kNoPathCost = 255;  // above every path cost

// Makes rows of costs averaged over a window, of at most kLargestPathCost. Windows are cut at the
// image's border.
class CostAverager {
 public:
  CostAverager(const BandTask& task, int stride, ByteCostRows rows)
      : task_(task),
        rows_(std::move(rows)),
        radius_(task.window / 2),
        stride_(stride),
        row_(static_cast<size_t>(task.width) * stride),
        ring_(Filled<uint8_t>((task.window + 1) * row_, 0)),
        nothing_(Filled<uint8_t>(row_, 0)),
        column_sums_(Filled<uint16_t>(row_ + (2 * radius_ + 1) * static_cast<size_t>(stride), 0)),
        window_sums_(Filled<uint16_t>(stride, 0)),
        padding_(Filled<uint8_t>(stride, 0)) {
    std::fill_n(padding_.get() + task.num_disparities, stride - task.num_disparities, kNoPathCost);
  }

  // Writes rows [y_begin, y_end), `stride` costs a pixel; kNoPathCost past the last disparity.
  void Rows(int y_begin, int y_end, uint8_t* out) {
    const int first = std::max(0, y_begin - radius_);
    for (int y = first; y < y_end + radius_; ++y) {
      const int above = y - task_.window, centre = y - radius_;
      if (y < task_.height) rows_.Row(y, stride_, RingRow(y));
      Average(y < task_.height ? RingRow(y) : nothing_.get(),
              above >= first ? RingRow(above) : nothing_.get(),
              std::min(y, task_.height - 1) - std::max(first, centre - radius_) + 1, out);
      if (centre >= y_begin) out += row_;  // the row before it is not whole, and is overwritten
    }
  }

 private:
  // The sums of column x, which may be up to radius + 1 outside the image, where they are zero.
  uint16_t* Column(int x) {
    return column_sums_.get() + static_cast<ptrdiff_t>(x + radius_ + 1) * stride_;
  }
  uint8_t* RingRow(int y) { return ring_.get() + (y % (task_.window + 1)) * row_; }

  // Moves the windows down by a row and writes their averages.
  // @param entering, leaving costs of the rows that come in and go out.
  // @param rows of the image in the window.
  void Average(const uint8_t* entering, const uint8_t* leaving, int rows, uint8_t* out) {
    std::fill_n(window_sums_.get(), stride_, uint16_t{0});
    const size_t pixel = stride_;
    for (int x = -radius_; x < task_.width; ++x) {
      const int column = x + radius_;
      const bool inside = column < task_.width;
      const int columns = std::min(column, task_.width - 1) - std::max(0, x - radius_) + 1;
      // What is written for x < 0 is overwritten.
      Slide(x, inside ? entering + column * pixel : nothing_.get(),
            inside ? leaving + column * pixel : nothing_.get(),
            static_cast<uint16_t>(AverageFactor(rows * columns)), out + std::max(0, x) * pixel);
    }
  }

  // Brings the sums of the column that enters the window at x up to date, slides the window on to x
  // and writes its averages.
  HWY_INLINE void Slide(int x, const uint8_t* entering, const uint8_t* leaving, uint16_t factor,
                        uint8_t* out) {
    const DU16 d;
    const hn::Rebind<uint8_t, DU16> d8;
    const auto scale = hn::Set(d, factor);
    const auto largest = hn::Set(d, uint16_t{kLargestPathCost});
    uint16_t* right = Column(x + radius_);
    const uint16_t* left = Column(std::max(x - radius_ - 1, -radius_ - 1));
    // Locals, for all the compiler knows, a store of bytes could change members.
    uint16_t* sums = window_sums_.get();
    const uint8_t* padding = padding_.get();
    const int stride = stride_;
    for (int k = 0; k < stride; k += LanesOf<uint16_t>()) {
      const auto cost = hn::PromoteTo(d, hn::Load(d8, entering + k));
      const auto change = hn::Sub(cost, hn::PromoteTo(d, hn::Load(d8, leaving + k)));
      const auto column = hn::Add(hn::Load(d, right + k), change);
      hn::Store(column, d, right + k);
      const auto sum = hn::Add(hn::Load(d, sums + k), hn::Sub(column, hn::Load(d, left + k)));
      hn::Store(sum, d, sums + k);
      const auto average = hn::Min(hn::MulHigh(hn::Add(sum, sum), scale), largest);
      const auto bytes = hn::DemoteTo(d8, hn::BitCast(hn::RebindToSigned<DU16>(), average));
      hn::Store(hn::Or(bytes, hn::Load(d8, padding + k)), d8, out + k);
    }
  }

  const BandTask& task_;
  ByteCostRows rows_;
  int radius_, stride_;
  size_t row_;                                           // elements of a row
  hwy::AlignedFreeUniquePtr<uint8_t[]> ring_, nothing_;  // costs of the last rows; zeros
  hwy::AlignedFreeUniquePtr<uint16_t[]> column_sums_, window_sums_;
  hwy::AlignedFreeUniquePtr<uint8_t[]> padding_;
};

// Per pixel, the least path cost of each direction.
constexpr int kDirections = 4;
using Least = std::array<uint8_t, kDirections>;

// least[r] = minimum over the lanes of v_r.
HWY_INLINE void MinOfEach(V8 v0, V8 v1, V8 v2, V8 v3, Least& least) {
#if HWY_TARGET == HWY_SCALAR
  least = {hn::GetLane(v0), hn::GetLane(v1), hn::GetLane(v2), hn::GetLane(v3)};
#else
  const D8 d;
  // Each fold halves the lanes per direction in every 128-bit block; after two, a block holds the
  // four directions in order, four times.
  const auto fold = [&](V8 a, V8 b) HWY_ATTR {
    return hn::Min(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  };
  auto v = fold(fold(v0, v2), fold(v1, v3));
  v = hn::Min(v, hn::ShiftRightBytes<8>(d, v));
  v = hn::Min(v, hn::ShiftRightBytes<4>(d, v));
  HWY_ALIGN uint8_t blocks[HWY_MAX_BYTES];
  hn::Store(v, d, blocks);
  const hn::CappedTag<uint8_t, kDirections> d4;
  auto result = hn::Load(d4, blocks);
  for (size_t k = 16; k < hn::Lanes(d); k += 16) result = hn::Min(result, hn::Load(d4, blocks + k));
  hn::Store(result, d4, least.data());
#endif
}

enum class Sums { kNone, kStore, kAdd };

// Path costs in four directions, a row after the other. From the top, these are the paths that come
// from the left, upper left, top and upper right; from the bottom, their opposites.
class PathSweep {
 public:
  PathSweep(const SemiGlobalTask& task, int stride, bool from_top)
      : width_(task.band.width),
        stride_(stride),
        step_(from_top ? 1 : -1),
        pitch_(stride + kGuard),
        p1_(static_cast<uint8_t>(task.p1)),
        p2_(static_cast<uint8_t>(task.p2)),
        before_(NoPaths()),
        now_(NoPaths()),
        least_before_(width_ + 2),
        least_now_(width_ + 2),
        along_(Filled<uint8_t>(kGuard + 2 * pitch_, kNoPathCost)) {}

  // What the next row depends on.
  struct State {
    std::vector<uint8_t> paths;
    std::vector<Least> least;
  };
  State Save() const { return {{before_.get(), before_.get() + PathBytes()}, least_before_}; }
  void Restore(const State& state) {
    std::copy(state.paths.begin(), state.paths.end(), before_.get());
    least_before_ = state.least;
  }

  // Goes on to the next row. `sums` is not touched for kNone.
  template <Sums kSums>
  void Row(const uint8_t* costs, uint16_t* sums) {
    uint8_t* previous = along_.get() + kGuard;
    uint8_t* current = previous + pitch_;
    std::fill_n(previous, stride_, uint8_t{0});
    uint8_t least_previous = 0;
    for (int i = 0, x = step_ > 0 ? 0 : width_ - 1; i < width_; ++i, x += step_) {
      Pixel<kSums>(x, costs + static_cast<size_t>(x) * stride_, previous, current, least_previous,
                   sums + static_cast<size_t>(x) * stride_);
      least_previous = least_now_[x + 1][0];
      std::swap(previous, current);
    }
    std::swap(before_, now_);
    std::swap(least_before_, least_now_);
  }

 private:
  static constexpr int kGuard = 32;  // kNoPathCost between pixels; keeps them aligned

  // Path costs of three directions for a row and a pixel on either side: zero, as befits pixels
  // outside the image, where paths begin.
  hwy::AlignedFreeUniquePtr<uint8_t[]> NoPaths() const {
    auto paths = Filled<uint8_t>(PathBytes(), kNoPathCost);
    for (size_t i = kGuard; i < PathBytes(); i += pitch_)
      std::fill_n(paths.get() + i, stride_, uint8_t{0});
    return paths;
  }
  size_t PathBytes() const {
    return kGuard + static_cast<size_t>(kDirections - 1) * (width_ + 2) * pitch_;
  }

  // The path costs of pixel x, in [-1, width], in direction 1 (from the side that the row comes
  // from), 2 (straight) or 3.
  uint8_t* At(const hwy::AlignedFreeUniquePtr<uint8_t[]>& paths, int direction, int x) const {
    const size_t pixel = static_cast<size_t>(direction - 1) * (width_ + 2) + (x + 1);
    return paths.get() + kGuard + pixel * pitch_;
  }

  // A path's predecessor: its costs, the least of them, and that plus p2.
  struct From {
    const uint8_t* costs;
    V8 least, limit;
  };
  HWY_INLINE From MakeFrom(const uint8_t* costs, uint8_t least) const {
    const auto v = hn::Set(D8(), least);
    return {costs, v, hn::SaturatedAdd(v, hn::Set(D8(), p2_))};
  }

  // Eq. 13. A sum that saturates is never the least, since a path cost itself does not. Padding
  // stays at kNoPathCost, for its costs are that.
  static HWY_INLINE V8 Step(const From& from, int k, V8 cost, V8 p1) {
    const D8 d;
    const auto aside = hn::Min(hn::LoadU(d, from.costs + k - 1), hn::LoadU(d, from.costs + k + 1));
    const auto near = hn::Min(hn::Load(d, from.costs + k), hn::SaturatedAdd(aside, p1));
    return hn::SaturatedAdd(hn::Sub(hn::Min(near, from.limit), from.least), cost);
  }

  template <Sums kSums>
  HWY_INLINE void Pixel(int x, const uint8_t* costs, const uint8_t* previous, uint8_t* current,
                        uint8_t least_previous, uint16_t* sums) {
    const D8 d;
    const int side = x - step_, other_side = x + step_;
    const From from0 = MakeFrom(previous, least_previous);
    const From from1 = MakeFrom(At(before_, 1, side), least_before_[side + 1][1]);
    const From from2 = MakeFrom(At(before_, 2, x), least_before_[x + 1][2]);
    const From from3 = MakeFrom(At(before_, 3, other_side), least_before_[other_side + 1][3]);
    uint8_t* now1 = At(now_, 1, x);
    uint8_t* now2 = At(now_, 2, x);
    uint8_t* now3 = At(now_, 3, x);
    const auto p1 = hn::Set(d, p1_);
    auto least0 = hn::Set(d, kNoPathCost), least1 = least0, least2 = least0, least3 = least0;
    // A local, for all the compiler knows, a store of bytes could change members.
    const int stride = stride_;
    // Sums come from too far away to be waited for, and no prefetcher sees through their order.
    const ptrdiff_t ahead = ptrdiff_t{std::clamp(x + 2 * step_, 0, width_ - 1) - x} * stride;
    for (int k = 0; k < stride; k += LanesOf<uint8_t>()) {
      const auto cost = hn::Load(d, costs + k);
      const auto path0 = Step(from0, k, cost, p1), path1 = Step(from1, k, cost, p1);
      const auto path2 = Step(from2, k, cost, p1), path3 = Step(from3, k, cost, p1);
      hn::Store(path0, d, current + k);
      hn::Store(path1, d, now1 + k);
      hn::Store(path2, d, now2 + k);
      hn::Store(path3, d, now3 + k);
      least0 = hn::Min(least0, path0);
      least1 = hn::Min(least1, path1);
      least2 = hn::Min(least2, path2);
      least3 = hn::Min(least3, path3);
      if constexpr (kSums == Sums::kAdd) hwy::Prefetch(sums + ahead + k);
      if constexpr (kSums != Sums::kNone)
        AddUp<kSums>(current + k, now1 + k, now2 + k, now3 + k, sums + k);
    }
    MinOfEach(least0, least1, least2, least3, least_now_[x + 1]);
  }

  // Sums of four path costs, a vector of bytes.
  template <Sums kSums>
  static HWY_INLINE void AddUp(const uint8_t* path0, const uint8_t* path1, const uint8_t* path2,
                               const uint8_t* path3, uint16_t* sums) {
    const DU16 d;
    const hn::Rebind<uint8_t, DU16> d8;
    const auto wide = [&](const uint8_t* from)
                          HWY_ATTR { return hn::PromoteTo(d, hn::Load(d8, from)); };
    for (int k = 0; k < LanesOf<uint8_t>(); k += LanesOf<uint16_t>()) {
      auto sum = hn::Add(hn::Add(wide(path0 + k), wide(path1 + k)),
                         hn::Add(wide(path2 + k), wide(path3 + k)));
      if constexpr (kSums == Sums::kAdd) sum = hn::Add(sum, hn::Load(d, sums + k));
      hn::Store(sum, d, sums + k);
    }
  }

  int width_, stride_, step_, pitch_;
  uint8_t p1_, p2_;
  hwy::AlignedFreeUniquePtr<uint8_t[]> before_, now_;
  std::vector<Least> least_before_, least_now_;
  hwy::AlignedFreeUniquePtr<uint8_t[]> along_;  // path costs along the row: before, now
};

// Takes the winners of rows of sums.
class SumWinners {
 public:
  SumWinners(const BandTask& task, int stride)
      : task_(task),
        stride_(stride),
        winners_(task, stride),
        padding_(Filled<int16_t>(stride, SumTraits<int16_t>::kMax)) {
    std::fill_n(padding_.get(), task.num_disparities, SumTraits<int16_t>::kOffset);
  }

  void Row(int y, const uint16_t* sums) {
    winners_.StartRow();
    for (int x = 0; x < task_.width; x += kPixels) {
      const int count = std::min(kPixels, task_.width - x);
      for (int p = 0; p < count; ++p, sums += stride_) Fill(p, sums);
      winners_.Take(x, y, count);
    }
    winners_.EndRow(y);
  }

 private:
  HWY_INLINE void Fill(int p, const uint16_t* sums) {
    const VectorTag<int16_t> d;
    const DU16 du;
    const auto offset = hn::Set(d, SumTraits<int16_t>::kOffset);
    auto least = hn::Set(d, SumTraits<int16_t>::kMax);
    int16_t* slot = winners_.Slot(p);
    for (int k = 0; k < stride_; k += LanesOf<int16_t>()) {
      const auto sum = hn::Xor(hn::BitCast(d, hn::Load(du, sums + k)), offset);
      const auto candidate = hn::Max(sum, hn::Load(d, padding_.get() + k));
      hn::Store(candidate, d, slot + k);
      least = hn::Min(least, candidate);
    }
    hn::Store(least, d, winners_.Least(p));
  }

  const BandTask& task_;
  int stride_;
  RowWinners<int16_t> winners_;
  hwy::AlignedFreeUniquePtr<int16_t[]> padding_;
};

// The whole of a pair.
//
// Rows are taken in blocks, and two workers start from the top and the bottom. Up to the middle
// each only follows its paths, and notes where they stand at every block. Beyond, a worker takes up
// the other's paths from such a note for the sums of a block, adds its own, and has the winners. So
// no more than a block's sums are in memory, and the caches hold them.
class SemiGlobalRun {
 public:
  SemiGlobalRun(const SemiGlobalTask& task, const CostRowsFactory& factory)
      : task_(task),
        factory_(factory),
        height_(task.band.height),
        scale_q16_(ByteScaleQ16(factory, {task.band.width, height_}, task.band.num_disparities)),
        stride_(static_cast<int>(hwy::RoundUpTo(task.band.num_disparities, LanesOf<uint8_t>()))),
        row_(static_cast<size_t>(task.band.width) * stride_),
        block_rows_(static_cast<int>(std::ceil(std::sqrt(height_)))),
        blocks_((height_ + block_rows_ - 1) / block_rows_),
        notes_(blocks_) {}

  void Run() {
    std::array<Worker, 2> workers{MakeWorker(true), MakeWorker(false)};
    ParallelFor(2, task_.threads, [&](int i) { Approach(workers[i]); });
    ParallelFor(2, task_.threads, [&](int i) { Finish(workers[i]); });
  }

 private:
  struct Worker {
    bool from_top;
    PathSweep own, other;
    SumWinners winners;
    hwy::AlignedFreeUniquePtr<uint8_t[]> costs;  // of a block
    hwy::AlignedFreeUniquePtr<uint16_t[]> sums;  // of a block
  };

  Worker MakeWorker(bool from_top) const {
    const size_t block = block_rows_ * row_;
    return {from_top,
            PathSweep(task_, stride_, from_top),
            PathSweep(task_, stride_, !from_top),
            SumWinners(task_.band, stride_),
            hwy::AllocateAligned<uint8_t>(block),
            hwy::AllocateAligned<uint16_t>(block)};
  }

  int Begin(int block) const { return block * block_rows_; }
  int End(int block) const { return std::min(Begin(block) + block_rows_, height_); }

  // Calls f(i) for i in [begin, end), from the top or from the bottom.
  template <class F>
  static void ForEach(bool from_top, int begin, int end, const F& f) {
    for (int i = 0; i < end - begin; ++i) f(from_top ? begin + i : end - 1 - i);
  }

  // Made anew each time they are needed: for sgf, that takes no longer than fresh memory for all.
  const uint8_t* Costs(int block, Worker& worker) const {
    ByteCostRows rows(factory_, scale_q16_, task_.band.width, task_.band.num_disparities);
    CostAverager averager(task_.band, stride_, std::move(rows));
    averager.Rows(Begin(block), End(block), worker.costs.get());
    return worker.costs.get();
  }

  void Approach(Worker& worker) {
    const int middle = blocks_ / 2;
    ForEach(worker.from_top, worker.from_top ? 0 : middle, worker.from_top ? middle : blocks_,
            [&](int block) {
              notes_[block] = worker.own.Save();
              const uint8_t* costs = Costs(block, worker);
              ForEach(worker.from_top, 0, End(block) - Begin(block), [&](int i) {
                worker.own.Row<Sums::kNone>(costs + i * row_, worker.sums.get());
              });
            });
  }

  void Finish(Worker& worker) const {
    const int middle = blocks_ / 2;
    ForEach(worker.from_top, worker.from_top ? middle : 0, worker.from_top ? blocks_ : middle,
            [&](int block) { FinishBlock(block, worker); });
  }

  void FinishBlock(int block, Worker& worker) const {
    const uint8_t* costs = Costs(block, worker);
    uint16_t* sums = worker.sums.get();
    const int rows = End(block) - Begin(block);
    worker.other.Restore(notes_[block]);
    ForEach(!worker.from_top, 0, rows,
            [&](int i) { worker.other.Row<Sums::kStore>(costs + i * row_, sums + i * row_); });
    ForEach(worker.from_top, 0, rows, [&](int i) {
      worker.own.Row<Sums::kAdd>(costs + i * row_, sums + i * row_);
      worker.winners.Row(Begin(block) + i, sums + i * row_);
    });
  }

  const SemiGlobalTask& task_;
  const CostRowsFactory& factory_;
  int height_;
  uint32_t scale_q16_;
  int stride_;
  size_t row_;  // elements of a row
  int block_rows_, blocks_;
  std::vector<PathSweep::State> notes_;  // where the first worker to come stood at a block
};

void RunSemiGlobal(const SemiGlobalTask& task, const CostRowsFactory& factory) {
  SemiGlobalRun(task, factory).Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sgf::stereo::internal {

HWY_EXPORT(RunSemiGlobal);

void MatchSemiGlobal(const SemiGlobalTask& task, const CostRowsFactory& factory) {
  HWY_DYNAMIC_DISPATCH(RunSemiGlobal)(task, factory);
}

}  // namespace sgf::stereo::internal
#endif  // HWY_ONCE
