#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/metrics/registry.h>
#include <sgf/metrics/sample_image.h>
#include <sgf/stereo/byte_scale.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/sgf_image.h>

namespace sgf::stereo::internal {
namespace {

using metrics::Sample;
using metrics::SampleImage;

// The right image turned so that increasing disparities are contiguous: the pixel that left column
// x meets at disparity index d stands at Column(x) + d. Border columns are repeated outside.
struct Mirror {
  int width, min_disparity, before, after;

  Mirror(int image_width, const CostOptions& options)
      : width(image_width),
        min_disparity(options.min_disparity),
        before(std::max(0, -options.min_disparity)),
        after(std::max(0, options.min_disparity) + options.num_disparities) {}

  int Column(int x) const { return before + width - 1 - x + min_disparity; }
};

template <class T>
cv::Mat_<T> Mirrored(const cv::Mat_<T>& plane, const Mirror& mirror) {
  cv::Mat flipped, padded;
  cv::flip(plane, flipped, 1);
  cv::copyMakeBorder(flipped, padded, 0, 0, mirror.before, mirror.after, cv::BORDER_REPLICATE);
  return padded;
}

template <class F>
void ForEachPlane(SampleImage& image, F f) {
  for (cv::Mat1f* plane : {&image.intensity, &image.gx, &image.gy, &image.norm, &image.reg_norm,
                           &image.ax, &image.ay, &image.r})
    f(*plane);
}

// Row y of the planes of an image.
struct SampleRow {
  const float *intensity, *gx, *gy, *norm, *reg_norm, *ax, *ay, *r;

  SampleRow(const SampleImage& image, int y)
      : intensity(image.intensity[y]),
        gx(image.gx[y]),
        gy(image.gy[y]),
        norm(image.norm[y]),
        reg_norm(image.reg_norm[y]),
        ax(image.ax[y]),
        ay(image.ay[y]),
        r(image.r[y]) {}

  template <class T = float>
  Sample<T> At(int x) const {
    return {T(intensity[x]), T(gx[x]), T(gy[x]), T(norm[x]),
            T(reg_norm[x]),  T(ax[x]), T(ay[x]), T(r[x])};
  }
};

float Magnitude(float residual) { return std::abs(residual); }
template <class Vector>
float Magnitude(const Vector& residual) {
  return residual.norm();
}

// Cost units per unit of a dissimilarity: fine enough for its noise, coarse enough for its range in
// 16 bits. Gain-invariant ones are bounded by 2 (vectors, by 4); products of gradients reach 2^15
// (grey levels/px)^2, differences 255 grey levels.
template <class Metric>
constexpr float Resolution() {
  if constexpr (Metric::kInfo.traits.gain_invariant) return 16383;
  if constexpr (Metric::kInfo.name == "sgf2" || Metric::kInfo.name == "sgf3") return 1;
  return 256;
}

uint16_t Quantize(float cost) { return static_cast<uint16_t>(std::min(cost + 0.5F, 65535.F)); }

// Both images' samples, the right one's mirrored.
struct SamplePair {
  SampleImage left, right;
  Mirror mirror;
  int num_disparities;

  SamplePair(const cv::Mat& left_image, const cv::Mat& right_image, const CostOptions& options)
      : left(metrics::MakeSampleImage(left_image, options.gradient, options.epsilon, options.tau)),
        right(
            metrics::MakeSampleImage(right_image, options.gradient, options.epsilon, options.tau)),
        mirror(left_image.cols, options),
        num_disparities(options.num_disparities) {
    ForEachPlane(right, [&](cv::Mat1f& plane) { plane = Mirrored(plane, mirror); });
  }
};

template <class Metric>
class PointCostRows final : public CostRows {
 public:
  PointCostRows(const Metric& metric, std::shared_ptr<const SamplePair> pair)
      : metric_(metric), pair_(std::move(pair)) {}

  void Row(int y, int stride, uint16_t* costs) override {
    const SampleRow left(pair_->left, y);
    const SampleRow right(pair_->right, y);
    const Metric metric = metric_;
    for (int x = 0; x < pair_->mirror.width; ++x, costs += stride) {
      const Sample<float> i = left.At(x);
      const int column = pair_->mirror.Column(x);
      for (int d = 0; d < pair_->num_disparities; ++d)
        costs[d] = Quantize(Resolution<Metric>() * Magnitude(metric(i, right.At(column + d))));
    }
  }

 private:
  Metric metric_;
  std::shared_ptr<const SamplePair> pair_;
};

// Rounds a plane to 16 significant bits of its largest value. In double, sums over windows of
// products of two such numbers are then exact, so that they can slide without a trace.
void Snap(cv::Mat1f& plane) {
  double low = 0, high = 0;
  cv::minMaxLoc(plane, &low, &high);
  const double largest = std::max(std::abs(low), std::abs(high));
  if (largest == 0) return;
  const auto step = static_cast<float>(std::exp2(std::ilogb(largest) + 1 - 16));
  for (float& value : plane) value = std::nearbyint(value / step) * step;
}

// Dissimilarities with a window of their own: their sums over the window's columns are kept for
// every column and disparity, and slide down by rows and along x.
template <class Metric>
class WindowCostRows final : public CostRows {
 public:
  WindowCostRows(std::shared_ptr<const SamplePair> pair, int window)
      : pair_(std::move(pair)),
        radius_(window / 2),
        columns_(static_cast<size_t>(pair_->mirror.width) * pair_->num_disparities) {}

  void Row(int y, int stride, uint16_t* costs) override {
    if (entered_ < 0) entered_ = first_ = std::max(0, y - radius_);
    const int height = pair_->left.gx.rows;
    for (; entered_ <= std::min(y + radius_, height - 1); ++entered_)
      AddRow(entered_, [](Sums& column, const Sums& pixel) { column += pixel; });
    if (y - radius_ - 1 >= first_)
      AddRow(y - radius_ - 1, [](Sums& column, const Sums& pixel) { column -= pixel; });
    SlideAlong(stride, costs);
  }

 private:
  using Sums = typename Metric::template Sums<double>;

  template <class Add>
  void AddRow(int y, Add add) {
    const SampleRow left(pair_->left, y);
    const SampleRow right(pair_->right, y);
    for (int x = 0; x < pair_->mirror.width; ++x) {
      const Sample<double> i = left.At<double>(x);
      const int column = pair_->mirror.Column(x);
      for (int d = 0; d < pair_->num_disparities; ++d) {
        Sums pixel;
        pixel.Add(i, right.At<double>(column + d));
        add(Column(x, d), pixel);
      }
    }
  }

  Sums& Column(int x, int d) {
    return columns_[static_cast<size_t>(x) * pair_->num_disparities + d];
  }

  // All disparities of a column at a time, in the order they lie in memory.
  void SlideAlong(int stride, uint16_t* costs) {
    const Metric metric;
    const int width = pair_->mirror.width, count = pair_->num_disparities;
    std::vector<Sums> windows(count);
    const auto slide = [&](int x, auto change) {
      if (x < 0 || x >= width) return;
      for (int d = 0; d < count; ++d) change(windows[d], Column(x, d));
    };
    const auto enter = [](Sums& window, const Sums& column) { window += column; };
    const auto leave = [](Sums& window, const Sums& column) { window -= column; };
    for (int x = 0; x < radius_; ++x) slide(x, enter);
    for (int x = 0; x < width; ++x, costs += stride) {
      slide(x + radius_, enter);
      slide(x - radius_ - 1, leave);
      for (int d = 0; d < count; ++d)
        costs[d] = Quantize(Resolution<Metric>() * static_cast<float>(metric.Value(windows[d])));
    }
  }

  std::shared_ptr<const SamplePair> pair_;
  int radius_;
  int first_ = 0, entered_ = -1;
  std::vector<Sums> columns_;
};

class CensusCostRows final : public CostRows {
 public:
  CensusCostRows(std::shared_ptr<const metrics::CensusImage> left,
                 std::shared_ptr<const metrics::CensusImage> right, const Mirror& mirror,
                 int num_disparities)
      : left_(std::move(left)),
        right_(std::move(right)),
        mirror_(mirror),
        num_disparities_(num_disparities) {}

  void Row(int y, int stride, uint16_t* costs) override {
    const metrics::Census census;
    for (int x = 0; x < mirror_.width; ++x, costs += stride) {
      const uint64_t i = left_->Row(y)[x];
      for (int d = 0; d < num_disparities_; ++d) {
        const int x_right = std::clamp(x - mirror_.min_disparity - d, 0, mirror_.width - 1);
        costs[d] = static_cast<uint16_t>(census(i, right_->Row(y)[x_right]));
      }
    }
  }

 private:
  std::shared_ptr<const metrics::CensusImage> left_, right_;
  Mirror mirror_;
  int num_disparities_;
};

// MeshStereo's own cost.
class CensusSobelCostRows final : public CostRows {
 public:
  CensusSobelCostRows(CensusCostRows census, const cv::Mat1b& left_sobel,
                      const cv::Mat1b& right_sobel, const Mirror& mirror, int num_disparities)
      : census_(std::move(census)),
        left_(left_sobel),
        right_(Mirrored<uint8_t>(right_sobel, mirror)),
        mirror_(mirror),
        num_disparities_(num_disparities) {}

  void Row(int y, int stride, uint16_t* costs) override {
    census_.Row(y, stride, costs);
    for (int x = 0; x < mirror_.width; ++x, costs += stride) {
      const int i = left_(y, x);
      const uint8_t* j = right_[y] + mirror_.Column(x);
      for (int d = 0; d < num_disparities_; ++d)
        costs[d] = static_cast<uint16_t>(2 * costs[d] + std::abs(i - j[d]));
    }
  }

 private:
  CensusCostRows census_;
  cv::Mat1b left_, right_;
  Mirror mirror_;
  int num_disparities_;
};

// Horizontal Sobel response of an 8-bit image, halved, around 128.
cv::Mat1b HorizontalSobel(const cv::Mat& image) {
  if (image.type() != CV_8UC1)
    throw Error("metric", fmt::format("{} needs 8-bit images, got {}", kCensusSobel,
                                      cv::typeToString(image.type())));
  cv::Mat1b sobel;
  cv::Sobel(image, sobel, CV_8U, 1, 0, 3, 0.5, 128, cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
  return sobel;
}

template <class Metric>
Metric WithParameters(Metric metric, const CostOptions& options) {
  if constexpr (std::is_same_v<Metric, metrics::Pm>)
    return {options.pm.alpha, options.pm.tau_c, options.pm.tau_g};
  else
    return metric;
}

CensusCostRows MakeCensusRows(const cv::Mat& left, const cv::Mat& right,
                              const CostOptions& options) {
  return {std::make_shared<const metrics::CensusImage>(metrics::ComputeCensus(left)),
          std::make_shared<const metrics::CensusImage>(metrics::ComputeCensus(right)),
          Mirror(left.cols, options), options.num_disparities};
}

CostRowsFactory MakeCensusSobelFactory(const cv::Mat& left, const cv::Mat& right,
                                       const CostOptions& options, int window) {
  const CensusSobelCostRows rows(MakeCensusRows(left, right, options), HorizontalSobel(left),
                                 HorizontalSobel(right), Mirror(left.cols, options),
                                 options.num_disparities);
  return {[=] { return std::make_unique<CensusSobelCostRows>(rows); }, window};
}

// One maker per kind of dissimilarity.
template <class Metric>
CostRowsFactory MakeFactory(const Metric& metric, const cv::Mat& left, const cv::Mat& right,
                            const CostOptions& options, int window) {
  if constexpr (std::is_same_v<Metric, metrics::Sgf>) {
    auto l = std::make_shared<const SgfImage>(PrepareSgf(left, options));
    auto r = std::make_shared<const SgfImage>(PrepareSgf(right, options));
    const int width = left.cols;
    return {[=] { return MakeSgfCostRows(width, options, l, r); }, window};
  } else if constexpr (metrics::PointMetric<Metric>) {
    auto pair = std::make_shared<const SamplePair>(left, right, options);
    return {[=] { return std::make_unique<PointCostRows<Metric>>(metric, pair); }, window};
  } else if constexpr (metrics::WindowMetric<Metric>) {
    auto pair = std::make_shared<SamplePair>(left, right, options);
    ForEachPlane(pair->left, Snap);
    ForEachPlane(pair->right, Snap);
    return {[pair, window] { return std::make_unique<WindowCostRows<Metric>>(pair, window); }, 1};
  } else if constexpr (Metric::kInfo.traits.kind == metrics::MetricKind::kSignature) {
    const auto census = MakeCensusRows(left, right, options);
    return {[=] { return std::make_unique<CensusCostRows>(census); }, window};
  } else {
    throw std::logic_error("not a stereo cost; CheckOptions lets it through");
  }
}

}  // namespace

CostRowsFactory PrepareCostRows(const cv::Mat& left, const cv::Mat& right,
                                const CostOptions& options, int window) {
  if (options.metric == kCensusSobel) return MakeCensusSobelFactory(left, right, options, window);
  return metrics::VisitMetric(options.metric, [&](auto metric) {
    return MakeFactory(WithParameters(metric, options), left, right, options, window);
  });
}

uint32_t ByteScaleQ16(const CostRowsFactory& factory, cv::Size size, int num_disparities) {
  constexpr int kStep = 8;
  std::vector<uint16_t> row(static_cast<size_t>(size.width) * num_disparities);
  uint64_t total = 0, count = 0;
  for (int y = 0; y < size.height; y += kStep) {
    factory.make()->Row(y, num_disparities, row.data());  // a maker's rows are consecutive
    total = std::accumulate(row.begin(), row.end(), total);
    count += row.size();
  }
  return static_cast<uint32_t>(
      std::min<uint64_t>((count * kMeanByteCost << 16) / std::max<uint64_t>(total, 1), 1U << 24));
}

ByteCostRows::ByteCostRows(const CostRowsFactory& factory, uint32_t scale_q16, int width,
                           int num_disparities)
    : rows_(factory.make()),
      scale_q16_(scale_q16),
      width_(width),
      num_disparities_(num_disparities),
      row_(static_cast<size_t>(width) * num_disparities) {}

void ByteCostRows::Row(int y, int stride, uint8_t* costs) {
  rows_->Row(y, num_disparities_, row_.data());
  ScaleToBytes(row_.data(), width_, num_disparities_, scale_q16_, stride, costs);
}

}  // namespace sgf::stereo::internal
