#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/role.h"

/// The one table of what each role may do, and how many may have it.
namespace tenon::session {

enum class Right : std::uint32_t {
  kMoveHands = 1U << 0U,         ///< those of its role
  kMoveAnyHand = 1U << 1U,       ///< those of other roles too
  kAnswerStep = 1U << 2U,        ///< fulfil a condition, send a signal, leave a note
  kActOnOwnHands = 1U << 3U,     ///< release and swap what the hands that it moves hold; end a guidance
  kActOnAnyHand = 1U << 4U,      ///< likewise of all hands
  kContributeForces = 1U << 5U,  ///< external wrenches on objects
  kPlaceObjects = 1U << 6U,      ///< poses of external trackers
  kLeadRun = 1U << 7U,           ///< pause, freeze, skip, switch collisions, remove people, end the run
  kClearStop = 1U << 8U,         ///< clear the emergency stop; everybody may raise it
  kGuide = 1U << 9U,             ///< let an instructor's hand guide a trainee's
};

struct RoleRights {
  Role role = Role::kObserver;
  bool needs_key = false;    ///< of the session: wire::SharedKey
  std::size_t seats = 0;     ///< for so many clients at a time
  std::uint32_t rights = 0;  ///< bits of Right
};

[[nodiscard]] constexpr std::uint32_t bits(std::initializer_list<Right> rights) {
  std::uint32_t all = 0;
  for (const Right right : rights) all |= static_cast<std::uint32_t>(right);
  return all;
}

inline constexpr std::uint32_t kTraineeRights =
    bits({Right::kMoveHands, Right::kAnswerStep, Right::kActOnOwnHands, Right::kContributeForces});
inline constexpr std::uint32_t kInstructorRights =
    kTraineeRights |
    bits({Right::kActOnAnyHand, Right::kPlaceObjects, Right::kLeadRun, Right::kClearStop, Right::kGuide});

inline constexpr std::array kRoles{
    RoleRights{Role::kAdmin, true, 8, kInstructorRights | bits({Right::kMoveAnyHand})},
    RoleRights{Role::kInstructor, true, 8, kInstructorRights},
    RoleRights{Role::kTrainee, false, 16, kTraineeRights},
    RoleRights{Role::kObserver, false, 256, 0},
    RoleRights{Role::kRecorder, false, 8, 0},
};

/// Null for a role that there is not.
[[nodiscard]] constexpr const RoleRights* rightsOf(Role role) {
  const auto* const found =
      std::find_if(kRoles.begin(), kRoles.end(), [&](const RoleRights& row) { return row.role == role; });
  return found == kRoles.end() ? nullptr : found;
}

[[nodiscard]] constexpr bool has(Role role, Right right) {
  const RoleRights* const row = rightsOf(role);
  return row != nullptr && (row->rights & static_cast<std::uint32_t>(right)) != 0;
}

/// What a command needs at least: a role may be kept to its own hands (Right::kActOnAnyHand) and to ending a
/// guidance (Right::kGuide).
[[nodiscard]] constexpr Right rightFor(CommandKind kind) {
  switch (kind) {
    case CommandKind::kFulfilled:
    case CommandKind::kSignal:
    case CommandKind::kNote:
      return Right::kAnswerStep;
    case CommandKind::kRelease:
    case CommandKind::kSwapHands:
    case CommandKind::kGuide:
      return Right::kActOnOwnHands;
    case CommandKind::kClearEmergencyStop:
      return Right::kClearStop;
    default:
      return Right::kLeadRun;
  }
}

/// Welcome::permitted_commands.
[[nodiscard]] constexpr std::uint32_t permittedCommands(Role role) {
  std::uint32_t all = 0;
  for (const CommandKind kind : kCommandKinds)
    if (has(role, rightFor(kind))) all |= bitOf(kind);
  return all;
}

}  // namespace tenon::session
