#include <algorithm>
#include <array>
#include <string>

#include "server/game_control/state_machine.h"

namespace tenon::game_control {
namespace {

std::string textOf(const ScenarioFile& scenario, const Condition& condition) {
  const auto name = [&](ObjectId object) {
    return object.valid() ? scenario.objects[object.value].name : std::string("nothing");
  };
  switch (condition.kind) {
    case ConditionKind::kAll:
      return "all";
    case ConditionKind::kAny:
      return "any";
    case ConditionKind::kPose:
      return "pose of " + name(condition.object);
    case ConditionKind::kForce:
    case ConditionKind::kForceTarget:
      return "force on " + name(condition.object);
    case ConditionKind::kContact:
      return "contact " + name(condition.object) + "-" + name(condition.other);
    case ConditionKind::kContactTime:
      return "contact of " + name(condition.object);
    case ConditionKind::kFulfilled:
      return "command fulfilled";
    case ConditionKind::kSignal:
      return "signal " + scenario.signals[condition.signal];
  }
  return {};
}

ConditionGroup groupOf(ConditionKind kind) {
  if (!isGroup(kind)) return ConditionGroup::kSingle;
  return kind == ConditionKind::kAll ? ConditionGroup::kAll : ConditionGroup::kAny;
}

}  // namespace

StepState describe(const ScenarioFile& scenario, const StepStatus& status) {
  const ScenarioState& state = scenario.states[status.step];
  StepState step;
  step.revision = status.revision;
  step.step = status.step;
  step.steps = static_cast<std::uint32_t>(scenario.states.size());
  step.name = state.name;
  step.title = state.title;
  step.instruction = state.instruction;
  step.phase = status.phase;
  step.part = state.part;
  step.object = state.object;
  step.hand = status.hand.valid() ? status.hand : state.hand;
  step.touch = state.touch;
  step.has_target = state.X_WG.has_value();
  if (state.X_WG) {
    step.X_WG = *state.X_WG;
    step.tolerance = state.tolerance;
    step.angle_tolerance = state.angle_tolerance;
  }
  step.approach_W = state.approach_W;
  step.approach_distance = state.approach_distance;
  step.timeout = static_cast<double>(state.timeout) * kTickSeconds;
  step.started = status.started;
  return step;
}

StepProgress progress(const ScenarioFile& scenario, const StepStatus& status, Tick now) {
  StepProgress report;
  report.revision = status.revision;
  report.tick = now;
  report.position_error = status.position_error;
  report.angle_error = status.angle_error;
  report.contact_seconds = status.contact_seconds;
  const std::vector<Condition>& tree = scenario.states[status.step].conditions;
  // before the first evaluation there are no readings
  const std::size_t nodes = std::min(tree.size(), status.conditions.size());
  std::array<std::uint8_t, kMaxConditions> depths{};  // of the children of each node
  for (std::size_t i = 0; i < nodes; ++i) {
    const Condition& condition = tree[i];
    const std::uint8_t depth = i == 0 ? std::uint8_t{0} : depths[condition.parent];
    const bool is_plain_root = i == 0 && condition.kind == ConditionKind::kAll;
    depths[i] = static_cast<std::uint8_t>(depth + (is_plain_root ? 0 : 1));
    if (is_plain_root) continue;
    ++report.nodes;
    if (report.conditions.size() == kMostConditionsTold) continue;
    const ConditionReading& reading = status.conditions[i];
    report.conditions.push_back({textOf(scenario, condition), static_cast<float>(reading.value),
                                 static_cast<float>(limitOf(tree, i)), groupOf(condition.kind), reading.met,
                                 depth});
  }
  return report;
}

}  // namespace tenon::game_control
