#include <sgf/io/manifest.h>

#include "fuzz/fuzz_input.h"

// A folder with the files "a" and "b/c" and the input as its manifest.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const sgf::TempDir dir;
  static const bool made = !dir.Write("a", "1234").empty() && !dir.Write("b/c", "").empty();
  dir.Write(sgf::kManifestName, sgf::InputText(data, size));
  if (made && sgf::Loads([&] { sgf::ReadManifest(dir.path()); })) {
    sgf::IsComplete(dir.path(), "0");
    sgf::Loads([&] { sgf::CheckManifest(dir.path()); });
  }
  return 0;
}
