// Rows of samples, compiled once per instruction set by Highway.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sgf/alignment/sample_rows.cc"
#include <hwy/foreach_target.h>
// foreach_target.h has to come first.
#include <algorithm>
#include <vector>

#include <hwy/highway.h>

#include <sgf/alignment/sample_rows.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::alignment::internal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Calls body(d, x) for vectors d of pixels from x on, so that all of [0, width) is covered. The
// last vector may overlap the one before.
template <class Body>
HWY_INLINE void OverRow(int width, const Body& body) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  if (width < lanes) {
    for (int x = 0; x < width; ++x) body(hn::CappedTag<float, 1>(), x);
    return;
  }
  for (int x = 0; x + lanes <= width; x += lanes) body(d, x);
  if (width % lanes != 0) body(d, width - lanes);
}

// The derivatives of a row: the separable operator is applied down the columns first.
class RowGradient {
 public:
  RowGradient(const GreyRows& rows, const GradientTaps& taps) : taps_(taps), width_(rows.width) {
    // One pixel on each side repeats the border.
    static thread_local std::vector<float> memory;
    memory.resize(2 * (size_t(width_) + 2));
    smooth_ = memory.data() + 1;
    change_ = smooth_ + width_ + 2;
    OverRow(width_, [&](auto d, int x) {
      const auto above = hn::LoadU(d, rows.above + x), below = hn::LoadU(d, rows.below + x);
      hn::StoreU(Across(d, above, hn::LoadU(d, rows.row + x), below), d, smooth_ + x);
      hn::StoreU(Derivative(d, above, below), d, change_ + x);
    });
    for (float* line : {smooth_, change_}) {
      line[-1] = line[0];
      line[width_] = line[width_ - 1];
    }
  }

  template <class D>
  HWY_INLINE hn::Vec<D> X(D d, int x) const {
    return Derivative(d, hn::LoadU(d, smooth_ + x - 1), hn::LoadU(d, smooth_ + x + 1));
  }
  template <class D>
  HWY_INLINE hn::Vec<D> Y(D d, int x) const {
    return Across(d, hn::LoadU(d, change_ + x - 1), hn::LoadU(d, change_ + x),
                  hn::LoadU(d, change_ + x + 1));
  }

 private:
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V Across(D d, V before, V here, V after) const {
    return hn::Add(hn::Mul(hn::Set(d, taps_.across_side), hn::Add(before, after)),
                   hn::Mul(hn::Set(d, taps_.across_centre), here));
  }
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V Derivative(D d, V before, V after) const {
    return hn::Mul(hn::Set(d, taps_.derivative), hn::Sub(after, before));
  }

  GradientTaps taps_;
  int width_;
  float* smooth_;
  float* change_;
};

// Sums run in as many lanes on every instruction set.
constexpr int kSums = 16;

// Squared magnitudes of a row's gradients, and their sum.
class RowSquares {
 public:
  explicit RowSquares(int width) {
    static thread_local std::vector<float> memory;
    memory.resize((size_t(width) + kSums - 1) / kSums * kSums);
    std::fill(memory.begin() + width, memory.end(), 0.f);
    squares_ = memory;
  }

  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void Set(D d, int x, V gx, V gy) {
    hn::StoreU(hn::Add(hn::Mul(gx, gx), hn::Mul(gy, gy)), d, squares_.data() + x);
  }

  double Sum() const {
    const hn::CappedTag<float, kSums> d;
    const size_t lanes = hn::Lanes(d);
    float sums[kSums] = {};
    for (size_t x = 0; x < squares_.size(); x += kSums)
      for (size_t k = 0; k < kSums; k += lanes)
        hn::StoreU(hn::Add(hn::LoadU(d, sums + k), hn::LoadU(d, squares_.data() + x + k)), d,
                   sums + k);
    double sum = 0;
    for (const float part : sums) sum += part;
    return sum;
  }

 private:
  std::span<float> squares_;
};

double SumSquared(const GreyRows& rows, const GradientTaps& taps) {
  const RowGradient gradient(rows, taps);
  RowSquares squares(rows.width);
  OverRow(rows.width,
          [&](auto d, int x) { squares.Set(d, x, gradient.X(d, x), gradient.Y(d, x)); });
  return squares.Sum();
}

double GradientRow(const GreyRows& rows, const GradientTaps& taps, float* out) {
  const RowGradient gradient(rows, taps);
  RowSquares squares(rows.width);
  OverRow(rows.width, [&](auto d, int x) {
    const auto gx = gradient.X(d, x), gy = gradient.Y(d, x);
    hn::StoreInterleaved2(gx, gy, d, out + size_t{2} * x);
    squares.Set(d, x, gx, gy);
  });
  return squares.Sum();
}

void SampleRow(const GreyRows& rows, const GradientTaps& taps, std::span<const float> epsilon,
               float* out) {
  const RowGradient gradient(rows, taps);
  const bool constant = epsilon.size() == 1;
  OverRow(rows.width, [&](auto d, int x) {
    const auto e = constant ? hn::Set(d, epsilon[0]) : hn::LoadU(d, epsilon.data() + x);
    hn::StoreInterleaved4(hn::LoadU(d, rows.row + x), gradient.X(d, x), gradient.Y(d, x), e, d,
                          out + size_t{4} * x);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace sgf::alignment::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sgf::alignment::internal {

HWY_EXPORT(SumSquared);
HWY_EXPORT(GradientRow);
HWY_EXPORT(SampleRow);

double SumSquaredGradient(const GreyRows& rows, GradientOperator op) {
  return HWY_DYNAMIC_DISPATCH(SumSquared)(rows, TapsOf(op));
}

double MakeGradientRow(const GreyRows& rows, GradientOperator op, float* out) {
  return HWY_DYNAMIC_DISPATCH(GradientRow)(rows, TapsOf(op), out);
}

void MakeSampleRow(const GreyRows& rows, GradientOperator op, std::span<const float> epsilon,
                   float* out) {
  HWY_DYNAMIC_DISPATCH(SampleRow)(rows, TapsOf(op), epsilon, out);
}

}  // namespace sgf::alignment::internal
#endif  // HWY_ONCE
