#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/result.h"
#include "server/session/journal.h"
#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"

namespace tenon::session {

/// What a journal holds of a session whose server was killed.
struct ResumePoint {
  Tick tick = 0;        ///< the last one that can be computed again
  Tick checkpoint = 0;  ///< of the state from which it was
  std::string problem;  ///< damage of the file before its end, or empty
  /// Up to `tick`, of the last kKeptForRecorders ticks or since the checkpoint, with the checkpoints.
  std::vector<JournalEntry> entries;
};

/// Brings `simulation` into the state after the last tick of a killed server's journal: restores the last
/// checkpoint and simulates the inputs after it, comparing each hash. Reads the end of the file, and more of
/// it only where that has no checkpoint; changes nothing in it. Of a server that was killed before the first
/// tick, the state is left as it is.
///
/// Fails, with what to do, when the file cannot be read, is no server's journal, is that of a session that
/// has ended, was written with another scenario, has no checkpoint, or simulates differently here.
/// `simulation` is undefined then.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<ResumePoint> readResumePoint(const std::filesystem::path& journal,
                                                  const LoadedScene& loaded, SessionSimulation& simulation);

}  // namespace tenon::session
