#pragma once

#include <string>

#include <sgf/core/error.h>

namespace sgf {

/// what() of the sgf::Error that a call throws, "no error" when it throws none. Any other exception
/// passes and fails the test.
template <class F>
std::string ErrorMessage(F&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace sgf
