#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/core/parallel.h>
#include <sgf/core/random.h>
#include <sgf/synth/photometry.h>

namespace sgf::synth {
namespace {

// Saturates in any case, and holds in 32 bits.
constexpr float kMaxElectrons = 2e9F;
constexpr double kMaxFullWell = 1e9;
constexpr double kMaxGain = 1e20;

void MeanElectrons(const float* radiance, const float* vignette, float gain, std::span<float> e) {
  for (size_t x = 0; x < e.size(); ++x)
    e[x] = std::min(radiance[x] * gain * vignette[x], kMaxElectrons);
}

// Standard normal numbers as the inverse of the distribution function at 32 random bits. One bit is
// the sign, the others a probability u in [2^-33, 1/2]. Between its 64 nodes in every octave of u
// the inverse is linear: off by less than 2e-5 over the whole range of +-6.4.
class NormalTable {
 public:
  NormalTable() {
    double previous = 0;
    for (int i = kSegments; i >= 0; --i) {
      const auto node = std::bit_cast<float>(kFirst + (static_cast<uint32_t>(i) << kShift));
      const double value = UpperQuantile(node, previous);
      segments_[i] = {static_cast<float>(value), static_cast<float>((previous - value) / kStep)};
      previous = value;
    }
  }

  float operator()(uint32_t bits) const {
    const float u = (static_cast<float>(static_cast<int32_t>(bits >> 1)) + 0.5F) * 0x1p-32F;
    const uint32_t code = std::bit_cast<uint32_t>(u) - kFirst;
    const Segment& segment = segments_[code >> kShift];
    const float value = segment.value + segment.slope * static_cast<float>(code % kStep);
    return std::bit_cast<float>(std::bit_cast<uint32_t>(value) ^ (bits << 31));  // +-value
  }

 private:
  struct Segment {
    float value;  // at its first node
    float slope;  // per step of the bit pattern of u
  };
  static constexpr int kShift = 17;  // 23 bits of mantissa, of which 6 choose the segment
  static constexpr int kStep = 1 << kShift;
  static constexpr int kSegments = 32 * 64;  // a last one holds u = 1/2
  static constexpr uint32_t kFirst = std::bit_cast<uint32_t>(0x1p-33F);

  // x with Q(x) = u, for Q the upper tail of the normal distribution, by Newton's method. Q is
  // convex for x > 0, so that from any x that is too small the iteration only grows.
  static double UpperQuantile(double u, double x) {
    for (double step = 1; step > 1e-13;) {
      const double tail = std::erfc(x / std::numbers::sqrt2) / 2;
      const double density = std::exp(-x * x / 2) * std::numbers::inv_sqrtpi / std::numbers::sqrt2;
      step = (tail - u) / density;
      x += step;
    }
    return x;
  }

  std::array<Segment, kSegments + 1> segments_;
};

const NormalTable& Normal() {
  static const NormalTable table;
  return table;
}

// Below this mean, Poisson numbers come from summing probabilities, above from an expansion.
constexpr float kExpansionMean = 10;

// First k at which the distribution function of Poisson numbers with this mean reaches u.
float PoissonBySum(float mean, double u) {
  double term = std::exp(-static_cast<double>(mean));
  double sum = term;
  int k = 0;
  while (sum < u) {
    term *= mean / ++k;
    sum += term;
  }
  return static_cast<float>(k);
}

// The inverse of that distribution function at the probability of the normal number w: the normal
// expansion with correction of skewness and kurtosis of Giles, "Algorithm 955: approximation of the
// inverse Poisson cumulative distribution function", ACM TOMS 42(1), 2016.
float PoissonByExpansion(float mean, float w) {
  const float root = std::sqrt(mean);
  const float skew = (w * w + 2) / 6;
  const float value = mean + root * w + skew * (1 - w / (12 * root));
  return static_cast<float>(static_cast<int32_t>(std::max(0.F, value)));  // rounds down
}

uint32_t ShotBits(uint64_t bits) { return static_cast<uint32_t>(bits >> 32); }

// Turns mean numbers of electrons into Poisson numbers. In two loops, since the first one runs on
// SIMD lanes.
// @param normal normal numbers from the same random bits; overwritten.
void AddShotNoise(uint64_t seed, uint64_t first, std::span<float> normal, std::span<float> e) {
  for (size_t x = 0; x < e.size(); ++x)
    normal[x] = PoissonByExpansion(std::max(e[x], kExpansionMean), normal[x]);
  for (size_t x = 0; x < e.size(); ++x)
    e[x] = e[x] < kExpansionMean
               ? PoissonBySum(e[x], (ShotBits(Hash64(seed, first + x)) + 0.5) * 0x1p-32)
               : normal[x];
}

// Adds shot noise to mean numbers of electrons, and read noise, for pixels numbered from `first`
// on.
void AddNoise(const SensorNoiseOptions& noise, uint64_t seed, uint64_t first, std::span<float> e) {
  const NormalTable& normal = Normal();
  const auto read_noise = static_cast<float>(noise.read_noise_e);
  std::vector<float> shot(e.size()), read(e.size());
  for (size_t x = 0; x < e.size(); ++x) {
    const uint64_t bits = Hash64(seed, first + x);
    shot[x] = normal(ShotBits(bits));
    read[x] = read_noise * normal(static_cast<uint32_t>(bits));
  }
  if (noise.shot) AddShotNoise(seed, first, shot, e);
  for (size_t x = 0; x < e.size(); ++x) e[x] += read[x];
}

void RequirePositive(const char* key, double value) {
  if (!(value > 0 && std::isfinite(value)))
    throw Error(key, fmt::format("is {}; it has to be positive", value));
}

void RequireRadiance(const float* radiance, int width, int y) {
  for (int x = 0; x < width; ++x)
    if (!(radiance[x] >= 0 && radiance[x] <= std::numeric_limits<float>::max()))
      throw Error("radiance", fmt::format("is {} at pixel ({}, {}); it has to be finite and not "
                                          "negative",
                                          radiance[x], x, y));
}

double Polynomial(const std::vector<double>& coefficients, double r2) {
  double sum = 0;
  for (size_t i = coefficients.size(); i-- > 0;) sum = (sum + coefficients[i]) * r2;
  return 1 + sum;
}

// Squared distance (px^2) from the principal point to the corner pixel farthest from it.
double SquaredCornerRadius(const Camera& camera) {
  const double x = std::max(std::abs(camera.cx), std::abs(camera.width - 1 - camera.cx));
  const double y = std::max(std::abs(camera.cy), std::abs(camera.height - 1 - camera.cy));
  return std::max(x * x + y * y, std::numeric_limits<double>::min());
}

double VignetteAt(const Camera& camera, const VignetteOptions& options, int x, int y) {
  if (options.model == VignetteModel::kCos4) {
    // The ray ends at z = 1: the cosine is the inverse of its length.
    const double squared_length = camera.Unproject({x, y}).squaredNorm();
    return 1 / (squared_length * squared_length);
  }
  const double dx = x - camera.cx, dy = y - camera.cy;
  return Polynomial(options.coefficients, (dx * dx + dy * dy) / SquaredCornerRadius(camera));
}

cv::Mat1f VignetteImage(const Camera& camera, const VignetteOptions& options, int threads) {
  camera.Check();
  cv::Mat1f vignette(camera.height, camera.width);
  ParallelFor(camera.height, threads, [&](int y) {
    for (int x = 0; x < camera.width; ++x) {
      const double v = VignetteAt(camera, options, x, y);
      vignette(y, x) = static_cast<float>(v);
      if (!(v > 0 && v <= 1))
        throw Error("vignette",
                    fmt::format("is {} at pixel ({}, {}); it has to be in (0, 1]", v, x, y));
    }
  });
  return vignette;
}

void CheckTable(const std::vector<double>& table) {
  const char* key = "response.table";
  if (table.size() < 2)
    throw Error(key, fmt::format("has {} values; it needs at least 2", table.size()));
  if (table.front() != 0 || table.back() != 1)
    throw Error(key, fmt::format("runs from {} to {}; it has to run from 0 to 1", table.front(),
                                 table.back()));
  for (size_t i = 1; i < table.size(); ++i)
    if (!(table[i] > table[i - 1]))
      throw Error(key, fmt::format("value {} is {} after {}; the curve has to increase strictly", i,
                                   table[i], table[i - 1]));
}

PhotometryOptions Checked(const PhotometryOptions& options) {
  Check(options);
  return options;
}

}  // namespace

void Check(const PhotometryOptions& o) {
  RequirePositive("full_scale_ms", o.full_scale_ms);
  RequirePositive("noise.full_well_e", o.noise.full_well_e);
  if (o.noise.full_well_e > kMaxFullWell)
    throw Error("noise.full_well_e",
                fmt::format("is {}; the most is {}", o.noise.full_well_e, kMaxFullWell));
  if (!(o.noise.read_noise_e >= 0 && std::isfinite(o.noise.read_noise_e)))
    throw Error("noise.read_noise_e",
                fmt::format("is {}; it must not be negative", o.noise.read_noise_e));
  if (o.bits != 8 && o.bits != 16)
    throw Error("bits", fmt::format("is {}; it has to be 8 or 16", o.bits));
  if (o.vignette.model != VignetteModel::kPolynomial && !o.vignette.coefficients.empty())
    throw Error("vignette.coefficients", fmt::format("has {} values; only the polynomial has any",
                                                     o.vignette.coefficients.size()));
}

std::span<const std::pair<const char*, VignetteModel>> EnumNames(VignetteModel) {
  static constexpr std::array<std::pair<const char*, VignetteModel>, 3> kNames{
      {{"none", VignetteModel::kNone},
       {"polynomial", VignetteModel::kPolynomial},
       {"cos4", VignetteModel::kCos4}}};
  return kNames;
}

std::span<const std::pair<const char*, ResponseModel>> EnumNames(ResponseModel) {
  static constexpr std::array<std::pair<const char*, ResponseModel>, 3> kNames{
      {{"linear", ResponseModel::kLinear},
       {"gamma", ResponseModel::kGamma},
       {"table", ResponseModel::kTable}}};
  return kNames;
}

CameraResponse::CameraResponse(ResponseOptions options) : options_(std::move(options)) {
  if (options_.model == ResponseModel::kGamma) RequirePositive("response.gamma", options_.gamma);
  if (options_.model == ResponseModel::kTable)
    CheckTable(options_.table);
  else if (!options_.table.empty())
    throw Error("response.table",
                fmt::format("has {} values, but the model is not table", options_.table.size()));
}

double CameraResponse::Forward(double irradiance) const {
  const double x = std::clamp(irradiance, 0., 1.);
  if (options_.model == ResponseModel::kLinear) return x;
  if (options_.model == ResponseModel::kGamma) return std::pow(x, 1 / options_.gamma);
  const auto& table = options_.table;
  const double position = x * static_cast<double>(table.size() - 1);
  const size_t i = std::min(static_cast<size_t>(position), table.size() - 2);
  return table[i] + (table[i + 1] - table[i]) * (position - static_cast<double>(i));
}

double CameraResponse::Inverse(double output) const {
  const double y = std::clamp(output, 0., 1.);
  if (options_.model == ResponseModel::kLinear) return y;
  if (options_.model == ResponseModel::kGamma) return std::pow(y, options_.gamma);
  const auto& table = options_.table;
  const auto next = std::upper_bound(table.begin() + 1, table.end() - 1, y);
  const double fraction = (y - next[-1]) / (next[0] - next[-1]);
  return (static_cast<double>(next - table.begin() - 1) + fraction) /
         static_cast<double>(table.size() - 1);
}

std::vector<double> CameraResponse::InverseTable(int levels) const {
  std::vector<double> table(levels);
  for (int i = 0; i < levels; ++i) table[i] = Inverse(i / (levels - 1.));
  return table;
}

Quantizer::Quantizer(const CameraResponse& response, int levels)
    : thresholds_(levels, std::numeric_limits<float>::infinity()), guide_(kBins + 1) {
  for (int i = 0; i < levels - 1; ++i)
    thresholds_[i] = static_cast<float>(response.Inverse((i + 0.5) / (levels - 1)));
  for (size_t b = 0; b < guide_.size(); ++b) {
    const auto border = static_cast<float>(b) / static_cast<float>(kBins);
    const auto end = std::upper_bound(thresholds_.begin(), thresholds_.end(), border);
    guide_[b] = static_cast<uint16_t>(end - thresholds_.begin());
  }
}

cv::Mat1f Luminance(const cv::Mat3f& rgb) {
  cv::Mat1f luminance(rgb.size());
  for (int y = 0; y < rgb.rows; ++y) {
    const cv::Vec3f* in = rgb[y];
    float* out = luminance[y];
    for (int x = 0; x < rgb.cols; ++x)
      out[x] = 0.2126F * in[x][0] + 0.7152F * in[x][1] + 0.0722F * in[x][2];
  }
  return luminance;
}

cv::Mat3b ForScreen(const cv::Mat3f& radiance) {
  cv::Mat clipped = cv::min(radiance, cv::Scalar::all(1)), curved, bgr;
  cv::pow(clipped, 1 / 2.2, curved);
  curved.convertTo(bgr, CV_8U, 255);
  cv::cvtColor(bgr, bgr, cv::COLOR_RGB2BGR);
  return bgr;
}

uint64_t FrameSeed(uint64_t seed, int camera, int frame) {
  return Hash64(Hash64(seed, static_cast<uint64_t>(camera)), static_cast<uint64_t>(frame));
}

PhotometricCamera::PhotometricCamera(const Camera& camera, const PhotometryOptions& options,
                                     int threads)
    : options_(Checked(options)),
      threads_(threads),
      response_(options_.response),
      inverse_response_(response_.InverseTable(1 << options_.bits)),
      quantizer_(response_, 1 << options_.bits),
      vignette_(VignetteImage(camera, options_.vignette, threads)) {}

cv::Mat PhotometricCamera::Expose(const cv::Mat1f& radiance, double exposure_ms,
                                  uint64_t frame_seed) const {
  CheckCall(radiance, CV_32F, exposure_ms);
  cv::Mat image(radiance.size(), options_.bits == 8 ? CV_8U : CV_16U);
  ParallelFor(image.rows, threads_, [&](int y) {
    if (options_.bits == 8)
      ExposeRow(radiance[y], y, exposure_ms, frame_seed, image.ptr<uint8_t>(y));
    else
      ExposeRow(radiance[y], y, exposure_ms, frame_seed, image.ptr<uint16_t>(y));
  });
  return image;
}

template <class Level>
void PhotometricCamera::ExposeRow(const float* radiance, int y, double exposure_ms, uint64_t seed,
                                  Level* levels) const {
  const SensorNoiseOptions& noise = options_.noise;
  const int width = vignette_.cols;
  RequireRadiance(radiance, width, y);
  std::vector<float> electrons(width);
  const double gain = exposure_ms / options_.full_scale_ms * noise.full_well_e;
  MeanElectrons(radiance, vignette_[y], static_cast<float>(std::min(gain, kMaxGain)), electrons);
  if (noise.shot || noise.read_noise_e > 0)
    AddNoise(noise, seed, static_cast<uint64_t>(y) * static_cast<uint64_t>(width), electrons);
  const auto full_well = static_cast<float>(noise.full_well_e);
  for (int x = 0; x < width; ++x) {
    const float irradiance = std::clamp(electrons[x] / full_well, 0.F, 1.F);
    levels[x] = static_cast<Level>(quantizer_.Level(irradiance));
  }
}

cv::Mat1f PhotometricCamera::Radiance(const cv::Mat& image, double exposure_ms) const {
  CheckCall(image, options_.bits == 8 ? CV_8U : CV_16U, exposure_ms);
  cv::Mat1f radiance(image.size());
  ParallelFor(image.rows, threads_, [&](int y) {
    if (options_.bits == 8)
      RadianceRow(image.ptr<uint8_t>(y), y, exposure_ms, radiance[y]);
    else
      RadianceRow(image.ptr<uint16_t>(y), y, exposure_ms, radiance[y]);
  });
  return radiance;
}

template <class Level>
void PhotometricCamera::RadianceRow(const Level* levels, int y, double exposure_ms,
                                    float* radiance) const {
  const double scale = options_.full_scale_ms / exposure_ms;
  for (int x = 0; x < vignette_.cols; ++x)
    radiance[x] = static_cast<float>(inverse_response_[levels[x]] * scale / vignette_(y, x));
}

void PhotometricCamera::CheckCall(const cv::Mat& image, int type, double exposure_ms) const {
  RequirePositive("exposure_ms", exposure_ms);
  if (image.type() != type || image.size() != vignette_.size())
    throw Error("image", fmt::format("is {}x{} {}; the camera has {}x{} {}", image.cols, image.rows,
                                     cv::typeToString(image.type()), vignette_.cols, vignette_.rows,
                                     cv::typeToString(type)));
}

}  // namespace sgf::synth
