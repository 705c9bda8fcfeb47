#include <array>
#include <cmath>
#include <vector>

#include <sgf/alignment/pattern.h>

namespace sgf::alignment {
namespace {

std::vector<Eigen::Vector2f> Grid(int radius, int step, float disc) {
  std::vector<Eigen::Vector2f> offsets;
  for (int y = -radius; y <= radius; y += step)
    for (int x = -radius; x <= radius; x += step)
      if (std::hypot(float(x), float(y)) <= disc) offsets.emplace_back(x, y);
  return offsets;
}

}  // namespace

std::span<const std::pair<const char*, Pattern>> EnumNames(Pattern) {
  static constexpr std::pair<const char*, Pattern> kNames[] = {{"point", Pattern::kPoint},
                                                               {"dso8", Pattern::kDso8},
                                                               {"cross17", Pattern::kCross17},
                                                               {"square25", Pattern::kSquare25},
                                                               {"basalt52", Pattern::kBasalt52}};
  return kNames;
}

std::span<const Eigen::Vector2f> Offsets(Pattern pattern) {
  static const std::vector<Eigen::Vector2f> kPoint = {{0, 0}};
  static const std::vector<Eigen::Vector2f> kDso8 = {{0, -2}, {-1, -1}, {1, -1}, {-2, 0},
                                                     {0, 0},  {2, 0},   {-1, 1}, {0, 2}};
  static const std::vector<Eigen::Vector2f> kCross17 = {
      {0, -4}, {-3, -3}, {3, -3}, {0, -2}, {-2, -1}, {2, -1}, {-4, 0}, {-1, 0}, {0, 0},
      {1, 0},  {4, 0},   {-2, 1}, {2, 1},  {0, 2},   {-3, 3}, {3, 3},  {0, 4}};
  static const std::vector<Eigen::Vector2f> kSquare25 = Grid(2, 1, 3);
  // Centres of the 2 x 2 blocks of a 16 x 16 square that lie in a disc: rows of 4, 6, 8, 8, 8, 8, 6
  // and 4.
  static const std::vector<Eigen::Vector2f> kBasalt52 = Grid(7, 2, 8);
  switch (pattern) {
    case Pattern::kPoint:
      return kPoint;
    case Pattern::kDso8:
      return kDso8;
    case Pattern::kCross17:
      return kCross17;
    case Pattern::kSquare25:
      return kSquare25;
    case Pattern::kBasalt52:
      return kBasalt52;
  }
  return kDso8;
}

}  // namespace sgf::alignment
