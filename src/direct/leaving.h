#pragma once

#include <span>
#include <vector>

#include <sgf/direct/direct_odometry.h>
#include <sgf/direct/frame.h>

namespace sgf::direct {

/// Key-frames that leave a window: those the newest one hardly sees and, if there are still too
/// many, the one that is far from the newest and near to others (Engel, Koltun, Cremers, 2018, eq.
/// 20).
/// @return positions in the window.
std::vector<int> LeavingKeyframes(const Window& window, const DirectOptions& options);

/// Whether each point of each key-frame leaves: its key-frame does, or neither of the last two
/// key-frames sees it.
/// @param leaving positions of the key-frames that leave.
std::vector<std::vector<char>> LeavingPoints(const Window& window, std::span<const int> leaving);

}  // namespace sgf::direct
