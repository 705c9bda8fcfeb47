#include <algorithm>
#include <cmath>
#include <limits>

#include <sgf/io/rows.h>

namespace sgf {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr int kDecimals = 9;

bool AreDigits(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// The power of ten after the 'e' of a number; 0 for a number without.
std::optional<int> Exponent(std::string_view text) {
  if (text.empty()) return 0;
  text.remove_prefix(1);
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  const auto exponent = ParseNumber<int>(text);
  return exponent && *exponent > -30 && *exponent < 30 ? exponent : std::nullopt;
}

// The number 0.<digits> times 10^shift, rounded.
std::optional<std::int64_t> Rounded(std::string digits, int shift) {
  if (shift < 0) return 0;
  digits.resize(static_cast<size_t>(shift) + 1, '0');
  const std::string_view kept = std::string_view(digits).substr(0, digits.size() - 1);
  const auto whole = ParseNumber<std::int64_t>(kept.empty() ? "0" : kept);
  if (!whole || *whole == std::numeric_limits<std::int64_t>::max()) return std::nullopt;
  return *whole + (digits.back() >= '5');
}

}  // namespace

int ForEachRow(const std::filesystem::path& path, char separator, size_t columns,
               const RowReader& read) {
  const std::string text = ReadFile(path);
  std::string_view rest = text;
  int rows = 0;
  for (int number = 1; !rest.empty(); ++number) {
    const std::string_view line = StripBlanks(rest.substr(0, rest.find('\n')));
    rest.remove_prefix(std::min(rest.find('\n'), rest.size() - 1) + 1);
    if (line.empty() || line.front() == '#') continue;
    const std::string where = fmt::format("{}:{}", path.string(), number);
    const Fields fields = SplitFields(line, separator);
    if (fields.size() != columns)
      throw Error(where, fmt::format("has {} columns, expected {}", fields.size(), columns));
    read(fields, where);
    ++rows;
  }
  return rows;
}

Eigen::Vector3d VectorField(const Fields& fields, size_t first, const std::string& where) {
  return {NumberField<double>(fields[first], where), NumberField<double>(fields[first + 1], where),
          NumberField<double>(fields[first + 2], where)};
}

std::optional<std::int64_t> ParseSeconds(std::string_view text) {
  const std::string_view mantissa = text.substr(0, text.find_first_of("eE"));
  const auto exponent = Exponent(text.substr(mantissa.size()));
  const std::string_view whole = mantissa.substr(0, mantissa.find('.'));
  const std::string_view decimals = mantissa.substr(std::min(whole.size() + 1, mantissa.size()));
  if (!exponent || whole.empty() || !AreDigits(whole) || !AreDigits(decimals)) return std::nullopt;
  return Rounded(std::string(whole) + std::string(decimals),
                 static_cast<int>(whole.size()) + *exponent + kDecimals);
}

std::int64_t SecondsField(std::string_view text, const std::string& where) {
  const auto time_ns = ParseSeconds(text);
  if (!time_ns) throw Error(where, fmt::format("{} is no time in seconds", Printable(text)));
  return *time_ns;
}

std::string FormatSeconds(std::int64_t time_ns) {
  return fmt::format("{}.{:09}", time_ns / kSecond_ns, time_ns % kSecond_ns);
}

Eigen::Quaterniond UnitQuaternion(const Eigen::Quaterniond& q, const std::string& where) {
  const double norm = q.norm();
  if (!(std::abs(norm - 1) <= 1e-3))
    throw Error(where, fmt::format("quaternion has norm {}, expected 1", norm));
  return std::abs(norm - 1) < 1e-14 ? q : q.normalized();
}

}  // namespace sgf
