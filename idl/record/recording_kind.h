#pragma once

#include <filesystem>
#include <string>

#include "idl/record/mcap_reader.h"
#include "idl/types/result.h"

namespace tenon::record {

/// Why an MCAP file is no recording of a session, what it is instead, and what reads it; empty: it is one.
[[nodiscard]] std::string refusalOfKind(const McapReader& reader, const std::filesystem::path& file);

/// Fails with a sentence when a player cannot play `file`: it is no recording of a session, or was cut off,
/// and so has no index.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<void> checkPlayable(const std::filesystem::path& file);

}  // namespace tenon::record
