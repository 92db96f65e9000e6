#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "idl/record/mcap_reader.h"
#include "idl/types/result.h"

namespace tenon::record {

/// Why an MCAP file is no recording of a session, what it is instead, and what reads it; empty: it is one.
[[nodiscard]] std::string refusalOfKind(const McapReader& reader, const std::filesystem::path& file);

/// Fails with a sentence, and what reads it, when a player cannot play `file`: it is no recording of a
/// session, it was cut off and so has no index, its index is wrong, or a chunk is damaged: nearly each one
/// has states and events, all of which a player reads before it begins. Else the damage that it can be played
/// with, or nothing. Reads all of the file, unless `stop` is set meanwhile;
/// `progress` gets the fraction of it that is checked.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::string> checkPlayable(const std::filesystem::path& file,
                                                const std::atomic<bool>& stop,
                                                const std::function<void(double)>& progress = {});

}  // namespace tenon::record
