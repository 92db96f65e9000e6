#pragma once

#include <cstdint>

#include "idl/types/messages.h"

namespace tenon {

/// A person's or a program's command as the state machine takes it: names are already numbers, so a tick can
/// read and a journal can keep it.
///
/// Threads: a value. Real-time: all.
struct GameCommand {
  CommandKind kind = CommandKind::kFulfilled;
  HandId hand;  ///< of kRelease
  std::uint32_t signal =
      0;               ///< kSignal: index into ScenarioFile::signals; kSetCollision: into ScenarioFile::pairs
  double value = 0.0;  ///< kSetCollision: 0 off, else on
};

}  // namespace tenon
