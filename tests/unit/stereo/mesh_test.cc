// Triangulations of images.

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <support/stereo_images.h>

#include <sgf/stereo/mesh.h>

namespace sgf::stereo {
namespace {

constexpr int kNone = TriangleMesh::kNone;

cv::Mat ColourImage(cv::Size size, uint64_t seed) {
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>{TexturedImage(size, seed), TexturedImage(size, seed + 1),
                                 TexturedImage(size, seed + 2)},
            image);
  return image;
}

// Exact for the half-integral coordinates of vertices and pixel centres.
double TwiceArea(cv::Point2d a, cv::Point2d b, cv::Point2d c) { return (b - a).cross(c - a); }

bool Contains(const TriangleMesh& mesh, int triangle, cv::Point2d p) {
  for (int k = 0; k < 3; ++k)
    if (TwiceArea(mesh.Corner(triangle, k), mesh.Corner(triangle, (k + 1) % 3), p) < 0)
      return false;
  return true;
}

// Pixels that belong to no triangle, or to one that does not contain their centre.
int WronglyOwned(const TriangleMesh& mesh) {
  int count = 0;
  for (int y = 0; y < mesh.owner.rows; ++y)
    for (int x = 0; x < mesh.owner.cols; ++x) {
      const int owner = mesh.owner(y, x);
      const bool exists = owner >= 0 && owner < mesh.size();
      if (!exists || !Contains(mesh, owner, {x + 0.5, y + 0.5})) ++count;
    }
  return count;
}

// Triangles of positive area whose sum is the image's: together with the pixels' owners, neither
// gaps nor overlaps.
void ExpectCovers(const TriangleMesh& mesh, cv::Size size) {
  ASSERT_EQ(mesh.owner.size(), size);
  double sum = 0;
  for (int i = 0; i < mesh.size(); ++i) {
    const double area = TwiceArea(mesh.Corner(i, 0), mesh.Corner(i, 1), mesh.Corner(i, 2));
    EXPECT_GT(area, 0) << "triangle " << i;
    sum += area;
  }
  EXPECT_EQ(sum, 2.0 * size.area());
  EXPECT_EQ(WronglyOwned(mesh), 0);
}

bool OnOutline(cv::Point2f a, cv::Point2f b, cv::Size size) {
  const auto w = static_cast<float>(size.width), h = static_cast<float>(size.height);
  return (a.x == b.x && (a.x == 0 || a.x == w)) || (a.y == b.y && (a.y == 0 || a.y == h));
}

// Whether the neighbour across an edge has the same edge the other way round and knows of it.
bool IsReturned(const TriangleMesh& mesh, int triangle, int k) {
  const int other = mesh.neighbours[triangle][k];
  const int from = mesh.triangles[triangle][k], to = mesh.triangles[triangle][(k + 1) % 3];
  for (int m = 0; m < 3; ++m)
    if (mesh.triangles[other][m] == to && mesh.triangles[other][(m + 1) % 3] == from)
      return mesh.neighbours[other][m] == triangle;
  return false;
}

void ExpectNeighboursMeet(const TriangleMesh& mesh) {
  ASSERT_EQ(mesh.neighbours.size(), mesh.triangles.size());
  for (int i = 0; i < mesh.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const cv::Point2f from = mesh.Corner(i, k), to = mesh.Corner(i, (k + 1) % 3);
      ASSERT_EQ(mesh.neighbours[i][k] == kNone, OnOutline(from, to, mesh.owner.size()))
          << "edge " << k << " of triangle " << i;
      if (mesh.neighbours[i][k] == kNone) continue;
      EXPECT_TRUE(IsReturned(mesh, i, k)) << "edge " << k << " of triangle " << i;
    }
}

double LeastDistance(const TriangleMesh& mesh) {
  double least = 1e9;
  for (size_t i = 0; i < mesh.vertices.size(); ++i)
    for (size_t j = 0; j < i; ++j)
      least = std::min(least, cv::norm(mesh.vertices[i] - mesh.vertices[j]));
  return least;
}

void ExpectSound(const TriangleMesh& mesh, cv::Size size) {
  ExpectCovers(mesh, size);
  ExpectNeighboursMeet(mesh);
}

TEST(BuildMesh, TilesTheImage) {
  for (const cv::Size size : {cv::Size(120, 90), {83, 131}, {64, 40}})
    for (const cv::Mat& image : {cv::Mat(TexturedImage(size, 4)), ColourImage(size, 4)}) {
      SCOPED_TRACE(testing::Message() << size << ' ' << cv::typeToString(image.type()));
      const TriangleMesh mesh = BuildMesh(image, {});
      ExpectSound(mesh, size);
      EXPECT_GT(mesh.size(), size.area() / 200);
    }
}

TEST(BuildMesh, TilesTheImageWhateverTheOptions) {
  const cv::Size size(97, 61);
  const cv::Mat1b image = TexturedImage(size, 12);
  for (const int region : {4, 7, 25, 60, 1000})
    for (const double tolerance : {0.0, 1.0, 5.0})
      for (const int spacing : {1, 2, 8, 40}) {
        SCOPED_TRACE(testing::Message() << region << ' ' << tolerance << ' ' << spacing);
        ExpectSound(BuildMesh(image, {region, 10, tolerance, spacing}), size);
      }
}

TEST(BuildMesh, KeepsVerticesApart) {
  for (const int spacing : {1, 2, 3, 5, 8, 13}) {
    MeshOptions options;
    options.spacing_px = spacing;
    const TriangleMesh mesh = BuildMesh(TexturedImage({120, 90}, 5), options);
    EXPECT_GT(LeastDistance(mesh), spacing - 1);
  }
}

TEST(BuildMesh, SmallerRegionsGiveMoreTriangles) {
  const cv::Mat1b image = TexturedImage({120, 90}, 6);
  EXPECT_GT(BuildMesh(image, {6, 10, 1, 3}).size(), 1.25 * BuildMesh(image, {12, 10, 1, 3}).size());
}

// Share of the pixels on the other side of a line than most of their triangle.
double Straddling(const TriangleMesh& mesh, const cv::Mat1b& side) {
  std::vector<std::array<int, 2>> counts(mesh.size());
  for (int y = 0; y < side.rows; ++y)
    for (int x = 0; x < side.cols; ++x) ++counts[mesh.owner(y, x)][side(y, x) > 128 ? 1 : 0];
  int sum = 0;
  for (const auto& [dark, bright] : counts) sum += std::min(dark, bright);
  return static_cast<double>(sum) / static_cast<double>(side.total());
}

TEST(BuildMesh, FollowsStrongEdges) {
  const cv::Size size(120, 90);
  cv::Mat1b upright(size, 60), slanted(size, 60), disc(size, 60);
  upright.colRange(50, 120) = 190;
  cv::fillPoly(slanted,
               std::vector<std::vector<cv::Point>>{{{30, 0}, {119, 0}, {119, 89}, {77, 89}}}, 190);
  cv::circle(disc, {60, 45}, 30, 190, cv::FILLED);
  const TriangleMesh blind = BuildMesh(cv::Mat1b(size, 60), {});
  for (const cv::Mat1b& image : {upright, slanted, disc}) {
    const TriangleMesh mesh = BuildMesh(image, {});
    ExpectSound(mesh, size);
    EXPECT_LT(Straddling(mesh, image), 0.01);
    EXPECT_LT(Straddling(mesh, image), Straddling(blind, image) / 4);
  }
}

TEST(BuildMesh, AnImageWithinASegmentIsTwoTriangles) {
  for (const cv::Size size : {cv::Size(1, 1),
                              {2, 2},
                              {2, 3},
                              {7, 9},
                              {12, 12},
                              {60, 1},
                              {1, 60},
                              {50, 5},
                              {5, 50},
                              {70, 12}})
    for (const cv::Mat& image : {cv::Mat(size, CV_8UC1, 90.0), cv::Mat(size, CV_8UC3, 90.0)}) {
      SCOPED_TRACE(testing::Message() << size);
      const TriangleMesh mesh = BuildMesh(image, {});
      EXPECT_EQ(mesh.size(), 2);
      ExpectSound(mesh, size);
    }
}

TEST(BuildMesh, TilesImagesLittleLargerThanASegment) {
  for (int height = 13; height < 30; height += 2)
    for (int width = 13; width < 30; width += 3) {
      SCOPED_TRACE(testing::Message() << width << 'x' << height);
      const cv::Size size(width, height);
      ExpectSound(BuildMesh(TexturedImage(size, 3), {}), size);
    }
}

TEST(BuildMesh, LeavesTheImageAlone) {
  for (const cv::Mat& image : {cv::Mat(TexturedImage({60, 50}, 7)), ColourImage({60, 50}, 7)}) {
    const cv::Mat before = image.clone();
    BuildMesh(image, {});
    EXPECT_EQ(cv::norm(image, before, cv::NORM_L1), 0);
  }
}

TEST(BuildMesh, TakesAPartOfAnImageAsAnImage) {
  const cv::Mat1b wide = TexturedImage({120, 90}, 8);
  const cv::Mat1b part = wide(cv::Rect(11, 7, 61, 53));
  const TriangleMesh of_part = BuildMesh(part, {}), of_copy = BuildMesh(part.clone(), {});
  EXPECT_EQ(of_part.vertices, of_copy.vertices);
  EXPECT_EQ(of_part.triangles, of_copy.triangles);
}

}  // namespace
}  // namespace sgf::stereo
