#include "clients/simulated_person/simulated_trainee.h"

#include <algorithm>

namespace tenon::simulated_person {

namespace {
constexpr double kReading = 0.4;  // [s] to read a new instruction
}  // namespace

void TraineeHand::begin(const Pose& X_WH) noexcept {
  behavior.begin(X_WH);
  declutching.reset();
}

void TraineeHand::step(const HandPerception& hand, const DelayedPerception& perception, double dt) noexcept {
  const bool was_busy = declutching.busy();
  if (declutching.step(hand, behavior.beyondReach(), dt)) return;
  if (was_busy) behavior.resume(hand, perception);
  behavior.step(hand, perception, dt);
}

SimulatedTrainee::SimulatedTrainee(const PersonOptions& person)
    : person_(person), right_(person, person.seed * 2 + 1), left_(person, person.seed * 2 + 2) {}

void SimulatedTrainee::begin(std::span<const SceneObject> objects, const Pose& X_WRight,
                             const Pose& X_WLeft) {
  objects_ = objects;
  planner_.begin(objects);
  std::size_t count = 0;
  for (const SceneObject& object : objects) count = std::max<std::size_t>(count, object.object.value + 1);
  perception_.begin(count, person_.reaction_ticks);
  right_.begin(X_WRight);
  left_.begin(X_WLeft);
  instruction_ = {};  // reads the step anew, also one that is under way
  acted_ = true;
}

void SimulatedTrainee::read(const StepState& step) {
  const bool active = step.phase == StepPhase::kActive;
  const bool same =
      instruction_.active == active && instruction_.step == step.step && instruction_.started == step.started;
  if (same) return;
  instruction_ = {};
  instruction_.active = active;
  instruction_.step = step.step;
  instruction_.started = step.started;
  instruction_.object = step.object;
  instruction_.touch = step.touch;
  instruction_.hand = step.hand;
  instruction_.has_target = step.has_target;
  instruction_.X_WG = step.X_WG;
  instruction_.approach_W = step.approach_W;
  instruction_.approach_distance = step.approach_distance;
  instruction_.tolerance = step.tolerance;
  for (const SceneObject& object : objects_) {
    if (object.object != step.object) continue;
    instruction_.is_part = object.kind == "part";
  }
  acted_ = false;
  since_read_ = 0.0;
}

void SimulatedTrainee::step(const HandPerception& right, const HandPerception& left,
                            const haptic::WorldView& world, double dt) noexcept {
  perception_.record(world);
  since_read_ += dt;
  if (!acted_ && since_read_ > kReading + person_.reaction_ticks * dt) act(right, left);
  right_.step(right, perception_, dt);
  left_.step(left, perception_, dt);
}

void SimulatedTrainee::act(const HandPerception& right, const HandPerception& left) noexcept {
  left_works_ = instruction_.hand.valid() && instruction_.hand == left.hand;
  AssemblyBehavior& worker = (left_works_ ? left_ : right_).behavior;
  AssemblyBehavior& other = (left_works_ ? right_ : left_).behavior;
  const HandPerception& hand = left_works_ ? left : right;
  const HandPerception& rest = left_works_ ? right : left;
  if (!instruction_.active) {
    acted_ = true;
    return;
  }
  if (instruction_.touch.valid() && perception_.knows(instruction_.touch)) {
    TouchTask task;
    task.X_WO = perception_.pose(instruction_.touch);
    for (const SceneObject& object : objects_) {
      if (object.object != instruction_.touch) continue;
      task.size = object.size;
      task.centre = object.centre;
    }
    worker.touch(hand, planner_, task);
  } else if (instruction_.has_target) {
    // the object is not in this hand yet
    if (hand.object != instruction_.object) return;
    MountTask task;
    task.object = instruction_.object;
    task.X_WG = instruction_.X_WG;
    task.approach_W = instruction_.approach_W;
    task.approach_distance = instruction_.approach_distance;
    task.tolerance = instruction_.tolerance;
    task.guided_by_contact = instruction_.is_part;
    for (const SceneObject& object : objects_) {
      if (object.kind == "assistant") {
        task.assistant = object.object;
        task.assistant_centre = object.centre;
      }
      if (object.object != instruction_.object) continue;
      task.size = object.size;
      task.centre = object.centre;
    }
    task.misplaced = instruction_.is_part && mounts_ == person_.misplaced_mount;
    if (instruction_.is_part) ++mounts_;
    worker.mount(hand, planner_, task);
  }
  if (rest.hand.valid()) other.goHome(rest, planner_);
  acted_ = true;
}

const char* SimulatedTrainee::activity() const noexcept {
  const TraineeHand& worker = left_works_ ? left_ : right_;
  return worker.declutching.busy() ? "de-clutches" : worker.behavior.activity();
}

}  // namespace tenon::simulated_person
