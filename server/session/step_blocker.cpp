#include "server/session/step_blocker.h"

#include <algorithm>
#include <optional>
#include <tuple>

#include <fmt/format.h>

#include "server/game_control/quantity_text.h"
#include "server/game_control/state_machine.h"

namespace tenon::session {
namespace {

using game_control::ScenarioFile;
using game_control::ScenarioState;

/// The contact of `object` with the largest force on it, then the deepest; null when it touches nothing.
const PairContact* mostLoaded(const ScenarioFile& scenario, const TickOutput& output, ObjectId object) {
  const PairContact* most = nullptr;
  const auto load = [](const PairContact& contact) {
    return std::tuple(contact.F_Ao_W.force.norm(), contact.depth);
  };
  for (const PairState& state : output.pairs) {
    const PairContact& contact = state.contact;
    if (!contact.colliding || scenario.pairs[state.pair].sensing) continue;
    if (contact.a != object && contact.b != object) continue;
    if (most == nullptr || load(contact) > load(*most)) most = &contact;
  }
  return most;
}

/// "9.8 mm from its place", "turned by 12 deg from its place", or both; empty when it is there.
std::string errorText(const ScenarioState& state, const game_control::StepStatus& step) {
  const bool is_away = step.position_error > state.tolerance;
  const bool is_turned = step.angle_error > state.angle_tolerance;
  std::string text = is_away ? game_control::inMillimetres(step.position_error) : "";
  if (is_turned)
    text += fmt::format("{}turned by {}", is_away ? " and " : "", game_control::inDegrees(step.angle_error));
  return text.empty() ? text : text + " from its place";
}

/// The first condition that is not met and in no group that is; empty when there is none.
std::string unmetCondition(const ScenarioFile& scenario, const game_control::StepStatus& step) {
  const StepProgress progress = game_control::progress(scenario, step, step.tick);
  std::optional<std::uint8_t> met_depth;  // of the group around this condition that is met
  for (const ConditionValue& condition : progress.conditions) {
    if (met_depth && condition.depth <= *met_depth) met_depth.reset();
    if (met_depth) continue;
    if (condition.met)
      met_depth = condition.depth;
    else if (condition.group == ConditionGroup::kSingle)
      return "not met: " + condition.text;
  }
  return "";
}

}  // namespace

std::string whatBlocks(const ScenarioFile& scenario, const TickOutput& output) {
  const ScenarioState& state = scenario.states[output.step.step];
  const auto title = [&](ObjectId object) { return scenario.objects[object.value].title.front().text; };
  if (state.touch.valid() && !state.X_WG) {
    if (output.step.contact_seconds <= 0.0) return title(state.touch) + " was not touched";
    return fmt::format("{} was touched for {:.1f} s", title(state.touch), output.step.contact_seconds);
  }
  const std::string error = state.X_WG ? errorText(state, output.step) : "";
  if (error.empty()) return unmetCondition(scenario, output.step);
  if (!output.objects[state.object.value].holder.valid())
    return fmt::format("{} is {}, in no hand", title(state.object), error);
  const PairContact* contact = mostLoaded(scenario, output, state.object);
  if (contact == nullptr) return fmt::format("{} is {}, and touches nothing", title(state.object), error);
  const ObjectId other = contact->a == state.object ? contact->b : contact->a;
  return fmt::format("{} is held {} by {}, at {}", title(state.object), error, title(other),
                     game_control::pointText(contact->p_WP));
}

}  // namespace tenon::session
