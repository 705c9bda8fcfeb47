#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <opencv2/imgproc.hpp>
#include <opencv2/ximgproc/slic.hpp>

#include <sgf/stereo/mesh.h>

namespace sgf::stereo {
namespace {

constexpr int kNone = TriangleMesh::kNone;

cv::Mat1i Segment(const cv::Mat& image, const MeshOptions& options) {
  constexpr int kIterations = 6;
  constexpr int kLeastSizePct = 25;  // of a segment of the nominal size
  cv::Mat colour;
  if (image.channels() == 3)
    cv::cvtColor(image, colour, cv::COLOR_BGR2Lab);
  else
    colour = image;
  const auto slic = cv::ximgproc::createSuperpixelSLIC(
      colour, cv::ximgproc::SLIC, options.region_px, static_cast<float>(options.compactness));
  slic->iterate(kIterations);
  slic->enforceLabelConnectivity(kLeastSizePct);
  cv::Mat1i labels;
  slic->getLabels(labels);
  return labels;
}

// The lines between pixels of different segments. Corner (x, y) is the upper left one of pixel
// (x, y); the image's own outline is a line too.
class Outlines {
 public:
  explicit Outlines(const cv::Mat1i& labels) : labels_(labels) {}

  int width() const { return labels_.cols; }
  int height() const { return labels_.rows; }

  // Whether the line from a corner in direction k (right, down, left, up) parts two segments.
  bool IsLine(cv::Point corner, int k) const {
    // The pixels on either side, relative to the corner.
    static const std::array<std::array<cv::Point, 2>, 4> kSides{
        {{{{0, -1}, {0, 0}}}, {{{-1, 0}, {0, 0}}}, {{{-1, -1}, {-1, 0}}}, {{{-1, -1}, {0, -1}}}}};
    return Label(corner + kSides[k][0]) != Label(corner + kSides[k][1]);
  }

  // Where other than two lines meet, and the image's corners.
  bool IsJunction(cv::Point corner) const {
    int lines = 0;
    for (int k = 0; k < 4; ++k) lines += IsLine(corner, k) ? 1 : 0;
    const bool image_corner =
        (corner.x == 0 || corner.x == width()) && (corner.y == 0 || corner.y == height());
    return lines > 2 || image_corner;
  }

 private:
  int Label(cv::Point pixel) const {
    const bool inside = pixel.x >= 0 && pixel.x < width() && pixel.y >= 0 && pixel.y < height();
    return inside ? labels_(pixel) : kNone;
  }

  const cv::Mat1i& labels_;
};

// Follows the outlines from junction to junction and simplifies each stretch to a polygon.
class VertexFinder {
 public:
  VertexFinder(const Outlines& outlines, double tolerance)
      : outlines_(outlines),
        tolerance_(tolerance),
        done_(cv::Mat1b::zeros(outlines.height() + 1, outlines.width() + 1)),
        vertex_(cv::Mat1b::zeros(done_.size())) {}

  std::vector<cv::Point> Find() {
    for (int y = 0; y < done_.rows; ++y)
      for (int x = 0; x < done_.cols; ++x)
        if (outlines_.IsJunction({x, y})) FollowAll({x, y});
    std::vector<cv::Point> found;
    cv::findNonZero(vertex_, found);
    return found;
  }

 private:
  static cv::Point Step(int k) {
    static const std::array<cv::Point, 4> kSteps{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
    return kSteps[k];
  }

  void FollowAll(cv::Point junction) {
    vertex_(junction) = 1;
    for (int k = 0; k < 4; ++k)
      if (outlines_.IsLine(junction, k) && !(done_(junction) & (1 << k))) Follow(junction, k);
  }

  void Follow(cv::Point at, int k) {
    std::vector<cv::Point> stretch{at};
    do {
      done_(at) |= static_cast<uint8_t>(1 << k);
      at += Step(k);
      const int back = (k + 2) % 4;
      done_(at) |= static_cast<uint8_t>(1 << back);
      stretch.push_back(at);
      for (k = 0; k < 4; ++k)
        if (k != back && outlines_.IsLine(at, k)) break;
    } while (!outlines_.IsJunction(at));
    std::vector<cv::Point> polygon;
    cv::approxPolyDP(stretch, polygon, tolerance_, false);
    for (const cv::Point& vertex : polygon) vertex_(vertex) = 1;
  }

  const Outlines& outlines_;
  double tolerance_;
  cv::Mat1b done_;  // directions already followed from each corner, one bit each
  cv::Mat1b vertex_;
};

// The points that keep a distance from one another: first come, first kept, those on the image's
// outline before the others. The image's corners always stay.
std::vector<cv::Point> Thin(const std::vector<cv::Point>& points, cv::Size size, int spacing) {
  cv::Mat1b taken = cv::Mat1b::zeros(size.height + 1, size.width + 1);
  const auto is_corner = [&](cv::Point p) {
    return (p.x == 0 || p.x == size.width) && (p.y == 0 || p.y == size.height);
  };
  const auto on_outline = [&](cv::Point p) {
    return p.x == 0 || p.x == size.width || p.y == 0 || p.y == size.height;
  };
  std::vector<cv::Point> kept;
  const auto keep = [&](cv::Point p) {
    kept.push_back(p);
    cv::circle(taken, p, spacing - 1, 1, cv::FILLED);
  };
  for (const cv::Point& p : points)
    if (is_corner(p)) keep(p);
  for (const cv::Point& p : points)
    if (on_outline(p) && !taken(p)) keep(p);
  for (const cv::Point& p : points)
    if (!taken(p)) keep(p);
  return kept;
}

double TwiceArea(cv::Point2f a, cv::Point2f b, cv::Point2f c) {
  const cv::Point2d u = b - a, v = c - a;
  return u.x * v.y - u.y * v.x;
}

// Delaunay triangles as indices into `points`, in an order that follows the image's rows.
std::vector<std::array<int, 3>> Delaunay(const std::vector<cv::Point>& points, cv::Size size) {
  constexpr int kFar = 20;
  // Subdiv2D starts from a triangle around its rectangle, and cuts away what flat triangles on the
  // image's outline it takes for parts of it: the farther away, the fewer.
  const int margin = kFar * std::max(size.width, size.height);
  cv::Subdiv2D subdivision(
      {-margin, -margin, size.width + 1 + 2 * margin, size.height + 1 + 2 * margin});
  cv::Mat1i index(size.height + 1, size.width + 1, kNone);
  for (size_t i = 0; i < points.size(); ++i) {
    subdivision.insert(cv::Point2f(points[i]));
    index(points[i]) = static_cast<int>(i);
  }
  std::vector<cv::Vec6f> list;
  subdivision.getTriangleList(list);
  std::vector<std::array<int, 3>> triangles;
  for (const cv::Vec6f& t : list) {
    const cv::Point2f a(t[0], t[1]), b(t[2], t[3]), c(t[4], t[5]);
    const double area = TwiceArea(a, b, c);
    if (area == 0) continue;
    triangles.push_back({index(a), index(b), index(c)});
    if (area < 0) std::swap(triangles.back()[1], triangles.back()[2]);
    std::rotate(triangles.back().begin(),
                std::min_element(triangles.back().begin(), triangles.back().end()),
                triangles.back().end());
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

std::vector<std::array<int, 3>> Neighbours(const std::vector<std::array<int, 3>>& triangles) {
  std::vector<std::array<int, 3>> neighbours(triangles.size(), {kNone, kNone, kNone});
  std::map<std::pair<int, int>, std::pair<int, int>> open;  // edge -> triangle and its corner
  for (int i = 0; i < static_cast<int>(triangles.size()); ++i)
    for (int k = 0; k < 3; ++k) {
      const auto edge = std::minmax(triangles[i][k], triangles[i][(k + 1) % 3]);
      const auto [other, is_new] = open.try_emplace(edge, i, k);
      if (is_new) continue;
      neighbours[i][k] = other->second.first;
      neighbours[other->second.first][other->second.second] = i;
    }
  return neighbours;
}

// Marks the pixels whose centres lie in a triangle, its outline included, that have no owner yet.
void Rasterise(const TriangleMesh& mesh, int triangle, cv::Mat1i& owner) {
  const cv::Point2f a = mesh.Corner(triangle, 0), b = mesh.Corner(triangle, 1),
                    c = mesh.Corner(triangle, 2);
  const auto [x_min, x_max] = std::minmax({a.x, b.x, c.x});
  const auto [y_min, y_max] = std::minmax({a.y, b.y, c.y});
  for (int y = static_cast<int>(y_min); y < static_cast<int>(y_max); ++y)
    for (int x = static_cast<int>(x_min); x < static_cast<int>(x_max); ++x) {
      const cv::Point2f p(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      const bool inside =
          TwiceArea(a, b, p) >= 0 && TwiceArea(b, c, p) >= 0 && TwiceArea(c, a, p) >= 0;
      if (inside && owner(y, x) == kNone) owner(y, x) = triangle;
    }
}

// Gives pixels that rounding left between triangles to that of the pixel before them.
void CloseGaps(cv::Mat1i& owner) {
  int last = 0;
  for (int& triangle : owner) {
    if (triangle == kNone) triangle = last;
    last = triangle;
  }
}

}  // namespace

TriangleMesh BuildMesh(const cv::Mat& image, const MeshOptions& options) {
  cv::Mat1i labels = cv::Mat1i::zeros(image.size());
  if (std::min(image.cols, image.rows) > options.region_px) labels = Segment(image, options);
  const std::vector<cv::Point> points =
      Thin(VertexFinder(Outlines(labels), options.tolerance_px).Find(), image.size(),
           options.spacing_px);
  TriangleMesh mesh;
  mesh.vertices.assign(points.begin(), points.end());
  mesh.triangles = Delaunay(points, image.size());
  mesh.neighbours = Neighbours(mesh.triangles);
  mesh.owner = cv::Mat1i(image.size(), kNone);
  for (int i = 0; i < mesh.size(); ++i) Rasterise(mesh, i, mesh.owner);
  CloseGaps(mesh.owner);
  return mesh;
}

}  // namespace sgf::stereo
