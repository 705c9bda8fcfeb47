#include <ceres/ceres.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/corner_world.h>
#include <support/error_message.h>

#include <sgf/alignment/direct_alignment.h>
#include <sgf/alignment/point_selection.h>
#include <sgf/alignment/residual_table.h>

namespace sgf::alignment {
namespace {

const Camera kCamera{.width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 160, .cy = 120};
const SE3 kTrue{ExpSO3({0.02, -0.03, 0.015}), {0.06, -0.04, 0.08}};  // T_cur_ref

std::vector<ReferencePoint> PointsOf(const Pyramid& pyramid, const cv::Mat1f& depth_m) {
  const cv::Mat1b all(depth_m.size(), 255);
  std::vector<ReferencePoint> points;
  for (const cv::Point& p : SelectPoints(pyramid.samples[0], all, {.cell_px = 8}))
    points.push_back({Eigen::Vector2f(float(p.x), float(p.y)), 1 / depth_m(p)});
  return points;
}

struct Scene {
  test::CornerWorld world{kCamera};
  test::CornerWorld::View reference = world.Render({});
};

AlignmentResult AlignScene(const AlignmentOptions& options, const cv::Mat& current,
                           const SE3& guess = {}) {
  static const Scene scene;
  const DirectAligner aligner(kCamera, options);
  const Pyramid pyramid = aligner.MakePyramid(scene.reference.grey);
  const auto reference = aligner.MakeReference(pyramid, PointsOf(pyramid, scene.reference.depth_m));
  return aligner.Align(*reference, aligner.MakePyramid(current), guess);
}

double PositionError(const SE3& a, const SE3& b) { return (a.p - b.p).norm(); }
double AngleError(const SE3& a, const SE3& b) { return LogSO3(a.R.conjugate() * b.R).norm(); }

cv::Mat1b Current(double gain = 1, double offset = 0) {
  return test::CornerWorld(kCamera).Render(kTrue.Inverse(), gain, offset).grey;
}

class EveryResidual : public testing::TestWithParam<ResidualInfo> {};

TEST_P(EveryResidual, FindsTheMotion) {
  const AlignmentResult result = AlignScene({.residual = std::string(GetParam().name)}, Current());
  EXPECT_TRUE(result.ok());
  // The costs of ngf and ugf are lowest where edges are strongest, not where images agree.
  const bool agrees = GetParam().name != "ngf" && GetParam().name != "ugf";
  EXPECT_LT(PositionError(result.T_cur_ref, kTrue), agrees ? 0.004 : 1.5 * kTrue.p.norm());
  EXPECT_LT(AngleError(result.T_cur_ref, kTrue), agrees ? 0.001 : 0.04);
  if (!agrees) return;
  EXPECT_GT(result.overlap, 0.7);
  EXPECT_GT(result.inlier_share, 0.8);
}

TEST_P(EveryResidual, FindsTheMotionFromTheReferenceToo) {
  AlignmentOptions options{.residual = std::string(GetParam().name),
                           .linearization = Linearization::kInverse};
  if (!GetParam().inverse_compositional) {
    EXPECT_THAT(ErrorMessage([&] { DirectAligner(kCamera, options); }),
                testing::HasSubstr("cannot be linearised at the reference"));
    return;
  }
  const AlignmentResult result = AlignScene(options, Current());
  EXPECT_TRUE(result.ok());
  EXPECT_LT(PositionError(result.T_cur_ref, kTrue), 0.004);
  EXPECT_LT(AngleError(result.T_cur_ref, kTrue), 0.001);
}

TEST_P(EveryResidual, GivesTheSameBitsForAnyNumberOfThreads) {
  AlignmentOptions options{.residual = std::string(GetParam().name)};
  const AlignmentResult one = AlignScene(options, Current());
  options.threads = 3;
  const AlignmentResult three = AlignScene(options, Current());
  EXPECT_EQ(one.T_cur_ref.Matrix(), three.T_cur_ref.Matrix());
  EXPECT_EQ(one.covariance, three.covariance);
}

INSTANTIATE_TEST_SUITE_P(Residuals, EveryResidual,
                         testing::ValuesIn(AllResiduals().begin(), AllResiduals().end()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(DirectAlignment, SurvivesAChangeOfGainAndOffsetWhereTheResidualDoes) {
  const cv::Mat1b changed = Current(0.4, 25);
  for (const char* name : {"sgf", "ngv", "sgv", "photo_affine", "bit_planes"}) {
    SCOPED_TRACE(name);
    EXPECT_LT(PositionError(AlignScene({.residual = name}, changed).T_cur_ref, kTrue), 0.006);
  }
  EXPECT_GT(PositionError(AlignScene({.residual = "photo"}, changed).T_cur_ref, kTrue), 0.012);
}

TEST(DirectAlignment, FindsTheBrightnessThatWasPutOn) {
  const AlignmentResult result = AlignScene({.residual = "photo_affine"}, Current(0.8, 10));
  // I_ref = (I_cur - 10) / 0.8
  EXPECT_NEAR(std::exp(result.alpha), 1 / 0.8, 0.02);
  EXPECT_NEAR(result.beta, -10 / 0.8, 1.5);
}

TEST(DirectAlignment, SaysWhenAnImageHasNothingToDoWithTheReference) {
  cv::Mat1b noise(kCamera.height, kCamera.width);
  cv::theRNG().state = 7;
  cv::randu(noise, 0, 255);
  for (const char* name : {"sgf", "ngv", "photo"}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(AlignScene({.residual = name}, noise).failure, AlignmentFailure::kFewInliers);
  }
}

TEST(DirectAlignment, SaysWhenTheViewsDoNotOverlap) {
  const SE3 away{ExpSO3({0, 2.0, 0}), {0, 0, 0}};
  const AlignmentResult result = AlignScene({}, Current(), away);
  EXPECT_EQ(result.failure, AlignmentFailure::kFewPoints);
}

TEST(DirectAlignment, CovarianceIsThatOfTheScatterUnderNoise) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  constexpr int kRuns = 20;
  std::vector<Vector6> errors;
  Eigen::Matrix<double, 6, 6> stated = Eigen::Matrix<double, 6, 6>::Zero();
  for (int run = 0; run < kRuns; ++run) {
    cv::Mat1b noisy = Current();
    cv::RNG generator(100 + run);
    cv::Mat1s noise(noisy.size());
    generator.fill(noise, cv::RNG::NORMAL, 0, 2);
    cv::add(noisy, noise, noisy, cv::noArray(), CV_8U);
    const AlignmentResult result =
        AlignScene({.residual = "ngv", .solver = {.max_iterations = 60, .tolerance = 1e-9}}, noisy);
    const SE3 difference = result.T_cur_ref * kTrue.Inverse();
    errors.emplace_back();
    errors.back() << difference.p, LogSO3(difference.R);
    stated += result.covariance / kRuns;
  }
  Vector6 mean = Vector6::Zero();
  for (const Vector6& error : errors) mean += error / kRuns;
  double squared = 0;  // in units of the stated covariance: 6 (n - 1) / n is expected
  for (const Vector6& error : errors)
    squared += (error - mean).dot(stated.ldlt().solve(error - mean)) / kRuns;
  EXPECT_GT(squared, 3);
  EXPECT_LT(squared, 15);
}

TEST(DirectAlignment, RefusesWhatItCannotWorkWith) {
  Camera distorted = kCamera;
  distorted.k1 = 0.1;
  EXPECT_THAT(ErrorMessage([&] { DirectAligner(distorted, {}); }),
              testing::HasSubstr("distortion"));
  EXPECT_THAT(ErrorMessage([&] { DirectAligner(kCamera, {.residual = "zncc"}); }),
              testing::HasSubstr("'zncc' is unknown; known: photo"));
  const DirectAligner aligner(kCamera, {});
  EXPECT_THAT(ErrorMessage([&] { aligner.MakePyramid(cv::Mat1b(10, 10)); }),
              testing::HasSubstr("is 10x10 px; the camera has 320x240"));
}

/// The residuals of a reference image's points as Ceres sees them, at the finest level.
class CeresAlignment : public ceres::SizedCostFunction<2, 6> {
 public:
  CeresAlignment(const SampleChannels& image, const PixelAtDepth<double>& input,
                 const metrics::Sample<double>& reference, const SE3& T_start)
      : image_(image), input_(input), reference_(reference), T_start_(T_start) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    // Parameters are one perturbation of the start; differences give the derivative, so that
    // nothing of the derivatives under test is used.
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> xi(parameters[0]);
    Eigen::Map<Eigen::Vector2d> r(residuals);
    r = At(xi);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> J(jacobians[0]);
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 6; ++k) {
      const Eigen::Matrix<double, 6, 1> step = kStep * Eigen::Matrix<double, 6, 1>::Unit(k);
      J.col(k) = (At(xi + step) - At(xi - step)) / (2 * kStep);
    }
    return true;
  }

 private:
  Eigen::Vector2d At(const Eigen::Matrix<double, 6, 1>& xi) const {
    const Se3Warp<double> warp(kCamera, SE3{ExpSO3(xi.tail<3>()), xi.head<3>()} * T_start_);
    Se3Warp<double>::Point point;
    if (!warp.At(input_, point) || !image_.Inside(point.pixel)) return {0, 0};
    return PointResidual<metrics::Ngv>{}.Value<double>(image_.Sample(point.pixel).value, point.A(),
                                                       reference_);
  }

  const SampleChannels& image_;
  PixelAtDepth<double> input_;
  metrics::Sample<double> reference_;
  SE3 T_start_;
};

TEST(DirectAlignment, AgreesWithCeres) {
  const Scene scene;
  const AlignmentOptions options{.residual = "ngv",
                                 .pattern = Pattern::kPoint,
                                 .levels = 1,
                                 .loss = RobustKind::kNone,
                                 .solver = {.max_iterations = 60, .tolerance = 1e-10}};
  const DirectAligner aligner(kCamera, options);
  const Pyramid before = aligner.MakePyramid(scene.reference.grey);
  const Pyramid after = aligner.MakePyramid(Current());
  const auto points = PointsOf(before, scene.reference.depth_m);
  const SE3 start{ExpSO3({0.019, -0.029, 0.014}), {0.062, -0.038, 0.078}};
  const AlignmentResult ours = aligner.Align(*aligner.MakeReference(before, points), after, start);

  ceres::Problem problem;
  Eigen::Matrix<double, 6, 1> xi = Eigen::Matrix<double, 6, 1>::Zero();
  for (const ReferencePoint& p : points) {
    const Vector2<double> pixel = p.pixel.cast<double>();
    const PixelAtDepth<double> input{
        {(pixel.x() - kCamera.cx) / kCamera.fx, (pixel.y() - kCamera.cy) / kCamera.fy},
        p.inverse_depth,
        {0, 0}};
    const auto reference =
        PointResidual<metrics::Ngv>::MakeReference<double>(before.samples[0].Sample(pixel));
    problem.AddResidualBlock(new CeresAlignment(after.samples[0], input, reference, start), nullptr,
                             xi.data());
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.function_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  const SE3 theirs = SE3{ExpSO3(xi.tail<3>()), xi.head<3>()} * start;
  // Interpolation leaves kinks around the minimum, so the lowest points found may differ a little.
  EXPECT_LT(PositionError(ours.T_cur_ref, theirs), 1e-3);
  EXPECT_LT(AngleError(ours.T_cur_ref, theirs), 3e-4);
  const SE3 difference = ours.T_cur_ref * start.Inverse();
  xi << difference.p, LogSO3(difference.R);
  double our_cost = 0;
  problem.Evaluate({}, &our_cost, nullptr, nullptr, nullptr);
  EXPECT_LT(our_cost, 1.005 * summary.final_cost);
  EXPECT_LT(our_cost, 0.9 * summary.initial_cost);
}

}  // namespace
}  // namespace sgf::alignment
