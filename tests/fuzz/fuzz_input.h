#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include <signal.h>
#include <stdlib.h>
#include <sys/time.h>

#include <sgf/core/error.h>

#include "support/temp_dir.h"

/// What libFuzzer calls with every input, and a test with every file of the corpus
/// (replay_test.cc). A fuzzer is one file that defines it: it hands the bytes to the loaders of a
/// kind of file. Whatever they are, a loader gives a result or an sgf::Error. Another exception, a
/// report of a sanitizer, gigabytes and ten seconds of the processor are findings.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace sgf {

inline std::string_view InputText(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// While it lives, this much processor time of the process ends it: that of a hang, and not of a
/// busy machine, which lets libFuzzer's own timeout, by the clock, go off anywhere.
class ProcessorTimeLimit {
 public:
  explicit ProcessorTimeLimit(int seconds) {
    signal(SIGPROF, [](int) { abort(); });
    Set(seconds);
  }
  ~ProcessorTimeLimit() { Set(0); }
  ProcessorTimeLimit(const ProcessorTimeLimit&) = delete;
  ProcessorTimeLimit& operator=(const ProcessorTimeLimit&) = delete;

 private:
  static void Set(int seconds) {
    const itimerval once{{0, 0}, {seconds, 0}};
    setitimer(ITIMER_PROF, &once, nullptr);
  }
};

/// Calls a loader, which may refuse what it is given. @return whether it did not.
template <class F>
bool Loads(F&& load) {
  const ProcessorTimeLimit limit(10);
  try {
    load();
  } catch (const Error&) {
    return false;
  }
  return true;
}

/// A file with these bytes, in a folder that all inputs of a process share.
/// @param name of the file, for loaders that look at its extension.
inline std::filesystem::path InputFile(std::string_view bytes, const char* name = "input") {
  static const TempDir dir;
  return dir.Write(name, bytes);
}

/// A folder whose files are the parts of an input: a part is a line "=== <path in the folder>" and
/// the bytes up to the line end before the next such line. Parts that cannot be files there are
/// left out.
class InputFolder {
 public:
  explicit InputFolder(std::string_view input) {
    for (size_t begin = Find(input, 0); begin < input.size();) {
      const size_t end = Find(input, begin + 1);
      Add(input.substr(begin + kMark.size(), end - begin - kMark.size()));
      begin = end;
    }
  }

  std::filesystem::path operator/(const char* path) const { return dir_.path() / path; }

 private:
  static constexpr std::string_view kMark = "=== ";

  /// Where the next part begins, at or after a place; the input's size if there is none.
  static size_t Find(std::string_view input, size_t from) {
    for (size_t at = input.find(kMark, from); at < input.size(); at = input.find(kMark, at + 1))
      if (at == 0 || input[at - 1] == '\n') return at;
    return input.size();
  }

  void Add(std::string_view part) const {
    const std::filesystem::path path(part.substr(0, part.find('\n')));
    const bool outside = path.is_absolute() || path.lexically_normal().string().starts_with("..");
    const bool odd = path.native().find('\0') != std::string::npos || !path.has_filename();
    if (outside || odd || path.native().size() > kLongestPath) return;
    part.remove_prefix(std::min(path.native().size() + 1, part.size()));
    if (part.ends_with('\n')) part.remove_suffix(1);
    try {
      dir_.Write(path, part);
    } catch (const std::filesystem::filesystem_error&) {  // a file where a folder is needed
    }
  }

  static constexpr size_t kLongestPath = 100;
  TempDir dir_;
};

}  // namespace sgf
