#pragma once

#include <string>

#include <sgf/core/camera.h>
#include <sgf/core/se3.h>
#include <sgf/io/exr.h>
#include <sgf/synth/renderer.h>

namespace sgf::synth {

/// A frame as layers of an EXR image: R, G, B (half: the radiance of all light groups together),
/// light.GROUP.R, .G, .B and diffuse.R, .G, .B (half), N.X, N.Y, N.Z (half), Z (float, m) and id
/// (uint).
ExrImage ToExr(const Frame& frame, const Camera& camera, const SE3& T_world_cam);

/// The inverse of ToExr, to half precision for all but depth and id.
/// @param where what error messages call the image: its path.
/// @throws Error naming a layer that is missing or not of floating-point numbers.
Frame FromExr(const ExrImage& image, const std::string& where);

}  // namespace sgf::synth
