#pragma once

#include <array>
#include <vector>

#include <opencv2/core.hpp>

namespace sgf::stereo {

/// How an image is cut into triangles.
struct MeshOptions {
  int region_px = 12;
  double compactness = 10;
  double tolerance_px = 1;
  int spacing_px = 8;

  template <class V>
  void VisitFields(V&& visit) {
    visit("region_px", region_px, "px", "side of a segment of the over-segmentation");
    visit("compactness", compactness, "",
          "of segments: weight of distance against colour (SLIC's m)");
    visit("tolerance_px", tolerance_px, "px",
          "largest distance between a segment's outline and the mesh vertices' polygon");
    visit("spacing_px", spacing_px, "px",
          "vertices nearer than this to one kept before are dropped");
  }
};

/// A triangulation of an image. Coordinates are in px with pixel (x, y) covering [x, x + 1) x
/// [y, y + 1), so that vertices stand between pixels; pixel centres have coordinates + 0.5.
struct TriangleMesh {
  static constexpr int kNone = -1;

  std::vector<cv::Point2f> vertices;
  std::vector<std::array<int, 3>> triangles;  ///< vertices of each, all in one orientation
  /// Triangle across the edge from corner k to corner (k + 1) % 3, or kNone.
  std::vector<std::array<int, 3>> neighbours;
  cv::Mat1i owner;  ///< triangle of each pixel

  int size() const { return static_cast<int>(triangles.size()); }
  cv::Point2f Corner(int triangle, int k) const { return vertices[triangles[triangle][k]]; }
  cv::Point2f Barycentre(int triangle) const {
    return (Corner(triangle, 0) + Corner(triangle, 1) + Corner(triangle, 2)) / 3;
  }
};

/// Cuts an image into triangles that follow its edges, as MeshStereo does (Zhang et al., ICCV
/// 2015): SLIC over-segmentation, outlines of the segments as polygons, Delaunay triangulation of
/// the polygons' vertices. An image smaller than a segment becomes two triangles.
/// @param image 8-bit, one channel or BGR, not empty.
TriangleMesh BuildMesh(const cv::Mat& image, const MeshOptions& options);

}  // namespace sgf::stereo
