#pragma once

#include <cstdint>

#include "idl/types/messages/commands.h"

namespace tenon::game_control {

/// A command to the state machine. Names are already resolved to numbers, so that a tick reads it without
/// strings and a journal stores it as it is.
///
/// Threads: a value. Real-time: all.
struct GameCommand {
  CommandKind kind = CommandKind::kFulfilled;
  HandId hand;  ///< kRelease, kHandOver
  /// kSignal: index into ScenarioFile::signals; kSetCollision: into pairs; kGoToStep: into states; kHandOver:
  /// into objects
  std::uint32_t signal = 0;
  double value = 0.0;  ///< [-] kSetCollision: 0 disables the pair, any other value enables it
};

}  // namespace tenon::game_control
