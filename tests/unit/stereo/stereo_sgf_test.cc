#include <future>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <support/stereo_images.h>

#include <sgf/core/error.h>
#include <sgf/stereo/stereo_sgf.h>

namespace sgf {
namespace {

TEST(StereoSgf, SwapsInForStereoBmThroughTheSameInterface) {
  const auto [left, right] = ShiftedPair({160, 60}, 11, 1);
  for (const cv::Ptr<cv::StereoMatcher>& matcher :
       {cv::Ptr<cv::StereoMatcher>(cv::StereoBM::create(32, 9)),
        cv::Ptr<cv::StereoMatcher>(StereoSgf::create(32, 9))}) {
    cv::Mat disparity;
    matcher->compute(left, right, disparity);
    ASSERT_EQ(disparity.type(), CV_16SC1);
    ASSERT_EQ(disparity.size(), left.size());
    EXPECT_NEAR(disparity.at<short>(30, 80), 16 * 11, 2);
  }
}

TEST(StereoSgf, KeepsItsParameters) {
  const auto matcher = StereoSgf::create(48, 11);
  EXPECT_EQ(matcher->getNumDisparities(), 48);
  EXPECT_EQ(matcher->getBlockSize(), 11);
  matcher->setMinDisparity(-3);
  matcher->setNumDisparities(20);
  matcher->setBlockSize(7);
  matcher->setSpeckleWindowSize(50);
  matcher->setSpeckleRange(2);
  matcher->setDisp12MaxDiff(3);
  matcher->setUniquenessRatio(12);
  matcher->setTextureThreshold(1.5);
  matcher->setThreads(2);
  EXPECT_EQ(matcher->getMinDisparity(), -3);
  EXPECT_EQ(matcher->getNumDisparities(), 20);
  EXPECT_EQ(matcher->getBlockSize(), 7);
  EXPECT_EQ(matcher->getSpeckleWindowSize(), 50);
  EXPECT_EQ(matcher->getSpeckleRange(), 2);
  EXPECT_EQ(matcher->getDisp12MaxDiff(), 3);
  EXPECT_EQ(matcher->getUniquenessRatio(), 12);
  EXPECT_EQ(matcher->getTextureThreshold(), 1.5);
  EXPECT_EQ(matcher->getThreads(), 2);
}

TEST(StereoSgf, MarksPixelsWithoutAMatchAsOpenCvDoes) {
  const cv::Mat1b left = TexturedImage({80, 40}, 1), right = TexturedImage({80, 40}, 2);
  const auto matcher = StereoSgf::create(16, 9);
  matcher->setMinDisparity(4);
  matcher->setUniquenessRatio(60);
  cv::Mat1s disparity;
  matcher->compute(left, right, disparity);
  EXPECT_GT(cv::countNonZero(disparity == 16 * 3), 2000);
  EXPECT_EQ(cv::countNonZero(disparity < 16 * 4 - 8), cv::countNonZero(disparity == 16 * 3));
}

TEST(StereoSgf, WritesIntoTheCallersMemory) {
  const auto [left, right] = ShiftedPair({80, 40}, 5, 1);
  cv::Mat1s disparity(left.size());
  const void* memory = disparity.data;
  StereoSgf::create(16, 9)->compute(left, right, disparity);
  EXPECT_EQ(disparity.data, memory);
}

TEST(StereoSgf, OneMatcherServesSeveralThreads) {
  const auto pair = ShiftedPair({96, 48}, 5, 1);
  for (const cv::Ptr<cv::StereoMatcher>& matcher :
       {cv::Ptr<cv::StereoMatcher>(StereoSgf::create(16, 9)),
        cv::Ptr<cv::StereoMatcher>(StereoSgfSemiGlobal::create(0, 16, 5)),
        cv::Ptr<cv::StereoMatcher>(StereoSgfMesh::create(16, 9))}) {
    const auto compute = [&] {
      cv::Mat1s disparity;
      matcher->compute(pair.first, pair.second, disparity);
      return disparity;
    };
    std::vector<std::future<cv::Mat1s>> others;
    for (int i = 0; i < 4; ++i) others.push_back(std::async(std::launch::async, compute));
    const cv::Mat1s expected = compute();
    for (auto& other : others) EXPECT_EQ(cv::countNonZero(other.get() != expected), 0);
  }
}

TEST(StereoSgf, ThrowsForBadParametersAndImages) {
  EXPECT_THROW(StereoSgf::create(-16, 9), Error);
  EXPECT_THROW(StereoSgf::create(16, 4), Error);
  cv::Mat disparity;
  EXPECT_THROW(StereoSgf::create(16, 9)->compute(cv::Mat(), cv::Mat(), disparity), Error);
}

}  // namespace
}  // namespace sgf
