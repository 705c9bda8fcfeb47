#include <charconv>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

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

int ParseNdisp(std::string_view text, const std::string& where) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 1)
    throw Error(where, fmt::format("ndisp is {}, expected a positive number", Printable(text)));
  return value;
}

}  // namespace

int ReadCalibNdisp(const std::filesystem::path& path) {
  std::istringstream lines(ReadFile(path));
  std::optional<int> ndisp;
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::string_view text = Trim(line);
    if (text.empty()) continue;
    const std::string where = fmt::format("{}:{}", path.string(), number);
    const size_t equals = text.find('=');
    if (equals == std::string_view::npos)
      throw Error(where, fmt::format("expected key=value, got {}", Printable(text)));
    if (Trim(text.substr(0, equals)) == "ndisp")
      ndisp = ParseNdisp(Trim(text.substr(equals + 1)), where);
  }
  if (!ndisp) throw Error(path.string(), "has no key ndisp");
  return *ndisp;
}

}  // namespace sgf
