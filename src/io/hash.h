#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace sgf {

/// SHA-256 (FIPS 180-4) of some bytes, as 64 lower-case hexadecimal digits.
std::string Sha256(std::string_view bytes);

/// SHA-256 of a file's content, read in blocks.
/// @throws Error naming the path when it is missing, no regular file or cannot be read.
std::string Sha256OfFile(const std::filesystem::path& path);

}  // namespace sgf
