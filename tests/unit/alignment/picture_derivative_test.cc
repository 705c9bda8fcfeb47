#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <unit/alignment/derivative_check.h>

#include <sgf/io/exr.h>

namespace sgf::alignment {
namespace {

TYPED_TEST(WarpTest, DerivativesAgreeWithDifferencesOnARendering) {
  const std::string path = SGF_SOURCE_DIR "/tests/fixtures/street_shops.exr";
  cv::Mat1f grey;
  cv::cvtColor(GetLayer(ReadExr(path), "", path), grey, cv::COLOR_RGB2GRAY);
  cv::normalize(grey, grey, 0, 255, cv::NORM_MINMAX);
  ExpectAgreementOnPicture<TypeParam>(grey);
}

}  // namespace
}  // namespace sgf::alignment
