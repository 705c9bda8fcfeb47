/* +------------------------------------------------------------------------+
   |                 mrpt-sgf-odometry, a module for MRPT                   |
   |                                                                        |
   | Copyright (c) 2026, The beyond-photometric contributors                |
   | Released under the BSD 3-Clause License: see file LICENSE              |
   +------------------------------------------------------------------------+ */
#pragma once

#include <exception>
#include <string>

namespace mrpt::sgf::internal
{
/** What an exception says, without the call stack that MRPT puts around it. */
inline std::string messageOf(const std::exception& e)
{
	const std::string text = e.what();
	const std::string kBegin = "Message:";
	const auto at = text.find(kBegin);
	if (at == std::string::npos) return text;
	const auto begin = text.find_first_not_of(" \n", at + kBegin.size());
	return text.substr(begin, text.find('\n', begin) - begin);
}

}  // namespace mrpt::sgf::internal
