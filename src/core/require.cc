#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/core/require.h>

namespace sgf {

void Require(bool valid, std::string_view option, double value, std::string_view range) {
  if (!valid) throw Error(std::string(option), fmt::format("is {}; it has to be {}", value, range));
}

void RequireRange(std::string_view option, double value, double low, double high) {
  Require(low <= value && value <= high, option, value, fmt::format("in [{}, {}]", low, high));
}

}  // namespace sgf
