#include "clients/trainee/simulated_trainee.h"

#include <algorithm>

namespace tenon {

namespace {
constexpr double kReading = 0.4;  // [s] she takes to look at a new instruction
}  // namespace

SimulatedTrainee::SimulatedTrainee(const PersonOptions& person)
    : person_(person), right_(person, person.seed * 2 + 1), left_(person, person.seed * 2 + 2) {}

void SimulatedTrainee::begin(std::span<const SceneObject> objects, const Pose& X_WRight,
                             const Pose& X_WLeft) {
  objects_ = objects;
  clear_way_.begin(objects);
  std::size_t count = 0;
  for (const SceneObject& object : objects) count = std::max<std::size_t>(count, object.object.value + 1);
  sight_.begin(count, person_.reaction_ticks);
  right_.begin(X_WRight);
  left_.begin(X_WLeft);
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

void SimulatedTrainee::step(const HandSense& right, const HandSense& left, const WorldView& world,
                            double dt) noexcept {
  sight_.look(world);
  since_read_ += dt;
  if (!acted_ && since_read_ > kReading + person_.reaction_ticks * dt) act(right, left);
  right_.step(right, sight_, dt);
  left_.step(left, sight_, dt);
}

void SimulatedTrainee::act(const HandSense& right, const HandSense& left) noexcept {
  works_left_ = instruction_.hand.valid() && instruction_.hand == left.hand;
  AssemblySkill& worker = works_left_ ? left_ : right_;
  AssemblySkill& other = works_left_ ? right_ : left_;
  const HandSense& hand = works_left_ ? left : right;
  const HandSense& rest = works_left_ ? right : left;
  if (!instruction_.active) {
    acted_ = true;
    return;
  }
  if (instruction_.touch.valid() && sight_.knows(instruction_.touch)) {
    TouchTask task;
    task.X_WO = sight_.pose(instruction_.touch);
    for (const SceneObject& object : objects_) {
      if (object.object != instruction_.touch) continue;
      task.size = object.size;
      task.centre = object.centre;
    }
    worker.touch(hand, clear_way_, task);
  } else if (instruction_.has_target) {
    // what she is to move is not in her hand yet
    if (hand.object != instruction_.object) return;
    MountTask task;
    task.object = instruction_.object;
    task.X_WG = instruction_.X_WG;
    task.approach_W = instruction_.approach_W;
    task.approach_distance = instruction_.approach_distance;
    task.tolerance = instruction_.tolerance;
    task.by_touch = instruction_.is_part;
    for (const SceneObject& object : objects_) {
      if (object.kind == "assistant") task.helper = object.object;
      if (object.object != instruction_.object) continue;
      task.size = object.size;
      task.centre = object.centre;
    }
    task.sure_of_it = instruction_.is_part && mounts_ == person_.stubborn_mount;
    if (instruction_.is_part) ++mounts_;
    worker.mount(hand, clear_way_, task);
  }
  if (rest.hand.valid()) other.goHome(rest, clear_way_);
  acted_ = true;
}

const char* SimulatedTrainee::doing() const noexcept { return works_left_ ? left_.doing() : right_.doing(); }

}  // namespace tenon
