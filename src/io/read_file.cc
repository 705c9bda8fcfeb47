#include <fstream>
#include <system_error>

#include <sgf/core/error.h>
#include <sgf/io/read_file.h>

namespace sgf {

std::string ReadFile(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw Error(path.string(), "file does not exist");
  if (!std::filesystem::is_regular_file(path, error))
    throw Error(path.string(), "is not a regular file");
  const auto size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) throw Error(path.string(), "cannot be read");
  std::string bytes(size, '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(size)))
    throw Error(path.string(), "cannot be read to its end");
  return bytes;
}

std::string Printable(std::string_view text) {
  constexpr size_t kMaxLength = 32;
  std::string quoted = "'";
  for (const char c : text.substr(0, kMaxLength)) quoted += (c >= ' ' && c <= '~') ? c : '?';
  return quoted + (text.size() > kMaxLength ? "...'" : "'");
}

}  // namespace sgf
