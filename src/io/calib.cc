#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/io/calib.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

std::string_view Trim(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\v\f";
  const size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

// A value of the file and the line it stands in, for messages.
struct Entry {
  std::string text, where;
};

// The entries of the file and its name.
struct CalibFile {
  std::string name;
  std::map<std::string, Entry> entries;

  const Entry& At(const std::string& key) const {
    const auto it = entries.find(key);
    if (it == entries.end()) throw Error(name, "has no key " + key);
    return it->second;
  }
};

CalibFile ReadEntries(const std::filesystem::path& path) {
  std::istringstream lines(ReadFile(path));
  CalibFile file{path.string(), {}};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::string_view text = Trim(line);
    if (text.empty()) continue;
    const std::string where = fmt::format("{}:{}", path.string(), number);
    const size_t equals = text.find('=');
    if (equals == std::string_view::npos)
      throw Error(where, fmt::format("expected key=value, got {}", Printable(text)));
    const std::string_view value = Trim(text.substr(equals + 1));
    file.entries[std::string(Trim(text.substr(0, equals)))] = {std::string(value), where};
  }
  return file;
}

template <class T>
std::optional<T> Parse(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

[[noreturn]] void Fail(const Entry& entry, const std::string& key, const char* expected) {
  throw Error(entry.where,
              fmt::format("{} is {}, expected {}", key, Printable(entry.text), expected));
}

int PositiveInt(const CalibFile& file, const std::string& key) {
  const Entry& entry = file.At(key);
  const auto value = Parse<int>(entry.text);
  if (!value || *value < 1) Fail(entry, key, "a positive number");
  return *value;
}

double Number(const CalibFile& file, const std::string& key) {
  const Entry& entry = file.At(key);
  const auto value = Parse<double>(entry.text);
  if (!value || !std::isfinite(*value)) Fail(entry, key, "a number");
  return *value;
}

// Sets f, cx and cy from the text of a camera matrix, "[f 0 cx; 0 f cy; 0 0 1]".
void ReadCamera(const CalibFile& file, MiddleburyCalib& calib) {
  const Entry& entry = file.At("cam0");
  std::string text = entry.text;
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '[' || c == ']' || c == ';'; }, ' ');
  std::istringstream words(text);
  std::vector<double> m;
  for (std::string word; words >> word;)
    m.push_back(Parse<double>(word).value_or(std::numeric_limits<double>::quiet_NaN()));
  const bool finite = std::all_of(m.begin(), m.end(), [](double v) { return std::isfinite(v); });
  if (m.size() != 9 || !finite || !(m[0] > 0) || m[4] != m[0])
    Fail(entry, "cam0", "[f 0 cx; 0 f cy; 0 0 1] with f > 0");
  calib.f = m[0];
  calib.cx = m[2];
  calib.cy = m[5];
}

}  // namespace

MiddleburyCalib ReadMiddleburyCalib(const std::filesystem::path& path) {
  constexpr double kMetresPerMillimetre = 1e-3;
  const CalibFile file = ReadEntries(path);
  MiddleburyCalib calib;
  ReadCamera(file, calib);
  calib.doffs = Number(file, "doffs");
  calib.baseline_m = Number(file, "baseline") * kMetresPerMillimetre;
  if (!(calib.baseline_m > 0)) Fail(file.At("baseline"), "baseline", "a positive number");
  calib.width = PositiveInt(file, "width");
  calib.height = PositiveInt(file, "height");
  calib.ndisp = PositiveInt(file, "ndisp");
  return calib;
}

int ReadCalibNdisp(const std::filesystem::path& path) {
  return PositiveInt(ReadEntries(path), "ndisp");
}

}  // namespace sgf
