#include "server/game_control/state_machine.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "server/simulation/environment.h"

namespace tenon {
namespace {

constexpr std::uint32_t kRetakeTicks = 1000;  // paper §5: 1 s of contact takes a part
constexpr std::uint32_t kRetakeLapse = 50;

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

/// Who plays a hand of the scenario now: whose own object is that hand's.
HandId handInRole(const ScenarioFile& scenario, const Environment& environment, HandId role) noexcept {
  for (std::uint32_t i = 0; i < scenario.hands.size(); ++i) {
    if (environment.hands()[i].own == scenario.hands[role.value].object) return HandId{i};
  }
  return role;
}

/// Hands that have taken the object move their own again.
void releaseFromHands(Environment& environment, ObjectId object) noexcept {
  for (std::uint32_t i = 0; i < environment.hands().size(); ++i) {
    const HandMotion& hand = environment.hands()[i];
    if (hand.object == object && hand.own != object) environment.release(HandId{i});
  }
}

}  // namespace

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
  takeAgain(environment, scene);
  letHelpersTake(environment, scene);
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
    case CommandKind::kSwapHands:
      swapHands(environment);
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
    environment.setGroup(ObjectId{object}, environment.scene().objects[object].group);
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
  memory_.retake = {};
  memory_.helping = {};

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
  status.hand = handInRole(*scenario_, environment, state().hand);
  measure(EnvironmentView(environment));
}

void StateMachine::place(Environment& environment, const Placement& placement) noexcept {
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

void StateMachine::takeAgain(Environment& environment, const SceneView& scene) noexcept {
  for (const HandAssignment& assignment : state().hands) {
    const HandId hand = handInRole(*scenario_, environment, assignment.hand);
    const ObjectId own = environment.hands()[hand.value].own;
    if (assignment.object == own || environment.hands()[hand.value].object != own) continue;
    memory_.retake.step(scene.touching(own, assignment.object), kRetakeLapse);
    if (memory_.retake.touched < kRetakeTicks) return;
    memory_.retake = {};
    environment.grab(hand, assignment.object);
    return;
  }
}

void StateMachine::letHelpersTake(Environment& environment, const SceneView& scene) noexcept {
  for (std::size_t i = 0; i < state().may_take.size(); ++i) {
    const HandAssignment& helper = state().may_take[i];
    const HandId hand = handInRole(*scenario_, environment, helper.hand);
    const ObjectId own = environment.hands()[hand.value].own;
    ContactTimer& timer = memory_.helping[i];
    if (environment.hands()[hand.value].object != own) continue;
    timer.step(scene.touching(own, helper.object), kRetakeLapse);
    if (timer.touched < kRetakeTicks) continue;
    timer = {};
    environment.grab(hand, helper.object);
  }
}

void StateMachine::dismissHelpers(Environment& environment) noexcept {
  for (const HandAssignment& helper : state().may_take) {
    const HandId hand = handInRole(*scenario_, environment, helper.hand);
    if (environment.hands()[hand.value].object == helper.object) environment.release(hand);
  }
}

void StateMachine::swapHands(Environment& environment) noexcept {
  FixedVector<HandId, 2> hands;
  for (std::uint32_t i = 0; i < scenario_->hands.size(); ++i) {
    const ScenarioHand& hand = scenario_->hands[i];
    if (hand.role == Role::kTrainee && hand.kind == HandKind::kCoupled) hands.push_back(HandId{i});
  }
  if (!hands.full()) return;
  environment.swapHands(hands[0], hands[1]);
  memory_.status.hand = handInRole(*scenario_, environment, state().hand);
  memory_.status.changed = environment.tick();
  ++memory_.status.revision;
}

void StateMachine::leave(Environment& environment, StepPhase phase) noexcept {
  StepStatus& status = memory_.status;
  status.phase = phase;
  status.changed = environment.tick();
  ++status.revision;
  status.failed = phase == StepPhase::kTimedOut && state().on_timeout == TimeoutAction::kFail;
  if (status.failed) return;
  status.finished = status.step + 1 == scenario_->states.size();
  dismissHelpers(environment);
  if (!state().snap) return;
  releaseFromHands(environment, state().object);
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

}  // namespace tenon
