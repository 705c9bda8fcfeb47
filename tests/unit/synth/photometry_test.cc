#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/core/options.h>
#include <sgf/synth/photometry.h>

#include "support/error_message.h"

namespace sgf::synth {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr Camera kCamera{.width = 512, .height = 512, .fx = 300, .fy = 320, .cx = 255, .cy = 260};

PhotometryOptions NoiseFree() {
  PhotometryOptions options;
  options.noise.shot = false;
  options.noise.read_noise_e = 0;
  return options;
}

// A level of the image is one electron.
PhotometryOptions CountingElectrons() {
  PhotometryOptions options;
  options.bits = 16;
  options.noise.full_well_e = 65535;
  options.noise.read_noise_e = 0;
  return options;
}

cv::Mat1f Constant(double radiance) {
  return cv::Mat1f(kCamera.height, kCamera.width, static_cast<float>(radiance));
}

std::vector<double> Electrons(const PhotometryOptions& options, double mean, uint64_t seed) {
  const PhotometricCamera camera(kCamera, options, 1);
  const cv::Mat_<uint16_t> image =
      camera.Expose(Constant(mean / 65535), options.full_scale_ms, seed);
  return {image.begin(), image.end()};
}

double Moment(const std::vector<double>& values, double about, int power) {
  double sum = 0;
  for (const double v : values) sum += std::pow(v - about, power);
  return sum / static_cast<double>(values.size());
}

TEST(PhotometricCamera, IsRadianceTimesExposureTimesVignetteTimesSensitivity) {
  PhotometryOptions options = NoiseFree();
  options.full_scale_ms = 8;
  options.vignette = {VignetteModel::kPolynomial, {-0.4}};
  const PhotometricCamera camera(kCamera, options);
  const cv::Mat1b image = camera.Expose(Constant(0.7), 6, 0);
  EXPECT_EQ(image(260, 255), std::lround(255 * 0.7 * 6 / 8));
  EXPECT_EQ(image(511, 511), std::lround(255 * 0.7 * 6 / 8 * camera.vignette()(511, 511)));
}

TEST(PhotometricCamera, SaturatesAtFullScale) {
  for (const bool noisy : {false, true}) {
    const PhotometricCamera camera(kCamera, noisy ? PhotometryOptions() : NoiseFree());
    EXPECT_EQ(cv::countNonZero(camera.Expose(Constant(1.5), 10, 1) != 255), 0);
    EXPECT_EQ(cv::countNonZero(camera.Expose(Constant(1e30), 10, 1) != 255), 0);
  }
  const PhotometricCamera camera(kCamera, NoiseFree());
  EXPECT_EQ(camera.Expose(Constant(1), 10, 1).at<uint8_t>(0, 0), 255);
  EXPECT_EQ(camera.Expose(Constant(1), 9.9, 1).at<uint8_t>(0, 0), 252);
}

TEST(PhotometricCamera, IsBlackWithoutLight) {
  PhotometryOptions options;
  const PhotometricCamera camera(kCamera, options);
  EXPECT_LE(cv::mean(camera.Expose(Constant(0), 10, 1))[0], 1);
  options.noise.read_noise_e = 0;
  EXPECT_EQ(cv::countNonZero(PhotometricCamera(kCamera, options).Expose(Constant(0), 10, 1)), 0);
}

TEST(PhotometricCamera, PolynomialVignetteIsOneAtThePrincipalPointAndTheSumAtTheFarthestCorner) {
  PhotometryOptions options;
  options.vignette = {VignetteModel::kPolynomial, {-0.3, 0.05, -0.1}};
  const cv::Mat1f v = PhotometricCamera(kCamera, options).vignette();
  EXPECT_EQ(v(260, 255), 1);
  EXPECT_FLOAT_EQ(v(0, 511), 1 - 0.3F + 0.05F - 0.1F);
  const double r2 = (100. * 100 + 50 * 50) / (256. * 256 + 260 * 260);
  EXPECT_FLOAT_EQ(v(210, 355), 1 + r2 * (-0.3 + r2 * (0.05 - 0.1 * r2)));
}

TEST(PhotometricCamera, Cos4VignetteIsThatOfTheFieldAngle) {
  PhotometryOptions options;
  options.vignette.model = VignetteModel::kCos4;
  const cv::Mat1f v = PhotometricCamera(kCamera, options).vignette();
  EXPECT_EQ(v(260, 255), 1);
  for (const cv::Point p : {cv::Point(511, 260), cv::Point(0, 0), cv::Point(300, 500)}) {
    const double angle = std::atan(std::hypot((p.x - 255) / 300., (p.y - 260) / 320.));
    EXPECT_NEAR(v(p), std::pow(std::cos(angle), 4), 1e-6);
  }
}

TEST(PhotometricCamera, Cos4VignetteFollowsTheRaysOfADistortedCamera) {
  Camera camera = kCamera;
  camera.k1 = -0.1;
  PhotometryOptions options;
  options.vignette.model = VignetteModel::kCos4;
  const cv::Mat1f v = PhotometricCamera(camera, options).vignette();
  const Eigen::Vector2d pixel(400, 100);
  EXPECT_NEAR(v(100, 400), std::pow(camera.Unproject(pixel).normalized().z(), 4), 1e-6);
  EXPECT_GT(std::abs(v(100, 400) - std::pow(kCamera.Unproject(pixel).normalized().z(), 4)), 1e-3);
}

// Photon transfer: what is counted has the variance of its mean, and read noise adds its own.
TEST(PhotometricCamera, VarianceIsSignalPlusReadNoise) {
  PhotometryOptions options = CountingElectrons();
  for (const double read_noise : {0., 30.})
    for (const double mean : {0.5, 3., 9.5, 10.5, 40., 300., 5000., 40000.}) {
      if (read_noise > 0 && mean < 300) continue;  // clipped at 0
      options.noise.read_noise_e = read_noise;
      const auto e = Electrons(options, mean, 5);
      const double n = static_cast<double>(e.size());
      const double variance = mean + read_noise * read_noise + (read_noise > 0 ? 1 / 12. : 0);
      EXPECT_NEAR(Moment(e, 0, 1), mean, 4 * std::sqrt(variance / n)) << mean;
      EXPECT_NEAR(Moment(e, mean, 2), variance, 4 * variance * std::sqrt((2 + 1 / mean) / n))
          << mean << " and read noise " << read_noise;
    }
}

// Pearson's statistic of counts against the Poisson distribution, over values expected at least 20
// times, less its mean and in units of its standard deviation.
double PoissonMisfit(const std::vector<double>& counts, double mean) {
  double chi2 = 0;
  int degrees = 0;
  for (int k = 0; k < 200; ++k) {
    const double expected = static_cast<double>(counts.size()) *
                            std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.));
    if (expected < 20) continue;
    const auto found = static_cast<double>(std::count(counts.begin(), counts.end(), k));
    chi2 += (found - expected) * (found - expected) / expected;
    ++degrees;
  }
  return (chi2 - degrees) / std::sqrt(2. * degrees);
}

TEST(PhotometricCamera, ShotNoiseIsPoissonBelowAndAboveTheSwitchToTheExpansion) {
  for (const double mean : {0.2, 2., 9.9, 10.1, 25., 100.})
    EXPECT_LT(PoissonMisfit(Electrons(CountingElectrons(), mean, 11), mean), 4) << mean;
}

TEST(PhotometricCamera, ShotNoiseHasTheSkewnessOfPoissonNumbers) {
  const auto e = Electrons(CountingElectrons(), 12, 3);
  EXPECT_NEAR(Moment(e, 12, 3) / 12, 1, 0.05);
}

TEST(PhotometricCamera, ReadNoiseIsGaussianAndNotCorrelated) {
  PhotometryOptions options = CountingElectrons();
  options.noise.shot = false;
  options.noise.read_noise_e = 2000;
  auto e = Electrons(options, 30000, 7);
  auto next_frame = Electrons(options, 30000, 8);
  for (auto* frame : {&e, &next_frame})
    for (double& v : *frame) v = (v - 30000) / 2000;
  const double sigma = 1 / std::sqrt(static_cast<double>(e.size()));
  EXPECT_NEAR(Moment(e, 0, 1), 0, 4 * sigma);
  EXPECT_NEAR(Moment(e, 0, 2), 1, 4 * sigma * std::sqrt(2));
  EXPECT_NEAR(Moment(e, 0, 3), 0, 4 * sigma * std::sqrt(15));
  EXPECT_NEAR(Moment(e, 0, 4), 3, 4 * sigma * std::sqrt(96));
  double neighbours = 0, frames = 0;
  for (size_t i = 1; i < e.size(); ++i) {
    neighbours += e[i] * e[i - 1] * sigma * sigma;
    frames += e[i] * next_frame[i] * sigma * sigma;
  }
  EXPECT_NEAR(neighbours, 0, 4 * sigma);
  EXPECT_NEAR(frames, 0, 4 * sigma);
}

TEST(PhotometricCamera, ReadNoiseReachesTheTailsOfTheNormalDistribution) {
  PhotometryOptions options = CountingElectrons();
  options.noise.shot = false;
  options.noise.read_noise_e = 2000;
  const auto e = Electrons(options, 30000, 9);
  for (const double z : {2., 3., 4.}) {
    const double expected = std::erfc(z / std::sqrt(2.)) * static_cast<double>(e.size());
    const auto found = static_cast<double>(std::count_if(
        e.begin(), e.end(), [&](double v) { return std::abs(v - 30000) > z * 2000; }));
    EXPECT_NEAR(found, expected, 4 * std::sqrt(expected)) << z;
  }
}

TEST(PhotometricCamera, ShotAndReadNoiseOfAPixelAreIndependent) {
  PhotometryOptions shot = CountingElectrons(), read = CountingElectrons();
  read.noise.shot = false;
  read.noise.read_noise_e = 100;
  const auto a = Electrons(shot, 10000, 4), b = Electrons(read, 10000, 4);
  double product = 0;
  for (size_t i = 0; i < a.size(); ++i) product += (a[i] - 10000) * (b[i] - 10000) / 10000;
  EXPECT_NEAR(product / static_cast<double>(a.size()), 0,
              4 / std::sqrt(static_cast<double>(a.size())));
}

TEST(PhotometricCamera, GivesTheSameBitsForAnyNumberOfThreads) {
  cv::Mat1f radiance(kCamera.height, kCamera.width);
  for (int y = 0; y < radiance.rows; ++y)
    for (int x = 0; x < radiance.cols; ++x) radiance(y, x) = static_cast<float>(x * y) / 250000;
  PhotometryOptions options;
  options.vignette.model = VignetteModel::kCos4;
  const PhotometricCamera one(kCamera, options, 1), two(kCamera, options, 2);
  const cv::Mat image = one.Expose(radiance, 10, 1);
  EXPECT_EQ(cv::countNonZero(image != two.Expose(radiance, 10, 1)), 0);
  EXPECT_EQ(cv::countNonZero(one.vignette() != two.vignette()), 0);
  EXPECT_EQ(cv::countNonZero(one.Radiance(image, 10) != two.Radiance(image, 10)), 0);
  EXPECT_GT(cv::countNonZero(image != one.Expose(radiance, 10, 2)), 1000);
}

TEST(PhotometricCamera, RadianceIsRecoveredToHalfALevel) {
  cv::Mat1f radiance(kCamera.height, kCamera.width);
  for (int y = 0; y < radiance.rows; ++y)
    for (int x = 0; x < radiance.cols; ++x)
      radiance(y, x) = static_cast<float>(1 + x + 512 * y) / (512 * 512);
  PhotometryOptions options = NoiseFree();
  options.vignette = {VignetteModel::kPolynomial, {-0.5}};
  options.response = {ResponseModel::kGamma, 2, {}};
  options.bits = 16;
  const PhotometricCamera camera(kCamera, options);
  const cv::Mat1f found = camera.Radiance(camera.Expose(radiance, 5, 0), 5);
  for (int y = 0; y < radiance.rows; y += 5)
    for (int x = 0; x < radiance.cols; x += 5) {
      // f^-1 has slope 2 f, and half a level is 1 / 131070.
      const double gain = 0.5 * camera.vignette()(y, x);
      const double bound = 2 * std::sqrt(radiance(y, x) * gain) / 131070 / gain;
      ASSERT_NEAR(found(y, x), radiance(y, x), 1.01 * bound + 1e-6) << x << " " << y;
    }
}

std::vector<ResponseOptions> AllResponses() {
  return {{},
          {ResponseModel::kGamma, 2.2, {}},
          {ResponseModel::kGamma, 0.4, {}},
          {ResponseModel::kTable, 2.2, {0, 0.5, 0.6, 0.95, 1}}};
}

TEST(CameraResponse, IsUndoneByItsInverse) {
  for (const ResponseOptions& options : AllResponses()) {
    const CameraResponse response(options);
    EXPECT_EQ(response.Forward(0), 0);
    EXPECT_EQ(response.Forward(1), 1);
    EXPECT_EQ(response.Inverse(0), 0);
    EXPECT_EQ(response.Inverse(1), 1);
    for (double x = 0.001; x < 1; x += 0.001) {
      EXPECT_NEAR(response.Inverse(response.Forward(x)), x, 1e-12);
      EXPECT_GT(response.Forward(x), response.Forward(x - 0.001));
    }
  }
}

TEST(CameraResponse, HasTheShapeItSays) {
  EXPECT_DOUBLE_EQ(CameraResponse(AllResponses()[1]).Forward(0.3), std::pow(0.3, 1 / 2.2));
  const CameraResponse table(AllResponses()[3]);
  EXPECT_DOUBLE_EQ(table.Forward(0.25), 0.5);
  EXPECT_DOUBLE_EQ(table.Forward(0.625), 0.775);
  EXPECT_DOUBLE_EQ(table.Inverse(0.55), 0.375);
  EXPECT_EQ(table.Forward(-1), 0);
  EXPECT_EQ(table.Forward(2), 1);
}

TEST(CameraResponse, InverseTableHasTheIrradianceOfEveryLevel) {
  for (const ResponseOptions& options : AllResponses()) {
    const CameraResponse response(options);
    const auto table = response.InverseTable(256);
    ASSERT_EQ(table.size(), 256U);
    EXPECT_EQ(table.front(), 0);
    EXPECT_EQ(table.back(), 1);
    for (int i = 1; i < 256; ++i) {
      EXPECT_GT(table[i], table[i - 1]);
      EXPECT_NEAR(255 * response.Forward(table[i]), i, 1e-9);
    }
  }
}

TEST(Quantizer, RoundsTheResponseToTheNearestLevel) {
  for (const ResponseOptions& options : AllResponses())
    for (const int levels : {256, 65536}) {
      const CameraResponse response(options);
      const Quantizer quantizer(response, levels);
      EXPECT_EQ(quantizer.Level(0), 0);
      EXPECT_EQ(quantizer.Level(1), levels - 1);
      for (int i = 1; i < 100000; ++i) {
        const float x = static_cast<float>(i) / 100000;
        const double exact = response.Forward(x) * (levels - 1);
        ASSERT_LE(std::abs(quantizer.Level(x) - exact), 0.51) << x << " of " << levels;
      }
    }
}

TEST(Luminance, WeighsLinearRedGreenAndBlue) {
  cv::Mat3f rgb(1, 4);
  rgb(0) = {1, 0, 0};
  rgb(1) = {0, 1, 0};
  rgb(2) = {0, 0, 1};
  rgb(3) = {2, 2, 2};
  const cv::Mat1f luminance = Luminance(rgb);
  EXPECT_FLOAT_EQ(luminance(0), 0.2126F);
  EXPECT_FLOAT_EQ(luminance(1), 0.7152F);
  EXPECT_FLOAT_EQ(luminance(2), 0.0722F);
  EXPECT_FLOAT_EQ(luminance(3), 2);
}

TEST(FrameSeed, DiffersForEyesFramesAndSequences) {
  std::vector<uint64_t> seeds;
  for (const uint64_t seed : {0, 1})
    for (const int camera : {0, 1})
      for (const int frame : {0, 1, 2}) seeds.push_back(FrameSeed(seed, camera, frame));
  std::sort(seeds.begin(), seeds.end());
  EXPECT_EQ(std::adjacent_find(seeds.begin(), seeds.end()), seeds.end());
}

TEST(PhotometryOptions, AreReadFromYaml) {
  PhotometryOptions options;
  ReadOptions(YAML::Load("{bits: 16, vignette: {model: cos4}, response: {model: table, table: [0, "
                         "0.7, 1]}, noise: {shot: false}}"),
              options, "camera.yaml");
  EXPECT_EQ(options.bits, 16);
  EXPECT_EQ(options.vignette.model, VignetteModel::kCos4);
  EXPECT_EQ(options.response.table[1], 0.7);
  EXPECT_FALSE(options.noise.shot);
}

template <class Change>
std::string MessageOf(Change change) {
  PhotometryOptions options;
  change(options);
  return ErrorMessage([&] { PhotometricCamera(kCamera, options); });
}

TEST(PhotometryOptions, OutOfRangeAreErrorsThatNameKeyAndValue) {
  using O = PhotometryOptions;
  EXPECT_EQ(MessageOf([](O& o) { o.full_scale_ms = 0; }),
            "full_scale_ms: is 0; it has to be positive");
  EXPECT_EQ(MessageOf([](O& o) { o.bits = 12; }), "bits: is 12; it has to be 8 or 16");
  EXPECT_EQ(MessageOf([](O& o) { o.noise.read_noise_e = -2; }),
            "noise.read_noise_e: is -2; it must not be negative");
  EXPECT_EQ(MessageOf([](O& o) { o.noise.full_well_e = -1; }),
            "noise.full_well_e: is -1; it has to be positive");
  EXPECT_THAT(MessageOf([](O& o) { o.noise.full_well_e = 1e12; }),
              StartsWith("noise.full_well_e: is 1000000000000"));
  EXPECT_EQ(MessageOf([](O& o) { o.noise.read_noise_e = NAN; }),
            "noise.read_noise_e: is nan; it must not be negative");
}

TEST(PhotometryOptions, AVignetteThatIsNotInZeroToOneIsAnError) {
  using O = PhotometryOptions;
  const auto with = [](double v2, double v4) {
    return MessageOf([&](O& o) { o.vignette = {VignetteModel::kPolynomial, {v2, v4}}; });
  };
  EXPECT_THAT(with(0.1, 0), HasSubstr("it has to be in (0, 1]"));
  EXPECT_THAT(with(0.1, 0), StartsWith("vignette: is 1."));
  EXPECT_THAT(with(-1.01, 0), StartsWith("vignette: is -0.00"));
  EXPECT_THAT(with(-2.9, 2), StartsWith("vignette: is -0.0"));  // 0.1 at the corner
  EXPECT_THAT(with(NAN, 0), StartsWith("vignette: is nan"));
  EXPECT_EQ(with(-0.99, 0), "no error");
  EXPECT_EQ(MessageOf([](O& o) { o.vignette.coefficients = {-0.1}; }),
            "vignette.coefficients: has 1 values; only the polynomial has any");
}

TEST(PhotometryOptions, ABadResponseIsAnError) {
  const auto with = [](std::vector<double> table) {
    return MessageOf([&](auto& o) { o.response = {ResponseModel::kTable, 1, std::move(table)}; });
  };
  EXPECT_EQ(with({0, 0.5, 0.4, 1}),
            "response.table: value 2 is 0.4 after 0.5; the curve has to increase strictly");
  EXPECT_EQ(with({0, 0.5, 0.5, 1}),
            "response.table: value 2 is 0.5 after 0.5; the curve has to increase strictly");
  EXPECT_EQ(with({0.1, 1}), "response.table: runs from 0.1 to 1; it has to run from 0 to 1");
  EXPECT_EQ(with({}), "response.table: has 0 values; it needs at least 2");
  EXPECT_THAT(with({0, NAN, 1}), StartsWith("response.table: value 1 is nan"));
  EXPECT_EQ(MessageOf([](auto& o) {
              o.response.table = {0, 1};
            }),
            "response.table: has 2 values, but the model is not table");
  EXPECT_EQ(MessageOf([](auto& o) {
              o.response = {ResponseModel::kGamma, 0, {}};
            }),
            "response.gamma: is 0; it has to be positive");
}

TEST(PhotometricCamera, RefusesWhatItCannotExpose) {
  const PhotometricCamera camera(kCamera, NoiseFree());
  const auto expose = [&](const cv::Mat1f& radiance, double exposure_ms) {
    return ErrorMessage([&] { camera.Expose(radiance, exposure_ms, 0); });
  };
  EXPECT_EQ(expose(Constant(1), 0), "exposure_ms: is 0; it has to be positive");
  EXPECT_EQ(expose(Constant(1), -3), "exposure_ms: is -3; it has to be positive");
  EXPECT_THAT(expose(Constant(1), NAN), StartsWith("exposure_ms: is nan"));
  EXPECT_EQ(expose(cv::Mat1f(3, 4, 0.F), 1),
            "image: is 4x3 CV_32FC1; the camera has 512x512 CV_32FC1");
  for (const float bad : {-0.1F, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    cv::Mat1f radiance = Constant(0.5);
    radiance(7, 9) = bad;
    EXPECT_THAT(expose(radiance, 1), HasSubstr("at pixel (9, 7)")) << bad;
  }
  EXPECT_THAT(ErrorMessage([&] { camera.Radiance(Constant(1), 1); }),
              StartsWith("image: is 512x512 CV_32FC1; the camera has 512x512 CV_8UC1"));
}

}  // namespace
}  // namespace sgf::synth
