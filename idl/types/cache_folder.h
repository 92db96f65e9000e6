#pragma once

#include <filesystem>

namespace tenon {

/// Folder for data that can be generated again: $TENON_CACHE, $XDG_CACHE_HOME/tenon or ~/.cache/tenon;
/// without any of these variables, or where they are empty, tenon in the temporary folder.
///
/// Threads: any, while none changes the environment. Real-time: no.
[[nodiscard]] std::filesystem::path defaultCache();

}  // namespace tenon
