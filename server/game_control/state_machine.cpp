#include "server/game_control/state_machine.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <utility>

#include "server/simulation/environment.h"

namespace tenon::game_control {
namespace {

constexpr std::uint32_t kRegrabTicks = 1000;  // [ticks] paper §5: 1 s of contact grabs a part
constexpr std::uint32_t kRegrabLapse = 50;    // [ticks] tolerated interruption of that contact

/// The Environment as a SceneView.
class EnvironmentView final : public SceneView {
 public:
  explicit EnvironmentView(const simulation::Environment& environment) : environment_(environment) {}

  [[nodiscard]] Pose pose(ObjectId object) const noexcept override {
    return environment_.objects()[object.value].X_WO;
  }
  [[nodiscard]] Vector3 centre(ObjectId object) const noexcept override {
    return environment_.centreOf(object);
  }
  [[nodiscard]] Vector3 force(ObjectId object) const noexcept override {
    return environment_.forceOn(object).force;
  }
  [[nodiscard]] bool inContact(ObjectId a, ObjectId b) const noexcept override {
    return environment_.inContact(a, b);
  }
  [[nodiscard]] bool inAnyContact(ObjectId object) const noexcept override {
    return environment_.objects()[object.value].in_contact;
  }

 private:
  const simulation::Environment& environment_;
};

constexpr bool contains(const auto& set, std::uint32_t state) noexcept {
  return (set[state / 64] >> (state % 64) & 1U) != 0;
}

constexpr void assign(auto& set, std::uint32_t state, bool member) noexcept {
  const std::uint64_t bit = std::uint64_t{1} << (state % 64);
  set[state / 64] = member ? set[state / 64] | bit : set[state / 64] & ~bit;
}

constexpr std::uint32_t count(const auto& set) noexcept {
  std::uint32_t members = 0;
  for (const std::uint64_t states : set) members += static_cast<std::uint32_t>(std::popcount(states));
  return members;
}

/// The hand that currently has the role of a hand of the scenario: after hands were swapped, the one whose
/// default object is that of the scenario's hand.
HandId handInRole(const ScenarioFile& scenario, const simulation::Environment& environment,
                  HandId role) noexcept {
  for (std::uint32_t i = 0; i < scenario.hands.size(); ++i) {
    if (environment.hands()[i].default_object == scenario.hands[role.value].object) return HandId{i};
  }
  return role;
}

/// The command is about the state that is current: between two states it waits for the next one.
constexpr bool isOfState(CommandKind kind) noexcept {
  return kind == CommandKind::kSkipStep || kind == CommandKind::kFulfilled || kind == CommandKind::kSignal ||
         kind == CommandKind::kBack || kind == CommandKind::kRepeatStep;
}

/// The current state may end by the command: what follows it is about the state after that.
constexpr bool mayEndState(CommandKind kind) noexcept {
  return kind == CommandKind::kSkipStep || kind == CommandKind::kFulfilled;
}

/// Hands that have grabbed the object release it.
void releaseFromHands(simulation::Environment& environment, ObjectId object) noexcept {
  for (std::uint32_t i = 0; i < environment.hands().size(); ++i) {
    const simulation::HandMotion& hand = environment.hands()[i];
    if (hand.object == object && hand.default_object != object) environment.release(HandId{i});
  }
}

}  // namespace

StateMachine::StateMachine(std::shared_ptr<const ScenarioFile> scenario) : scenario_(std::move(scenario)) {
  assert(!scenario_->states.empty());
}

void StateMachine::start(simulation::Environment& environment) noexcept { enter(environment, 0); }

std::size_t StateMachine::step(simulation::Environment& environment, std::span<const GameCommand> commands,
                               std::uint32_t ticks) noexcept {
  StepStatus& status = memory_.status;
  status.tick = environment.tick();
  std::size_t taken = 0;
  for (bool more = true; more && taken < commands.size();) {
    const GameCommand& command = commands[taken];
    if (betweenStates() && isOfState(command.kind)) break;
    apply(environment, command);
    ++taken;
    more = !mayEndState(command.kind);
  }
  commands = commands.first(taken);

  // the state that ended in the last tick is followed by the next one
  if (status.phase == StepPhase::kWaiting || status.finished || status.failed) return taken;
  if (betweenStates()) {
    enter(environment, status.step + 1);
    return taken;
  }

  const EnvironmentView scene(environment);
  const bool met = memory_.progress.step(state().conditions, scene, commands, ticks);
  status.elapsed += ticks;
  updateMeasurements(scene, ticks);
  regrabReleasedPart(environment, scene, ticks);
  grabByHelpers(environment, scene, ticks);
  const bool skipped = std::any_of(commands.begin(), commands.end(), [](const GameCommand& command) {
    return command.kind == CommandKind::kSkipStep;
  });
  if (met) {
    leave(environment, StepPhase::kDone);
  } else if (skipped) {
    leave(environment, StepPhase::kSkipped);
  } else if (state().timeout > 0 && status.elapsed >= state().timeout) {
    leave(environment, StepPhase::kTimedOut);
  }
  return taken;
}

bool StateMachine::betweenStates() const noexcept {
  const StepStatus& status = memory_.status;
  const bool active = status.phase == StepPhase::kWaiting || status.phase == StepPhase::kActive;
  return !active && !status.finished && !status.failed;
}

void StateMachine::apply(simulation::Environment& environment, const GameCommand& command) noexcept {
  switch (command.kind) {
    case CommandKind::kRelease:
      if (command.hand.value < scenario_->hands.size()) environment.release(command.hand);
      break;
    case CommandKind::kSetCollision:
      if (command.signal < scenario_->pairs.size()) {
        environment.setPairEnabled(command.signal, command.value != 0.0);
      }
      break;
    case CommandKind::kSwapHands:
      swapHands(environment);
      break;
    case CommandKind::kReset:
      goTo(environment, 0);
      break;
    case CommandKind::kGoToStep:
      if (command.signal < scenario_->states.size()) goTo(environment, command.signal);
      break;
    case CommandKind::kBack:
      goTo(environment, std::max(memory_.status.step, 1U) - 1);
      break;
    case CommandKind::kRepeatStep:
      goTo(environment, memory_.status.step);
      break;
    case CommandKind::kHandOver:
      handOver(environment, ObjectId{command.signal}, command.hand);
      break;
    default:
      break;
  }
}

/// All objects, groups and pairs as at the start.
void StateMachine::restoreScene(simulation::Environment& environment) noexcept {
  for (std::uint32_t hand = 0; hand < scenario_->hands.size(); ++hand) environment.release(HandId{hand});
  for (std::uint32_t object = 0; object < scenario_->objects.size(); ++object) {
    const ScenarioObject& spec = scenario_->objects[object];
    const bool in_a_hand = std::any_of(scenario_->hands.begin(), scenario_->hands.end(),
                                       [&](const ScenarioHand& hand) { return hand.object.value == object; });
    if (!in_a_hand) environment.place(ObjectId{object}, spec.X_WO, spec.status);
    environment.setGroup(ObjectId{object}, environment.scene().objects[object].group);
  }
  for (std::size_t pair = 0; pair < scenario_->pairs.size(); ++pair) {
    environment.setPairEnabled(pair, scenario_->pairs[pair].enabled);
  }
}

void StateMachine::goTo(simulation::Environment& environment, std::uint32_t step) noexcept {
  restoreScene(environment);
  for (std::uint32_t passed = 0; passed < step; ++passed) {
    memory_.status.step = passed;
    applyEffects(environment);
    finish(environment, /*by_people=*/false);
    if (!contains(memory_.visited, passed)) setOutcome(passed, StepPhase::kSkipped);
  }
  for (auto later = step; later < scenario_->states.size(); ++later) setOutcome(later, StepPhase::kWaiting);
  memory_.status.finished = false;
  memory_.status.failed = false;
  enter(environment, step);
}

void StateMachine::handOver(simulation::Environment& environment, ObjectId object, HandId hand) noexcept {
  if (object.value >= scenario_->objects.size() || hand.value >= scenario_->hands.size()) return;
  releaseFromHands(environment, object);
  environment.grab(hand, object);
}

void StateMachine::enter(simulation::Environment& environment, std::uint32_t step) noexcept {
  StepStatus& status = memory_.status;
  status.step = step;
  status.phase = StepPhase::kActive;
  status.started = environment.tick();
  status.changed = environment.tick();
  status.tick = environment.tick();
  ++status.revision;
  memory_.progress.reset();
  status.elapsed = 0;
  memory_.contact_ticks = 0;
  memory_.regrabs = {};
  memory_.helpers = {};
  applyEffects(environment);
  status.hand = handInRole(*scenario_, environment, state().hand);
  updateMeasurements(EnvironmentView(environment), 0);
}

/// What a state does to the scene when it begins.
void StateMachine::applyEffects(simulation::Environment& environment) noexcept {
  for (const PairSwitch& change : state().pairs) environment.setPairEnabled(change.pair, change.enabled);
  for (const GroupChange& change : state().groups) environment.setGroup(change.object, change.group);
  for (const Placement& placement : state().placements) place(environment, placement);
  for (const HandAssignment& assignment : state().hands) {
    const HandId hand = handInRole(*scenario_, environment, assignment.hand);
    if (assignment.object == scenario_->hands[assignment.hand.value].object) {
      environment.release(hand);
    } else {
      environment.grab(hand, assignment.object);
    }
  }
}

void StateMachine::place(simulation::Environment& environment, const Placement& placement) noexcept {
  const Pose X_WO = placement.X_WO.value_or(environment.objects()[placement.object.value].X_WO);
  releaseFromHands(environment, placement.object);
  const bool has_mass = scenario_->objects[placement.object.value].body.has_value();
  switch (placement.kind) {
    case PlacementKind::kShow:
    case PlacementKind::kFree:
      environment.place(placement.object, X_WO, has_mass ? ObjectStatus::kFree : ObjectStatus::kParked);
      break;
    case PlacementKind::kHide:
      environment.place(placement.object, X_WO, ObjectStatus::kHidden);
      break;
    case PlacementKind::kFix:
      environment.place(placement.object, X_WO, ObjectStatus::kFixed);
      break;
  }
}

void StateMachine::regrabReleasedPart(simulation::Environment& environment, const SceneView& scene,
                                      std::uint32_t ticks) noexcept {
  const auto& assignments = state().hands;
  for (std::size_t i = 0; i < std::min(assignments.size(), kMaxRegrabs); ++i) {
    const HandAssignment& assignment = assignments[i];
    const HandId hand = handInRole(*scenario_, environment, assignment.hand);
    const ObjectId own = environment.hands()[hand.value].default_object;
    if (assignment.object == own || environment.hands()[hand.value].object != own) continue;
    ContactTimer& timer = memory_.regrabs[i];
    timer.step(scene.inContact(own, assignment.object), kRegrabLapse, ticks);
    if (timer.contact_ticks < kRegrabTicks) continue;
    timer = {};
    environment.grab(hand, assignment.object);
  }
}

void StateMachine::grabByHelpers(simulation::Environment& environment, const SceneView& scene,
                                 std::uint32_t ticks) noexcept {
  for (std::size_t i = 0; i < state().may_take.size(); ++i) {
    const HandAssignment& helper = state().may_take[i];
    const HandId hand = handInRole(*scenario_, environment, helper.hand);
    const ObjectId own = environment.hands()[hand.value].default_object;
    ContactTimer& timer = memory_.helpers[i];
    if (environment.hands()[hand.value].object != own) continue;
    timer.step(scene.inContact(own, helper.object), kRegrabLapse, ticks);
    if (timer.contact_ticks < kRegrabTicks) continue;
    timer = {};
    environment.grab(hand, helper.object);
  }
}

void StateMachine::releaseHelpers(simulation::Environment& environment) noexcept {
  for (const HandAssignment& helper : state().may_take) {
    const HandId hand = handInRole(*scenario_, environment, helper.hand);
    if (environment.hands()[hand.value].object == helper.object) environment.release(hand);
  }
}

void StateMachine::swapHands(simulation::Environment& environment) noexcept {
  FixedVector<HandId, 2> hands;
  for (std::uint32_t i = 0; i < scenario_->hands.size(); ++i) {
    const ScenarioHand& hand = scenario_->hands[i];
    if (hand.role == Role::kTrainee && hand.kind == simulation::HandKind::kCoupled)
      hands.push_back(HandId{i});
  }
  if (!hands.full()) return;
  environment.swapHands(hands[0], hands[1]);
  memory_.status.hand = handInRole(*scenario_, environment, state().hand);
  memory_.status.changed = environment.tick();
  ++memory_.status.revision;
}

void StateMachine::leave(simulation::Environment& environment, StepPhase phase) noexcept {
  StepStatus& status = memory_.status;
  status.phase = phase;
  status.changed = environment.tick();
  ++status.revision;
  setOutcome(status.step, phase);
  status.failed = phase == StepPhase::kTimedOut && state().on_timeout == TimeoutAction::kFail;
  if (status.failed) return;
  status.finished = status.step + 1 == scenario_->states.size();
  finish(environment, phase == StepPhase::kDone);
}

/// What a state does to the scene when it ends, unless it fails the training. A free body that people have
/// not brought to its target is put there too: the next state begins as if they had. A tool stays where it
/// is.
void StateMachine::finish(simulation::Environment& environment, bool by_people) noexcept {
  releaseHelpers(environment);
  const ObjectId object = state().object;
  if (!object.valid() || !state().X_WG) return;
  const bool is_body = scenario_->objects[object.value].body.has_value();
  if (!state().snap && (by_people || !is_body)) return;
  releaseFromHands(environment, object);
  environment.place(object, *state().X_WG, state().snap ? ObjectStatus::kFixed : ObjectStatus::kFree);
}

/// `phase` kWaiting: the state has not been visited.
void StateMachine::setOutcome(std::uint32_t step, StepPhase phase) noexcept {
  assign(memory_.visited, step, phase != StepPhase::kWaiting);
  assign(memory_.skipped, step, phase == StepPhase::kSkipped);
  assign(memory_.timed_out, step, phase == StepPhase::kTimedOut);
  countOutcomes();
}

void StateMachine::countOutcomes() noexcept {
  memory_.status.skipped = count(memory_.skipped);
  memory_.status.timed_out = count(memory_.timed_out);
}

void StateMachine::updateMeasurements(const SceneView& scene, std::uint32_t ticks) noexcept {
  StepStatus& status = memory_.status;
  const ScenarioState& current = state();
  status.position_error = 0.0;
  status.angle_error = 0.0;
  if (current.object.valid()) {
    if (scene.inAnyContact(current.object)) memory_.contact_ticks += ticks;
    if (current.X_WG) {
      status.position_error = positionError(scene, current.object, *current.X_WG);
      status.angle_error = angleBetween(scene.pose(current.object).rotation(), current.X_WG->rotation());
    }
  }
  status.contact_seconds = static_cast<double>(memory_.contact_ticks) * kTickSeconds;
  collectReadings();
}

void StateMachine::collectReadings() noexcept {
  memory_.status.conditions.clear();
  for (std::size_t i = 0; i < state().conditions.size(); ++i)
    memory_.status.conditions.push_back(memory_.progress.reading(i));
}

}  // namespace tenon::game_control
