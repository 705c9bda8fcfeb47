#include <exception>
#include <new>
#include <string>

#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/sgf/CSgfOdometry.h>

#include "fuzz/fuzz_input.h"

namespace {

using mrpt::config::CConfigFileMemory;
using mrpt::sgf::CSgfOdometry;

// MRPT refuses with any std::exception.
template <class F>
void LoadsInMrpt(F&& load) {
  sgf::Loads([&] {
    try {
      load();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      throw sgf::Error("", error.what());
    }
  });
}

}  // namespace

// The odometry's section of an MRPT configuration, read and written again.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  LoadsInMrpt([&] {
    const CConfigFileMemory file{std::string(sgf::InputText(data, size))};
    CSgfOdometry::TParams params;
    params.loadFromConfigFile(file, "SgfOdometry");
    CConfigFileMemory written;
    params.saveToConfigFile(written, "SgfOdometry");
    params.loadFromConfigFile(written, "SgfOdometry");
  });
  return 0;
}
