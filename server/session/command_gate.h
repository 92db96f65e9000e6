#pragma once

#include <cstdint>
#include <optional>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/run.h"
#include "server/session/refused.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Commands that take effect in a phase in which none is on its way: RunState::open_commands.
[[nodiscard]] std::uint32_t openCommands(RunPhase phase, bool is_stopped);

/// Whether a command takes effect in the phase of the run that it will meet: the one after all commands that
/// were accepted before it, of which the last ones wait for their tick. A command is accepted only if it
/// takes effect with the next ticks: in a pause it changes the scene at once, and during an emergency stop
/// the scene stays as it is and the run is not resumed.
///
/// Threads: one (wire). Real-time: no.
class CommandGate {
 public:
  /// Phase after the last tick.
  void update(RunPhase phase);
  /// Why the command cannot take effect, for any role.
  [[nodiscard]] tl::expected<void, Refused> check(CommandKind kind) const;
  /// The change of a command is on its way to the simulation.
  void accept(ChangeKind change);
  void engageStop() { is_stop_engaged_ = true; }
  /// The run is paused afterwards: nothing moves by itself when the stop is cleared.
  void clearStop();

  [[nodiscard]] bool isStopEngaged() const { return is_stop_engaged_; }
  /// A command has ended the run.
  [[nodiscard]] bool endRequested() const { return end_requested_; }
  /// As update() said last.
  [[nodiscard]] RunPhase phase() const { return phase_; }

 private:
  /// After all accepted changes have been applied.
  [[nodiscard]] RunPhase expectedPhase() const { return pending_phase_.value_or(phase_); }

  RunPhase phase_ = RunPhase::kWaitingForPeople;
  std::optional<RunPhase> pending_phase_;  ///< of an accepted pause or resume that no tick has applied yet
  bool is_stop_engaged_ = false;           ///< emergency stop
  bool end_requested_ = false;
};

}  // namespace tenon::session
