#pragma once

#include <cstdint>
#include <string>

#include "idl/types/ids.h"

/// Requests to the session.
namespace tenon {

enum class CommandKind : std::uint32_t {
  kFulfilled,  ///< meets the condition "fulfilled" (a key in the paper)
  kSignal,     ///< an external signal by name (text)
  kPause,
  kResume,
  kReset,
  kSkipStep,
  kRelease,       ///< `hand`, or if invalid the hand named by text, releases its object
  kSwapHands,     ///< the trainee's two coupled hands exchange their objects
  kSetCollision,  ///< text "a b": names of the pair; value 0: off, 1: on
  kStop,
  kClearEmergencyStop,  ///< clears every raise of the emergency stop that the server knows of; the run is
                        ///< paused then
};

/// A client's request to the session, acknowledged by a CommandAck with the same id.
struct Command {
  ClientId client;
  std::uint32_t id = 0;  ///< counts the client's commands from 1; the same when repeated
  CommandKind kind = CommandKind::kFulfilled;
  HandId hand;
  std::string text;
  double value = 0.0;  ///< [-] by kind
};

struct CommandAck {
  ClientId client;
  std::uint32_t id = 0;
  bool accepted = false;  ///< it takes effect
  std::string reason;     ///< of a refusal
};

}  // namespace tenon
