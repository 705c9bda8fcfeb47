#pragma once

#include <span>

#include <sgf/core/gradient.h>

/// Rows of SampleChannels and GradientChannels images, made by SIMD code that is chosen at run
/// time. The same bits for every instruction set.
namespace sgf::alignment::internal {

/// A row of a grey image with its neighbours; at the image's border it is its own.
struct GreyRows {
  const float* above;
  const float* row;
  const float* below;
  int width;  ///< px, at least 1
};

/// Sum over a row of the squared gradient magnitudes, (grey levels/px)^2.
double SumSquaredGradient(const GreyRows& rows, GradientOperator op);

/// Writes a row of interleaved gradients.
/// @param out 2 * width floats.
/// @return sum of their squared magnitudes.
double MakeGradientRow(const GreyRows& rows, GradientOperator op, float* out);

/// Writes a row of interleaved channels: intensity, gradient and epsilon.
/// @param epsilon of each pixel, or one for all.
/// @param out 4 * width floats.
void MakeSampleRow(const GreyRows& rows, GradientOperator op, std::span<const float> epsilon,
                   float* out);

}  // namespace sgf::alignment::internal
