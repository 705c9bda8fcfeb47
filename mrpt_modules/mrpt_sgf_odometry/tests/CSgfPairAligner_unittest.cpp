/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#include <gtest/gtest.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/sgf/CSgfPairAligner.h>

#include "syntheticRoom.h"

using namespace mrpt::sgf;
using mrpt::poses::CPose3D;
using mrpt::sgf::testing::CRoom;

namespace
{
const CPose3D kFirst(0.5, -0.3, 0.1, mrpt::DEG2RAD(20.0), 0.05, -0.04);
const CPose3D kMotion(0.15, 0.1, -0.05, mrpt::DEG2RAD(5.0), 0.03, 0.06);
const CPose3D kGuess(0.1, 0.05, 0, mrpt::DEG2RAD(4.0), 0.01, 0.03);
}  // namespace

TEST(CSgfPairAligner, FindsTheMotionAndItsInverse)
{
	CSgfPairAligner aligner{CSgfOdometry::TParams()};
	const auto a = aligner.makeView(*CRoom::stereo(kFirst, 1));
	const auto b = aligner.makeView(*CRoom::stereo(kFirst + kMotion, 500));
	ASSERT_TRUE(a && b);
	const auto there = aligner.align(*a, *b, kGuess);
	ASSERT_TRUE(there.ok);
	EXPECT_LT((there.motion.mean - kMotion).norm(), 0.02);
	EXPECT_GT(there.inlierShare, 0.6);
	EXPECT_GT(there.motion.cov.asEigen().diagonal().minCoeff(), 0);
	const auto back = aligner.align(*b, *a, -kGuess);
	ASSERT_TRUE(back.ok);
	EXPECT_LT((there.motion.mean + back.motion.mean).norm(), 0.03);
}

TEST(CSgfPairAligner, OtherPlacesDoNotFit)
{
	CSgfPairAligner aligner{CSgfOdometry::TParams()};
	const auto a = aligner.makeView(*CRoom::stereo(kFirst, 1));
	const CPose3D turnedAround(0, 0, 0, mrpt::DEG2RAD(180.0), 0, 0);
	const auto b = aligner.makeView(*CRoom::stereo(turnedAround, 2));
	const auto outcome = aligner.align(*a, *b, CPose3D());
	EXPECT_FALSE(outcome.ok && outcome.inlierShare > 0.6);
}

TEST(CSgfPairAligner, NoViewOfWhatCannotBeUsed)
{
	CSgfPairAligner aligner{CSgfOdometry::TParams()};
	EXPECT_FALSE(aligner.makeView(mrpt::obs::CObservationImage()));
	auto bad = CRoom::stereo({}, 1);
	bad->hasImageRight = false;
	EXPECT_FALSE(aligner.makeView(*bad));
	EXPECT_TRUE(aligner.makeView(*CRoom::stereo({}, 1)));
}
