#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <queue>
#include <tuple>

#include <Eigen/Dense>

#include <sgf/core/parallel.h>
#include <sgf/core/random.h>
#include <sgf/stereo/plane_field.h>

namespace sgf::stereo::internal {
namespace {

constexpr int kNone = TriangleMesh::kNone;
constexpr float kSteepest = 3;  // slope of a plane

template <class Body>
void ForEach(const std::vector<int>& items, int threads, const Body& body) {
  ParallelForBatches(static_cast<int>(items.size()), threads, [&](int n) { body(items[n]); });
}

// Mean colours of the triangles; of those without a pixel, the colour at the barycentre.
std::vector<cv::Vec3f> MeanColours(const TriangleMesh& mesh, const cv::Mat& image) {
  std::vector<cv::Vec3f> sums(mesh.size());
  std::vector<int> counts(mesh.size());
  const auto colour = [&](int y, int x) {
    if (image.channels() == 1) return cv::Vec3f::all(image.at<uint8_t>(y, x));
    return cv::Vec3f(image.at<cv::Vec3b>(y, x));
  };
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      sums[mesh.owner(y, x)] += colour(y, x);
      ++counts[mesh.owner(y, x)];
    }
  for (int i = 0; i < mesh.size(); ++i) {
    const cv::Point2f p = mesh.Barycentre(i);
    sums[i] = counts[i] > 0 ? sums[i] / static_cast<float>(counts[i])
                            : colour(static_cast<int>(p.y), static_cast<int>(p.x));
  }
  return sums;
}

float Likeness(const cv::Vec3f& a, const cv::Vec3f& b, double gamma) {
  const cv::Vec3f d = a - b;
  return std::exp(-(std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2])) / static_cast<float>(gamma));
}

// The plane through three points, or one that is too steep where they lie on a line.
Plane PlaneThrough(const std::array<cv::Point2f, 3>& p, const std::array<float, 3>& d) {
  const cv::Point2f u = p[1] - p[0], v = p[2] - p[0];
  const float area = u.x * v.y - u.y * v.x;
  if (area == 0) return {std::numeric_limits<float>::infinity(), 0, 0};
  const float du = d[1] - d[0], dv = d[2] - d[0];
  return Plane::Through(p[0].x, p[0].y, d[0], (du * v.y - dv * u.y) / area,
                        (dv * u.x - du * v.x) / area);
}

struct FitPoint {
  float x, y, disparity, weight;  // px from the centre, px, -
};

std::vector<FitPoint> PointsAround(const cv::Mat1f& guess, const SupportWindows& windows, int i) {
  constexpr int kRadius = 10;
  const cv::Point centre = windows.Centre(i);
  const int radius = std::min(kRadius, windows.window() / 2);
  const cv::Rect inside = WindowInside(centre, radius, guess.size());
  std::vector<FitPoint> points;
  for (int y = inside.y; y < inside.br().y; ++y)
    for (int x = inside.x; x < inside.br().x; ++x)
      if (const uint8_t weight = windows.Weight(i, x, y))
        points.push_back({static_cast<float>(x - centre.x), static_cast<float>(y - centre.y),
                          guess(y, x), static_cast<float>(weight)});
  return points;
}

// The plane through the points that lie near another one; held to it where they do not say.
Eigen::Vector3f FitNear(const std::vector<FitPoint>& points, const Eigen::Vector3f& plane,
                        float near_px) {
  constexpr float kHold = 1e-3F;
  Eigen::Matrix3f normal = kHold * Eigen::Matrix3f::Identity();
  Eigen::Vector3f right = normal * plane;
  for (const FitPoint& p : points) {
    const Eigen::Vector3f row(p.x, p.y, 1);
    if (std::abs(row.dot(plane) - p.disparity) > near_px) continue;
    normal += p.weight * row * row.transpose();
    right += p.weight * p.disparity * row;
  }
  return normal.llt().solve(right);
}

}  // namespace

PlaneField::PlaneField(const VolumeView& view, const TriangleMesh& mesh,
                       const SupportWindows& windows, const cv::Mat& image,
                       const MeshStereoOptions& options, uint64_t seed)
    : view_(view),
      mesh_(mesh),
      windows_(windows),
      options_(options),
      seed_(seed),
      planes_(mesh.size()),
      data_(mesh.size()),
      version_(mesh.size(), 1),
      tried_(mesh.size()),
      likeness_(mesh.size()),
      price_(mesh.size()),
      aligned_(mesh.size()),
      fans_(mesh.vertices.size()) {
  ColourTriangles();
  CompareColours(image);
  for (int i = 0; i < mesh.size(); ++i)
    for (int k = 0; k < 3; ++k) fans_[mesh.triangles[i][k]].push_back({i, k});
}

// Greedy: each triangle has at most three neighbours, so four classes do.
void PlaneField::ColourTriangles() {
  std::vector<int> colours(mesh_.size(), kNone);
  classes_.resize(4);
  for (int i = 0; i < mesh_.size(); ++i) {
    const auto taken = [&](int colour) {
      return std::any_of(mesh_.neighbours[i].begin(), mesh_.neighbours[i].end(),
                         [&](int j) { return j != kNone && colours[j] == colour; });
    };
    int colour = 0;
    while (taken(colour)) ++colour;
    colours[i] = colour;
    classes_[colour].push_back(i);
  }
}

void PlaneField::CompareColours(const cv::Mat& image) {
  const std::vector<cv::Vec3f> colours = MeanColours(mesh_, image);
  const auto whole = static_cast<float>(options_.split_px * options_.split_px);
  const auto least = static_cast<float>(options_.split_least);
  for (int i = 0; i < mesh_.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const int j = mesh_.neighbours[i][k];
      if (j == kNone) continue;
      likeness_[i][k] = Likeness(colours[i], colours[j], options_.split_gamma);
      price_[i][k] = whole * (least + (1 - least) * likeness_[i][k]);
    }
}

void PlaneField::Initialise(const cv::Mat1f& guess) {
  ParallelForBatches(mesh_.size(), options_.threads, [&](int i) {
    planes_[i] = FitPlane(guess, i);
    data_[i] = PlaneCost(view_, windows_, i, planes_[i], std::numeric_limits<float>::max());
    for (int k = 0; k < 3; ++k) aligned_[i][k] = planes_[i].At(Corner(i, k).x, Corner(i, k).y);
  });
}

// Least squares over the pixels around the triangle's centre, each weighted as in the support
// window: first those near their median, then those near the plane found.
Plane PlaneField::FitPlane(const cv::Mat1f& guess, int i) const {
  const cv::Point centre = windows_.Centre(i);
  std::vector<FitPoint> points = PointsAround(guess, windows_, i);
  const auto middle = points.begin() + static_cast<ptrdiff_t>(points.size() / 2);
  std::nth_element(points.begin(), middle, points.end(),
                   [](const FitPoint& a, const FitPoint& b) { return a.disparity < b.disparity; });
  const Plane level{0, 0, middle->disparity};
  Eigen::Vector3f plane(0, 0, level.offset);  // slopes, and disparity at the centre
  for (const float near_px : {4.F, 1.F}) plane = FitNear(points, plane, near_px);
  const Plane fit = Plane::Through(static_cast<float>(centre.x), static_cast<float>(centre.y),
                                   plane[2], plane[0], plane[1]);
  return Admissible(i, fit) ? fit : level;
}

bool PlaneField::Admissible(int i, const Plane& plane) const {
  if (!(std::abs(plane.slope_x) <= kSteepest && std::abs(plane.slope_y) <= kSteepest)) return false;
  const cv::Point2f centre = Centre(i);
  const float index = plane.At(centre.x, centre.y) - static_cast<float>(view_.min_disparity);
  return index >= 0 && index <= static_cast<float>(view_.num_disparities - 1);
}

float PlaneField::SquaredGap(int i, int k, const Plane& plane) const {
  const Plane& other = planes_[mesh_.neighbours[i][k]];
  const cv::Point2f s = Corner(i, k), t = Corner(i, (k + 1) % 3);
  const float at_s = plane.At(s.x, s.y) - other.At(s.x, s.y);
  const float at_t = plane.At(t.x, t.y) - other.At(t.x, t.y);
  return 0.5F * (at_s * at_s + at_t * at_t);
}

float PlaneField::Penalty(int i, int k, const Plane& plane) const {
  const float gap = SquaredGap(i, k, plane), price = price_[i][k];
  return lambda_ * price * gap / (price + gap);
}

float PlaneField::Smoothness(int i, const Plane& plane) const {
  float sum = 0;
  for (int k = 0; k < 3; ++k)
    if (mesh_.neighbours[i][k] != kNone) sum += Penalty(i, k, plane);
  return sum;
}

float PlaneField::Energy(int i) const { return Smoothness(i, planes_[i]) + data_[i]; }

float PlaneField::Connection(int i, int k) const {
  if (mesh_.neighbours[i][k] == kNone) return 0;
  const float z = price_[i][k] / (price_[i][k] + SquaredGap(i, k, planes_[i]));
  return z * z;
}

// Takes `plane` for triangle i where it lowers the energy.
void PlaneField::Try(int i, const Plane& plane, float& best) {
  if (!Admissible(i, plane)) return;
  const float smoothness = Smoothness(i, plane);
  if (smoothness >= best) return;
  const float data = PlaneCost(view_, windows_, i, plane, best - smoothness);
  if (smoothness + data >= best) return;
  best = smoothness + data;
  planes_[i] = plane;
  data_[i] = data;
  ++version_[i];
}

void PlaneField::Sweep(const PlaneField& other, int direction, int round) {
  lambda_ = static_cast<float>(options_.smoothness * (round + 1) / options_.rounds);
  for (int pass = 0; pass < options_.passes; ++pass)
    for (const std::vector<int>& members : classes_)
      ForEach(members, options_.threads, [&](int i) { TryNeighbours(i); });
  for (const std::vector<int>& members : classes_)
    ForEach(members, options_.threads, [&](int i) {
      float best = Energy(i);
      TryOtherView(i, other, direction, best);
      TryAligned(i, best);
      TryRandom(i, round, best);
    });
}

// The planes of the neighbours across the edges that have changed since they were last tried.
// Triangles further off are of the same class and may be changing.
void PlaneField::TryNeighbours(int i) {
  float best = -1;
  for (int k = 0; k < 3; ++k) {
    const int j = mesh_.neighbours[i][k];
    if (j == kNone || tried_[i][k] == version_[j]) continue;
    tried_[i][k] = version_[j];
    if (best < 0) best = Energy(i);
    Try(i, planes_[j], best);
  }
}

// The plane that the other image has where this triangle's centre falls.
void PlaneField::TryOtherView(int i, const PlaneField& other, int direction, float& best) {
  const cv::Point2f centre = Centre(i);
  const float shift = static_cast<float>(direction) * planes_[i].At(centre.x, centre.y);
  const int x = static_cast<int>(std::lrint(centre.x - shift));
  const int y = std::clamp(static_cast<int>(std::lrint(centre.y)), 0, view_.height - 1);
  if (x < 0 || x >= view_.width) return;
  const Plane& plane = other.planes_[other.mesh_.owner(y, x)];
  // d = a (x - s d) + b y + c in this image's coordinates, s the direction.
  const float scale = 1 + static_cast<float>(direction) * plane.slope_x;
  if (scale <= 0) return;
  Try(i, {plane.slope_x / scale, plane.slope_y / scale, plane.offset / scale}, best);
}

void PlaneField::TryAligned(int i, float& best) {
  Try(i, PlaneThrough({Corner(i, 0), Corner(i, 1), Corner(i, 2)}, aligned_[i]), best);
}

// Ever smaller changes of the disparity at the centre and of the slopes.
void PlaneField::TryRandom(int i, int round, float& best) {
  const uint64_t stream =
      Hash64(seed_, static_cast<uint64_t>(round) << 32 | static_cast<uint32_t>(i));
  const cv::Point2f centre = Centre(i);
  uint64_t index = 0;
  const auto draw = [&] { return static_cast<float>(2 * Uniform01(stream, index++) - 1); };
  auto d_radius = static_cast<float>(options_.random_disparity_px);
  auto slope_radius = static_cast<float>(options_.random_slope);
  const float middle = static_cast<float>(view_.num_disparities - 1) / 2;
  for (int trial = 0; trial < options_.global_trials; ++trial) {
    const float d = static_cast<float>(view_.min_disparity) + middle * (1 + draw());
    const float slope_x = slope_radius * draw(), slope_y = slope_radius * draw();
    Try(i, Plane::Through(centre.x, centre.y, d, slope_x, slope_y), best);
  }
  for (int trial = 0; trial < options_.random_trials; ++trial) {
    const Plane& now = planes_[i];
    const float d = now.At(centre.x, centre.y) + d_radius * draw();
    const float slope_x = now.slope_x + slope_radius * draw();
    const float slope_y = now.slope_y + slope_radius * draw();
    Try(i, Plane::Through(centre.x, centre.y, d, slope_x, slope_y), best);
    d_radius *= 0.5F;
    slope_radius *= 0.5F;
  }
}

// The planes that `members`, the triangles labelled `own`, would take over from those around them:
// each that of the triangle from which it is reached over the least change of colour. Empty where
// that leaves a member without an admissible plane.
std::vector<Plane> PlaneField::Extend(const std::vector<int>& members,
                                      const std::vector<int>& label, int own) const {
  using Entry = std::tuple<float, int, int>;  // distance, triangle, triangle whose plane it brings
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  const auto reach = [&](float distance, int i, int k, int to, int source) {
    constexpr float kStep = 0.1F;  // of a triangle without any change of colour
    constexpr float kLeast = 1e-6F;
    queue.emplace(distance + kStep - std::log(std::max(likeness_[i][k], kLeast)), to, source);
  };
  for (const int i : members)
    for (int k = 0; k < 3; ++k)
      if (const int j = mesh_.neighbours[i][k]; j != kNone && label[j] != own) reach(0, i, k, i, j);
  std::map<int, Plane> found;
  while (!queue.empty()) {
    const auto [distance, i, source] = queue.top();
    queue.pop();
    if (found.contains(i) || !Admissible(i, planes_[source])) continue;
    found[i] = planes_[source];
    for (int k = 0; k < 3; ++k)
      if (const int j = mesh_.neighbours[i][k]; j != kNone && label[j] == own)
        reach(distance, i, k, j, source);
  }
  std::vector<Plane> planes;
  if (found.size() < members.size()) return planes;
  for (const int i : members) planes.push_back(found[i]);
  return planes;
}

void PlaneField::FillUnconfirmed(const cv::Mat1b& valid) {
  std::vector<int> balance(mesh_.size()), label(mesh_.size()), members;
  for (int y = 0; y < valid.rows; ++y)
    for (int x = 0; x < valid.cols; ++x) balance[mesh_.owner(y, x)] += valid(y, x) ? 1 : -1;
  for (int i = 0; i < mesh_.size(); ++i) {
    label[i] = balance[i] > 0 ? 1 : 0;
    if (label[i] == 0) members.push_back(i);
  }
  const std::vector<Plane> planes = Extend(members, label, 0);
  for (size_t n = 0; n < planes.size(); ++n) planes_[members[n]] = planes[n];
}

// Groups of connected triangles. @param[out] label group of each triangle.
std::vector<std::vector<int>> PlaneField::Groups(std::vector<int>& label) const {
  std::vector<std::vector<int>> groups;
  label.assign(mesh_.size(), kNone);
  for (int seed = 0; seed < mesh_.size(); ++seed) {
    if (label[seed] != kNone) continue;
    const int own = static_cast<int>(groups.size());
    std::vector<int> members{seed};
    label[seed] = own;
    for (size_t n = 0; n < members.size(); ++n)
      for (int k = 0; k < 3; ++k) {
        const int j = mesh_.neighbours[members[n]][k];
        if (j == kNone || label[j] != kNone || !IsConnected(members[n], k)) continue;
        label[j] = own;
        members.push_back(j);
      }
    groups.push_back(std::move(members));
  }
  return groups;
}

void PlaneField::DissolveIslands() {
  std::vector<int> label;
  const std::vector<std::vector<int>> groups = Groups(label);
  const double largest = options_.island_share * mesh_.size();
  for (size_t own = 0; own < groups.size(); ++own)
    if (static_cast<double>(groups[own].size()) <= largest)
      Dissolve(groups[own], label, static_cast<int>(own));
}

double PlaneField::GroupEnergy(const std::vector<int>& members, const std::vector<int>& label,
                               int own) const {
  double sum = 0;
  for (const int i : members) {
    sum += data_[i];
    for (int k = 0; k < 3; ++k) {
      const int j = mesh_.neighbours[i][k];
      if (j != kNone) sum += (label[j] == own ? 0.5 : 1.0) * Penalty(i, k, planes_[i]);
    }
  }
  return sum;
}

void PlaneField::Dissolve(const std::vector<int>& members, const std::vector<int>& label, int own) {
  const std::vector<Plane> planes = Extend(members, label, own);
  if (planes.empty()) return;
  const double before = GroupEnergy(members, label, own);
  std::vector<std::pair<Plane, float>> old;
  for (size_t n = 0; n < members.size(); ++n) {
    const int i = members[n];
    old.emplace_back(planes_[i], data_[i]);
    planes_[i] = planes[n];
    data_[i] = PlaneCost(view_, windows_, i, planes_[i], std::numeric_limits<float>::max());
  }
  const bool better = GroupEnergy(members, label, own) < before;
  for (size_t n = 0; n < members.size(); ++n) {
    if (better)
      ++version_[members[n]];
    else
      std::tie(planes_[members[n]], data_[members[n]]) = old[n];
  }
}

void PlaneField::Align() {
  ParallelForBatches(static_cast<int>(fans_.size()), options_.threads,
                     [&](int v) { AlignVertex(fans_[v]); });
}

// Corner disparities x of the triangles around a vertex: the minimum of
// mu sum_i (x_i - d_i)^2 + sum_e z_e (x_i - x_j)^2.
void PlaneField::AlignVertex(const Fan& fan) {
  const int count = static_cast<int>(fan.size());
  const auto mu = static_cast<float>(options_.alignment_weight);
  Eigen::MatrixXf system = mu * Eigen::MatrixXf::Identity(count, count);
  Eigen::VectorXf target(count);
  for (int m = 0; m < count; ++m) {
    const auto [i, corner] = fan[m];
    const cv::Point2f p = Corner(i, corner);
    target(m) = mu * planes_[i].At(p.x, p.y);
    for (const int k : {corner, (corner + 2) % 3}) {  // the two edges at this vertex
      const int j = mesh_.neighbours[i][k];
      for (int n = m + 1; n < count; ++n) {
        if (fan[n][0] != j) continue;
        const float z = Connection(i, k);
        system(m, m) += z;
        system(n, n) += z;
        system(m, n) -= z;
        system(n, m) -= z;
      }
    }
  }
  const Eigen::VectorXf x = system.llt().solve(target);
  for (int m = 0; m < count; ++m) aligned_[fan[m][0]][fan[m][1]] = x(m);
}

// The group of each triangle of a fan: those connected across an edge at the vertex are in one.
std::vector<int> PlaneField::GroupFan(const Fan& fan) const {
  std::vector<int> group(fan.size());
  std::iota(group.begin(), group.end(), 0);
  for (const auto& [i, corner] : fan)
    for (const int k : {corner, (corner + 2) % 3}) {
      if (mesh_.neighbours[i][k] == kNone || !IsConnected(i, k)) continue;
      int own = 0, other = 0;
      for (size_t n = 0; n < fan.size(); ++n) {
        if (fan[n][0] == i) own = group[n];
        if (fan[n][0] == mesh_.neighbours[i][k]) other = group[n];
      }
      std::replace(group.begin(), group.end(), std::max(own, other), std::min(own, other));
    }
  return group;
}

DisparityMesh PlaneField::Lift() const {
  DisparityMesh lifted;
  lifted.triangles.resize(mesh_.size());
  for (size_t v = 0; v < fans_.size(); ++v) {
    const Fan& fan = fans_[v];
    const std::vector<int> group = GroupFan(fan);
    for (size_t own = 0; own < fan.size(); ++own) {
      float sum = 0, count = 0;
      for (size_t n = 0; n < fan.size(); ++n) {
        if (group[n] != static_cast<int>(own)) continue;
        const cv::Point2f p = Corner(fan[n][0], fan[n][1]);
        sum += planes_[fan[n][0]].At(p.x, p.y);
        ++count;
        lifted.triangles[fan[n][0]][fan[n][1]] = static_cast<int>(lifted.vertices.size());
      }
      if (count > 0)
        lifted.vertices.emplace_back(mesh_.vertices[v].x, mesh_.vertices[v].y, sum / count);
    }
  }
  return lifted;
}

}  // namespace sgf::stereo::internal
