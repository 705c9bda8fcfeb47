#pragma once

#include <span>
#include <utility>

#include <opencv2/core.hpp>

namespace sgf::stereo {

/// Curve through the winner's cost and its two neighbours whose minimum is the sub-pixel disparity.
enum class Subpixel {
  kNone,
  kEquiangular,  ///< two lines of opposite slope (as cv::StereoBM)
  kParabola,
};
std::span<const std::pair<const char*, Subpixel>> EnumNames(Subpixel);

/// Options of BlockMatcher and SemiGlobal: the sub-pixel disparity of a match, and which matches
/// are dropped.
struct MatchChecks {
  Subpixel subpixel = Subpixel::kEquiangular;
  double uniqueness_pct = 10;
  int left_right_max = 1;
  int speckle_window = 0;
  double speckle_range = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("subpixel", subpixel, "", "interpolation of the winner's cost");
    visit(
        "uniqueness_pct", uniqueness_pct, "%",
        "a match is dropped unless every candidate other than the winner and its neighbours costs "
        "more than (1 + this) times the winner; 0 keeps all");
    visit("left_right_max", left_right_max, "px",
          "largest difference to the disparity found from the right image; -1 turns the check off");
    visit("speckle_window", speckle_window, "px",
          "connected regions up to this size are dropped; 0 keeps all");
    visit("speckle_range", speckle_range, "px", "largest step inside a connected region");
  }
};

/// @throws Error for an option out of range, with its name and value.
void CheckOptions(const MatchChecks& options);

/// Disparities of the left image in 1/16 px, as OpenCV's matchers give them, with what the
/// uniqueness filter needs.
struct Matches {
  cv::Mat1s
      disparity;     ///< 16 * disparity; the matcher's InvalidDisparity() where there is no match
  cv::Mat1i best;    ///< summed cost of the winner, in the matcher's integer units
  cv::Mat1i second;  ///< least summed cost outside the winner and its two neighbours
};

namespace internal {

/// Marks pixels without a match: 16 * (min_disparity - 1), as in OpenCV.
constexpr short InvalidDisparity(int min_disparity) {
  return static_cast<short>(16 * (min_disparity - 1));
}

/// Margin over the winner's cost times 2^16.
int UniquenessQ16(double percent);

/// The disparities whose second-best candidate costs more than (1 + uniqueness_pct / 100) times the
/// best, the others set to `invalid`; 0 keeps all.
/// @throws Error for a threshold out of range.
cv::Mat1s UniqueDisparities(const Matches& matches, double uniqueness_pct, short invalid);

/// Sets connected regions of at most `window` pixels to `invalid`; 0 keeps all.
/// @param range largest step inside a region, px.
void DropSpeckles(cv::Mat1s& disparity, short invalid, int window, double range);

/// 1/16 px as px, NaN for `invalid`.
cv::Mat1f ToFloat(const cv::Mat1s& disparity, short invalid);

}  // namespace internal
}  // namespace sgf::stereo
