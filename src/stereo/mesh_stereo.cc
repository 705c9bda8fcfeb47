#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include <sgf/core/error.h>
#include <sgf/core/random.h>
#include <sgf/core/require.h>
#include <sgf/stereo/cost_rows.h>
#include <sgf/stereo/mesh_refine.h>
#include <sgf/stereo/mesh_stereo.h>
#include <sgf/stereo/plane_field.h>
#include <sgf/stereo/prefilter.h>
#include <sgf/stereo/refine.h>
#include <sgf/stereo/semi_global.h>

namespace sgf::stereo {
namespace {

constexpr int kLargestWindow = 45;  // at which 32 bits hold a window's sum of costs

cv::Mat Grey(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

void RequireColourOrGrey(const cv::Mat& image, const char* name) {
  if (image.empty()) throw Error(name, "is empty");
  if (image.type() != CV_8UC1 && image.type() != CV_8UC3)
    throw Error(name, fmt::format("has to be 8-bit with one or three channels, got {}",
                                  cv::typeToString(image.type())));
}

// What one image brings into the inference.
struct Side {
  TriangleMesh mesh;
  internal::SupportWindows windows;
  internal::PlaneField field;

  Side(const cv::Mat& image, const internal::VolumeView& view, const MeshStereoOptions& options,
       uint64_t seed)
      : mesh(BuildMesh(image, options.mesh)),
        windows(image, Centres(mesh), options.window, options.gamma, options.threads),
        field(view, mesh, windows, image, options, seed) {}

  cv::Mat1f Render(const MeshStereoOptions& o) const {
    return internal::Render(mesh, field.planes(), o.min_disparity, o.num_disparities);
  }

 private:
  static std::vector<cv::Point> Centres(const TriangleMesh& mesh) {
    std::vector<cv::Point> centres(mesh.size());
    for (int i = 0; i < mesh.size(); ++i) {
      const cv::Point2f p = mesh.Barycentre(i);
      centres[i] = {std::min(static_cast<int>(p.x), mesh.owner.cols - 1),
                    std::min(static_cast<int>(p.y), mesh.owner.rows - 1)};
    }
    return centres;
  }
};

// Dense disparities by semi-global matching, from which the planes start.
class Start {
 public:
  Start(const cv::Mat& left, const cv::Mat& right, const CostOptions& options)
      : left_(left), right_(right), matcher_(OptionsOf(options, left.size())) {}

  cv::Mat1f Left() const { return Dense(left_, right_); }

  // Mirrored, the right image is the left one of a pair.
  cv::Mat1f Right() const {
    cv::Mat left, right, disparity;
    cv::flip(right_, left, 1);
    cv::flip(left_, right, 1);
    cv::flip(Dense(left, right), disparity, 1);
    return disparity;
  }

 private:
  static SemiGlobalOptions OptionsOf(const CostOptions& cost, cv::Size size) {
    SemiGlobalOptions options;
    static_cast<CostOptions&>(options) = cost;
    options.uniqueness_pct = 0;
    const int side = std::min(size.width, size.height);
    options.window = std::min(options.window, side - 1 + side % 2);  // the largest odd one
    return options;
  }

  cv::Mat1f Dense(const cv::Mat& left, const cv::Mat& right) const {
    cv::Mat1s matches;
    matcher_.Compute(left, right, matches);
    cv::Mat1f disparity = matcher_.ToFloat(matches);
    FillHoles(disparity);
    cv::patchNaNs(disparity, matcher_.options().min_disparity);  // of a map without any match
    return disparity;
  }

  cv::Mat left_, right_;
  SemiGlobal matcher_;
};

void Infer(Side& left, Side& right, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    left.field.Sweep(right.field, 1, round);
    right.field.Sweep(left.field, -1, round);
    for (Side* side : {&left, &right}) {
      side->field.DissolveIslands();
      side->field.Align();
    }
  }
}

}  // namespace

void CheckOptions(const MeshStereoOptions& o) {
  CheckCostOptions(o);
  RequireRange("window", o.window, 3, kLargestWindow);
  RequireOdd("window", o.window);
  RequireRange("gamma", o.gamma, 1e-3, 1e6);
  RequireRange("cost_window", o.cost_window, 1, kLargestWindow);
  RequireOdd("cost_window", o.cost_window);
  RequireRange("outside_share", o.outside_share, 0, 255);
  RequireRange("mesh.region_px", o.mesh.region_px, 4, 1000);
  RequireRange("mesh.compactness", o.mesh.compactness, 1e-3, 1e6);
  RequireRange("mesh.tolerance_px", o.mesh.tolerance_px, 0, 1000);
  RequireRange("mesh.spacing_px", o.mesh.spacing_px, 1, 1000);
  RequireRange("rounds", o.rounds, 0, 1000);
  RequireRange("passes", o.passes, 0, 1000);
  RequireRange("global_trials", o.global_trials, 0, 1000);
  RequireRange("random_trials", o.random_trials, 0, 1000);
  RequireRange("random_disparity_px", o.random_disparity_px, 0, kLargestDisparity);
  RequireRange("random_slope", o.random_slope, 0, 10);
  RequireRange("smoothness", o.smoothness, 0, 1e6);
  RequireRange("split_px", o.split_px, 1e-3, kLargestDisparity);
  RequireRange("split_gamma", o.split_gamma, 1e-3, 1e6);
  RequireRange("split_least", o.split_least, 1e-6, 1);
  RequireRange("alignment_weight", o.alignment_weight, 1e-3, 1e6);
  RequireRange("island_share", o.island_share, 0, 1);
  RequireRange("left_right_max", o.left_right_max, 0, kLargestDisparity);
  RequireRange("median_window", o.median_window, 0, kLargestWindow);
  if (o.median_window > 0) RequireOdd("median_window", o.median_window);
  RequireRange("seed", o.seed, 0, std::numeric_limits<int>::max());
}

MeshStereo::MeshStereo(MeshStereoOptions options) : options_(std::move(options)) {
  CheckOptions(options_);
}

MeshStereoResult MeshStereo::Match(const cv::Mat& left, const cv::Mat& right) const {
  const MeshStereoOptions& o = options_;
  RequireColourOrGrey(left, "left image");
  RequireColourOrGrey(right, "right image");
  if (left.type() != right.type())
    throw Error("right image",
                fmt::format("is {}, the left image {}", cv::typeToString(right.type()),
                            cv::typeToString(left.type())));
  const cv::Mat left_grey = Grey(left), right_grey = Grey(right);
  CheckPair(left_grey, right_grey, o);
  const cv::Mat l = ApplyPrefilter(left_grey, o), r = ApplyPrefilter(right_grey, o);
  const internal::CostVolume volume(internal::PrepareCostRows(l, r, o, o.cost_window), left.size(),
                                    o, o.outside_share);
  const auto seed = static_cast<uint64_t>(o.seed);
  Side left_side(left, volume.Left(), o, Hash64(seed, 0));
  Side right_side(right, volume.Right(), o, Hash64(seed, 1));
  const Start start(l, r, o);
  left_side.field.Initialise(start.Left());
  right_side.field.Initialise(start.Right());
  Infer(left_side, right_side, o.rounds);

  MeshStereoResult result;
  result.valid =
      internal::CheckLeftRight(left_side.Render(o), right_side.Render(o), o.left_right_max);
  left_side.field.FillUnconfirmed(result.valid);
  result.mesh = left_side.field.Lift();
  result.disparity = left_side.Render(o);
  internal::MedianOfInvalid(left, result.valid, o, result.disparity);
  return result;
}

void MeshStereo::Compute(const cv::Mat& left, const cv::Mat& right, cv::Mat1s& disparity) const {
  Match(left, right).disparity.convertTo(disparity, CV_16S, 16);
}

}  // namespace sgf::stereo
