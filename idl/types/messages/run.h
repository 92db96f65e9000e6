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
};

struct RecorderStatus {
  std::string file;
  bool recording = false;
  std::uint64_t messages = 0;  ///< written
  std::uint64_t lost = 0;      ///< samples that the server published and that are missing in the recording
  std::string problem;         ///< why it does not record; or empty
};

/// Latched: stays engaged when its writer leaves.
struct EmergencyStop {
  bool engaged = false;
  std::string who;
  std::string reason;
};

}  // namespace tenon
