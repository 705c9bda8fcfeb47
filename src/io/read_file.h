#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace sgf {

/// Whole content of a file.
/// @throws Error naming the path when it is missing, is no regular file or cannot be read.
std::string ReadFile(const std::filesystem::path& path);

/// Text from an untrusted file as it can stand in a message: quoted, what is not printable ASCII
/// replaced by '?', and cut after 32 characters.
std::string Printable(std::string_view text);

}  // namespace sgf
