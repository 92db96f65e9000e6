#pragma once

#include <cstdint>
#include <string>

#include "idl/types/ids.h"

/// The session as a whole: its phase, its recording, its emergency stop.
namespace tenon {

enum class RunPhase : std::uint32_t { kWaitingForPeople, kRunning, kPaused, kSucceeded, kFailed, kStopped };

/// Succeeded, failed or stopped.
[[nodiscard]] constexpr bool isOver(RunPhase phase) { return phase >= RunPhase::kSucceeded; }

/// Phase of the session.
struct RunState {
  RunPhase phase = RunPhase::kWaitingForPeople;
  Tick tick = 0;                 ///< of this state
  std::string reason;            ///< of the phase, for people
  std::uint64_t final_hash = 0;  ///< state hash at the end of the run; 0 before
  std::uint32_t server_epoch = 0;
  std::uint32_t steps_skipped = 0;    ///< so far, and not done since
  std::uint32_t steps_timed_out = 0;  ///< likewise
  bool forces_frozen = false;         ///< by a command: hands are held still, whatever the phase
  bool emergency_stop = false;        ///< a raise stands
  std::uint32_t open_commands = 0;    ///< that take effect in this state: of bitOf() of commands.h
};

/// Whether a run that has ended did what its exercise asks for; `allow_skips`: also when steps were skipped.
[[nodiscard]] inline bool isCompleted(const RunState& run, bool allow_skips = false) {
  return run.phase == RunPhase::kSucceeded && run.steps_timed_out == 0 &&
         (allow_skips || run.steps_skipped == 0);
}

struct RecorderStatus {
  std::string file;
  bool recording = false;
  std::uint64_t messages = 0;  ///< written
  std::uint64_t lost = 0;      ///< samples that the server published and that are missing in the recording
  std::string problem;         ///< why it does not record; or empty
};

/// One raise of the emergency stop, by any client, directly to every device and to the server. It stands
/// until an EmergencyClear names it or a later one of its client (StopTruth), whoever leaves meanwhile; no
/// two raises have equal keys.
struct EmergencyStop {
  std::string client_guid;    ///< of the raiser: random, chosen by it at its start
  std::uint32_t counter = 0;  ///< of its raises: each has a larger one than those before it
  std::string who;
  std::string reason;
};

/// The end of one raise, and of all that its client raised before it, by the server alone.
struct EmergencyClear {
  std::string client_guid;    ///< of the raise
  std::uint32_t counter = 0;  ///< of the raise
  std::string who;            ///< cleared it
  std::string reason;
};

/// The newest raise that the server knows of. A clear names its number, and is refused with any other one: so
/// it lifts no raise that its sender has not been told of.
struct NewestRaise {
  std::uint32_t number = 0;    ///< counts raises, in a range of this life of the server; 0: there was none
  std::uint32_t standing = 0;  ///< raises that stand: of each client the newest one
  std::string who;
  std::string reason;
};

}  // namespace tenon
