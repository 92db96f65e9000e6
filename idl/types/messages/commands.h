#pragma once

#include <array>
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
  kClearEmergencyStop,  ///< value: of NewestRaise, of which its sender was told; clears the stop, unless a
                        ///< newer raise stands; the run is paused then
  kGoToStep,            ///< text: name or number, from 1, of a step; the scene is as at its begin
  kBack,                ///< to the step before, likewise
  kRepeatStep,          ///< the current step from its begin
  kHandOver,            ///< text "OBJECT HAND": the hand takes the object from whoever holds it
  kNote,                ///< text: a remark, for the recording and the report
  kGuide,         ///< text "show|together|off|... HAND ...": guidance of a trainee's hand (docs/mentoring.md)
  kFreezeForces,  ///< value 1: hands are held still and display no force, the steps go on; 0: no more
  kKick,          ///< text: name, or number of the client, of who has to leave, then perhaps a reason
};

inline constexpr std::array kCommandKinds{
    CommandKind::kFulfilled,
    CommandKind::kSignal,
    CommandKind::kPause,
    CommandKind::kResume,
    CommandKind::kReset,
    CommandKind::kSkipStep,
    CommandKind::kRelease,
    CommandKind::kSwapHands,
    CommandKind::kSetCollision,
    CommandKind::kStop,
    CommandKind::kClearEmergencyStop,
    CommandKind::kGoToStep,
    CommandKind::kBack,
    CommandKind::kRepeatStep,
    CommandKind::kHandOver,
    CommandKind::kNote,
    CommandKind::kGuide,
    CommandKind::kFreezeForces,
    CommandKind::kKick,
};

/// For sets of commands in a message.
[[nodiscard]] constexpr std::uint32_t bitOf(CommandKind kind) {
  return 1U << static_cast<std::uint32_t>(kind);
}

/// Why a command is refused, for displays that say it in their own language.
enum class Refusal : std::uint32_t {
  kNone,          ///< it was accepted
  kOther,         ///< `reason` says it
  kNotJoined,     ///< the server does not know the client
  kNotPermitted,  ///< to its role
  kOver,          ///< the run is over
  kWaiting,       ///< for people, before the run
  kAlready,       ///< the session is in the state that was asked for
  kUnknownName,   ///< of a step, signal, object, hand, pair or person
  kNotYourHand,   ///< the client does not control it
  kNotHoldable,   ///< no hand takes the object, or this hand takes none
  kNobodyThere,   ///< nobody moves the hand
  kTooMany,       ///< commands wait for their tick: it can be sent again soon
  kStopped,       ///< an emergency stop stands
  kRaisedAgain,   ///< a raise stands that is newer than those that a clear names
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
  Refusal refusal = Refusal::kNone;
};

}  // namespace tenon
