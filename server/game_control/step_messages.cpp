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
  std::size_t leaf = 0;
  for (const Condition& condition : scenario.states[status.step].conditions) {
    if (isGroup(condition.kind) || leaf == status.conditions.size()) continue;
    const ConditionReading& reading = status.conditions[leaf++];
    report.conditions.push_back({textOf(scenario, condition), reading.value, reading.limit, reading.met});
  }
  return report;
}

}  // namespace tenon::game_control
