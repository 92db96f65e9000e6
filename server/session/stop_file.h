#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "idl/types/result.h"
#include "idl/types/stop_truth.h"

/// The raises of a session's emergency stop, and which of them were cleared, over a crash of the server.
///
/// Threads: any. Real-time: no.
namespace tenon::session {

/// Where `tenon serve` keeps them: $XDG_STATE_HOME/tenon, else ~/.local/state/tenon; empty without a home.
[[nodiscard]] std::filesystem::path defaultStopFile(std::uint32_t domain, const std::string& session);
/// What to say when there is no such place.
inline constexpr const char* kNoStopFile =
    "neither HOME nor XDG_STATE_HOME is set: an emergency stop will not stand after a restart of this server";
/// What the file has; nothing when it does not exist. Fails when it cannot be read or is damaged.
[[nodiscard]] Result<StopTruth> readStopFile(const std::filesystem::path& file);
/// Replaces the file; on disk, with its folder, when this returns. An empty path writes nothing.
[[nodiscard]] Result<void> writeStopFile(const std::filesystem::path& file, const StopTruth& truth);

}  // namespace tenon::session
