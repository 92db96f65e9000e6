#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/run.h"

/// Enumerators of the protocol as users read and type them.
namespace tenon {

[[nodiscard]] constexpr std::string_view roleName(Role role) noexcept {
  constexpr std::array<std::string_view, 5> kNames{"admin", "instructor", "trainee", "observer", "recorder"};
  const auto index = static_cast<std::size_t>(role);
  return index < kNames.size() ? kNames[index] : "unknown role";
}

/// As typed in `tenon command`.
[[nodiscard]] constexpr std::string_view commandName(CommandKind kind) noexcept {
  constexpr std::array<std::string_view, 19> kNames{
      "fulfilled", "signal", "pause", "resume", "reset", "skip", "release", "swap",   "collision", "stop",
      "clear",     "goto",   "back",  "repeat", "give",  "note", "guide",   "freeze", "kick"};
  const auto index = static_cast<std::size_t>(kind);
  return index < kNames.size() ? kNames[index] : "unknown command";
}

/// For displays that have their own texts for refusals.
[[nodiscard]] constexpr std::string_view refusalName(Refusal refusal) noexcept {
  constexpr std::array<std::string_view, 14> kNames{
      "",        "other",        "not_joined",    "not_permitted", "over",         "waiting",
      "already", "unknown_name", "not_your_hand", "not_holdable",  "nobody_there", "too_many",
      "stopped", "raised_again"};
  const auto index = static_cast<std::size_t>(refusal);
  return index < kNames.size() ? kNames[index] : "other";
}

[[nodiscard]] constexpr std::string_view objectStatusName(ObjectStatus status) noexcept {
  constexpr std::array<std::string_view, 6> kNames{"hidden", "parked", "held", "tracked", "fixed", "free"};
  const auto index = static_cast<std::size_t>(status);
  return index < kNames.size() ? kNames[index] : "unknown status";
}

[[nodiscard]] constexpr std::string_view runPhaseName(RunPhase phase) noexcept {
  switch (phase) {
    case RunPhase::kWaitingForPeople:
      return "waiting for people";
    case RunPhase::kRunning:
      return "running";
    case RunPhase::kPaused:
      return "paused";
    case RunPhase::kSucceeded:
      return "succeeded";
    case RunPhase::kFailed:
      return "failed";
    case RunPhase::kStopped:
      return "stopped";
  }
  return "unknown";
}

}  // namespace tenon
