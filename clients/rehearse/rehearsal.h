#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/station.h"
#include "idl/types/messages/log.h"
#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"
#include "server/session/tick_io.h"

namespace tenon::rehearse {

/// Of a rehearsal: seed, threads, limits and observers.
struct RehearsalOptions {
  std::uint64_t seed = 1;
  unsigned workers = 1;
  double seconds = 600.0;  ///< [s] of session time, at most
  bool collisions = true;  ///< false: collisions with objects of kind `scene` are disabled
  std::function<void(const EventLog&)> on_event;  ///< each logged event; may be empty
  std::function<void(const session::TickInput&, const session::TickOutput&)>
      on_tick;                      ///< after each tick; may be empty
  std::function<bool()> stop_when;  ///< true ends the rehearsal; may be empty
};

/// How a rehearsal ended.
struct RehearsalReport {
  RunPhase phase = RunPhase::kWaitingForPeople;
  Tick ticks = 0;
  std::uint64_t final_hash = 0;  ///< of the state after the last tick
  std::string reason;            ///< of the last change of phase
};

/// Runs a session in one process on a virtual clock: the session simulation and the stations, each fed in
/// tick n with what the other sent in tick n - 1. Lockstep over DDS has the same one-tick exchange, so both
/// give bit-equal states. Fails with the server's reason when a station is not admitted.
///
/// Threads: one, and the workers of the simulation.
[[nodiscard]] Result<RehearsalReport> runRehearsal(const session::LoadedScene& loaded,
                                                   std::vector<std::unique_ptr<haptic::Station>> stations,
                                                   const RehearsalOptions& options);

}  // namespace tenon::rehearse
