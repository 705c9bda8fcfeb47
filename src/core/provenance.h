#pragma once

#include <string>

namespace sgf {

/// What was built, saved with every run so that a number can be traced to its code.
struct Provenance {
  std::string version;       ///< project version
  std::string git_revision;  ///< `git describe --always --dirty` at configure time, an image's `REVISION`, or "unknown"
  std::string compiler;      ///< compiler and its version
  std::string build_type;    ///< CMake build type
};

/// Facts of this build.
const Provenance& BuildProvenance();

}  // namespace sgf
