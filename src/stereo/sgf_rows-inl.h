// Rows of fixed-point sgf samples and their costs, per instruction set (Highway's -inl.h
// convention).

#if defined(SGF_STEREO_SGF_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SGF_STEREO_SGF_ROWS_INL_H_
#undef SGF_STEREO_SGF_ROWS_INL_H_
#else
#define SGF_STEREO_SGF_ROWS_INL_H_
#endif

#include <algorithm>
#include <vector>

#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include <sgf/stereo/band.h>
#include <sgf/stereo/vector_tag-inl.h>

HWY_BEFORE_NAMESPACE();
namespace sgf::stereo::internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = VectorTag<int16_t>;
using V16 = hn::Vec<D16>;

// A vector of Q15 numbers under the operations that sgf.inc asks for; metrics::Q15 is its scalar.
struct Q15Lanes {
  V16 v;
};
HWY_INLINE Q15Lanes operator*(Q15Lanes a, Q15Lanes b) { return {hn::MulFixedPoint15(a.v, b.v)}; }
HWY_INLINE Q15Lanes operator+(Q15Lanes a, Q15Lanes b) { return {hn::SaturatedAdd(a.v, b.v)}; }
HWY_INLINE Q15Lanes Min(Q15Lanes a, Q15Lanes b) { return {hn::Min(a.v, b.v)}; }

struct LaneSample {
  Q15Lanes ax, ay, r;
};

#include <sgf/metrics/sgf.inc>

// One row of fixed-point samples: three planes, each with room around the image's columns.
struct SgfRow {
  hwy::AlignedFreeUniquePtr<int16_t[]> storage;
  int16_t *ax, *ay, *r;

  SgfRow(int width, int before, int after) {
    const size_t stride = static_cast<size_t>(before + width + after);
    storage = hwy::AllocateAligned<int16_t>(3 * stride);
    std::fill_n(storage.get(), 3 * stride, int16_t{0});
    ax = storage.get() + before;
    ay = ax + stride;
    r = ay + stride;
  }
};

// Whole vectors may be written past the last column of a row.
constexpr int kSlack = HWY_MAX_BYTES;

// Derivatives of rows of 8-bit images in exact integers, 32 times grey levels per pixel, with
// replicated border. Both operators are [-1 0 1] / 2 along and [side centre side] / 16 across.
class IntegerGradient {
 public:
  IntegerGradient(int width, GradientOperator op)
      : width_(width),
        side_(op == GradientOperator::kScharr ? 3 : 0),
        centre_(op == GradientOperator::kScharr ? 10 : 16),
        smoothed_(width + 2 + kSlack),
        difference_(width + 2 + kSlack) {}

  // Prepares row y: sums across for the x derivative, differences across for the y derivative.
  void SetRow(const cv::Mat1b& image, int y) {
    const uint8_t* above = image[std::max(y - 1, 0)];
    const uint8_t* row = image[y];
    const uint8_t* below = image[std::min(y + 1, image.rows - 1)];
    const D16 d;
    const hn::Rebind<uint8_t, D16> d8;
    const auto side = hn::Set(d, side_), centre = hn::Set(d, centre_);
    const int lanes = static_cast<int>(hn::Lanes(d));
    int x = 0;
    for (; x + lanes <= width_; x += lanes) {
      const auto a = hn::PromoteTo(d, hn::LoadU(d8, above + x));
      const auto b = hn::PromoteTo(d, hn::LoadU(d8, below + x));
      const auto r = hn::PromoteTo(d, hn::LoadU(d8, row + x));
      const auto sum = hn::Add(hn::Mul(side, hn::Add(a, b)), hn::Mul(centre, r));
      hn::StoreU(sum, d, &smoothed_[x + 1]);
      hn::StoreU(hn::Sub(b, a), d, &difference_[x + 1]);
    }
    for (; x < width_; ++x) {
      smoothed_[x + 1] = static_cast<int16_t>(side_ * (above[x] + below[x]) + centre_ * row[x]);
      difference_[x + 1] = static_cast<int16_t>(below[x] - above[x]);
    }
    for (auto* values : {&smoothed_, &difference_}) {
      (*values)[0] = (*values)[1];
      (*values)[width_ + 1] = (*values)[width_];
    }
  }

  // x and y derivatives of a vector of pixels from x on; those past the width are arbitrary.
  HWY_INLINE V16 X(int x) const {
    const D16 d;
    return hn::Sub(hn::LoadU(d, &smoothed_[x + 2]), hn::LoadU(d, &smoothed_[x]));
  }
  HWY_INLINE V16 Y(int x) const {
    const D16 d;
    const auto sides = hn::Add(hn::LoadU(d, &difference_[x]), hn::LoadU(d, &difference_[x + 2]));
    return hn::Add(hn::Mul(hn::Set(d, side_), sides),
                   hn::Mul(hn::Set(d, centre_), hn::LoadU(d, &difference_[x + 1])));
  }

 private:
  int width_;
  int16_t side_, centre_;
  std::vector<int16_t> smoothed_, difference_;  // one pixel of border on either side
};

constexpr float kIntegerGradientUnit = 1.F / 32;  // grey levels per pixel

// Gradient of row y, grey levels per pixel. Whole vectors are written.
HWY_INLINE void GradientRow(IntegerGradient& gradient, const cv::Mat1b& image, int y, float* gx,
                            float* gy) {
  const VectorTag<float> df;
  const hn::Rebind<int32_t, decltype(df)> di;
  const hn::Rebind<int16_t, decltype(df)> d_half;
  const D16 d;
  const int lanes = static_cast<int>(hn::Lanes(d)), half = static_cast<int>(hn::Lanes(df));
  const auto unit = hn::Set(df, kIntegerGradientUnit);
  HWY_ALIGN int16_t values[HWY_MAX_BYTES / sizeof(int16_t)];
  const auto store = [&](V16 v, float* to) HWY_ATTR {
    hn::Store(v, d, values);
    for (int k = 0; k < lanes; k += half) {
      const auto integers = hn::PromoteTo(di, hn::Load(d_half, values + k));
      hn::StoreU(hn::Mul(unit, hn::ConvertTo(df, integers)), df, to + k);
    }
  };
  gradient.SetRow(image, y);
  for (int x = 0; x < image.cols; x += lanes) {
    store(gradient.X(x), gx + x);
    store(gradient.Y(x), gy + x);
  }
}

// Sum of squared gradient magnitudes over rows [begin, end), exact, in units of
// kIntegerGradientUnit squared.
int64_t SumSquaredGradient(const cv::Mat1b& image, GradientOperator op, int begin, int end) {
  const VectorTag<int32_t> di;
  const hn::Rebind<int16_t, decltype(di)> d_half;
  const D16 d;
  const int lanes = static_cast<int>(hn::Lanes(d)), half = static_cast<int>(hn::Lanes(di));
  HWY_ALIGN int16_t values[2][HWY_MAX_BYTES / sizeof(int16_t)];
  HWY_ALIGN int32_t partial[HWY_MAX_BYTES / sizeof(int32_t)];
  IntegerGradient gradient(image.cols, op);
  int64_t total = 0;
  const auto add = [&](int x, int count, auto& sum) HWY_ATTR {
    hn::Store(gradient.X(x), d, values[0]);
    hn::Store(gradient.Y(x), d, values[1]);
    for (auto& component : values) {
      std::fill(component + count, component + lanes, int16_t{0});
      for (int k = 0; k < lanes; k += half) {
        const auto g = hn::PromoteTo(di, hn::Load(d_half, component + k));
        sum = hn::Add(sum, hn::Mul(g, g));
      }
    }
  };
  // A 32-bit lane holds the squares of this many vectors: 4 squares of at most 4080 each.
  constexpr int kVectors = 32;
  for (int y = begin; y < end; ++y) {
    gradient.SetRow(image, y);
    for (int x0 = 0; x0 < image.cols; x0 += kVectors * lanes) {
      auto sum = hn::Zero(di);
      for (int x = x0; x < std::min(image.cols, x0 + kVectors * lanes); x += lanes)
        add(x, std::min(lanes, image.cols - x), sum);
      hn::Store(sum, di, partial);
      for (int k = 0; k < half; ++k) total += partial[k];
    }
  }
  return total;
}

// MakeSample<float> and QuantizeSample (tests/support/fixed_point.h, which also bounds the error) on
// lanes, in the same order of operations.
// @param epsilon one value, or with `epsilon_map` one a column.
HWY_INLINE void QuantizeRow(const float* gx, const float* gy, const float* epsilon,
                            bool epsilon_map, float tau, int scale, int width, SgfRow& out) {
  const VectorTag<float> df;
  const hn::Rebind<int16_t, decltype(df)> d16;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const auto one = hn::Set(df, 1.F);
  const auto unit = hn::Set(df, 32767.F);
  using VF = hn::Vec<decltype(df)>;
  const auto store = [&](VF v, int16_t* to)
                         HWY_ATTR { hn::StoreU(hn::DemoteTo(d16, hn::NearestInt(v)), d16, to); };
  for (int x = 0; x < width; x += lanes) {
    const auto gx_x = hn::LoadU(df, gx + x);
    const auto gy_x = hn::LoadU(df, gy + x);
    const auto eps = epsilon_map ? hn::LoadU(df, epsilon + x) : hn::Set(df, *epsilon);
    const auto squared = hn::Add(hn::Add(hn::Mul(gx_x, gx_x), hn::Mul(gy_x, gy_x)), eps);
    const auto inverse =
        hn::IfThenElseZero(hn::Gt(squared, hn::Zero(df)), hn::Div(one, hn::Sqrt(squared)));
    const auto ax = hn::Mul(gx_x, inverse);
    const auto ay = hn::Mul(gy_x, inverse);
    const auto a2 = hn::Add(hn::Mul(ax, ax), hn::Mul(ay, ay));
    const auto r = hn::Div(one, hn::Max(a2, hn::Set(df, tau)));
    store(hn::Mul(unit, ax), out.ax + x);
    store(hn::Mul(unit, ay), out.ay + x);
    store(hn::Min(hn::Mul(hn::Set(df, static_cast<float>(scale)), r), unit), out.r + x);
  }
}

// Makes rows of fixed-point samples of one image.
class SgfRowMaker {
 public:
  SgfRowMaker(const SgfImage& image, int width, int scale)
      : image_(image),
        width_(width),
        scale_(scale),
        integer_gradient_(width, image.op),
        gx_(width + kSlack),
        gy_(width + kSlack),
        epsilon_(width + kSlack) {}

  void Make(int y, SgfRow& out) {
    if (image_.pixels.empty()) {
      std::copy_n(image_.gradient.x[y], width_, gx_.begin());
      std::copy_n(image_.gradient.y[y], width_, gy_.begin());
    } else {
      GradientRow(integer_gradient_, image_.pixels, y, gx_.data(), gy_.data());
    }
    const bool map = image_.epsilon.total() > 1;
    std::copy_n(image_.epsilon[map ? y : 0], map ? width_ : 1, epsilon_.begin());
    QuantizeRow(gx_.data(), gy_.data(), epsilon_.data(), map, image_.tau, scale_, width_, out);
  }

 private:
  const SgfImage& image_;
  int width_, scale_;
  IntegerGradient integer_gradient_;
  std::vector<float> gx_, gy_, epsilon_;
};

// Source of costs for BandMatcher: fixed-point sgf, computed as the aggregation asks for it.
class SgfSource {
 public:
  using Sum = int16_t;
  using Cost = uint8_t;

  SgfSource(const BandTask& task, const SgfImage& left, const SgfImage& right, int stride)
      : width_(task.width),
        min_disparity_(task.min_disparity),
        scale_(SgfCostScale(task.window)),
        before_(std::max(0, -task.min_disparity)),
        after_(std::max(0, task.min_disparity) + stride),
        left_(left, width_, scale_),
        right_(right, width_, scale_),
        left_row_(width_, 0, kSlack),
        right_row_(width_, 0, kSlack),
        mirrored_(width_, before_, after_) {}

  void StartRow(int y) {
    left_.Make(y, left_row_);
    right_.Make(y, right_row_);
    Mirror(right_row_.ax, mirrored_.ax);
    Mirror(right_row_.ay, mirrored_.ay);
    Mirror(right_row_.r, mirrored_.r);
  }

  // The costs of one left column: call with the first disparity index of a vector.
  struct Column {
    LaneSample left;
    V16 scale;
    const int16_t *ax, *ay, *r;

    HWY_INLINE V16 operator()(D16 d, int k) const {
      const LaneSample right{{hn::LoadU(d, ax + k)}, {hn::LoadU(d, ay + k)}, {hn::LoadU(d, r + k)}};
      return hn::Max(hn::Sub(scale, SgfSimilarity(left, right).v), hn::Zero(d));
    }
  };

  HWY_INLINE Column At(int x) const {
    const D16 d;
    const int k = width_ - 1 - x + min_disparity_;
    const LaneSample left{
        {hn::Set(d, left_row_.ax[x])}, {hn::Set(d, left_row_.ay[x])}, {hn::Set(d, left_row_.r[x])}};
    return {left, hn::Set(d, static_cast<int16_t>(scale_)), mirrored_.ax + k, mirrored_.ay + k,
            mirrored_.r + k};
  }

 private:
  // Reversed, so that increasing disparities are contiguous; the border columns are repeated.
  void Mirror(const int16_t* row, int16_t* out) const {
    std::reverse_copy(row, row + width_, out);
    std::fill_n(out - before_, before_, row[width_ - 1]);
    std::fill_n(out + width_, after_, row[0]);
  }

  int width_, min_disparity_, scale_, before_, after_;
  SgfRowMaker left_, right_;
  SgfRow left_row_, right_row_, mirrored_;
};

}  // namespace HWY_NAMESPACE
}  // namespace sgf::stereo::internal
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
