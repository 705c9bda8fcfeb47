/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <mrpt/img/CImage.h>
#include <mrpt/maps/CPointsMap.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/math/TPose3D.h>

#include <vector>

namespace mrpt::sgf
{
/** Draws points (grey, the higher the darker) and a path (blue, its end red)
 * as seen from above, x to the right and y up, with a scale bar. Needs no
 * display.
 * \param side_px of the longer side of the picture
 * \ingroup mrpt_sgf_odometry_grp */
mrpt::img::CImage topView(
	const mrpt::maps::CPointsMap& points,
	const std::vector<mrpt::math::TPose3D>& path, int side_px = 1000);

/** All points of the range scans of a map of key-frames, in map coordinates.
 * \ingroup mrpt_sgf_odometry_grp */
void insertPoints(
	const mrpt::maps::CSimpleMap& map, mrpt::maps::CPointsMap& points);

}  // namespace mrpt::sgf
