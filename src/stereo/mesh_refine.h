#pragma once

// Internal to sgf::stereo: from planes on triangles to a dense disparity map.

#include <vector>

#include <opencv2/core.hpp>

#include <sgf/stereo/mesh.h>
#include <sgf/stereo/mesh_stereo.h>
#include <sgf/stereo/plane_cost.h>

namespace sgf::stereo::internal {

/// Disparities of all pixels under their triangles' planes, cut to the range searched, px.
cv::Mat1f Render(const TriangleMesh& mesh, const std::vector<Plane>& planes, int min_disparity,
                 int num_disparities);

/// 255 where the disparity of the pixel's partner in the other image differs by no more than
/// `largest` px, else 0.
cv::Mat1b CheckLeftRight(const cv::Mat1f& left, const cv::Mat1f& right, double largest);

/// Replaces the disparities of pixels that are not valid by the median over the window around them
/// (`median_window`; 0 changes nothing), weighted by likeness of colour as SupportWindows are.
/// Medians are in steps of 1/8 px.
void MedianOfInvalid(const cv::Mat& image, const cv::Mat1b& valid, const MeshStereoOptions& options,
                     cv::Mat1f& disparity);

}  // namespace sgf::stereo::internal
