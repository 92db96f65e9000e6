#pragma once

#include <filesystem>
#include <optional>

#include "idl/types/result.h"
#include "idl/wire/identity.h"

namespace tenon::haptic {

/// File with the secret key of a station's seat: a restarted station gets its hands back, with the objects
/// they held. A server that does not know the seat assigns a new one.
///
/// Threads: any. Real-time: no.

/// False when the file has more than a key in it: it is another file, which must not be replaced.
[[nodiscard]] bool mayBeSeatFile(const std::filesystem::path& file);
/// None when the file does not exist or holds no valid key.
[[nodiscard]] std::optional<wire::SeatKey> readSeatKey(const std::filesystem::path& file);
/// Creates or replaces the file, readable by its owner only. An empty path writes nothing. Fails when the
/// file cannot be written.
[[nodiscard]] Result<void> writeSeatKey(const std::filesystem::path& file, const wire::SeatKey& seat);

}  // namespace tenon::haptic
