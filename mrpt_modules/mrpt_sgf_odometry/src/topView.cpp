/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <mrpt/core/format.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/sgf/topView.h>

#include <algorithm>
#include <cmath>

namespace mrpt::sgf
{
using mrpt::img::CImage;
using mrpt::img::TColor;
using mrpt::math::TPoint3Df;
using mrpt::math::TPose3D;

namespace
{
struct TRange
{
	double low = 0, high = 0;
	double size() const { return high - low; }
};

// All but the outermost two per cent: far points would make the rest tiny.
TRange bulk(std::vector<double> values)
{
	if (values.empty()) return {};
	std::sort(values.begin(), values.end());
	const size_t cut = values.size() / 50;
	return {values[cut], values[values.size() - 1 - cut]};
}

void include(TRange& range, double value)
{
	range.low = std::min(range.low, value);
	range.high = std::max(range.high, value);
}

// Where the picture lies in the world.
struct TFrame2D
{
	TRange x, y;
	double px_per_m = 1;

	int column(double at) const
	{
		return margin + int((at - x.low) * px_per_m);
	}
	int row(double at) const { return margin + int((y.high - at) * px_per_m); }
	int columns() const { return 2 * margin + int(x.size() * px_per_m) + 1; }
	int rows() const { return 2 * margin + int(y.size() * px_per_m) + 1; }

	static constexpr int margin = 30;  // px
};

std::vector<double> coordinates(
	const std::vector<TPoint3Df>& points, float TPoint3Df::*which)
{
	std::vector<double> values;
	for (const auto& p : points) values.push_back(p.*which);
	return values;
}

TFrame2D fit(
	const std::vector<TPoint3Df>& points, const std::vector<TPose3D>& path,
	int side_px)
{
	TFrame2D frame{
		bulk(coordinates(points, &TPoint3Df::x)),
		bulk(coordinates(points, &TPoint3Df::y))};
	for (const auto& pose : path)
	{
		include(frame.x, pose.x);
		include(frame.y, pose.y);
	}
	const double side_m = std::max({frame.x.size(), frame.y.size(), 1e-3});
	frame.px_per_m = (side_px - 2 * TFrame2D::margin) / side_m;
	return frame;
}

void drawPoints(
	CImage& image, const TFrame2D& frame, const std::vector<TPoint3Df>& points)
{
	const TRange heights = bulk(coordinates(points, &TPoint3Df::z));
	for (const auto& p : points)
	{
		const double share =
			(p.z - heights.low) / std::max(heights.size(), 1e-6);
		const auto grey =
			static_cast<uint8_t>(210 - 170 * std::clamp(share, 0.0, 1.0));
		const int x = frame.column(p.x), y = frame.row(p.y);
		image.filledRectangle(x, y, x + 1, y + 1, TColor(grey, grey, grey));
	}
}

void drawPath(
	CImage& image, const TFrame2D& frame, const std::vector<TPose3D>& path)
{
	for (size_t i = 1; i < path.size(); ++i)
		image.line(
			frame.column(path[i - 1].x), frame.row(path[i - 1].y),
			frame.column(path[i].x), frame.row(path[i].y), TColor(30, 60, 220),
			2);
	if (!path.empty())
		image.drawCircle(
			frame.column(path.back().x), frame.row(path.back().y), 5,
			TColor(220, 30, 30), 2);
}

// A bar of the longest round length that is at most a quarter of the picture.
void drawScale(CImage& image, const TFrame2D& frame)
{
	const double limit_m = frame.columns() / (4 * frame.px_per_m);
	double length_m = std::pow(10, std::floor(std::log10(limit_m)));
	for (const double factor : {5.0, 2.0})
		if (length_m * factor <= limit_m)
		{
			length_m *= factor;
			break;
		}
	const int row = frame.rows() - 12;
	const int end = TFrame2D::margin + int(length_m * frame.px_per_m);
	image.line(TFrame2D::margin, row, end, row, TColor::black(), 2);
	image.textOut(
		end + 6, row - 8, mrpt::format("%g m", length_m), TColor::black());
}

}  // namespace

CImage topView(
	const mrpt::maps::CPointsMap& points, const std::vector<TPose3D>& path,
	int side_px)
{
	std::vector<TPoint3Df> all(points.size());
	for (size_t i = 0; i < all.size(); ++i)
		points.getPointFast(i, all[i].x, all[i].y, all[i].z);
	const TFrame2D frame = fit(all, path, side_px);
	CImage image(frame.columns(), frame.rows(), mrpt::img::CH_RGB);
	image.filledRectangle(
		0, 0, frame.columns() - 1, frame.rows() - 1, TColor::white());
	drawPoints(image, frame, all);
	drawPath(image, frame, path);
	drawScale(image, frame);
	return image;
}

void insertPoints(
	const mrpt::maps::CSimpleMap& map, mrpt::maps::CPointsMap& points)
{
	for (size_t i = 0; i < map.size(); ++i)
	{
		const auto [pose, frame] = map.get(i);
		const mrpt::poses::CPose3D mean = pose->getMeanVal();
		frame->insertObservationsInto(points, mean);
	}
}

}  // namespace mrpt::sgf
