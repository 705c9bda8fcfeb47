#pragma once

#include <string_view>

namespace sgf {

/// What the check of an option says, the same everywhere: "levels: is 0; it has to be positive".
/// @param option its name, as the user gives it. @param range what the value has to be.
/// @throws Error unless `valid`.
void Require(bool valid, std::string_view option, double value, std::string_view range);

/// @throws Error unless low <= value <= high.
void RequireRange(std::string_view option, double value, double low, double high);

}  // namespace sgf
