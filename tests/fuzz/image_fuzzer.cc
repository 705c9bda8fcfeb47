#include <string>

#include <opencv2/imgcodecs.hpp>

#include <sgf/io/disparity.h>
#include <sgf/io/dso_calibration.h>
#include <sgf/io/image.h>
#include <sgf/io/odometry_dataset.h>

#include "fuzz/fuzz_input.h"
#include "support/encoded_images.h"

// PNG, JPEG, PGM and PPM as images, disparities, depth and vignettes. A PNG's checksums are set
// right before, for a changed file would never get past them.
int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string bytes(sgf::InputText(data, size));
  if (bytes.starts_with("\x89PNG")) bytes = sgf::WithRightPngChecksums(std::move(bytes));
  const auto file = sgf::InputFile(bytes);
  sgf::Loads([&] { sgf::ReadDisparity(file, 2); });
  if (!sgf::Loads([&] { sgf::ReadImage(file, cv::IMREAD_UNCHANGED); })) return 0;
  sgf::Loads([&] { sgf::ReadGrey(file); });
  sgf::Loads([&] { sgf::ReadImage(file, cv::IMREAD_ANYCOLOR); });
  sgf::Loads([&] { sgf::ReadDepth(file, 5000); });
  sgf::Loads([&] { sgf::ReadVignette(file); });
  return 0;
}
