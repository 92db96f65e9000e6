#pragma once

#include <atomic>
#include <map>
#include <optional>
#include <string>

#include "idl/types/messages/objects.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/types/messages/timing.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon::command {

/// Who and what there is in a session, by the names that commands take.
struct SessionLists {
  std::map<ClientId, Presence> people;
  std::map<HandId, SceneHand> hands;
  std::map<ObjectId, SceneObject> objects;
  std::map<std::uint32_t, SceneStep> steps;
  std::uint32_t unheard = 0;         ///< people with a seat of whom nothing has arrived
  std::optional<StepState> current;  ///< step; the server sends it once the session is there
  std::optional<TickStats> stats;    ///< newest; none before the first tick

  /// People, hands, steps, objects and how the server does, as aligned text; titles in `language`.
  [[nodiscard]] std::string text(const std::string& language = "en") const;
};

/// Reads the lists of a session as an observer, which needs no key. Fails with a sentence when there is no
/// session or it does not send them within 5 s.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<SessionLists> readLists(wire::MembershipOptions options, const std::atomic<bool>& stop);

}  // namespace tenon::command
