#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/io/fields.h>
#include <sgf/io/read_file.h>

/// Rows of numbers in text files: a row a line; empty lines and those after '#' do not count.
namespace sgf {

using Fields = std::vector<std::string_view>;

/// Takes the fields of a row, and "file:line" for messages.
using RowReader = std::function<void(const Fields& fields, const std::string& where)>;

/// Calls `read` for every row.
/// @return the number of rows.
/// @throws Error naming file and line for a row of another number of columns; as ReadFile().
int ForEachRow(const std::filesystem::path& path, char separator, size_t columns,
               const RowReader& read);

/// A field as a finite number. @throws Error with `where` when it is none.
template <class T>
T NumberField(std::string_view text, const std::string& where) {
  const auto number = ParseNumber<T>(text);
  if (!number) throw Error(where, fmt::format("{} is no number of its column", Printable(text)));
  return *number;
}

/// The three fields from `first` on. @throws Error as NumberField().
Eigen::Vector3d VectorField(const Fields& fields, size_t first, const std::string& where);

/// Nanoseconds of a decimal number of seconds that is not negative, such as 1403636583.76356 or
/// 1.5e-01. A double has too few digits for times since 1970; this is exact, and rounded where
/// there are more digits than nanoseconds. None for another text or from 2^63 ns on.
std::optional<std::int64_t> ParseSeconds(std::string_view text);

/// As ParseSeconds(). @throws Error with `where` where that gives none.
std::int64_t SecondsField(std::string_view text, const std::string& where);

/// Seconds with nine decimals, from which ParseSeconds() gives the same time back.
/// @param time_ns not negative.
std::string FormatSeconds(std::int64_t time_ns);

/// A quaternion from a file that holds it to a few digits, normalised. One that is of unit norm to
/// rounding is kept as it is.
/// @throws Error with `where` when the norm differs from 1 by more than 1e-3.
Eigen::Quaterniond UnitQuaternion(const Eigen::Quaterniond& q, const std::string& where);

/// Appends an item with `time_ns`.
/// @throws Error with `where` when that is not after the time of the last item.
template <class T>
void AppendLater(std::vector<T>& items, T item, const std::string& where) {
  if (!items.empty() && item.time_ns <= items.back().time_ns)
    throw Error(where, fmt::format("time {} is not after {}", item.time_ns, items.back().time_ns));
  items.push_back(std::move(item));
}

}  // namespace sgf
