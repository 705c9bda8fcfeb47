#pragma once

// Internal to sgf::stereo: slanted planes on a triangle mesh, found by minimising MeshStereo's
// energy.

#include <array>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/stereo/mesh.h>
#include <sgf/stereo/mesh_stereo.h>
#include <sgf/stereo/plane_cost.h>

namespace sgf::stereo::internal {

/// The planes of one image's triangles.
///
/// Energy: E = sum_i phi_i(D_i) + lambda * sum_e psi_e. phi_i is the mean cost of plane D_i over
/// the support window of triangle i. For two triangles that share edge e, Delta_e^2 is the mean
/// squared gap between their planes at the edge's two vertices. Whether they are connected there or
/// split is a line process z_e in [0, 1] (1: connected; 1 - z_e is the splitting probability):
///
///     psi_e = min over z of z Delta_e^2 + tau_e (sqrt(z) - 1)^2 = tau_e Delta_e^2 / (tau_e +
///     Delta_e^2)
///
/// at z = (tau_e / (tau_e + Delta_e^2))^2 (Black and Rangarajan, IJCV 1996). tau_e, the price of a
/// split, is lower where the triangles' colours differ: splits follow intensity edges. In
/// MeshStereo splitting probabilities belong to vertices; here each pair of neighbours has one, in
/// closed form.
class PlaneField {
 public:
  /// @param mesh, windows, options have to outlive this.
  PlaneField(const VolumeView& view, const TriangleMesh& mesh, const SupportWindows& windows,
             const cv::Mat& image, const MeshStereoOptions& options, uint64_t seed);

  /// Fits each triangle's plane to a disparity map.
  /// @param guess px, finite.
  void Initialise(const cv::Mat1f& guess);

  /// One round of PatchMatch: each triangle tries its neighbours' planes, again and again, then
  /// that of the other image, the aligned one, and random changes of its own. At lambda held fixed
  /// the energy never rises; it grows evenly with the rounds up to its full value.
  /// @param direction 1 where the other image's pixel is x - d, -1 where it is x + d.
  void Sweep(const PlaneField& other, int direction, int round);

  /// Moves that no single triangle can make: a group of connected triangles, split from all around
  /// it, takes over the planes of its surroundings where that lowers the energy.
  void DissolveIslands();

  /// The mesh step: least-squares disparities of the triangles' corners, pulled together at shared
  /// vertices as strongly as their triangles are connected; the next Sweep() tries them.
  void Align();

  /// Gives triangles of which no more than half is valid the planes of their surroundings.
  void FillUnconfirmed(const cv::Mat1b& valid);

  const std::vector<Plane>& planes() const { return planes_; }

  /// The mesh in three dimensions: at a vertex, triangles that follow one another around it and are
  /// connected (z >= 1/4: a gap no larger than the one a split costs) share one disparity.
  DisparityMesh Lift() const;

 private:
  using Fan = std::vector<std::array<int, 2>>;  // triangles around a vertex and their corners there

  cv::Point2f Corner(int i, int k) const { return mesh_.Corner(i, k) - cv::Point2f(0.5F, 0.5F); }
  cv::Point2f Centre(int i) const { return mesh_.Barycentre(i) - cv::Point2f(0.5F, 0.5F); }

  void ColourTriangles();
  void CompareColours(const cv::Mat& image);

  Plane FitPlane(const cv::Mat1f& guess, int i) const;
  bool Admissible(int i, const Plane& plane) const;
  float SquaredGap(int i, int k, const Plane& plane) const;
  float Penalty(int i, int k, const Plane& plane) const;
  float Smoothness(int i, const Plane& plane) const;
  float Energy(int i) const;
  float Connection(int i, int k) const;
  bool IsConnected(int i, int k) const { return Connection(i, k) >= 0.25F; }

  void Try(int i, const Plane& plane, float& best);
  void TryNeighbours(int i);
  void TryOtherView(int i, const PlaneField& other, int direction, float& best);
  void TryAligned(int i, float& best);
  void TryRandom(int i, int round, float& best);

  std::vector<Plane> Extend(const std::vector<int>& members, const std::vector<int>& label,
                            int own) const;
  std::vector<std::vector<int>> Groups(std::vector<int>& label) const;
  void Dissolve(const std::vector<int>& members, const std::vector<int>& label, int own);
  double GroupEnergy(const std::vector<int>& members, const std::vector<int>& label, int own) const;

  void AlignVertex(const Fan& fan);
  std::vector<int> GroupFan(const Fan& fan) const;

  VolumeView view_;
  const TriangleMesh& mesh_;
  const SupportWindows& windows_;
  const MeshStereoOptions& options_;
  uint64_t seed_;
  float lambda_ = 0;  // in the present round
  std::vector<Plane> planes_;
  std::vector<float> data_;                     // phi of each plane
  std::vector<uint32_t> version_;               // counts the changes of a plane
  std::vector<std::array<uint32_t, 3>> tried_;  // version of each neighbour when last tried
  std::vector<std::array<float, 3>> likeness_;  // of colours across each edge, in (0, 1]
  std::vector<std::array<float, 3>> price_;     // tau of each edge, px^2
  std::vector<std::array<float, 3>> aligned_;   // corner disparities, px
  std::vector<Fan> fans_;                       // by vertex
  std::vector<std::vector<int>> classes_;       // no two neighbours in one
};

}  // namespace sgf::stereo::internal
