#include <cstring>
#include <vector>

#include <gtest/gtest.h>
#include <support/error_message.h>

#include <sgf/alignment/level.h>
#include <sgf/core/random.h>
#include <sgf/core/simd.h>

namespace sgf::alignment {
namespace {

cv::Mat1f Noise(int rows, int cols) {
  cv::Mat1f image(rows, cols);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x)
      image(y, x) = static_cast<float>(255 * Uniform01(1, static_cast<uint64_t>(y * cols + x)));
  return image;
}

template <int N>
std::vector<float> Pixels(const ChannelImage<N>& image) {
  const float* first = image.At(0, 0);
  return {first, first + size_t(N) * image.rows() * image.cols()};
}

LevelOptions With(GradientOperator op, metrics::EpsilonScope scope) {
  LevelOptions options{.gradient = op};
  options.epsilon.scope = scope;
  options.epsilon.noise_floor = 0.5;
  return options;
}

// Widths around those of vectors, and one row or column, where the border is all there is.
constexpr std::pair<int, int> kSizes[] = {{1, 1},  {1, 9},  {7, 1},   {2, 3},  {5, 15},
                                          {6, 16}, {6, 17}, {40, 31}, {33, 67}};

TEST(SampleChannels, HaveTheGradientsAndEpsilonThatStandOnTheirOwn) {
  for (const auto& [rows, cols] : kSizes) {
    const cv::Mat1f image = Noise(rows, cols);
    for (const auto op : {GradientOperator::kCentral, GradientOperator::kScharr})
      for (const auto scope : {metrics::EpsilonScope::kImage, metrics::EpsilonScope::kTile}) {
        const LevelOptions options = With(op, scope);
        const SampleChannels samples = MakeSampleChannels(image, options);
        const GradientImage gradient = ComputeGradient(image, op);
        const cv::Mat1f epsilon = metrics::ComputeEpsilon(gradient, options.epsilon);
        for (int y = 0; y < rows; ++y)
          for (int x = 0; x < cols; ++x) {
            const float* at = samples.At(y, x);
            EXPECT_EQ(at[kIntensity], image(y, x));
            EXPECT_NEAR(at[kGradientX], gradient.x(y, x), 1e-4) << cols << ": " << x << "," << y;
            EXPECT_NEAR(at[kGradientY], gradient.y(y, x), 1e-4) << cols << ": " << x << "," << y;
            EXPECT_NEAR(at[kEpsilon], epsilon(y, x), 1e-4 * epsilon(y, x));
          }
      }
  }
}

TEST(GradientChannels, AreThoseOfTheSamples) {
  for (const auto& [rows, cols] : kSizes) {
    const cv::Mat1f image = Noise(rows, cols);
    for (const auto scope : {metrics::EpsilonScope::kImage, metrics::EpsilonScope::kTile}) {
      const LevelOptions options = With(GradientOperator::kScharr, scope);
      const SampleChannels samples = MakeSampleChannels(image, options);
      GradientChannels gradients;
      const cv::Mat1f epsilon = MakeGradientChannels(image, options, gradients);
      const bool one = scope == metrics::EpsilonScope::kImage;
      ASSERT_EQ(epsilon.size(), one ? cv::Size(1, 1) : image.size());
      for (int y = 0; y < rows; ++y)
        for (int x = 0; x < cols; ++x) {
          const float *sample = samples.At(y, x), *gradient = gradients.At(y, x);
          EXPECT_EQ(gradient[0], sample[kGradientX]);
          EXPECT_EQ(gradient[1], sample[kGradientY]);
          EXPECT_EQ(one ? epsilon(0, 0) : epsilon(y, x), sample[kEpsilon]);
        }
    }
  }
}

TEST(SampleChannels, HaveTheSameBitsForAnyThreadsAndInstructionSet) {
  const cv::Mat1f image = Noise(70, 83);
  const auto make = [&](int threads) {
    SampleChannels samples;
    MakeSampleChannels(image, {}, samples, threads);
    return Pixels(samples);
  };
  const std::vector<float> expected = make(1);
  EXPECT_EQ(make(2), expected);
  for (const std::string& target : SimdTargets()) {
    RestrictSimd(target);
    EXPECT_EQ(make(1), expected) << target;
  }
  RestrictSimd("");
}

TEST(SampleChannels, RefuseOptionsThatMakeNoSense) {
  LevelOptions options;
  options.epsilon.noise_floor = -1;
  EXPECT_NE(ErrorMessage([&] { MakeSampleChannels(Noise(4, 4), options); }).find("noise_floor"),
            std::string::npos);
}

TEST(GreyPyramid, LeavesTheImagesOfEarlierCallsAlone) {
  const cv::Mat1f first = Noise(16, 16), kept = first.clone();
  const cv::Mat1b second(16, 16, uint8_t{7});
  std::vector<cv::Mat1f> pyramid;
  GreyPyramid(first, 2, pyramid);
  EXPECT_EQ(pyramid[0].data, first.data) << "floats are not copied";
  GreyPyramid(second, 2, pyramid);
  EXPECT_EQ(cv::norm(first, kept, cv::NORM_INF), 0);
  EXPECT_EQ(pyramid[0](3, 3), 7);
  const float* memory = pyramid[0][0];
  GreyPyramid(second, 2, pyramid);
  EXPECT_EQ(pyramid[0][0], memory) << "its own memory is used again";
}

}  // namespace
}  // namespace sgf::alignment
