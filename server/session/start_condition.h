#pragma once

#include <string>
#include <vector>

#include "idl/types/messages/role.h"
#include "idl/types/result.h"
#include "server/game_control/scenario.h"
#include "server/session/session_registry.h"

namespace tenon::session {

/// Hands and roles that must be present before the first tick.
///
/// Threads: any. Real-time: no.
struct StartCondition {
  std::vector<HandId> hands;
  std::vector<Role> roles;

  /// By SessionOptions::wait_for: names of hands and of roles; without any, traineeHands. Fails when one is
  /// neither.
  [[nodiscard]] static Result<StartCondition> make(const game_control::ScenarioFile& scenario,
                                                   const std::vector<std::string>& names);
  [[nodiscard]] bool isMet(const SessionRegistry& registry) const;
  /// Names of the hands and roles that are not present, as `--wait-for` has them.
  [[nodiscard]] std::vector<std::string> missing(const game_control::ScenarioFile& scenario,
                                                 const SessionRegistry& registry) const;
};

/// All hands of the role trainee, coupled and tracked.
[[nodiscard]] std::vector<HandId> traineeHands(const game_control::ScenarioFile& scenario);

}  // namespace tenon::session
