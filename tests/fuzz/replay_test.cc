#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <sgf/io/read_file.h>

#include "fuzz/fuzz_input.h"

// Feeds the corpus of a fuzzer to its loaders, without libFuzzer and with any compiler: what was
// once found stays mended, and what was valid stays so.

namespace sgf {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> Corpus() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(SGF_FUZZ_CORPUS)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

long PeakMemory_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

TEST(Corpus, IsLoadedOrRefused) {
  const std::vector<fs::path> files = Corpus();
  ASSERT_FALSE(files.empty());
  for (const fs::path& file : files) {
    SCOPED_TRACE(file.filename().string());
    const std::string bytes = ReadFile(file);
    EXPECT_NO_THROW(
        LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
    EXPECT_LT(PeakMemory_MB(), 1024);
  }
}

}  // namespace
}  // namespace sgf
