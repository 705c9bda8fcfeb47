#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <sgf/core/always_inline.h>
#include <sgf/core/camera.h>
#include <sgf/core/gradient.h>
#include <sgf/metrics/epsilon.h>

/// Images as alignment samples them: channels interpolated bilinearly, with the exact derivative of
/// that interpolation.
namespace sgf::alignment {

/// Channels of an image at one place, and their derivatives by its column and row.
template <class T, int N>
struct ChannelsAt {
  Eigen::Array<T, N, 1> value;
  Eigen::Array<T, N, 1> d_x, d_y;  ///< per px
};

/// An image with N channels for each pixel. Pixel (0, 0) is the centre of the upper left pixel.
template <int N>
class ChannelImage {
 public:
  static constexpr int kChannels = N;

  ChannelImage() = default;
  ChannelImage(const ChannelImage&) = delete;
  ChannelImage& operator=(const ChannelImage&) = delete;
  ChannelImage(ChannelImage&&) noexcept = default;
  ChannelImage& operator=(ChannelImage&&) noexcept = default;

  /// Sets all pixels; memory of the right size is used again.
  /// @param planes N images of one size and type CV_32F: the channels.
  void Assign(std::span<const cv::Mat> planes) {
    Create(planes[0].rows, planes[0].cols);
    cv::merge(planes.data(), planes.size(), data_);
  }

  /// Makes room for an image; memory of the right size is used again.
  void Create(int rows, int cols) {
    data_.create(rows, cols, CV_32FC(N));
    rows_ = rows;
    cols_ = cols;
    pixels_ = data_.template ptr<float>();
  }
  float* Row(int y) { return data_.template ptr<float>(y); }

  int rows() const { return rows_; }
  int cols() const { return cols_; }
  const float* At(int y, int x) const { return pixels_ + (size_t(y) * cols_ + x) * N; }

  /// Whether a place can be sampled: at least a pixel away from the border.
  template <class T>
  bool Inside(const Eigen::Matrix<T, 2, 1>& p) const {
    return p.x() >= T(1) && p.y() >= T(1) && p.x() < T(cols_ - 2) && p.y() < T(rows_ - 2);
  }

  /// Asks for the memory that Value() and Sample() will read at a place that is Inside().
  template <class T>
  void Prefetch(const Eigen::Matrix<T, 2, 1>& p) const {
    const float* upper = At(static_cast<int>(p.y()), static_cast<int>(p.x()));
    __builtin_prefetch(upper);
    __builtin_prefetch(upper + size_t(cols_) * N);
  }

  /// Channels at a place that is Inside().
  template <class T>
  SGF_ALWAYS_INLINE ChannelsAt<T, N> Sample(const Eigen::Matrix<T, 2, 1>& p) const {
    using Pixel = Eigen::Map<const Eigen::Array<float, N, 1>>;
    const int x = static_cast<int>(p.x());
    const int y = static_cast<int>(p.y());
    const T fx = p.x() - T(x);
    const T fy = p.y() - T(y);
    const float* upper = At(y, x);
    const float* lower = upper + size_t(cols_) * N;
    const Eigen::Array<T, N, 1> a = Pixel(upper).template cast<T>();
    const Eigen::Array<T, N, 1> b = Pixel(upper + N).template cast<T>();
    const Eigen::Array<T, N, 1> c = Pixel(lower).template cast<T>();
    const Eigen::Array<T, N, 1> d = Pixel(lower + N).template cast<T>();
    const Eigen::Array<T, N, 1> top = a + fx * (b - a);
    const Eigen::Array<T, N, 1> bottom = c + fx * (d - c);
    return {top + fy * (bottom - top), (b - a) + fy * ((d - c) - (b - a)), bottom - top};
  }

  /// The same without their derivatives, which are not computed then.
  template <class T>
  SGF_ALWAYS_INLINE Eigen::Array<T, N, 1> Value(const Eigen::Matrix<T, 2, 1>& p) const {
    return Sample(p).value;
  }

 private:
  int rows_ = 0, cols_ = 0;
  const float* pixels_ = nullptr;
  cv::Mat data_;
};

/// Channels of a SampleChannels image.
enum SampleChannel { kIntensity, kGradientX, kGradientY, kEpsilon };

/// Intensity (grey levels), gradient (grey levels/px) and epsilon ((grey levels/px)^2), from which
/// all pointwise dissimilarities are made.
using SampleChannels = ChannelImage<4>;

/// The gradient alone (grey levels/px): along the columns, then along the rows.
using GradientChannels = ChannelImage<2>;

/// Eight smoothed binary images: bit k of the 3 x 3 census (Alismail, Kilgour, Browning, Lucey,
/// "Direct visual odometry using bit-planes", 2016).
using BitPlanes = ChannelImage<8>;

/// How the levels of a pyramid are made.
struct LevelOptions {
  GradientOperator gradient = GradientOperator::kScharr;
  metrics::EpsilonOptions epsilon = {};

  template <class V>
  void VisitFields(V&& visit) {
    visit("gradient", gradient, "", "derivative operator");
    visit("epsilon", epsilon, "", "normalisation of gradients, eq. 6");
  }
};

/// Samples of a grey image.
/// @throws Error for an image that cannot be worked on.
SampleChannels MakeSampleChannels(const cv::Mat& grey, const LevelOptions& options);

/// The same into samples whose memory is used again where it has the size: fresh memory takes
/// longer than the arithmetic.
/// @param threads 0 for all cores. The result does not depend on it.
void MakeSampleChannels(const cv::Mat& grey, const LevelOptions& options, SampleChannels& samples,
                        int threads = 1);

/// Gradients of a grey image; memory of the right size is used again.
/// @return epsilon, (grey levels/px)^2: of all pixels in a 1 x 1 image where its scope is the
/// image,
///   else of each.
/// @throws Error for an image that cannot be worked on.
cv::Mat1f MakeGradientChannels(const cv::Mat& grey, const LevelOptions& options,
                               GradientChannels& gradients);

/// Bit-planes of a grey image, smoothed before and after binarisation (standard deviations 0.75 and
/// 1.5 px, the values that Alismail et al. recommend for odometry).
/// @throws Error for an image that cannot be worked on.
void MakeBitPlanes(const cv::Mat& grey, BitPlanes& planes);

/// Grey images of half the size each, as float; the first has full size, and is the image itself
/// where that is of floats. Pixels are means of 2 x 2; the last row or column of an odd size is
/// dropped.
std::vector<cv::Mat1f> GreyPyramid(const cv::Mat& grey, int levels);

/// The same into a pyramid whose memory is used again.
void GreyPyramid(const cv::Mat& grey, int levels, std::vector<cv::Mat1f>& pyramid);

/// Camera whose image is level `level` of GreyPyramid().
Camera LevelCamera(const Camera& camera, int level);

/// Place (px) in a level of a place in full size, and back.
inline double ToLevel(double full_px, int level) { return (full_px + 0.5) / (1 << level) - 0.5; }
inline double FromLevel(double level_px, int level) {
  return (level_px + 0.5) * (1 << level) - 0.5;
}

}  // namespace sgf::alignment
