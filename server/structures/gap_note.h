#pragma once

#include <string_view>

namespace tenon::structures {

/// The line of StructureInfo::notes that begins with this is printed whenever the object is loaded.
inline constexpr std::string_view kGapNote = "narrow gaps: ";

}  // namespace tenon::structures
