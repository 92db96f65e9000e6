#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "clients/haptic/station.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon {

struct StationProgramOptions {
  MembershipWishes link;                        ///< role and hands are the station's own
  std::filesystem::path seat;                   ///< file of the seat's token; empty: a new seat each time
  bool real_time = true;                        ///< ask for SCHED_FIFO and locked memory
  std::string language = "en";                  ///< of the instructions said
  std::function<void(const std::string&)> say;  ///< to the person at the terminal
};

/// Runs a station in a session until the run is over or `stop` is set. When the server has lost it, or it the
/// server, it looks for its seat as long as the link's patience. By the clock, a servo thread steps the
/// station each millisecond and never touches the network, and this thread carries the messages; in lockstep,
/// one thread does both, a step for each tick it has heard completely.
///
/// Threads: the caller becomes the wire thread. Real-time: the servo thread's loop.
Result<RunState> runStation(Station& station, const StationProgramOptions& options,
                            const std::atomic<bool>& stop);

/// Set by SIGINT and SIGTERM from the first call on.
[[nodiscard]] const std::atomic<bool>& stopSignal();

}  // namespace tenon
