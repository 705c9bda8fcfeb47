#pragma once

#include <string>
#include <string_view>

namespace sgf {

/// Checks the header of an OpenEXR file before the library sees it ("OpenEXR File Layout",
/// openexr.com): one part of scan lines, and attributes that end within the file and have the size
/// that their type has. The library allocates whatever an attribute claims; where it reads another
/// number of bytes than the attribute claims, it takes what follows for the next attribute.
/// @return the file's version field.
/// @throws Error with `where`, saying what is wrong.
int RequireSoundExrHeader(std::string_view bytes, const std::string& where);

}  // namespace sgf
