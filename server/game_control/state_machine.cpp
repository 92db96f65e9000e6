#include "server/game_control/state_machine.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <concepts>
#include <limits>
#include <utility>

#include "server/simulation/environment.h"

namespace tenon {
namespace {

/// The Environment, as conditions ask it.
class EnvironmentView final : public SceneView {
 public:
  explicit EnvironmentView(const Environment& environment) : environment_(environment) {}

  [[nodiscard]] Pose pose(ObjectId object) const noexcept override {
    return environment_.objects()[object.value].X_WO;
  }
  [[nodiscard]] Vector3 force(ObjectId object) const noexcept override {
    return environment_.forceOn(object).force;
  }
  [[nodiscard]] bool touching(ObjectId a, ObjectId b) const noexcept override {
    return environment_.inContact(a, b);
  }
  [[nodiscard]] bool touchesAnything(ObjectId object) const noexcept override {
    return environment_.objects()[object.value].in_contact;
  }

 private:
  const Environment& environment_;
};

/// Every number of a memory is one 64-bit word when hashed, saved and restored.
template <typename Number>
std::uint64_t toWord(const Number& number) {
  if constexpr (std::same_as<Number, double>) {
    return std::bit_cast<std::uint64_t>(number);
  } else {
    return static_cast<std::uint64_t>(number);
  }
}

template <typename Number>
void fromWord(std::uint64_t word, Number& number) {
  if constexpr (std::same_as<Number, double>) {
    number = std::bit_cast<double>(word);
  } else if constexpr (std::same_as<Number, bool>) {
    number = word != 0;
  } else {
    number = static_cast<Number>(word);
  }
}

}  // namespace

template <typename Visitor>
void StateMachine::visitMemory(Memory& memory, Visitor&& visit) {
  StepStatus& status = memory.status;
  visit(status.revision);
  visit(status.step);
  visit(status.phase);
  visit(status.started);
  visit(status.changed);
  visit(status.tick);
  visit(status.finished);
  visit(status.failed);
  visit(status.position_error);
  visit(status.angle_error);
  visit(status.contact_seconds);
  memory.progress.visitMemory(visit);
  visit(memory.elapsed);
  visit(memory.contact_ticks);
}

StateMachine::StateMachine(std::shared_ptr<const ScenarioFile> scenario) : scenario_(std::move(scenario)) {
  assert(!scenario_->states.empty());
}

void StateMachine::start(Environment& environment) noexcept { enter(environment, 0); }

void StateMachine::step(Environment& environment, std::span<const GameCommand> commands) noexcept {
  StepStatus& status = memory_.status;
  status.tick = environment.tick();
  for (const GameCommand& command : commands) obey(environment, command);

  // a state that ended in the last tick gives way to the next one
  if (status.phase == StepPhase::kWaiting || status.finished || status.failed) return;
  if (status.phase != StepPhase::kActive) {
    enter(environment, status.step + 1);
    return;
  }

  const EnvironmentView scene(environment);
  const bool met = memory_.progress.step(state().conditions, scene, commands);
  ++memory_.elapsed;
  measure(scene);
  const bool skipped = std::any_of(commands.begin(), commands.end(), [](const GameCommand& command) {
    return command.kind == CommandKind::kSkipStep;
  });
  if (met) {
    leave(environment, StepPhase::kDone);
  } else if (skipped) {
    leave(environment, StepPhase::kSkipped);
  } else if (state().timeout > 0 && memory_.elapsed >= state().timeout) {
    leave(environment, StepPhase::kTimedOut);
  }
}

void StateMachine::obey(Environment& environment, const GameCommand& command) noexcept {
  switch (command.kind) {
    case CommandKind::kRelease:
      if (command.hand.value < scenario_->hands.size()) environment.release(command.hand);
      break;
    case CommandKind::kSetCollision:
      if (command.signal < scenario_->pairs.size()) {
        environment.setPairEnabled(command.signal, command.value != 0.0);
      }
      break;
    case CommandKind::kReset:
      reset(environment);
      break;
    default:
      break;
  }
}

void StateMachine::reset(Environment& environment) noexcept {
  for (std::uint32_t hand = 0; hand < scenario_->hands.size(); ++hand) environment.release(HandId{hand});
  for (std::uint32_t object = 0; object < scenario_->objects.size(); ++object) {
    const ScenarioObject& spec = scenario_->objects[object];
    const bool in_a_hand = std::any_of(scenario_->hands.begin(), scenario_->hands.end(),
                                       [&](const ScenarioHand& hand) { return hand.object.value == object; });
    if (!in_a_hand) environment.place(ObjectId{object}, spec.X_WO, spec.status);
  }
  for (std::size_t pair = 0; pair < scenario_->pairs.size(); ++pair) {
    environment.setPairEnabled(pair, scenario_->pairs[pair].enabled);
  }
  memory_.status.finished = false;
  memory_.status.failed = false;
  enter(environment, 0);
}

void StateMachine::enter(Environment& environment, std::uint32_t step) noexcept {
  StepStatus& status = memory_.status;
  status.step = step;
  status.phase = StepPhase::kActive;
  status.started = environment.tick();
  status.changed = environment.tick();
  status.tick = environment.tick();
  ++status.revision;
  memory_.progress.reset();
  memory_.elapsed = 0;
  memory_.contact_ticks = 0;

  for (const PairSwitch& change : state().pairs) environment.setPairEnabled(change.pair, change.enabled);
  for (const Placement& placement : state().placements) {
    const Pose X_WO = placement.X_WO.value_or(environment.objects()[placement.object.value].X_WO);
    switch (placement.kind) {
      case PlacementKind::kShow:
      case PlacementKind::kFree:
        environment.place(placement.object, X_WO, ObjectStatus::kParked);
        break;
      case PlacementKind::kHide:
        environment.place(placement.object, X_WO, ObjectStatus::kHidden);
        break;
      case PlacementKind::kFix:
        environment.place(placement.object, X_WO, ObjectStatus::kFixed);
        break;
    }
  }
  for (const HandAssignment& assignment : state().hands) {
    if (assignment.object == scenario_->hands[assignment.hand.value].object) {
      environment.release(assignment.hand);
    } else {
      environment.grab(assignment.hand, assignment.object);
    }
  }
  measure(EnvironmentView(environment));
}

void StateMachine::leave(Environment& environment, StepPhase phase) noexcept {
  StepStatus& status = memory_.status;
  status.phase = phase;
  status.changed = environment.tick();
  ++status.revision;
  status.failed = phase == StepPhase::kTimedOut && state().on_timeout == TimeoutAction::kFail;
  if (status.failed) return;
  status.finished = status.step + 1 == scenario_->states.size();
  if (!state().snap) return;
  // every hand lets go first: what the object is placed as stays
  for (std::uint32_t hand = 0; hand < scenario_->hands.size(); ++hand) {
    const bool own = scenario_->hands[hand].object == state().object;
    if (!own && environment.hands()[hand].object == state().object) environment.release(HandId{hand});
  }
  environment.place(state().object, *state().X_WG, ObjectStatus::kFixed);
}

void StateMachine::measure(const SceneView& scene) noexcept {
  StepStatus& status = memory_.status;
  const ScenarioState& asked = state();
  status.position_error = 0.0;
  status.angle_error = 0.0;
  if (asked.object.valid()) {
    if (memory_.elapsed > 0 && scene.touchesAnything(asked.object)) ++memory_.contact_ticks;
    if (asked.X_WG) {
      const Pose X_WO = scene.pose(asked.object);
      status.position_error = (X_WO.translation() - asked.X_WG->translation()).norm();
      status.angle_error = angleBetween(X_WO.rotation(), asked.X_WG->rotation());
    }
  }
  status.contact_seconds = static_cast<double>(memory_.contact_ticks) * kTickSeconds;
  listReadings();
}

void StateMachine::listReadings() noexcept {
  const std::vector<Condition>& tree = state().conditions;
  memory_.status.conditions.clear();
  for (std::size_t i = 0; i < tree.size(); ++i) {
    if (!isGroup(tree[i].kind)) memory_.status.conditions.push_back(memory_.progress.reading(i));
  }
}

void StateMachine::addTo(StateHash& hash) const noexcept {
  Memory copy = memory_;
  visitMemory(copy, [&hash](const auto& number) { hash.add(toWord(number)); });
}

std::vector<std::uint8_t> StateMachine::save() const {
  std::vector<std::uint8_t> bytes;
  Memory copy = memory_;
  visitMemory(copy, [&bytes](const auto& number) {
    const std::uint64_t word = toWord(number);
    for (unsigned shift = 0; shift < 64; shift += 8)
      bytes.push_back(static_cast<std::uint8_t>(word >> shift));
  });
  return bytes;
}

Result<void> StateMachine::restore(std::span<const std::uint8_t> bytes) {
  Memory memory;
  std::size_t words = 0;
  visitMemory(memory, [&words](const auto&) { ++words; });
  if (bytes.size() != words * sizeof(std::uint64_t)) {
    return fail("state machine: a saved state has " + std::to_string(words * sizeof(std::uint64_t)) +
                " bytes, this one has " + std::to_string(bytes.size()));
  }
  std::size_t at = 0;
  visitMemory(memory, [&](auto& number) {
    std::uint64_t word = 0;
    for (unsigned shift = 0; shift < 64; shift += 8) word |= std::uint64_t{bytes[at++]} << shift;
    fromWord(word, number);
  });
  if (memory.status.step >= scenario_->states.size() || memory.status.phase > StepPhase::kSkipped) {
    return fail("state machine: a saved state is at step " + std::to_string(memory.status.step) +
                ", but the scenario has " + std::to_string(scenario_->states.size()));
  }
  memory_ = memory;
  listReadings();
  return {};
}

}  // namespace tenon
