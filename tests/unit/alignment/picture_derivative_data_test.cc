#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>
#include <unit/alignment/derivative_check.h>

#include <sgf/io/image.h>

namespace sgf::alignment {
namespace {

TYPED_TEST(WarpTest, DerivativesAgreeWithDifferencesOnAPhotograph) {
  const std::filesystem::path root = std::getenv("SGF_DATA");
  ExpectAgreementOnPicture<TypeParam>(
      ReadGrey(root / "middlebury2014/MiddEval3/trainingQ/Teddy/im0.png"));
}

}  // namespace
}  // namespace sgf::alignment
