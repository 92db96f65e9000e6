#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/haptic/station.h"
#include "clients/rehearse/simulated_link.h"
#include "idl/types/messages/log.h"
#include "server/game_control/scenario.h"
#include "server/session/scene_loader.h"
#include "server/session/session_simulation.h"
#include "server/session/tick_io.h"

namespace tenon::rehearse {

/// [s] Session time after a tick. A quotient: the double nearest to the decimal number of milliseconds, as in
/// files.
[[nodiscard]] constexpr double secondsAt(Tick tick) { return static_cast<double>(tick) / 1000.0; }

/// Of a rehearsal: seed, threads, limits and observers.
struct RehearsalOptions {
  std::uint64_t seed = 1;
  unsigned workers = 1;
  double seconds = 600.0;  ///< [s] of session time, at most
  bool collisions = true;  ///< false: collisions with objects of kind `scene` are disabled
  /// Hands that must be present before the first state starts; none: the trainee's.
  std::optional<std::vector<HandId>> needed_hands;
  /// What hands hold from the start on, see session::ChangeKind::kTake.
  std::vector<game_control::HandAssignment> takes;
  /// Of each station, which measures it (MeasuredLink); a station beyond the list, or without one, has all
  /// streams in the next tick.
  std::vector<std::optional<LinkConditions>> links;
  std::function<void(const EventLog&)> on_event;  ///< each logged event; may be empty
  /// After each tick; may be empty. TickStats::compute_seconds is the time that the tick thread of a server
  /// would have taken: simulation, output, state hash, journal entry and checkpoint.
  std::function<void(const session::SessionSimulation&, const session::TickInput&,
                     const session::TickOutput&)>
      on_tick;
  /// A device input that the server refuses, with its reason: the tick does not get it. May be empty.
  std::function<void(const DeviceInput&, const std::string&)> on_refused;
  std::function<bool()> stop_when;  ///< true ends the rehearsal; may be empty
};

/// How a rehearsal ended.
struct RehearsalReport {
  RunPhase phase = RunPhase::kWaitingForPeople;
  bool completed = false;  ///< isCompleted() of the run
  Tick ticks = 0;
  std::uint64_t final_hash = 0;  ///< of the state after the last tick
  std::string reason;            ///< of the last change of phase
  Tick crowded_ticks = 0;        ///< [ticks] in which a pair had more contacts than its list takes
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
