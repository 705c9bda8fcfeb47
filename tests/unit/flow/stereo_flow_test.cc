#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/core/options.h>
#include <sgf/core/simd.h>
#include <sgf/flow/stereo_flow.h>

namespace sgf::flow {
namespace {

using testing::HasSubstr;

// Raw cameras: distorted, and not parallel.
const Camera kCamera{.width = 320, .height = 240, .fx = 260, .fy = 262, .cx = 158, .cy = 121};
const StereoRig kRig{kCamera, kCamera, {ExpSO3({0.01, -0.006, 0.008}), {0.15, 0.004, -0.002}}};
const cv::Mat kNoImage;

struct Pair {
  test::CornerWorld::View left;
  cv::Mat1b right;
};

Pair Render(const SE3& T_world_left, double gain = 1) {
  const test::CornerWorld world(kCamera);
  return {world.Render(T_world_left, gain),
          world.Render(T_world_left * kRig.T_left_right, gain).grey};
}

SE3 PoseAt(int k) {
  return {ExpSO3({0.004 * k, -0.006 * k, 0.01 * k}), {0.02 * k, -0.01 * k, 0.03 * k}};
}

// Where the point of a left pixel is for another camera.
Eigen::Vector2d Moved(const Pair& pair, const Eigen::Vector2d& left_px, const SE3& T_other_left) {
  const cv::Mat1f& depth = pair.left.depth_m;
  const int x = int(std::lround(left_px.x())), y = int(std::lround(left_px.y()));
  const Eigen::Vector3d ray = kCamera.Unproject(left_px);
  return kCamera.Project(T_other_left * (double(depth(y, x)) * ray));
}

double Median(std::vector<double> values) {
  if (values.empty()) return INFINITY;
  std::nth_element(values.begin(), values.begin() + long(values.size() / 2), values.end());
  return values[values.size() / 2];
}

double MedianStereoError(const Pair& pair, const FlowFrame& frame) {
  std::vector<double> errors;
  for (const FlowObservation& o : frame.observations)
    if (o.right_px)
      errors.push_back((*o.right_px - Moved(pair, o.left_px, kRig.T_left_right.Inverse())).norm());
  return Median(errors);
}

std::map<std::int64_t, FlowObservation> ById(const FlowFrame& frame) {
  std::map<std::int64_t, FlowObservation> observations;
  for (const FlowObservation& o : frame.observations) observations[o.id] = o;
  return observations;
}

FlowOptions Small(const std::string& residual = "lssd") {
  return {.residual = residual, .cell_px = 30};
}

TEST(StereoFlow, FollowsPointsAndMatchesThem) {
  for (const char* residual : {"lssd", "sgf3", "ngv"}) {
    SCOPED_TRACE(residual);
    StereoFlow flow(kRig, Small(residual));
    Pair before;
    FlowFrame last;
    for (int k = 0; k < 5; ++k) {
      const Pair pair = Render(PoseAt(k));
      const FlowFrame frame = flow.Process(k, pair.left.grey, pair.right);
      EXPECT_GT(frame.observations.size(), 50u);
      EXPECT_GT(frame.stereo, int(frame.observations.size()) * 7 / 10);
      EXPECT_LT(MedianStereoError(pair, frame), 0.1);
      if (k > 0) {
        EXPECT_GT(frame.tracked, 4 * frame.lost);
        std::vector<double> errors;
        for (const auto& [id, o] : ById(frame))
          if (const auto seen = ById(last); seen.contains(id))
            errors.push_back((o.left_px - Moved(before, seen.at(id).left_px,
                                                PoseAt(k).Inverse() * PoseAt(k - 1)))
                                 .norm());
        EXPECT_EQ(int(errors.size()), frame.tracked);
        EXPECT_LT(Median(errors), 0.1);
      }
      before = pair;
      last = frame;
    }
  }
}

TEST(StereoFlow, GivesIdsOnceAndInOrder) {
  StereoFlow flow(kRig, Small());
  std::set<std::int64_t> ever, alive;
  for (int k = 0; k < 8; ++k) {
    const Pair pair = Render(PoseAt(3 * k));
    const FlowFrame frame = flow.Process(k, pair.left.grey, pair.right);
    std::set<std::int64_t> now;
    int fresh = 0, kept = 0;
    std::int64_t last = -1;
    for (const FlowObservation& o : frame.observations) {
      EXPECT_GT(o.id, last);
      last = o.id;
      now.insert(o.id);
      fresh += ever.insert(o.id).second;
      kept += alive.contains(o.id);
    }
    EXPECT_EQ(fresh, frame.detected);
    EXPECT_EQ(kept, frame.tracked);  // who is lost does not come back
    EXPECT_EQ(int(alive.size()), frame.tracked + frame.lost);
    alive = now;
  }
  EXPECT_GT(ever.size(), alive.size());
}

TEST(StereoFlow, KeepsOneTrackACellAtTheBeginning) {
  StereoFlow flow(kRig, Small());
  const Pair pair = Render({});
  std::set<std::pair<int, int>> cells;
  const FlowFrame frame = flow.Process(0, pair.left.grey, pair.right);
  for (const FlowObservation& o : frame.observations)
    EXPECT_TRUE(cells.emplace(int(o.left_px.x() - 10) / 30, int(o.left_px.y() - 10) / 30).second);
  EXPECT_EQ(flow.Process(1, pair.left.grey, pair.right).tracked, int(cells.size()));
}

TEST(StereoFlow, LosesPatchesThatChange) {
  StereoFlow flow(kRig, Small());
  const Pair pair = Render({});
  flow.Process(0, pair.left.grey, pair.right);
  cv::Mat1b changed = pair.left.grey.clone();
  const cv::Rect hidden(100, 80, 90, 80);
  cv::RNG random(7);
  cv::Mat1b noise(hidden.size());
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(noise, changed(hidden), {}, 1.5);
  const FlowFrame frame = flow.Process(1, changed, pair.right);
  EXPECT_GT(frame.lost, 0);
  EXPECT_GT(frame.tracked, 20);
  const int first_new = frame.tracked + frame.lost;  // ids count up
  for (const FlowObservation& o : frame.observations) {
    if (o.id >= first_new) continue;
    EXPECT_FALSE(hidden.contains(cv::Point(int(o.left_px.x()), int(o.left_px.y())))) << o.id;
  }
}

TEST(StereoFlow, DropsRightPointsOffTheEpipolarLine) {
  const Pair pair = Render({});
  const auto stereo = [&](double shift_y, double error) {
    FlowOptions options = Small();
    options.max_epipolar_error = error;
    const cv::Mat shift = (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, shift_y);
    cv::Mat right;
    cv::warpAffine(pair.right, right, shift, pair.right.size(), cv::INTER_LINEAR,
                   cv::BORDER_REFLECT_101);
    return StereoFlow(kRig, options).Process(0, pair.left.grey, right).stereo;
  };
  EXPECT_GT(stereo(0, 0.005), 40);
  EXPECT_GT(stereo(3, 2), 40);
  EXPECT_LT(stereo(3, 0.005), 5);
}

TEST(StereoFlow, DropsRightPointsBehindTheCameras) {
  const Pair pair = Render({});
  StereoRig swapped = kRig;
  swapped.T_left_right.p *= -1;
  FlowOptions options = Small();
  options.max_backward_px = 0.2;
  EXPECT_LT(StereoFlow(swapped, options).Process(0, pair.left.grey, pair.right).stereo, 5);
}

TEST(StereoFlow, UsesARotationToFollowAJump) {
  const SE3 turned{ExpSO3({0.12, -0.2, 0.15}), {0, 0, 0}};
  const Pair first = Render({}), second = Render(turned);
  const auto tracked = [&](const std::optional<Eigen::Quaterniond>& R_cur_last) {
    StereoFlow flow(kRig, Small());
    flow.Process(0, first.left.grey, first.right);
    const FlowFrame frame = flow.Process(1, second.left.grey, second.right, R_cur_last);
    int right = 0;
    StereoFlow again(kRig, Small());
    const auto begin = ById(again.Process(0, first.left.grey, first.right));
    for (const FlowObservation& o : frame.observations)
      if (begin.contains(o.id) &&
          (o.left_px - Moved(first, begin.at(o.id).left_px, turned.Inverse())).norm() < 0.3)
        ++right;
    return right;
  };
  EXPECT_GT(tracked(turned.R.conjugate()), 25);
  EXPECT_LT(tracked(std::nullopt), 8);
}

TEST(StereoFlow, HasTheSameBitsForAnyThreadsAndInstructionSet) {
  const auto run = [](const std::string& residual, int threads) {
    FlowOptions options = Small(residual);
    options.threads = threads;
    StereoFlow flow(kRig, options);
    std::vector<double> numbers;
    for (int k = 0; k < 3; ++k) {
      const Pair pair = Render(PoseAt(k));
      for (const FlowObservation& o : flow.Process(k, pair.left.grey, pair.right).observations) {
        numbers.insert(numbers.end(), {double(o.id), o.left_px.x(), o.left_px.y()});
        if (o.right_px) numbers.insert(numbers.end(), {o.right_px->x(), o.right_px->y()});
      }
    }
    return numbers;
  };
  for (const char* residual : {"lssd", "sgf3", "ngv"}) {
    const std::vector<double> expected = run(residual, 1);
    EXPECT_EQ(run(residual, 2), expected) << residual;
    for (const std::string& isa : SimdTargets()) {
      RestrictSimd(isa);
      EXPECT_EQ(run(residual, 1), expected) << residual << " " << isa;
    }
    RestrictSimd("");
  }
}

TEST(StereoFlow, GoesOnWithoutTheRightImage) {
  StereoFlow flow(kRig, Small());
  const Pair pair = Render({});
  const FlowFrame both = flow.Process(0, pair.left.grey, pair.right);
  EXPECT_GT(both.stereo, 40);
  const FlowFrame left = flow.Process(1, pair.left.grey, kNoImage);
  EXPECT_EQ(left.stereo, 0);
  EXPECT_EQ(left.tracked, int(both.observations.size()));
  for (const FlowObservation& o : left.observations) EXPECT_FALSE(o.right_px);
  EXPECT_GT(flow.Process(2, pair.left.grey, pair.right).stereo, 40);
}

TEST(StereoFlow, FindsNothingInBlankImages) {
  const Pair pair = Render({});
  for (const int grey : {0, 128, 255}) {
    for (const char* residual : {"lssd", "photo", "ngv", "sgf", "sgf3"}) {
      SCOPED_TRACE(residual);
      const cv::Mat1b blank(kCamera.height, kCamera.width, uint8_t(grey));
      StereoFlow flow(kRig, Small(residual));
      EXPECT_TRUE(flow.Process(0, blank, blank).observations.empty());
      EXPECT_GT(flow.Process(1, pair.left.grey, pair.right).detected, 50);
      EXPECT_TRUE(flow.Process(2, blank, blank).observations.empty());
      EXPECT_GT(flow.Process(3, pair.left.grey, pair.right).detected, 50);
    }
  }
}

TEST(StereoFlow, FollowsThroughAChangeOfGain) {
  const Pair bright = Render({}), dark = Render(PoseAt(1), 0.6);
  const auto share = [&](const char* residual) {
    StereoFlow flow(kRig, Small(residual));
    flow.Process(0, bright.left.grey, bright.right);
    const FlowFrame frame = flow.Process(1, dark.left.grey, dark.right);
    return double(frame.tracked) / (frame.tracked + frame.lost);
  };
  for (const char* residual : {"lssd", "ngv", "sgf3"}) EXPECT_GT(share(residual), 0.7) << residual;
  EXPECT_LT(share("photo"), 0.4);
}

TEST(StereoFlow, RefusesImagesItCannotWorkOn) {
  StereoFlow flow(kRig, Small());
  const Pair pair = Render({});
  const auto& left = pair.left.grey;
  const int begun = flow.Process(5, left, pair.right).detected;
  const cv::Mat wide(kCamera.height, kCamera.width + 1, CV_8UC1, cv::Scalar(9));
  const auto message = [&](std::int64_t time, const cv::Mat& l, const cv::Mat& r) {
    return ErrorMessage([&] { flow.Process(time, l, r); });
  };
  cv::Mat colour, deep;
  cv::cvtColor(left, colour, cv::COLOR_GRAY2BGR);
  left.convertTo(deep, CV_32F);
  EXPECT_THAT(message(6, wide, pair.right), HasSubstr("left image: has 321x240 px"));
  EXPECT_THAT(message(6, left, wide), HasSubstr("right image: has 321x240 px"));
  EXPECT_THAT(message(6, colour, pair.right), HasSubstr("8-bit grey"));
  EXPECT_THAT(message(6, left, deep), HasSubstr("8-bit grey"));
  EXPECT_THAT(message(6, kNoImage, pair.right), HasSubstr("left image"));
  EXPECT_THAT(message(5, left, pair.right), HasSubstr("5 does not come after 5"));
  EXPECT_THAT(message(-7, left, pair.right), HasSubstr("-7 does not come after 5"));
  EXPECT_EQ(flow.Process(6, left, pair.right).tracked, begun);  // as if nothing had been said
}

TEST(StereoFlow, RefusesOptionsAndRigsOutOfRange) {
  const auto message = [](auto change) {
    FlowOptions options;
    change(options);
    return ErrorMessage([&] { StereoFlow(kRig, options); });
  };
  EXPECT_EQ(message([](auto&) {}), "no error");
  EXPECT_THAT(message([](auto& o) { o.residual = "ngf"; }), HasSubstr("'ngf'"));
  EXPECT_THAT(message([](auto& o) { o.residual = "what"; }), HasSubstr("what"));
  EXPECT_THAT(message([](auto& o) { o.levels = 0; }), HasSubstr("flow.levels"));
  EXPECT_THAT(message([](auto& o) { o.levels = 7; }), HasSubstr("too many"));
  EXPECT_THAT(message([](auto& o) { o.stereo_levels = 5; }), HasSubstr("flow.stereo_levels"));
  EXPECT_THAT(message([](auto& o) { o.cell_px = 2; }), HasSubstr("flow.cell_px"));
  EXPECT_THAT(message([](auto& o) { o.least_fast_threshold = 50; }),
              HasSubstr("flow.fast_threshold"));
  EXPECT_THAT(message([](auto& o) { o.max_backward_px = NAN; }), HasSubstr("max_backward_px"));
  EXPECT_THAT(message([](auto& o) { o.threads = -1; }), HasSubstr("threads"));
  StereoRig rig = kRig;
  rig.T_left_right.p.setZero();
  EXPECT_THAT(ErrorMessage([&] { StereoFlow(rig, {}); }), HasSubstr("two places"));
  rig = kRig;
  rig.right.fx = 0;
  EXPECT_THAT(ErrorMessage([&] { StereoFlow(rig, {}); }), HasSubstr("focal"));
}

TEST(StereoFlow, DocumentsItsOptions) {
  for (const OptionDoc& doc : DescribeOptions(FlowOptions())) EXPECT_FALSE(doc.text.empty());
}

TEST(StereoFlow, CanBeMoved) {
  const Pair pair = Render({});
  StereoFlow flow(kRig, Small());
  const int begun = flow.Process(0, pair.left.grey, pair.right).detected;
  StereoFlow other = std::move(flow);
  EXPECT_EQ(other.Process(1, pair.left.grey, pair.right).tracked, begun);
}

}  // namespace
}  // namespace sgf::flow
