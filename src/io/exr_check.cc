#include <algorithm>
#include <cstdint>
#include <utility>

#include <ImfVersion.h>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/io/exr_check.h>
#include <sgf/io/read_file.h>

namespace sgf {
namespace {

// Takes a number of bytes off the front of `rest`.
std::string_view Take(std::string_view& rest, size_t count, const std::string& where) {
  if (rest.size() < count) throw Error(where, "truncated OpenEXR header");
  const std::string_view taken = rest.substr(0, count);
  rest.remove_prefix(count);
  return taken;
}

uint32_t TakeUint32(std::string_view& rest, const std::string& where) {
  uint32_t value = 0;
  for (int shift = 0; const char byte : Take(rest, 4, where)) {
    value |= uint32_t{static_cast<unsigned char>(byte)} << shift;
    shift += 8;
  }
  return value;
}

std::string_view TakeName(std::string_view& rest, const std::string& where) {
  const std::string_view name = Take(rest, std::min(rest.find('\0'), rest.size()), where);
  Take(rest, 1, where);
  return name;
}

void RequireScanLines(int version, const std::string& where) {
  if (Imf::isMultiPart(version)) throw Error(where, "has several parts; one is needed");
  if (Imf::isNonImage(version)) throw Error(where, "is a deep image");
  if (Imf::isTiled(version)) throw Error(where, "is tiled; scan lines are needed");
}

// Whether the channels, a name and 16 bytes each, and the empty name after them fill a list.
bool IsChannelList(std::string_view list, const std::string& where) {
  constexpr size_t kChannelBytes = 16;
  while (!TakeName(list, where).empty()) Take(list, kChannelBytes, where);
  return list.empty();
}

bool IsStringVector(std::string_view strings, const std::string& where) {
  while (!strings.empty()) Take(strings, TakeUint32(strings, where), where);
  return true;
}

// A small image of four bytes a pixel, behind its sizes.
bool IsPreview(std::string_view preview, const std::string& where) {
  const uint64_t width = TakeUint32(preview, where), height = TakeUint32(preview, where);
  return preview.size() % 4 == 0 && width < UINT32_MAX / 4 && height < UINT32_MAX / 4 &&
         width * height == preview.size() / 4;
}

// The size of a type that always has the same; 0 for any other.
size_t FixedSize(std::string_view type) {
  static constexpr std::pair<std::string_view, size_t> kSizes[] = {
      {"box2f", 16},      {"box2i", 16},    {"chromaticities", 32},
      {"compression", 1}, {"double", 8},    {"deepImageState", 1},
      {"envmap", 1},      {"float", 4},     {"int", 4},
      {"keycode", 28},    {"lineOrder", 1}, {"m33d", 72},
      {"m33f", 36},       {"m44d", 128},    {"m44f", 64},
      {"rational", 8},    {"tiledesc", 9},  {"timecode", 8},
      {"v2d", 16},        {"v2f", 8},       {"v2i", 8},
      {"v3d", 24},        {"v3f", 12},      {"v3i", 12}};
  for (const auto& [name, size] : kSizes)
    if (name == type) return size;
  return 0;
}

bool HasSizeOfItsType(std::string_view type, std::string_view data, const std::string& where) {
  if (const size_t size = FixedSize(type)) return data.size() == size;
  if (type == "chlist") return IsChannelList(data, where);
  if (type == "stringvector") return IsStringVector(data, where);
  if (type == "preview") return IsPreview(data, where);
  if (type == "floatvector") return data.size() % sizeof(float) == 0;
  return true;
}

}  // namespace

int RequireSoundExrHeader(std::string_view bytes, const std::string& where) {
  if (!Imf::isImfMagic(std::string(bytes.substr(0, 4)).append(4, '\0').c_str()))
    throw Error(where, "is no OpenEXR file");
  bytes.remove_prefix(4);
  const auto version = static_cast<int>(TakeUint32(bytes, where));
  RequireScanLines(version, where);
  for (std::string_view name = TakeName(bytes, where); !name.empty();
       name = TakeName(bytes, where)) {
    const std::string_view type = TakeName(bytes, where);
    const std::string_view data = Take(bytes, TakeUint32(bytes, where), where);
    if (!HasSizeOfItsType(type, data, where))
      throw Error(where, fmt::format("header attribute {} of type {} has {} bytes: damaged header",
                                     Printable(name), Printable(type), data.size()));
  }
  return version;
}

}  // namespace sgf
