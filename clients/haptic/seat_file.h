#pragma once

#include <filesystem>
#include <string>

#include "idl/types/result.h"

namespace tenon {

/// Where a station keeps the token of its seat, so that it gets its hands and what they held back when it is
/// started again. A token of another session or server is harmless: that server gives a new seat.
///
/// Threads: any. Real-time: no.

/// Empty when there is no such file.
[[nodiscard]] std::string readToken(const std::filesystem::path& file);
/// For the owner's eyes alone. An empty path keeps nothing.
[[nodiscard]] Result<void> keepToken(const std::filesystem::path& file, const std::string& token);

}  // namespace tenon
