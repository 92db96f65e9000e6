#include "server/session/start_condition.h"

#include <algorithm>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "idl/types/names.h"

namespace tenon::session {
namespace {

std::optional<Role> roleNamed(std::string_view name) {
  for (const Role role : {Role::kAdmin, Role::kInstructor, Role::kTrainee, Role::kObserver, Role::kRecorder})
    if (roleName(role) == name) return role;
  return std::nullopt;
}

}  // namespace

bool StartCondition::isMet(const SessionRegistry& registry) const {
  return std::all_of(hands.begin(), hands.end(),
                     [&](HandId hand) { return registry.controllerOf(hand).valid(); }) &&
         std::all_of(roles.begin(), roles.end(), [&](Role role) { return registry.isRolePresent(role); });
}

std::vector<std::string> StartCondition::missing(const game_control::ScenarioFile& scenario,
                                                 const SessionRegistry& registry) const {
  std::vector<std::string> names;
  for (const HandId hand : hands)
    if (!registry.controllerOf(hand).valid()) names.push_back(scenario.hands[hand.value].name);
  for (const Role role : roles)
    if (!registry.isRolePresent(role)) names.emplace_back(roleName(role));
  return names;
}

Result<StartCondition> StartCondition::make(const game_control::ScenarioFile& scenario,
                                            const std::vector<std::string>& names) {
  StartCondition all;
  if (names.empty()) all.hands = traineeHands(scenario);
  for (const std::string& name : names) {
    const HandId hand = scenario.handNamed(name);
    const auto role = roleNamed(name);
    if (!hand.valid() && !role)
      return fail(fmt::format("cannot wait for '{}': neither a hand of this scenario nor a role", name));
    if (hand.valid()) {
      all.hands.push_back(hand);
    } else {
      all.roles.push_back(*role);
    }
  }
  return all;
}

std::vector<HandId> traineeHands(const game_control::ScenarioFile& scenario) {
  std::vector<HandId> hands;
  for (std::uint32_t i = 0; i < scenario.hands.size(); ++i)
    if (scenario.hands[i].role == Role::kTrainee) hands.push_back(HandId{i});
  return hands;
}

}  // namespace tenon::session
