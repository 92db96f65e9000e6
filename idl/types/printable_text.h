#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tenon {

/// The text as it may stand in a line of a log, a terminal or a page: control characters (line breaks,
/// terminal escapes, changes of the writing direction) are spaces, and bytes that are not UTF-8 are question
/// marks. For texts that people and other programs send.
[[nodiscard]] std::string printable(std::string_view text);

/// The longest begin of a text in UTF-8 that has at most `most` bytes and no cut character.
[[nodiscard]] std::string shortened(std::string_view text, std::size_t most);

}  // namespace tenon
