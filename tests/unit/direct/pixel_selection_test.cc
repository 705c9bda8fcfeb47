#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/direct/pixel_selection.h>

namespace sgf::direct {
namespace {

using test::kCamera;

alignment::SampleChannels Channels(const cv::Mat& image) {
  return alignment::MakeSampleChannels(image, {});
}

TEST(PixelSelector, FindsAboutAsManyAsWanted) {
  const auto image = Channels(test::CornerWorld(kCamera).Render({}).grey);
  for (const int wanted : {200, 500, 1000}) {
    PixelSelector select({.points = wanted});
    const auto points = select(image);
    EXPECT_GT(points.size(), 0.7 * wanted);
    EXPECT_LT(points.size(), 1.4 * wanted);
  }
}

TEST(PixelSelector, SpreadsThemAndKeepsOffTheBorder) {
  PixelSelector select({.points = 400});
  std::array<int, 4> quarters{};
  for (const cv::Point& p : select(Channels(test::CornerWorld(kCamera).Render({}).grey))) {
    EXPECT_TRUE(p.x >= 5 && p.y >= 5 && p.x < 315 && p.y < 235);
    ++quarters[(p.y >= 120) * 2 + (p.x >= 160)];
  }
  for (const int count : quarters) EXPECT_GT(count, 60);
}

TEST(PixelSelector, TakesNoneWhereThereIsNoGradient) {
  cv::Mat1b image = test::CornerWorld(kCamera).Render({}).grey;
  image(cv::Rect(0, 0, 160, 240)) = uint8_t{90};
  PixelSelector select({.points = 400});
  for (const cv::Point& p : select(Channels(image))) EXPECT_GE(p.x, 159);
  EXPECT_TRUE(PixelSelector({})(Channels(cv::Mat1b(240, 320, uint8_t{90}))).empty());
}

TEST(PixelSelector, RefusesOptionsOutOfRange) {
  EXPECT_THAT(ErrorMessage([] { PixelSelector({.points = 3}); }), testing::HasSubstr("points"));
  EXPECT_THAT(ErrorMessage([] { PixelSelector({.border_px = 0}); }),
              testing::HasSubstr("border_px"));
}

}  // namespace
}  // namespace sgf::direct
