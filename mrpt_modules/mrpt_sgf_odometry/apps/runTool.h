/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include <sgf/apps/cli.h>

#include <mrpt/sgf/CObservationSource.h>

#include <cstdio>

#include "../src/messageOf.h"

namespace mrpt::sgf::apps
{
/** Parses the command line and runs the tool's body.
 * \return the exit code: 2, after a line on stderr, for a bad command line and
 * for bad input */
inline int runTool(
	CLI::App& app, int argc, char** argv, const std::function<void()>& body)
{
	return ::sgf::apps::RunTool(
		app, argc, argv,
		[&]
		{
			try
			{
				body();
			}
			catch (const std::exception& e)
			{
				throw ::sgf::Error("", internal::messageOf(e));
			}
		});
}

/** Prints how many frames the source has left out, if any. */
inline void reportIncomplete(const CObservationSource& source)
{
	if (const size_t count = source.incompleteFrames())
		std::printf("left out: %zu x frame with a missing file\n", count);
}

}  // namespace mrpt::sgf::apps
