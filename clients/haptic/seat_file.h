#pragma once

#include <filesystem>
#include <string>

#include "idl/types/result.h"

namespace tenon::haptic {

/// File with the token of a station's seat: a restarted station gets its hands back, with the objects they
/// held. A server that does not know the token assigns a new seat.
///
/// Threads: any. Real-time: no.

/// False when the file has more than a token in it: it is another file, which must not be replaced.
[[nodiscard]] bool mayBeSeatFile(const std::filesystem::path& file);
/// The token; empty when the file does not exist or holds no valid token.
[[nodiscard]] std::string readSeatToken(const std::filesystem::path& file);
/// Creates or replaces the file, readable by its owner only. An empty path writes nothing. Fails when the
/// file cannot be written.
[[nodiscard]] Result<void> writeSeatToken(const std::filesystem::path& file, const std::string& token);

}  // namespace tenon::haptic
