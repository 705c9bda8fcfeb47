#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace sgf {

/// Bad input or configuration: a file, an option, an image of the wrong shape. Tools print what()
/// and end with exit code 2. Failures that belong to one frame are part of a result, not an Error;
/// programmer errors are checks.
class Error : public std::runtime_error {
 public:
  /// @param where the file, option or argument at fault; what() reads "where: what".
  /// @param what what is wrong, with the offending value.
  Error(std::string where, const std::string& what)
      : std::runtime_error(where.empty() ? what : where + ": " + what), where_(std::move(where)) {}

  const std::string& where() const { return where_; }

 private:
  std::string where_;
};

}  // namespace sgf
