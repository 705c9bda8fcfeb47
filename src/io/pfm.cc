#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/pfm.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

constexpr std::string_view kBlanks = " \t\n\v\f\r";

struct PfmHeader {
  int width = 0;
  int height = 0;
  std::endian byte_order = std::endian::little;
};

// Takes blanks, a word and the one blank after it off the front of `rest`.
std::string_view TakeWord(std::string_view& rest) {
  rest.remove_prefix(std::min(rest.find_first_not_of(kBlanks), rest.size()));
  const std::string_view word = rest.substr(0, rest.find_first_of(kBlanks));
  rest.remove_prefix(std::min(word.size() + 1, rest.size()));
  return word;
}

template <class T>
T TakeNumber(std::string_view& rest, const char* name, const std::string& where) {
  const std::string_view word = TakeWord(rest);
  T value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size())
    throw Error(where, fmt::format("PFM {} is {}", name, Printable(word)));
  return value;
}

PfmHeader TakeHeader(std::string_view& rest, const std::string& where) {
  const std::string_view magic = TakeWord(rest);
  if (magic == "PF") throw Error(where, "is a colour PFM (PF); one channel (Pf) is needed");
  if (magic != "Pf") throw Error(where, fmt::format("is no PFM: begins with {}", Printable(magic)));
  PfmHeader header;
  header.width = TakeNumber<int>(rest, "width", where);
  header.height = TakeNumber<int>(rest, "height", where);
  if (header.width < 1 || header.height < 1)
    throw Error(where, fmt::format("PFM size is {}x{}", header.width, header.height));
  const auto scale = TakeNumber<double>(rest, "scale", where);
  if (!std::isfinite(scale) || scale == 0)
    throw Error(where, fmt::format("PFM scale is {}", scale));
  header.byte_order = scale < 0 ? std::endian::little : std::endian::big;
  return header;
}

// Also keeps a damaged header from deciding how much memory is allocated.
void RequireDataSize(const PfmHeader& header, size_t available, const std::string& where) {
  const int64_t needed = int64_t{header.width} * header.height;
  if (static_cast<int64_t>(available / sizeof(float)) < needed)
    throw Error(where, fmt::format("truncated PFM: {}x{} values of 4 bytes, but {} bytes of data",
                                   header.width, header.height, available));
  if (available != static_cast<size_t>(needed) * sizeof(float))
    throw Error(where, fmt::format("PFM has {} bytes after its {}x{} values",
                                   available - static_cast<size_t>(needed) * sizeof(float),
                                   header.width, header.height));
}

// Changes floats between the machine's byte order and another one, in place.
void ConvertByteOrder(std::endian order, float* values, int count) {
  if (order == std::endian::native) return;
  auto* bytes = reinterpret_cast<char*>(values);
  for (int i = 0; i < count; ++i, bytes += sizeof(float))
    std::reverse(bytes, bytes + sizeof(float));
}

}  // namespace

cv::Mat1f ReadPfm(const std::filesystem::path& path) {
  const std::string bytes = ReadFile(path);
  std::string_view rest = bytes;
  const PfmHeader header = TakeHeader(rest, path.string());
  RequireDataSize(header, rest.size(), path.string());
  cv::Mat1f image(header.height, header.width);
  const size_t row_bytes = header.width * sizeof(float);
  for (int y = header.height - 1; y >= 0; --y, rest.remove_prefix(row_bytes)) {
    std::memcpy(image[y], rest.data(), row_bytes);
    ConvertByteOrder(header.byte_order, image[y], header.width);
  }
  return image;
}

void WritePfm(const std::filesystem::path& path, const cv::Mat1f& image) {
  if (image.empty()) throw Error(path.string(), "cannot write an empty image");
  AtomicFile file(path);
  file.Write(fmt::format("Pf\n{} {}\n-1\n", image.cols, image.rows));
  for (int y = image.rows - 1; y >= 0; --y) {
    cv::Mat1f row = image.row(y).clone();
    ConvertByteOrder(std::endian::little, row[0], row.cols);
    file.Write({reinterpret_cast<const char*>(row[0]), row.cols * sizeof(float)});
  }
  file.Commit();
}

}  // namespace sgf
