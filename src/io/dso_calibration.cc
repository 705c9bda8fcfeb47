#include <algorithm>
#include <cmath>
#include <sstream>
#include <string_view>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/dso_calibration.h>
#include <sgf/io/fields.h>
#include <sgf/io/image.h>
#include <sgf/io/read_file.h>
#include <sgf/io/rows.h>

namespace sgf {
namespace {

constexpr double kWhite = 65535;

std::string AtLine(const std::filesystem::path& path, size_t line) {
  return fmt::format("{}:{}", path.string(), line);
}

// Compares as DSO does, in single precision.
void RequireInverseResponse(const std::vector<double>& values, const std::string& where) {
  if (values.size() != kPcalibLevels)
    throw Error(where, fmt::format("inverse response has {} values instead of {}", values.size(),
                                   kPcalibLevels));
  for (size_t i = 1; i < values.size(); ++i)
    if (!(static_cast<float>(values[i]) > static_cast<float>(values[i - 1])))
      throw Error(where,
                  fmt::format("inverse response is {} at level {} after {}; it has to increase",
                              values[i], i, values[i - 1]));
}

bool IsNumber(std::string_view text) {
  return !text.empty() &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// `previous`: the frame before it, if there is one.
void RequireFrameTime(const FrameTime& frame, const FrameTime* previous, const std::string& where) {
  if (!IsNumber(frame.id))
    throw Error(where, fmt::format("id is {}, expected digits", Printable(frame.id)));
  if (frame.time_ns < 0) throw Error(where, fmt::format("time is {} ns", frame.time_ns));
  if (previous != nullptr && frame.time_ns <= previous->time_ns)
    throw Error(where, fmt::format("time {} ns does not come after {} ns", frame.time_ns,
                                   previous->time_ns));
  if (!(frame.exposure_ms > 0 && std::isfinite(frame.exposure_ms)))
    throw Error(where,
                fmt::format("exposure time is {} ms; it has to be positive", frame.exposure_ms));
}

FrameTime ParseFrameTime(std::string_view line, const std::string& where) {
  const auto fields = SplitFields(line, ' ');
  if (fields.size() != 3)
    throw Error(where,
                fmt::format("expected id, seconds and milliseconds, got {}", Printable(line)));
  const auto time_ns = ParseSeconds(fields[1]);
  const auto exposure_ms = ParseNumber<double>(fields[2]);
  if (!time_ns) throw Error(where, fmt::format("time is {}", Printable(fields[1])));
  if (!exposure_ms) throw Error(where, fmt::format("exposure time is {}", Printable(fields[2])));
  return {std::string(fields[0]), *time_ns, *exposure_ms};
}

/// Sets the camera's numbers from the first line of camera.txt.
void SetIntrinsics(std::string_view line, const std::string& where, Camera& camera) {
  auto fields = SplitFields(line, ' ');
  std::string_view model = "FOV";
  if (!fields.empty() && !ParseNumber<double>(fields[0])) {
    model = fields[0];
    fields.erase(fields.begin());
  }
  std::vector<double*> numbers = {&camera.fx, &camera.fy, &camera.cx, &camera.cy};
  if (model == "FOV" || model == "Pinhole")
    numbers.push_back(&camera.omega);
  else if (model == "RadTan")
    numbers.insert(numbers.end(), {&camera.k1, &camera.k2, &camera.p1, &camera.p2});
  else
    throw Error(where, fmt::format("camera model {} is unknown; known: FOV, Pinhole, RadTan",
                                   Printable(model)));
  if (fields.size() != numbers.size())
    throw Error(
        where, fmt::format("{} has {} numbers, expected {}", model, fields.size(), numbers.size()));
  for (size_t i = 0; i < fields.size(); ++i) *numbers[i] = NumberField<double>(fields[i], where);
  if (model == "Pinhole" && camera.omega != 0)
    throw Error(where, fmt::format("a pinhole's last number is {} instead of 0", camera.omega));
}

}  // namespace

Camera ReadCameraTxt(const std::filesystem::path& path) {
  std::istringstream lines(ReadFile(path));
  std::string intrinsics, size;
  std::getline(lines, intrinsics);
  std::getline(lines, size);
  Camera camera;
  SetIntrinsics(intrinsics, AtLine(path, 1), camera);
  const auto fields = SplitFields(size, ' ');
  if (fields.size() != 2) throw Error(AtLine(path, 2), "expected width and height");
  camera.width = NumberField<int>(fields[0], AtLine(path, 2));
  camera.height = NumberField<int>(fields[1], AtLine(path, 2));
  if (camera.cx < 1 && camera.cy < 1) {  // DSO's rule
    camera.fx *= camera.width;
    camera.fy *= camera.height;
    camera.cx = camera.cx * camera.width - 0.5;
    camera.cy = camera.cy * camera.height - 0.5;
  }
  camera.Check();
  return camera;
}

void WritePcalib(const std::filesystem::path& path, const std::vector<double>& inverse_response) {
  RequireInverseResponse(inverse_response, path.string());
  if (inverse_response.front() != 0 || inverse_response.back() != 1)
    throw Error(path.string(), fmt::format("inverse response runs from {} to {} instead of 0 to 1",
                                           inverse_response.front(), inverse_response.back()));
  std::string line;
  for (const double value : inverse_response)
    line += fmt::format("{}{}", line.empty() ? "" : " ", value * (kPcalibLevels - 1));
  WriteTextFile(path, line + "\n");
}

std::vector<double> ReadPcalib(const std::filesystem::path& path) {
  const std::string text = ReadFile(path);
  const std::string where = AtLine(path, 1);
  const std::string_view line = std::string_view(text).substr(0, text.find('\n'));
  if (!StripBlanks(std::string_view(text).substr(line.size())).empty())
    throw Error(AtLine(path, 2), "expected one line");
  std::vector<double> values;
  for (const std::string_view field : SplitFields(line, ' ')) {
    const auto value = ParseNumber<double>(field);
    if (!value) throw Error(where, fmt::format("value {} is {}", values.size(), Printable(field)));
    values.push_back(*value);
  }
  RequireInverseResponse(values, where);
  const double first = values.front(), range = values.back() - first;
  for (double& value : values) value = (value - first) / range;
  return values;
}

void WriteVignette(const std::filesystem::path& path, const cv::Mat1f& vignette) {
  cv::Mat_<uint16_t> levels(vignette.size());
  for (int y = 0; y < vignette.rows; ++y)
    for (int x = 0; x < vignette.cols; ++x) {
      const double level = std::round(vignette(y, x) * kWhite);
      if (!(level >= 1 && vignette(y, x) <= 1))
        throw Error(path.string(), fmt::format("vignette is {} at pixel ({}, {}); it has to be in "
                                               "(0, 1], and at least 1/65535 for this file",
                                               vignette(y, x), x, y));
      levels(y, x) = static_cast<uint16_t>(level);
    }
  WritePng(path, levels);
}

cv::Mat1f ReadVignette(const std::filesystem::path& path) {
  const cv::Mat levels = ReadImage(path, cv::IMREAD_UNCHANGED);
  if (levels.type() != CV_16UC1)
    throw Error(path.string(), fmt::format("a vignette has one channel of 16 bit, this image is {}",
                                           cv::typeToString(levels.type())));
  cv::Mat1f vignette(levels.size());
  for (int y = 0; y < levels.rows; ++y)
    for (int x = 0; x < levels.cols; ++x) {
      const uint16_t level = levels.at<uint16_t>(y, x);
      if (level == 0)
        throw Error(path.string(), fmt::format("vignette is 0 at pixel ({}, {})", x, y));
      vignette(y, x) = static_cast<float>(level / kWhite);
    }
  return vignette;
}

void WriteFrameTimes(const std::filesystem::path& path, const std::vector<FrameTime>& times) {
  std::string text;
  for (size_t i = 0; i < times.size(); ++i) {
    const FrameTime& frame = times[i];
    RequireFrameTime(frame, i > 0 ? &times[i - 1] : nullptr, AtLine(path, i + 1));
    text += fmt::format("{} {} {}\n", frame.id, FormatSeconds(frame.time_ns), frame.exposure_ms);
  }
  WriteTextFile(path, text);
}

std::vector<FrameTime> ReadFrameTimes(const std::filesystem::path& path) {
  std::istringstream lines(ReadFile(path));
  std::vector<FrameTime> times;
  std::string line;
  while (std::getline(lines, line)) {
    const std::string where = AtLine(path, times.size() + 1);
    times.push_back(ParseFrameTime(line, where));
    RequireFrameTime(times.back(), times.size() > 1 ? &times.end()[-2] : nullptr, where);
  }
  return times;
}

}  // namespace sgf
