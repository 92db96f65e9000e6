#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"
#include "server/game_control/scenario.h"
#include "server/session/refused.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Who gives a command, and in what session.
struct CommandContext {
  Role role = Role::kObserver;
  std::span<const ClientId> controllers;  ///< of each hand, index = HandId; valid during the call
  bool is_stop_engaged = false;           ///< emergency stop
  NewestRaise newest;                     ///< of it
  bool is_instructor_present = false;
  std::optional<std::uint32_t> step;  ///< the current one, from 0; none: a command that waits may change it
};

/// What a command asks of the simulation, by the names of the scenario, of a sender whose role may send it
/// (rightFor()): what it may do with the hands of others is decided here. It knows nothing of the run's
/// phase.
///
/// Threads: any. Real-time: no.
class CommandTranslator {
 public:
  using Decision = tl::expected<Change, Refused>;

  /// `scenario` must outlive this.
  explicit CommandTranslator(const game_control::ScenarioFile& scenario) : scenario_(scenario) {}

  /// The Change, or why there is none.
  [[nodiscard]] Decision changeFor(const Command& command, const CommandContext& context) const;

 private:
  [[nodiscard]] Decision leadChange(const Command& command, const CommandContext& context) const;
  [[nodiscard]] Decision collisionChange(const Command& command) const;
  [[nodiscard]] Decision handOverChange(const Command& command, const CommandContext& context) const;
  [[nodiscard]] Decision releaseChange(const Command& command, const CommandContext& context) const;
  [[nodiscard]] Decision clearStopChange(const Command& command, const CommandContext& context) const;
  [[nodiscard]] int findStep(std::string_view text) const;
  [[nodiscard]] int findPair(std::string_view a, std::string_view b) const;
  [[nodiscard]] Decision swapChange(const Command& command, const CommandContext& context) const;

  const game_control::ScenarioFile& scenario_;
};

}  // namespace tenon::session
