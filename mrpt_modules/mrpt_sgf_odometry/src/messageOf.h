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
/** What an exception says, in one line, without the heading and the call stack
 * that MRPT puts around it. */
inline std::string messageOf(const std::exception& e)
{
	const std::string text = e.what();
	const std::string kBegin = "Message:";
	const auto at = text.find(kBegin);
	size_t begin = 0;
	if (at != std::string::npos)
		begin = at + kBegin.size();
	else if (text.rfind("====", 0) == 0)
		begin = text.find('\n');
	begin = text.find_first_not_of(" \n", begin);
	if (begin == std::string::npos) return text;
	return text.substr(begin, text.find('\n', begin) - begin);
}

}  // namespace mrpt::sgf::internal
