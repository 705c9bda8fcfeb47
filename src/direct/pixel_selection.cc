#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include <sgf/core/require.h>
#include <sgf/direct/pixel_selection.h>

namespace sgf::direct {
namespace {

using alignment::kGradientX, alignment::kGradientY, alignment::SampleChannels;

float SquaredGradient(const float* pixel) {
  return pixel[kGradientX] * pixel[kGradientX] + pixel[kGradientY] * pixel[kGradientY];
}

/// Squared thresholds of blocks, (grey levels/px)^2.
cv::Mat1f Thresholds(const SampleChannels& image, const PixelSelectionOptions& options) {
  const int block = options.block_px;
  cv::Mat1f thresholds((image.rows() + block - 1) / block, (image.cols() + block - 1) / block);
  std::vector<float> gradients;
  for (int row = 0; row < thresholds.rows; ++row)
    for (int col = 0; col < thresholds.cols; ++col) {
      gradients.clear();
      for (int y = row * block; y < std::min((row + 1) * block, image.rows()); ++y)
        for (int x = col * block; x < std::min((col + 1) * block, image.cols()); ++x)
          gradients.push_back(SquaredGradient(image.At(y, x)));
      const auto middle = gradients.begin() + static_cast<ptrdiff_t>(gradients.size() / 2);
      std::nth_element(gradients.begin(), middle, gradients.end());
      thresholds(row, col) = std::sqrt(*middle) + static_cast<float>(options.above_median);
    }
  cv::Mat1f smooth;
  cv::blur(thresholds, smooth, {3, 3}, {-1, -1}, cv::BORDER_REPLICATE);
  return smooth.mul(smooth);
}

struct Best {
  float share = 1;  // of the threshold, squared; the winner has the largest
  cv::Point pixel{-1, -1};
};

/// The steepest pixels of a grid of cells, coarser where finer cells have none.
std::vector<cv::Point> SelectInCells(const SampleChannels& image, const cv::Mat1f& thresholds,
                                     int cell_px, const PixelSelectionOptions& options) {
  constexpr int kScales = 3;
  constexpr float kLower = 0.75f * 0.75f;  // squared, from one scale to the next
  const int border = options.border_px;
  std::vector<cv::Point> chosen;
  const auto best_of = [&](const cv::Rect& cell, float least) {
    Best best{least};
    for (int y = cell.y; y < cell.br().y; ++y)
      for (int x = cell.x; x < cell.br().x; ++x) {
        const float share = SquaredGradient(image.At(y, x)) /
                            thresholds(y / options.block_px, x / options.block_px);
        if (share > best.share) best = {share, {x, y}};
      }
    return best;
  };
  const cv::Rect inside(border, border, image.cols() - 2 * border, image.rows() - 2 * border);
  // Whether any pixel was chosen in a cell, scale after scale.
  const auto visit = [&](const auto& self, const cv::Rect& cell, int scale) -> bool {
    if (cell.area() <= 0) return false;
    bool any = false;
    if (scale > 0) {
      const int half = cell_px << (scale - 1);
      for (int k = 0; k < 4; ++k)
        any |= self(self,
                    cv::Rect(cell.x + (k % 2) * half, cell.y + (k / 2) * half, half, half) & inside,
                    scale - 1);
      if (any) return true;
    }
    const Best best = best_of(cell, std::pow(kLower, static_cast<float>(scale)));
    if (best.pixel.x >= 0) chosen.push_back(best.pixel);
    return best.pixel.x >= 0;
  };
  const int side = cell_px << (kScales - 1);
  for (int y = inside.y; y < inside.br().y; y += side)
    for (int x = inside.x; x < inside.br().x; x += side)
      visit(visit, cv::Rect(x, y, side, side) & inside, kScales - 1);
  return chosen;
}

}  // namespace

void CheckOptions(const PixelSelectionOptions& options) {
  Require(options.points >= 50, "selection.points", options.points, "at least 50");
  Require(options.block_px >= 8, "selection.block_px", options.block_px, "at least 8");
  Require(options.above_median >= 0, "selection.above_median", options.above_median, "at least 0");
  Require(options.border_px >= 3, "selection.border_px", options.border_px, "at least 3");
}

PixelSelector::PixelSelector(const PixelSelectionOptions& options) : options_(options) {
  CheckOptions(options);
}

std::vector<cv::Point> PixelSelector::operator()(const SampleChannels& image) {
  constexpr int kTries = 4, kMostCell = 32;
  const cv::Mat1f thresholds = Thresholds(image, options_);
  std::vector<cv::Point> chosen;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    chosen = SelectInCells(image, thresholds, cell_px_, options_);
    // Points are as many as cells: inversely proportional to the area of one.
    const double ratio = static_cast<double>(chosen.size()) / options_.points;
    const int next = std::clamp(
        static_cast<int>(std::lround(cell_px_ * std::sqrt(std::max(ratio, 0.05)))), 1, kMostCell);
    if (next == cell_px_ || (ratio > 0.8 && ratio < 1.25)) break;
    cell_px_ = next;
  }
  return chosen;
}

}  // namespace sgf::direct
