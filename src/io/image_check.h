#pragma once

#include <string>
#include <string_view>

namespace sgf {

/// Checks the container of an encoded image before a decoder sees it, because decoders hand out
/// half-filled images (JPEG), print, or allocate what a damaged header asks for:
///   - PNG: every chunk is there to IEND and its CRC-32 is right (PNG specification, 5.3, 5.4);
///   - JPEG: every segment and scan is there to the EOI marker (ITU-T T.81, annex B). JPEG has no
///     checksum: damage inside a scan cannot be told from content;
///   - binary PGM and PPM: header, and as many samples as it promises.
/// Dimensions must be positive and the pixels must fit into the data at the best ratio that the
/// compression can reach.
/// @param where names the file in messages.
/// @throws Error naming what is wrong; for any other format too, naming those that are read.
void RequireCompleteImage(std::string_view bytes, const std::string& where);

}  // namespace sgf
